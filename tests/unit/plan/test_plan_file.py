"""Plans survive JSON, and hostile files get one clear message."""

import json
from dataclasses import replace

import pytest

from psstereo.errors import InputError, MissingFileError, OptionError, PsstereoError, UnreadableFileError
from psstereo.pipeline import Options, plan_capture, reconstruct
from psstereo.plan.diagnosis import Finding
from psstereo.plan.plan import make_plan
from psstereo.plan.plan_file import plan_record, read_plan, write_plan
from psstereo_synth import checker, hills, lambertian_capture, spiral


@pytest.fixture(scope="module")
def capture():
    return lambertian_capture(hills(40, 40), checker((40, 40)), spiral(12, max_tilt=0.9), bits=16, noise=0.01)[0]


@pytest.fixture(scope="module")
def plan(capture):
    return plan_capture(capture)


def changed(tmp_path, plan, change):
    record = json.loads(json.dumps(plan_record(plan)))
    change(record)
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(record), "utf-8")
    return path


def stage(record, name):
    return next(one for one in record["stages"] if one["name"] == name)


def test_round_trip(tmp_path, plan):
    finding = Finding(
        name="x", severity="note", figure=1.5, unit="°", sentence="S.", remedy="R.", confidence=0.5, images=(2,)
    )
    full = replace(plan, facts=replace(plan.facts, findings=(finding,)))
    write_plan(tmp_path / "plan.json", full)
    assert read_plan(tmp_path / "plan.json") == full


def test_a_saved_plan_runs_as_the_first_one(tmp_path, capture, plan):
    write_plan(tmp_path / "plan.json", plan)
    one, other = reconstruct(capture), reconstruct(capture, plan=read_plan(tmp_path / "plan.json"))
    assert one.normals.normals.tobytes() == other.normals.normals.tobytes()
    assert one.depth.depth.tobytes() == other.depth.depth.tobytes()
    assert {s.name: s.done for s in one.steps if s.name != "survey"} == {
        s.name: s.done for s in other.steps if s.name != "survey"
    }


def test_edited_stages_are_followed(tmp_path, capture, plan):
    def edit(record):
        stage(record, "robust solving").update(use=True, options={"solver": "robust", "settings": {"loss": "huber"}})
        stage(record, "shadow gate").update(use=False)
        stage(record, "depth").update(options={"integrator": "poisson", "settings": {"tolerance": 1e-6}})
        stage(record, "mesh").update(use=False)

    answer = reconstruct(capture, plan=read_plan(changed(tmp_path, plan, edit)))
    assert (answer.normals.facts["solver"], answer.normals.facts["gate"]) == ("robust", "saturation")
    assert answer.normals.facts["options"]["loss"] == "huber"
    assert answer.mesh is None
    assert answer.depth is not None
    assert not next(one for one in answer.steps if one.name == "mesh").done


@pytest.mark.parametrize(
    ("name", "entry", "word"),
    [
        ("robust solving", {"use": True, "options": {"solver": "ambient"}}, "solver is 'ambient'"),
        ("robust solving", {"use": True}, "solver is None"),
        ("robust solving", {"use": True, "options": {"solver": "robust", "settings": {"rounds": 0}}}, "0 rounds"),
        ("robust solving", {"use": True, "options": {"solver": "robust", "settings": {"gate": "none"}}}, "'gate'"),
        ("robust solving", {"use": True, "options": {"solver": "robust", "settings": 3}}, "settings are 3"),
        ("depth", {"use": True, "options": {"integrator": "poison"}}, "poisson"),
        ("depth", {"use": True, "options": {"settings": []}}, "settings are"),
        ("depth", {"use": False, "options": {}}, "the depth is left out"),
        ("reading", {"use": False, "options": {}}, "it is left out"),
        ("reading", {"use": True, "options": {"gray": 7}}, "gray value is 7"),
        ("reading", {"use": True, "options": {"clip": -1}}, "clip is -1"),
        ("saturation gate", {"use": True, "options": {"valid_range": [1]}}, "valid range is"),
        ("linearisation", {"use": True}, "no curve"),
        ("dark level", {"use": True}, "no dark image"),
        ("near lamps", {"use": True}, "has a place"),
        ("perspective", {"use": True}, "orthographic"),
        ("observation mask", {"use": True}, "no mask is given"),
        ("tiling", {"use": True, "options": {"max_memory": "much"}}, "limit is 'much'"),
        ("compiled kernels", {"use": True, "robust": True}, "samples need"),
        ("light directions", {"use": True, "options": {"source": "given"}}, "source is 'given'"),
        ("light directions", {"use": True, "options": {"source": "refine", "doubt": "x"}}, "doubt is 'x'"),
        ("light strengths", {"use": True, "options": {"choice": "guess"}}, "choice is 'guess'"),
    ],
)
def test_stages_that_cannot_be_followed_are_refused(tmp_path, capture, plan, name, entry, word):  # noqa: PLR0917
    def edit(record):
        if entry.pop("robust", False):
            stage(record, "robust solving").update(use=True, options={"solver": "robust"})
        stage(record, name).update(entry)
        if name == "depth" and not entry["use"]:
            stage(record, "mesh").update(use=True)

    with pytest.raises(PsstereoError, match=word):
        reconstruct(capture, plan=read_plan(changed(tmp_path, plan, edit)))


