"""``psstereo convert``: lights, pictures under any light, and normal maps."""

import json

import cv2
import numpy as np
import pytest

from psstereo.io import read_capture, read_lp, read_normal_map
from psstereo.io.rig_file import read_rig
from psstereo.lights import Rig


def test_lights_of_a_capture_go_through_all_kinds_of_files(run, folder, tmp_path):
    wanted, _ = read_capture(folder)
    for name, words in [("a.lp", ()), ("b.dome", ()), ("c.json", ()), ("d.toml", ()), ("e", ("--to", "psbox"))]:
        done = run("convert", folder, tmp_path / name, *words, "--json")
        if name == "e":  # its lights are coloured
            assert done.code == 3
            assert "colours" in done.record["error"]["given"]
            continue
        assert done.code == 0
        assert done.record["lights"] == 8
        assert ("strengths" in " ".join(done.record["left_out"])) == (name in ("a.lp", "b.dome"))
        again = run("convert", tmp_path / name, tmp_path / f"{name}.lp")
        assert again.code == 0
        assert again.out == ""
        np.testing.assert_allclose(read_lp(tmp_path / f"{name}.lp").vectors, wanted.rig.directions, atol=1e-15)
    rig = read_rig(tmp_path / "d.toml")
    np.testing.assert_array_equal(rig.rig.strengths(3), wanted.rig.strengths(3))
    assert rig.names == wanted.stack.names
    assert rig.quality.verdict.startswith("Good: 8 lights")
    assert "Converted from" in rig.provenance[0]


def test_what_is_missing_is_asked_for_and_what_is_there_stays(run, tmp_path):
    (tmp_path / "a.toml").write_text(
        "rig = 1\n[lights]\npositions = [[100, 0, 0], [0, 100, 0], [-100, 0, 0]]\naxes = [[-0.3, 0, -1], [0, -0.3, -1],"
        ' [0.3, 0, -1]]\nmu = [1, 1, 1]\nflux = [1, 2, 3]\n[camera]\ntype = "pinhole"\n'
        "K = [[900, 0, 320], [0, 900, 240], [0, 0, 1]]\n"
    )
    words = ("convert", tmp_path / "a.toml", tmp_path / "led_params.txt")
    done = run(*words, "--distance", 300)
    assert done.code == 3
    assert "--size" in done.text
    assert run(*words, "--distance", -3, "--size", "640x480").code == 3
    assert run(*words, "--distance", 300, "--size", "640x480").code == 0
    assert (tmp_path / "led_params.txt").read_text().splitlines()[1] == "3 480 640 900 320 240 300"
    assert run(*words, "--distance", 300, "--size", "640x480").code == 3
    assert run(*words, "--distance", 300, "--size", "640x480", "--overwrite").code == 0
    back = run("convert", tmp_path / "led_params.txt", tmp_path / "near", "--to", "near-ps")
    assert back.code == 0
    assert "left out" in back.text
    assert "distance of the object" in back.text


@pytest.mark.parametrize("name", ["a.ptm", "a.rti"])
def test_files_for_viewers_are_written(run, folder, tmp_path, name):
    words = () if name == "a.ptm" else ("--basis", "hsh4", "--exposure", "0.8")
    done = run("convert", folder, tmp_path / name, *words, "--json")
    assert done.code == 0
    assert (done.record["width"], done.record["height"], done.record["lights"]) == (48, 40, 8)
    assert 0 < done.record["misfit_percent"] < 20
    head = (tmp_path / name).read_bytes()[:40]
    assert head.startswith(
        b"PTM_1.2\nPTM_FORMAT_LRGB\n48\n40\n" if name == "a.ptm" else b"#HSH1.2\n3\n48 40 3\n4 2 1\n"
    )
    assert run("convert", folder, tmp_path / name, *words).code == 3
    if name == "a.rti":
        few = run("convert", folder, tmp_path / "b.rti")
        assert few.code == 3
        assert "hsh4" in few.text


def test_a_page_is_written_whole(run, folder, tmp_path):
    done = run("convert", folder, tmp_path / "page", "--to", "web", "--quality", 90)
    assert done.code == 0
    assert "misfit" in done.text
    assert sorted(p.suffix for p in (tmp_path / "page").iterdir()) == [".html", ".jpg", ".jpg", ".jpg", ".json"]
    assert json.loads((tmp_path / "page" / "info.json").read_text())["format"] == "jpg"
    assert run("convert", folder, tmp_path / "x.ptm", "--quality", 90).code == 2


def test_normal_maps_change_their_frame_and_keep_sixteen_bits(run, tmp_path):
    plain = tmp_path / "result"
    plain.mkdir()
    vectors = np.random.default_rng(1).standard_normal((9, 11, 3))
    vectors /= np.linalg.norm(vectors, axis=2, keepdims=True)
    vectors[2, 3] = np.nan
    np.save(plain / "normals.npy", vectors.astype(np.float32))
    done = run("convert", plain, tmp_path / "n.png", "--out-frame", "directx", "--json")
    assert done.code == 0
    picture = cv2.imread(str(tmp_path / "n.png"), cv2.IMREAD_UNCHANGED)
    assert picture.dtype == np.uint16
    normals = np.load(plain / "normals.npy")
    known = np.isfinite(normals).all(axis=2)
    assert done.record["pixels"] == known.sum()
    np.testing.assert_allclose(picture[known][:, 1] / 32767.5 - 1, -normals[known][:, 1], atol=2e-5)
    assert run("convert", tmp_path / "n.png", tmp_path / "m.npy", "--frame", "directx").code == 0
    again = read_normal_map(tmp_path / "m.npy").normals
    np.testing.assert_allclose(again[known], normals[known], atol=4e-5)
    assert run("convert", tmp_path / "n.png", tmp_path / "m.npy").code == 3


