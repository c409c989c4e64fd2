"""``psstereo info``: what is recognised, and why."""

import json
import tomllib

import numpy as np
import pytest

from psstereo.io import READERS, read_capture, write_diligent


def test_a_folder_is_described(run, folder):
    done = run("info", folder, "--json")
    assert done.code == 0
    assert done.err == ""
    record = done.record
    assert record["format"] == "diligent"
    assert [fit["format"] for fit in record["recognised"]][0] == "diligent"  # noqa: RUF015
    assert "light_directions.txt" in record["recognised"][0]["reason"]
    assert record["images"] == {
        "count": 8,
        "width": 48,
        "height": 40,
        "channels": 3,
        "type": "uint16",
        "full_scale": 65535,
        "response": "linear",
        "dark_image": False,
    }
    capture, _ = read_capture(folder)
    assert record["mask_share"] == pytest.approx(capture.mask.mean())
    lights = record["lights"]
    assert lights["source"] == "light_directions.txt"
    assert lights["distant"] is True
    assert lights["behind"] == 0
    assert lights["condition"] == pytest.approx(capture.rig.condition())
    tilt = np.degrees(np.arccos(capture.rig.directions[:, 2]))
    assert lights["tilt_deg"] == pytest.approx([tilt.min(), tilt.max()])
    strengths = np.loadtxt(folder / "light_intensities.txt")
    assert lights["strength_ratio"] == pytest.approx(strengths.max() / strengths.min())
    assert record["truth"] == {"source": "Normal_gt.mat", "normals": True, "depth": True, "albedo": False}


def test_the_table_says_the_same(run, folder):
    record = run("info", folder, "--json").record
    done = run("info", folder)
    assert done.code == 0
    assert done.out == ""
    assert "8 of 48 × 40, 3 × uint16" in done.text
    assert f"{record['mask_share']:.1%} of the image" in done.text
    assert "light_directions.txt, distant" in done.text
    assert f"{record['lights']['condition']:.3g} (1 is best)" in done.text
    assert "normals, depth (Normal_gt.mat)" in done.text


def test_options_change_what_is_read(run, folder, tmp_path):
    np.savetxt(tmp_path / "other.txt", np.loadtxt(folder / "light_directions.txt") * [1, -1, 1])
    done = run("info", folder, "--lights", tmp_path / "other.txt", "--mask", "none", "--json").record
    assert done["lights"]["source"] == "other.txt"
    assert done["mask_share"] is None
    assert "every pixel counts" in run("info", folder, "--mask", "none").text
    found = run("info", folder, "--mask", "auto", "--json").record
    assert any("found from brightness" in note for note in found["notes"])
    (folder / "list.lp").write_text(
        "8\n" + "".join(f"{i:03d}.png 0.1 {0.1 * i} 0.9\n" for i in range(1, 9)), encoding="utf-8"
    )
    assert run("info", folder, "--format", "lp", "--json").record["format"] == "lp"


def test_notes_are_told(run, folder):
    (folder / "light_intensities.txt").unlink()
    done = run("info", folder)
    assert "note: No light_intensities.txt: all lights are taken to be equally strong." in done.err


def test_three_times_three_lights_are_told_apart(run, folder):
    names = (folder / "filenames.txt").read_text().split()[:3]
    (folder / "filenames.txt").write_text("\n".join(names))
    rows = np.loadtxt(folder / "light_directions.txt")[:3]
    np.savetxt(folder / "light_directions.txt", rows)
    np.savetxt(folder / "light_intensities.txt", np.loadtxt(folder / "light_intensities.txt")[:3])
    assert run("info", folder).code == 3
    for layout, lights in (("rows", rows), ("columns", rows.T)):
        tilt = np.degrees(np.arccos(lights[:, 2] / np.linalg.norm(lights, axis=1)))
        done = run("info", folder, "--lights-layout", layout, "--json")
        assert done.record["lights"]["tilt_deg"] == pytest.approx([tilt.min(), tilt.max()])


def test_too_few_or_coplanar_lights_are_described_all_the_same(run, tmp_path):
    images = np.full((2, 12, 12, 3), 100, np.uint8)
    mask = np.ones((12, 12), np.bool_)
    write_diligent(tmp_path / "two", images=images, directions=[[0, 0, 1], [1, 0, 1]], intensities=[1, 2], mask=mask)
    done = run("info", tmp_path / "two", "--json")
    assert done.code == 0
    assert done.record["lights"]["condition"] is None
    assert "the lights are coplanar" in run("info", tmp_path / "two").text


def test_near_lamps_are_described_without_being_solved(run, folder):
    rows = np.loadtxt(folder / "light_directions.txt")
    (folder / "light_directions.txt").unlink()
    names = ("light_intensities.txt", "filenames.txt", "Normal_gt.mat", "depth_gt.npz")
    for name in names:
        (folder / name).unlink()
    np.savetxt(folder / "led_positions_mm.txt", rows * [300, -300, -300] + [0, 0, 700])
    np.savetxt(folder / "led_axes.txt", -rows * [1, -1, -1])
    np.savetxt(folder / "led_mu.txt", np.ones(8))
    np.savetxt(folder / "led_intensity_rgb.txt", np.full((8, 3), 4e4))
    np.savetxt(folder / "K.txt", [[900, 0, 23.5], [0, 900, 19.5], [0, 0, 1]])
    for i in range(8):
        (folder / f"{i + 1:03d}.png").rename(folder / f"led_{i + 1}.png")
    done = run("info", folder, "--json")
    assert done.code == 0
    assert done.record["format"] == "near-led"
    assert done.record["camera"] == "pinhole"
    assert done.record["lights"]["distant"] is False
    assert "condition" not in done.record["lights"]
    assert ", near" in run("info", folder).text


def test_every_layout_is_listed(run):
    assert run("info", "--formats", "--json").record == {name: reader.summary for name, reader in READERS.items()}
    done = run("info", "--formats")
    assert done.out == ""
    for name in READERS:
        assert f"\n {name} " in done.err
    assert "capture.toml" in done.err


def test_the_template_is_a_description_that_works(run, tmp_path):
    done = run("info", "--template")
    assert done.code == 0
    assert done.err == ""
    content = tomllib.loads(done.out)
    assert len(content["lights"]["directions"]) == 3
    import cv2

    (tmp_path / "capture.toml").write_text(done.out, encoding="utf-8")
    for i in range(3):
        cv2.imencode(".png", np.full((9, 9), 60 + i, np.uint8))[1].tofile(tmp_path / f"img_{i + 1}.png")
    described = run("info", tmp_path, "--json").record
    assert described["format"] == "capture"
    assert described["name"] == "my object"
    assert described["images"]["count"] == 3


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (("nowhere",), ("nowhere does not exist",)),
        (("capture", "--format", "psmm"), ("psmm", "Did you mean psm?")),
        (("capture", "--format", "yale"), ()),
        (("capture", "--mask", "no.png"), ("no.png",)),
        (("capture", "--lights", "no.txt"), ("no.txt",)),
        (("capture", "--lights-layout", "diagonal"), ("diagonal", "rows")),
    ],
)
def test_what_cannot_be_read_is_told_once(run, folder, monkeypatch, words, parts):
    monkeypatch.chdir(folder.parent)
    done = run("info", *words, "--json")
    assert done.code == 3
    error = json.loads(done.out)["error"]
    assert done.err == f"psstereo: {error['given']}\n  {error['needed']}\n  {error['remedy']}\n"
    for part in parts:
        assert part in done.err
