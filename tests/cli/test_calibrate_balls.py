"""``psstereo calibrate balls`` and ``matte``: folders of pictures in, a rig file out, or a refusal with its reason."""

import json
import sys

import cv2
import numpy as np
import pytest
import typer

from psstereo.calibrate.balls import Ball
from psstereo.errors import ExistingResultError, InputError, MissingFileError, OptionError
from psstereo.io.rig_file import read_rig
from psstereo.lights import Directional, Led
from psstereo_cli.commands.calibrate_balls import calibrate_balls
from psstereo_cli.commands.calibrate_matte import calibrate_matte
from psstereo_synth.calibration_balls import matte_ball_picture, mirror_ball_picture
from tests.cli.stages import Stages

TOWARD = np.array([[0.1, 0.2, 1.0], [0.7, 0.2, 0.7], [-0.5, 0.8, 0.5], [-0.4, -0.6, 0.9]])
TOWARD /= np.linalg.norm(TOWARD, axis=1, keepdims=True)
BALL = Ball.circle(60.4, 58.7, 40.0)
SHAPE = (110, 124)


@pytest.fixture
def call(capsys, monkeypatch):
    """Run one command function with words, as the sub-app does, and return stdout and stderr."""

    def run(command, *words):
        app = typer.Typer()
        app.command()(command)
        monkeypatch.setattr(sys, "argv", ["psstereo", *map(str, words)])
        app(list(map(str, words)), standalone_mode=False)
        return capsys.readouterr()

    return run


def write(path, image):
    cv2.imwrite(str(path), np.rint(255 * np.clip(image, 0, 1)).astype(np.uint8))


@pytest.fixture(scope="module")
def mirror(tmp_path_factory):
    """Return a folder of a mirror ball in four pictures, its mask, its circle in a file, and a card beside it."""
    folder = tmp_path_factory.mktemp("mirror")
    for i, d in enumerate(TOWARD):
        image = mirror_ball_picture(BALL, Directional(direction=d, strength=1.0), SHAPE, size=0.08, surroundings=0.05)
        image[:8, :30] = (0.4 + 0.1 * i) * d[2]
        write(folder / f"shot{i + 1}.png", image)
    rows, columns = np.indices(SHAPE)
    disc = (np.hypot(columns - 60.4, rows - 58.7) < 40).astype(float)
    write(folder / "shot.mask.png", disc)
    write(folder / "ref.png", 0.2 + 0.6 * cv2.GaussianBlur(disc, (0, 0), 0.7))
    (folder / "circle_data.txt").write_text(f"{60.4 + 1}\n{SHAPE[0] - 58.7}\n40.0\n")
    return folder


@pytest.fixture(scope="module")
def matte(tmp_path_factory):
    folder = tmp_path_factory.mktemp("matte")
    for i, d in enumerate(TOWARD):
        light = Directional(direction=d, strength=[0.4 + 0.1 * i, 0.3])
        image = matte_ball_picture(BALL, light, SHAPE, ambient=26 / 255)
        write(folder / f"{i + 1}.png", np.concatenate([image, image[..., 1:]], axis=-1))
    return folder


def off(rig):
    got = rig.rig.directions
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(got, TOWARD), axis=1), (got * TOWARD).sum(axis=1)))


@pytest.mark.parametrize("how", ["bottom-left", "clicks", "circle file", "nothing", "auto"])
def test_a_ball_may_be_given_in_any_way(call, mirror, tmp_path, how):
    out = tmp_path / "rig.toml"
    words = {
        "bottom-left": ("--ball", "61.4,51.3,40", "--origin", "bottom-left"),
        "clicks": ("--ball", "20.4,58.7,60.4,18.7,100.4,58.7"),
        "circle file": ("--ball", mirror / "circle_data.txt"),
        "nothing": (),
        "auto": ("--ball", "auto", "--outline", mirror / "ref.png"),
    }[how]
    done = call(calibrate_balls, mirror, "-o", out, *words)
    rig = read_rig(out)
    assert off(rig).max() < 0.5
    assert rig.names == ()
    assert rig.quality.verdict.startswith("4 lights")
    assert "one ball" in done.err
    assert any("x = 60." in line for line in rig.provenance)


def test_json_names_and_a_white_card(call, mirror, tmp_path):
    out = tmp_path / "rig.toml"
    words = ("--ball", "60.4,58.7,40", "--white", "2,1,26,6", "--by-name", "--json")
    record = json.loads(call(calibrate_balls, mirror, "-o", out, *words).out)
    assert record["reach"] == "untold"
    assert len(record["highlights"]) == 4
    rig = read_rig(out)
    assert rig.names == tuple(f"shot{i}.png" for i in (1, 2, 3, 4))
    strengths = np.array([light.strength[0] for light in rig.rig.lights])
    np.testing.assert_allclose(strengths, [0.4, 0.5, 0.6, 0.7], rtol=0.02)
    with pytest.raises(ExistingResultError):
        call(calibrate_balls, mirror, "-o", out, "--ball", "60.4,58.7,40")
    call(calibrate_balls, mirror, "-o", out, "--ball", "60.4,58.7,40", "--overwrite")