def test_two_solvers_are_one_too_many(tmp_path, capture, plan):
    def edit(record):
        stage(record, "ambient solving").update(use=True, options={"solver": "ambient"})
        stage(record, "robust solving").update(use=True, options={"solver": "robust"})

    with pytest.raises(InputError, match="ambient as well"):
        reconstruct(capture, plan=read_plan(changed(tmp_path, plan, edit)))


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda r: r.update(schema=2), "schema 2"),
        (lambda r: r.update(more=1), "'more' is unknown"),
        (lambda r: r.update(stages=3), "no list of stages"),
        (lambda r: r["stages"].append(3), "no name"),
        (lambda r: r["stages"].append(r["stages"][0]), "twice"),
        (lambda r: r["stages"].pop(), "mesh is missing"),
        (lambda r: r["stages"][0].update(name="linear"), "'linear' is unknown"),
        (lambda r: r["stages"][0].update(use=1), "true or false"),
        (lambda r: r["stages"][0].update(options=[]), "no object"),
        (lambda r: r["stages"][0].update(options={"x": 1}), "known are none"),
        (lambda r: stage(r, "robust solving").update(options={"solver": "robust"}), "left out and has options"),
        (lambda r: r["stages"][0].update(extra=1), "'extra'"),
        (lambda r: r["stages"][0].update(reason=1), "texts"),
        (lambda r: r.pop("facts"), "named entries"),
        (lambda r: r["facts"].pop("images"), "no entry 'images'"),
        (lambda r: r["facts"].update(images=1.5), "whole number"),
        (lambda r: r["facts"].update(images=True), "whole number"),
        (lambda r: r["facts"].update(noise="much"), "a number"),
        (lambda r: r["facts"].update(trials=[{"solver": 1}]), "Trial|no entry|text"),
        (lambda r: r["facts"].update(colour=1), "'colour'"),
        (lambda r: r["predicted"].update(read="long"), "a number"),
    ],
)
def test_wrong_entries_are_named(tmp_path, plan, change, word):
    with pytest.raises(InputError, match=word):
        read_plan(changed(tmp_path, plan, change))


@pytest.mark.parametrize("text", ["", "[", "{" * 5000, '{"a": NaN}', "\x00", "[" * 100_000])
def test_what_is_no_json_is_told(tmp_path, text):
    path = tmp_path / "plan.json"
    path.write_text(text, "utf-8")
    with pytest.raises(UnreadableFileError, match="cannot be read as a plan"):
        read_plan(path)


def test_files_that_are_not_there(tmp_path, plan):
    with pytest.raises(MissingFileError, match="does not exist"):
        read_plan(tmp_path / "none.json")
    with pytest.raises(UnreadableFileError, match="cannot be read"):
        read_plan(tmp_path)
    with pytest.raises(MissingFileError, match="cannot be written"):
        write_plan(tmp_path / "none" / "plan.json", plan)
    assert list(tmp_path.iterdir()) == []


def test_options_beside_a_plan_are_refused(capture, plan):
    with pytest.raises(OptionError, match="the option clip"):
        reconstruct(capture, Options(clip=1.0), plan=plan)


def test_nothing_left_out_does_what_applies(capture):
    options = Options(nothing_left_out=True)
    plan = make_plan(plan_capture(capture, options).facts, options)
    assert plan["robust solving"].use
    assert plan["discontinuities"].use
    assert plan["shadow gate"].use
    assert not plan["non-Lambertian solving"].use
