"""``psstereo calibrate response``, ``flat`` and ``lens``, each as a command of its own."""

import json

import cv2
import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from psstereo.camera import Lens, Pinhole
from psstereo.errors import ExistingResultError, InputError, OptionError, PsstereoError
from psstereo.io import read_capture
from psstereo.io.lens_file import read_lens
from psstereo.io.rig_file import RigFile, read_rig
from psstereo.io.rig_writer import write_rig
from psstereo.lights import Rig
from psstereo.types import no_progress
from psstereo_cli.commands.calibrate_flat import calibrate_flat
from psstereo_cli.commands.calibrate_lens import calibrate_lens
from psstereo_cli.commands.calibrate_response import calibrate_response
from psstereo_cli.reading import ReadingOptions, read_otherwise
from tests.cli.stages import Stages

app = typer.Typer()
app.command("response")(calibrate_response)
app.command("flat")(calibrate_flat)
app.command("lens")(calibrate_lens)


def run(*words):
    result = CliRunner().invoke(app, [str(word) for word in words])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


def write(path, image):
    cv2.imencode(".png", image)[1].tofile(path)
    return path


@pytest.fixture
def rig(tmp_path):
    write_rig(tmp_path / "rig.toml", RigFile(rig=Rig.distant(np.eye(3))))
    return tmp_path / "rig.toml"


def exposures(folder):
    light = np.exp(np.random.default_rng(0).uniform(np.log(0.01), 0, (60, 60)))
    return [
        write(folder / f"e{i}.png", np.round(255 * np.clip(light * time, 0, 1) ** (1 / 2.2)).astype(np.uint8))
        for i, time in enumerate((0.5, 1, 2))
    ]


def test_a_response_from_exposures_goes_into_the_rig_file(tmp_path, rig, monkeypatch):
    paths, stages = exposures(tmp_path), Stages(monkeypatch)
    record = json.loads(run("response", *paths, "--times", "0.01,0.02,0.04", "--add-to", rig, "--json").stdout)
    assert record["response"] == "gamma"
    assert abs(record["exponent"] / 2.2 - 1) < 2e-3
    assert read_rig(rig).response.exponent == pytest.approx(record["exponent"])
    assert "3 exposures" in read_rig(rig).provenance[-1]
    assert stages.ended() == ["pictures read", "exposures left out in turn"]


def test_a_person_is_told_the_line_for_a_description(tmp_path):
    told = run("response", *exposures(tmp_path), "--times", "1,2,4").stderr
    assert "response = 2." in told
    assert "gamma curve" in told


def test_a_response_from_shading(tmp_path, monkeypatch):
    stages = Stages(monkeypatch)
    y, x = np.mgrid[-1:1:32j, -1:1:32j]
    inside = x * x + y * y < 0.9
    normals = np.stack([x, y, np.sqrt(np.maximum(1 - x * x - y * y, 0))], -1)
    turn = np.arange(8) * 2.39996
    lights = np.stack([0.6 * np.cos(turn), 0.6 * np.sin(turn), np.full(8, 0.8)], 1)
    for i, light in enumerate(lights):
        shown = 0.8 * np.maximum(normals @ light, 0) * inside
        write(tmp_path / f"img_{i}.png", np.round(255 * shown ** (1 / 1.8)).astype(np.uint8))
    np.savetxt(tmp_path / "lights.txt", lights)
    record = json.loads(run("response", tmp_path, "--json").stdout)
    assert record["from"] == "shading"
    assert stages.ended()[-2:] == ["looking at images", "exponent"]
    assert abs(record["exponent"] / 1.8 - 1) < 0.01


def test_a_flat_field_is_written_and_named(tmp_path, rig, monkeypatch):
    stages = Stages(monkeypatch)
    card = np.linspace(80, 160, 40).astype(np.uint8)[None].repeat(30, axis=0)
    paths = [write(tmp_path / f"card_{i}.png", card) for i in range(2)]
    record = json.loads(run("flat", *paths, "-o", tmp_path / "flat.npy", "--add-to", rig, "--json").stdout)
    light = np.load(tmp_path / "flat.npy")
    np.testing.assert_allclose(light[..., 0], card / np.median(card), rtol=1e-6)
    assert record["dead"] == 0
    assert stages.ended() == ["pictures read", "white card"]
    assert read_rig(rig).flat.name == "flat.npy"
    with pytest.raises(ExistingResultError):
        run("flat", *paths, "-o", tmp_path / "flat.npy")
    assert "corners" in run("flat", *paths, "-o", tmp_path / "flat.npy", "--overwrite").stderr