def test_files_of_lights_are_held_against_the_balls(call, mirror, tmp_path):
    np.savetxt(tmp_path / "right.txt", TOWARD)
    np.savetxt(tmp_path / "wrong.txt", TOWARD + np.array([[0.0, 0, 0], [0, 0.2, 0], [0, 0, 0], [0, 0, 0]]))
    words = ("--ball", "60.4,58.7,40", "--compare", tmp_path / "right.txt", "--compare", tmp_path / "wrong.txt")
    done = call(calibrate_balls, mirror, "-o", tmp_path / "rig.toml", *words)
    assert "right.txt agrees with the balls" in done.err
    assert "wrong.txt disagrees with the balls" in done.err
    assert "at light 2" in done.err
    record = json.loads(call(calibrate_balls, mirror, "-o", tmp_path / "b.toml", *words, "--json").out)
    assert [one["agrees"] for one in record["compared"]] == [True, False]
    np.savetxt(tmp_path / "few.txt", TOWARD[:3])
    with pytest.raises(InputError):
        call(calibrate_balls, mirror, "-o", tmp_path / "c.toml", *words[:2], "--compare", tmp_path / "few.txt")


@pytest.mark.data
def test_the_chrome_ball_of_the_university_of_washington(call, data_dir, tmp_path):
    """Its own mask; twelve directions within 0.6° of lights.txt on average, and the other copy told to be wrong."""
    psm = data_dir / "psm"
    words = ("--compare", psm / "lights.txt", "--compare", psm / "lights_other_copy.txt", "--json")
    record = json.loads(call(calibrate_balls, psm / "chrome", "-o", tmp_path / "rig.toml", *words).out)
    right, wrong = record["compared"]
    assert np.mean(right["angles_deg"]) < 0.4
    assert right["agrees"]
    assert not wrong["agrees"]
    assert np.mean(wrong["angles_deg"]) > 2.5
    assert max(wrong["angles_deg"]) == wrong["angles_deg"][1] > 8


@pytest.mark.data
def test_the_matte_sphere_of_columbia_and_its_pedestal(call, data_dir, tmp_path):
    """The outline by the over-exposed picture; the background of all pictures reads 73 to 76 of 255."""
    spheres = tmp_path / "spheres"
    spheres.mkdir()
    for name in ("sphere1.pgm", "sphere2.pgm", "sphere3.pgm"):
        (spheres / name).symlink_to(data_dir / "hand" / name)
    words = ("--ball", "auto", "--outline", data_dir / "hand" / "sphere0.pgm", "--json")
    record = json.loads(call(calibrate_matte, spheres, "-o", tmp_path / "rig.toml", *words).out)
    assert 255 * record["pedestal"][0] == pytest.approx(75, abs=6)
    want = np.array([[0.145, -0.447, 0.882], [0.521, 0.114, 0.846], [0.211, 0.537, 0.817]])
    got = read_rig(tmp_path / "rig.toml").rig.directions
    assert np.degrees(np.arctan2(np.linalg.norm(np.cross(got, want), axis=1), (got * want).sum(axis=1))).max() < 2
    assert record["residual_percent"] < 6
    assert any("tone curve" in line for line in record["advice"])  # its lamps are near, or its tones bent


def test_two_folders_two_balls_and_the_objects_own_pixels(call, tmp_path):
    """Lamps at known places, balls cut out of one frame; positions in the pixels of an object at half the size."""
    places = np.array([[300.0, 300.0, 900.0], [500.0, -400.0, 800.0], [0.0, 100.0, 1000.0]])
    corners = (0, 480)
    for corner in corners:
        local = Ball.circle(60.4, 58.7, 50.0)
        (tmp_path / f"at{corner}").mkdir()
        for i, place in enumerate(places):
            lamp = Led(position=place - [corner, 0, 0], axis=[0, 0, -1], mu=0.0, flux=1.0)
            write(
                tmp_path / f"at{corner}" / f"{i}.png",
                mirror_ball_picture(local, lamp, (116, 124), size=0.08, samples=6),
            )
    words = [tmp_path / f"at{corner}" for corner in corners]
    for corner in corners:
        words += ["--ball", "60.4,58.7,50", "--corner", f"{corner},0"]
    call(calibrate_balls, *words, "-o", tmp_path / "rig.toml", "--lamps", "positions")
    rig = read_rig(tmp_path / "rig.toml")
    got = np.array([light.position for light in rig.rig.lights])
    spread = np.sqrt(np.trace(rig.quality.position_covariance, axis1=1, axis2=2))
    assert (np.linalg.norm(got - places, axis=1) < 2.5 * spread).all()
    call(calibrate_balls, *words, "-o", tmp_path / "half.toml", "--lamps", "positions", "--object-crop", "200,40,0.5")
    half = np.array([light.position for light in read_rig(tmp_path / "half.toml").rig.lights])
    # The frame's pixels 200 and 201 make the object's first one, whose middle is between them.
    np.testing.assert_allclose(half, (got - [200.5, -40.5, 0]) / 2, rtol=0, atol=1e-3 * np.abs(got).max())