def test_words_that_mean_nothing_are_usage_errors(run, folder, tmp_path):
    assert run("convert", folder, tmp_path / "x").code == 2
    assert run("convert", folder, tmp_path / "x", "--to", "gif").code == 2
    done = run("convert", tmp_path / "none", tmp_path / "x.lp", "--json")
    assert done.code == 3
    assert "does not exist" in done.record["error"]["given"]
    assert run("convert", folder, tmp_path / "x.lp", "--from", "gif").code == 3
    assert not any(tmp_path.glob("x*"))
    three = Rig.distant(np.eye(3)).directions
    (tmp_path / "three").mkdir()
    np.savetxt(tmp_path / "three" / "light_directions.txt", three)
    assert "--from" in run("convert", tmp_path / "three", tmp_path / "x.lp").text


def test_nothing_of_anybody_is_converted_away(run, folder, tmp_path):
    """Not what is read, and no file of another kind, even with --overwrite; options of another kind are told."""
    picture = cv2.imread(str(next(folder.glob("*1.png"))))
    cv2.imwrite(str(tmp_path / "n.png"), picture // 4)
    (tmp_path / "a.ptm").write_text("mine")
    np.save(tmp_path / "n.npy", np.dstack([np.zeros((4, 4, 2)), np.ones((4, 4))]))
    for source, out in ((tmp_path / "n.npy", "n.png"), (folder, "a.ptm"), (tmp_path / "n.npy", "n.npy")):
        before = (tmp_path / out).read_bytes()
        done = run("convert", source, tmp_path / out, "--overwrite")
        assert done.code == 3
        assert "Choose another name." in done.text
        assert (tmp_path / out).read_bytes() == before
    assert run("convert", folder, tmp_path / "a.lp", "--quality", 50).code == 2
    assert run("convert", folder, tmp_path / "b.ptm", "--frame", "directx").code == 2
    assert run("convert", tmp_path / "n.npy", tmp_path / "m.png", "--from", "diligent").code == 2
    assert {path.name for path in tmp_path.iterdir()} == {"n.png", "a.ptm", "n.npy", folder.name}


def test_plain_directions_are_lights(run, tmp_path):
    """Text, with a count or not, and .npy: as `reconstruct --lights` reads them; 3 × 3 numbers need a word."""
    vectors = np.array([[0.0, 0.0, 2.0], [0.6, 0.0, 0.8], [0.0, -0.6, 0.8], [-0.6, 0.0, 0.8]])
    np.savetxt(tmp_path / "a.txt", vectors)
    np.savetxt(tmp_path / "t.txt", vectors.T)
    (tmp_path / "c.dat").write_text("4\n" + (tmp_path / "a.txt").read_text())
    np.save(tmp_path / "n.npy", vectors)
    unit = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    for name in ("a.txt", "t.txt", "c.dat", "n.npy"):
        done = run("convert", tmp_path / name, tmp_path / "a.toml", "--overwrite", "--json")
        assert done.code == 0
        assert bool(done.record["notes"]) == (name == "t.txt")
        np.testing.assert_allclose(read_rig(tmp_path / "a.toml").rig.directions, unit, atol=1e-15)
        assert run("rig", tmp_path / name, "--json").record["lights"] == 4
    three = vectors[[0, 1, 3]] + [0.0, 0.1, 0.0]
    np.savetxt(tmp_path / "three.txt", three)
    assert "--from diligent takes rows" in run("rig", tmp_path / "three.txt").text
    for kind, wanted in (("diligent", three), ("psbox", three.T)):
        done = run("convert", tmp_path / "three.txt", tmp_path / "a.toml", "--from", kind, "--overwrite")
        assert done.code == 0
        length = np.linalg.norm(wanted, axis=1, keepdims=True)
        np.testing.assert_allclose(read_rig(tmp_path / "a.toml").rig.directions, wanted / length, atol=1e-15)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.txt", b"hello\n", "Only numbers"),
        ("a.txt", b"0 0 1\n0 1\n", "3 numbers are expected"),
        ("a.txt", b"0 0 1\n0 0 0\n0 1 1\n1 0 1\n", "a.txt: Light 2"),
        ("a.txt", b"1 2 3 4\n" * 5, "one light of three numbers"),
        ("a.txt", b"", "is empty"),
        ("a.npy", b"\x93NUMPY\x01", "a.npy cannot be read"),
        ("a.png", b"\x89PNG", "no format of lights"),
    ],
)
def test_what_holds_no_directions_is_refused(run, tmp_path, name, content, said):
    (tmp_path / name).write_bytes(content)
    done = run("convert", tmp_path / name, tmp_path / "b.lp")
    assert done.code == 3
    assert said in done.text
    assert not (tmp_path / "b.lp").exists()