def test_a_lens_is_written_and_read(tmp_path, rig, monkeypatch):
    from psstereo.calibrate.camera import Board, lens_target

    board, camera, lens = Board(columns=7, rows=6), Pinhole(fx=300, fy=302, cx=80, cy=60), Lens((-0.2, 0.03, 0, 0, 0))
    rng = np.random.default_rng(2)

    def corners(picture, wanted):
        if picture[0, 0, 0] == 0:
            return None
        rotation = cv2.Rodrigues(rng.uniform(-0.5, 0.5, 3))[0]
        points = wanted.corners @ rotation.T + [-2.5, -2, rng.uniform(14, 18)]
        ideal = (points @ camera.matrix.T)[:, :2] / points[:, 2:]
        assert wanted == board
        return wanted.corners, lens.distorted(ideal, camera)

    # finding corners in pictures is tested with the library; here they are exact
    monkeypatch.setattr(lens_target, "find_corners", corners)
    stages = Stages(monkeypatch)
    paths = [write(tmp_path / f"b{i}.png", np.full((120, 160), 90 * (i != 3), np.uint8)) for i in range(7)]
    out = tmp_path / "camera.toml"
    record = json.loads(run("lens", *paths, "--board", "7x6", "-o", out, "--add-to", rig, "--json").stdout)
    found, glass = read_lens(out)
    np.testing.assert_allclose(found.matrix, camera.matrix, atol=0.1)
    assert record["unused"] == ["b3.png"]
    assert stages.ended() == ["pictures read", "corners of the board"]
    assert read_rig(rig).lens == glass
    assert read_rig(rig).camera == found
    with pytest.raises(ExistingResultError):
        run("lens", *paths, "--board", "7x6", "-o", out)
    assert "focal length" in run("lens", *paths, "--board", "7x6", "-o", out, "--overwrite").stderr


@pytest.mark.parametrize(
    ("words", "kind"),
    [
        (("response", "e0.png", "e1.png", "--times", "1"), OptionError),
        (("response", "e0.png", "e1.png"), InputError),  # no EXIF
        (("response", "e0.png", "e1.png", "--times", "1,2", "--add-to", "none.toml"), PsstereoError),
        (("flat", "e0.png", "-o", "flat.jpg"), OptionError),
        (("lens", "e0.png", "--board", "seven", "-o", "c.toml"), OptionError),
        (("lens", "e0.png", "--board", "9x²", "-o", "c.toml"), OptionError),
        (("lens", "e0.png", "e1.png", "e2.png", "--board", "9x7", "-o", "c.toml"), InputError),
    ],
)
def test_what_cannot_be_used_is_refused(tmp_path, monkeypatch, words, kind):
    exposures(tmp_path)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(kind):
        run(*words)


def test_photographs_are_read_otherwise(tmp_path):
    lights = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, 0.6, 0.8], [-0.6, 0.0, 0.8]])
    rng = np.random.default_rng(4)
    for i in range(4):
        write(tmp_path / f"img_{i}.png", rng.integers(20, 200, (24, 32), np.uint8))
    np.savetxt(tmp_path / "lights.txt", lights)
    np.save(tmp_path / "card.npy", np.linspace(1, 2, 32)[None].repeat(24, axis=0))
    text = "[camera]\nK = [[90, 0, 16], [0, 90, 12], [0, 0, 1]]\nlens = [0, 0, 0, 0]\n"
    (tmp_path / "camera.toml").write_text(text)
    plain, _ = read_capture(tmp_path)

    def changed(**options):
        return read_otherwise(plain, ReadingOptions(**options), progress=no_progress)

    assert changed() is plain
    found = changed(response="2", flat=tmp_path / "card.npy", lens=tmp_path / "camera.toml", crop="4,2,20,16", size=2)
    assert found.shape == (8, 10)
    light = (plain.stack.frame(1)[..., 0] / 255.0) ** 2 * 255 / np.linspace(1, 2, 32) * 1.5
    wanted = light[2:18, 4:24].reshape(8, 2, 10, 2).mean(axis=(1, 3))
    np.testing.assert_allclose(found.stack.frame(1)[..., 0], wanted, rtol=1e-4)
    assert found.camera.cx == pytest.approx((16 - 4 - 0.5) / 2)
    with pytest.raises(OptionError, match="part"):
        changed(crop="1,2,3.5,4")
    with pytest.raises(InputError, match="4 frames"):
        changed(register="shift")


def test_other_peoples_files_stay(tmp_path):
    card = write(tmp_path / "card.png", np.full((20, 24), 120, np.uint8))
    np.save(tmp_path / "normals.npy", np.dstack([np.full((4, 4, 2), -0.5), np.ones((4, 4))]))
    (tmp_path / "capture.toml").write_text('[images]\npattern = "*.png"\n[camera]\nK = [[1]]\nlens = [1]\n')
    with pytest.raises(ExistingResultError, match="no flat field"):
        run("flat", card, "-o", tmp_path / "normals.npy", "--overwrite")
    with pytest.raises(ExistingResultError, match="camera and its lens"):
        run("lens", card, "--board", "9x7", "-o", tmp_path / "capture.toml", "--overwrite")
    for _ in range(2):  # its own file is replaced
        assert run("flat", card, "-o", tmp_path / "flat.npy", "--overwrite").exit_code == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["capture.toml", "card.png", "flat.npy", "normals.npy"]


def test_options_without_use_or_sense(tmp_path):
    card = write(tmp_path / "card.png", np.full((20, 24), 120, np.uint8))
    assert run("response", tmp_path, "--times", "1,2").exit_code == 2
    assert run("response", card, card, "--times", "1,2", "--mask", "none").exit_code == 2
    with pytest.raises(OptionError, match="smoothed over"):
        run("flat", card, "-o", tmp_path / "flat.npy", "--smooth", "1e9")


@pytest.mark.parametrize("options", [{"crop": "nan,0,1,1"}, {"crop": "0,0,inf,1"}, {"register": "foo"}])
def test_parts_and_registrations_that_are_none(folder, options):
    capture, _ = read_capture(folder)
    with pytest.raises(OptionError):
        read_otherwise(capture, ReadingOptions(**options), progress=no_progress)