def test_a_matte_ball_to_directions_strengths_and_level(call, matte, tmp_path, monkeypatch):
    out, stages = tmp_path / "rig.toml", Stages(monkeypatch)
    done = call(calibrate_matte, matte, "-o", out, "--ball", "60.4,58.7,40", "--json")
    record, rig = json.loads(done.out), read_rig(out)
    assert off(rig).max() < 0.5
    assert stages.ended() == ["outlines", "shading"]
    strengths = np.array([light.strength for light in rig.rig.lights])
    np.testing.assert_allclose(strengths[:, 2], [0.4, 0.5, 0.6, 0.7], rtol=0.01)  # files of OpenCV are B, G, R
    np.testing.assert_allclose(strengths[:, 0], 0.3, rtol=0.02)
    np.testing.assert_allclose(record["pedestal"], 26 / 255, atol=0.003)
    assert any("beside the ball shows" in line for line in rig.provenance)
    call(calibrate_matte, matte, "-o", out, "--ball", "60.4,58.7,40", "--pedestal", "0.102", "--overwrite")
    assert off(read_rig(out)).max() < 0.5


def test_errors_name_the_cause(call, mirror, matte, tmp_path):
    empty = tmp_path / "empty"
    empty.mkdir()
    blank = tmp_path / "blank"
    blank.mkdir()
    write(blank / "1.png", np.full(SHAPE, 0.2))
    for folder, words, kind, cause in (
        (mirror, ("--ball", "1,2"), OptionError, "Three numbers"),
        (mirror, ("--ball", "none.png"), MissingFileError, "neither numbers nor a file"),
        (mirror, ("--ball", "60,58,40", "--origin", "middle"), OptionError, "top-left or bottom-left"),
        (mirror, ("--ball", "60,58,40", "--lamps", "all"), OptionError, "directions"),
        (mirror, ("--ball", "60,58,40", "--lamps", "positions"), InputError, "one ball only"),
        (mirror, ("--ball", "300,300,40"), InputError, "covers 0 pixels"),
        (blank, ("--ball", "auto"), InputError, "0 balls were found"),
        (mirror, ("--ball", "60,58,40", "--corner", "1,2", "--corner", "1,2"), OptionError, "2 --corner are given"),
        (matte, ("--ball", "60.4,58.7,40"), InputError, "calibrate matte"),
        (empty, (), InputError, "holds no pictures"),
        (tmp_path / "nowhere", (), MissingFileError, "is no folder"),
    ):
        with pytest.raises(kind, match=cause):
            call(calibrate_balls, folder, "-o", tmp_path / "rig.toml", *words)
    with pytest.raises(InputError, match=r"has a strength|departs"):
        call(calibrate_matte, mirror, "-o", tmp_path / "rig.toml", "--ball", "60.4,58.7,40")
    assert not (tmp_path / "rig.toml").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--white", "nan,0,1,1"), "box is"),
        (("--object-crop", "1,1,inf"), "crop is"),
        (("--white-albedo", "0.5"), "without --white"),
        (("--ball-radius", "20"), "without --K"),
        (("--ball", ""), "neither numbers nor a file"),
    ],
)
def test_words_that_do_not_do(call, mirror, tmp_path, words, said):
    where = () if "--ball" in words else ("--ball", "60.4,58.7,40")
    with pytest.raises((OptionError, MissingFileError), match=said):
        call(calibrate_balls, mirror, "-o", tmp_path / "rig.toml", *where, *words)
    assert not list(tmp_path.iterdir())


def test_a_masks_faults_are_told_in_words_of_balls_and_names_with_blanks_are_quoted(call, mirror, tmp_path):
    cv2.imwrite(str(tmp_path / "m.png"), np.zeros(SHAPE, np.uint8))
    with pytest.raises(InputError, match="give the circle as x,y,r"):
        call(calibrate_balls, mirror, "-o", tmp_path / "rig.toml", "--ball", tmp_path / "m.png")
    done = call(calibrate_balls, mirror, "-o", tmp_path / "my rig.toml", "--ball", "60.4,58.7,40")
    assert "my rig.toml' uses it" in done.err
