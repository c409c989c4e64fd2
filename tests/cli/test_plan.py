"""``psstereo plan`` and ``psstereo reconstruct --plan``: what is decided is shown, kept, edited and followed."""

import json

import numpy as np
import pytest

from psstereo.errors import InputError
from psstereo_cli.suites import planner, planner_predictions


@pytest.fixture
def planned(run, folder, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    path = tmp_path / "plan.json"
    done = run("plan", folder, "-o", path, "--json", "--threads", "1")
    assert done.code == 0
    return path, done.record


def test_a_plan_is_told_and_kept(planned):
    path, record = planned
    kept = json.loads(path.read_text("utf-8"))
    assert {key: record[key] for key in kept} == kept
    assert kept["facts"]["images"] == 8
    assert kept["facts"]["surveyed"] == kept["facts"]["pixels"] > 0
    assert all(stage["reason"] for stage in kept["stages"])
    predicted = kept["predicted"]
    assert all(value >= 0 for value in predicted.values())
    assert predicted["memory"] > 5e7


def test_a_table_says_why(run, folder, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    done = run("plan", folder, "--threads", "1", "--normals-only")
    assert done.code == 0
    assert done.out == ""
    for words in ("shadow gate", "The images are linear.", "Only normals were asked for.", "Expected:", "condition"):
        assert words in done.text


def test_a_plan_is_run_as_it_was_made(run, folder, tmp_path, planned):
    path, record = planned
    plain = run("reconstruct", folder, "-o", tmp_path / "a", "--json", "--threads", "1").record
    again = run("reconstruct", folder, "-o", tmp_path / "b", "--plan", path, "--json", "--threads", "1").record
    assert again["normals"]["solver"] == plain["normals"]["solver"]
    for name in ("normals.npy", "depth.npy"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    assert [one["use"] for one in plain["plan"]["stages"]] == [one["use"] for one in record["stages"]]


def test_an_edited_plan_is_followed(run, folder, tmp_path, planned):
    path, record = planned
    for stage in record["stages"]:
        if stage["name"] in ("ambient solving", "robust solving", "non-Lambertian solving", "shadow gate"):
            stage.update(use=False, options={})
        if stage["name"] == "mesh":
            stage["use"] = False
    del record["capture"]
    path.write_text(json.dumps(record), "utf-8")
    done = run("reconstruct", folder, "-o", tmp_path / "a", "--plan", path, "--json")
    assert done.code == 0
    assert done.record["normals"]["solver"] == "least-squares"
    assert done.record["normals"]["gate"] == "saturation"
    assert done.record["mesh"] is None
    named = run("reconstruct", folder, "-o", tmp_path / "b", "--solver", "least-squares", "--gate", "saturation")
    assert named.code == 0
    np.testing.assert_array_equal(np.load(tmp_path / "a" / "normals.npy"), np.load(tmp_path / "b" / "normals.npy"))


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("--plan", "none.json"), 3, "does not exist"),
        (("--plan", "plan.json", "--clip", "1"), 3, "the option clip"),
        (("--plan", "plan.json", "--solver", "robust"), 3, "the option solver"),
    ],
)
def test_what_cannot_be_is_refused(run, folder, tmp_path, planned, monkeypatch, words, code, said):  # noqa: PLR0917
    assert planned[0].name == "plan.json"
    monkeypatch.chdir(tmp_path)
    done = run("reconstruct", folder, "-o", tmp_path / "out", *words)
    assert done.code == code
    assert said in done.text
    assert not (tmp_path / "out").exists()


def test_a_plan_is_not_replaced_unasked(run, folder, planned):
    path, _ = planned
    before = path.read_bytes()
    assert run("plan", folder, "-o", path).code == 3
    assert path.read_bytes() == before
    assert run("plan", folder, "-o", path, "--overwrite").code == 0
    assert run("plan", folder, "-o", path.parent / "none" / "plan.json").code == 3


def test_the_regret_is_measured(run, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(planner, "SCENES", ("matte-sphere",))
    monkeypatch.setattr(planner, "CONFIGURATIONS", ("least-squares", "robust"))
    monkeypatch.setattr(planner_predictions, "SCENES", ("matte-sphere",))
    monkeypatch.setattr(planner_predictions, "SIDES", (24,))
    monkeypatch.setattr(planner_predictions, "_command", lambda words, kept: run(*words, "--json").record)
    done = run("bench", "planner", "--size", "32x32", "--repeats", "1", "--threads", "1", "--json")
    assert done.code == 0
    assert done.record["table"]["columns"][4] == "regret"
    rows = {row[0]: row for row in done.record["table"]["rows"]}
    assert rows["matte-sphere"][1] == "least-squares"
    assert rows["matte-sphere"][4] == "none"
    said = next(note for note in done.record["notes"] if note.startswith("Predicted over measured, matte-sphere 24x24"))
    for part in ("read", "survey", "solve", "depth", "mesh", "total"):
        assert f"{part} 0." in said
    told = {one["method"] for one in done.record["rows"] if one["problem"] == "matte-sphere 24x24"}
    assert told == {"predicted", "planned"}


def test_a_command_that_fails_ends_the_predictions_with_its_words(tmp_path):
    with pytest.raises(InputError, match="ended with the code 3"):
        planner_predictions._command(["plan", str(tmp_path / "nowhere")], tmp_path)
