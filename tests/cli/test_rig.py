"""``psstereo rig``: proposals and ratings."""

import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from psstereo.io import read_capture, read_lp
from psstereo.io.rig_file import read_rig


def test_a_proposal_is_written_drawn_and_rated_again(run, tmp_path):
    done = run(
        "rig", "--lights", 3, "--max-tilt", 30, "--shape", "ring", "-o", tmp_path / "p.toml", "--picture",
        tmp_path / "p.svg", "--json",
    )  # fmt: skip
    assert done.code == 0
    assert done.err == ""
    record = done.record
    assert record["rings"] == [{"lights": 3, "slant_deg": pytest.approx(54.7356, abs=0.01)}]
    assert record["error_deg_at_1_percent"] == pytest.approx(0.8103, abs=1e-3)
    assert record["told_share"] == 1
    rig = read_rig(tmp_path / "p.toml")
    np.testing.assert_allclose(rig.rig.directions, record["directions"])
    drawn = ET.fromstring((tmp_path / "p.svg").read_text(encoding="utf-8"))
    dots = drawn.findall("{http://www.w3.org/2000/svg}circle[@class='light']")
    places = np.array([[float(dot.get("cx")) - 150, 150 - float(dot.get("cy"))] for dot in dots])
    np.testing.assert_allclose(places / 130, rig.rig.directions[:, :2], atol=1e-3)
    again = run("rig", tmp_path / "p.toml", "--json").record
    assert again["verdict"] == record["verdict"]
    assert any("no light is to spare" in sentence for sentence in again["advice"])
    assert [one["tilt_deg"] for one in again["tilts"]][:3] == [0, 5, 10]
    assert run("rig", "--lights", 3, "-o", tmp_path / "p.toml").code == 3
    assert run("rig", "--lights", 3, "--picture", tmp_path / "p.svg").code == 3
    listed = run("rig", "--lights", 4, "-o", tmp_path / "p.lp")
    assert listed.code == 0
    assert "left out: The format lp has no place for how good it is" in listed.text
    assert len(read_lp(tmp_path / "p.lp").names) == 4


def test_a_capture_s_lights_are_rated_in_words(run, folder):
    done = run("rig", folder)
    assert done.code == 0
    assert done.out == ""
    assert "8 lights, condition" in done.text
    assert re.search(r"0° +0\.\d+° +100% +8", done.err)
    capture, _ = read_capture(folder)
    record = run("rig", folder, "--json").record
    assert record["condition"] == pytest.approx(capture.rig.condition())
    table = run("rig", "--lights", 9, "--max-tilt", 75, "--shape", "dome").text
    assert "9 lights evenly over a dome up to" in table


def test_coplanar_lights_and_lamps_without_a_middle(run, tmp_path):
    (tmp_path / "flat.lp").write_text("3\na 0.5 0 0.8\nb 0 0 1\nc -0.5 0 0.8\n")
    done = run("rig", tmp_path / "flat.lp", "--json")
    assert done.code == 0
    assert done.record["verdict"].startswith("Not enough for normals")
    assert done.record["condition"] is None
    assert done.record["tilts"][0]["error_deg_at_1_percent"] is None
    assert "not told" in run("rig", tmp_path / "flat.lp").text
    (tmp_path / "board.toml").write_text(
        "rig = 1\n[lights]\npositions = [[50, 0, 0], [0, 50, 0], [-50, 0, 0], [0, -50, 0]]\n"
        "axes = [[0, 0, -1], [0, 0, -1], [0, 0, -1], [0, 0, -1]]\nmu = [1, 1, 1, 1]\nflux = [1, 1, 1, 1]\n"
    )
    done = run("rig", tmp_path / "board.toml")
    assert done.code == 3
    assert "where the object" in done.text
    assert run("rig", tmp_path / "board.toml", "--at", "0,0,-60").code == 0
    assert run("rig", tmp_path / "board.toml", "--at", "0,0").code == 3


@pytest.mark.parametrize(
    "words", [(), ("--lights", 5, "a.lp"), ("a.lp", "-o", "x.toml"), ("--lights", 5, "-o", "x.ptm")]
)
def test_words_that_do_not_go_together_are_usage_errors(run, tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.lp").write_text("1\na 0 0 1\n")
    assert run("rig", *words).code == 2
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.lp"]


@pytest.mark.parametrize("words", [("--lights", 2), ("--lights", 5, "--max-tilt", 88), ("--lights", 5, "--shape", "x")])
def test_numbers_out_of_range_are_refused(run, words):
    assert run("rig", *words).code == 3


def test_no_lights_are_written_where_the_picture_cannot_be(run, tmp_path):
    (tmp_path / "mine.svg").write_text("mine")
    for picture, code in (("no/p.svg", 3), ("p.png", 2), ("mine.svg", 3)):
        words = ("-o", tmp_path / "p.toml", "--picture", tmp_path / picture, "--overwrite")
        assert run("rig", "--lights", 3, *words).code == code
    assert [path.name for path in tmp_path.iterdir()] == ["mine.svg"]
    assert "does not end in .toml" in run("rig", "--lights", 3, "-o", tmp_path / "p.foo").text


@pytest.mark.parametrize("words", [("--max-tilt", 30), ("--lights", 3)])
def test_options_without_use_are_refused(run, folder, words):
    assert run("rig", folder, *words).code == 2


def test_a_place_that_is_none(run, folder):
    assert run("rig", folder, "--at", "0,nan,3").code == 3


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("rig = 1\n[lights\n", "Correct that place, save it as UTF-8 if an editor changed that, or calibrate again."),
        ("rig = 2\n", "A rig file of version 1"),
        ("[lights]\ndirections = [[0, 0, 1]]\n", "A rig file of version 1"),
        ("", "A rig file, as psstereo calibrate writes it."),
        ("rig = 1\na = " + "[" * 9999, "A rig file in UTF-8"),
        (
            "rig = 1\n[lights]\ndirections = [[0, 0, 1], [1, 0]]\nstrengths = [1, 1]\n",
            "a list of rows of 3 numbers each.",
        ),
    ],
)
def test_a_broken_rig_file_is_called_one(run, tmp_path, content, said):
    (tmp_path / "a.toml").write_text(content)
    for words in (("rig", tmp_path / "a.toml"), ("convert", tmp_path / "a.toml", tmp_path / "b.lp")):
        done = run(*words)
        assert done.code == 3
        assert said in done.text
        assert "image" not in done.text.split("toml", 1)[1]
    assert (tmp_path / "a.toml").read_text() == content


def test_no_broken_rig_file_is_written_over(run, tmp_path):
    (tmp_path / "a.lp").write_text("1\na 0 0 1\n")
    (tmp_path / "a.toml").write_text("rig = 1\n[lights\n")
    assert run("convert", tmp_path / "a.lp", tmp_path / "a.toml", "--overwrite").code == 3
    assert (tmp_path / "a.toml").read_text() == "rig = 1\n[lights\n"


def test_a_broken_description_of_a_capture_is_called_one(run, tmp_path):
    (tmp_path / "capture.toml").write_text("name = \n")
    (tmp_path / "mine.toml").write_text("[images]\nfiles = [\n")
    for name in ("capture.toml", "mine.toml"):
        done = run("rig", tmp_path / name)
        assert done.code == 3
        assert "[images]" in done.text
