"""``psstereo solvers``: the table, the options of one, and the same for machines."""

import pytest

from psstereo.depth import INTEGRATORS
from psstereo.method_options import options_of
from psstereo.normals import NORMAL_SOLVERS
from psstereo.sfs import SHADING_METHODS


def test_all_solvers_are_listed_with_what_they_need(run):
    done = run("solvers")
    assert done.code == 0
    assert done.out == ""
    for words in ("solver", "what it does", "assumes that", "least lights", "pays from", "avoid it when"):
        assert words in done.text
    for name in NORMAL_SOLVERS:
        assert f" {name} " in done.err
    assert "psstereo solvers NAME" in done.err


def test_machines_get_the_same(run):
    done = run("solvers", "--json")
    assert done.code == 0
    assert done.err == ""
    assert list(done.record) == list(NORMAL_SOLVERS)
    for name, facts in done.record.items():
        solver = NORMAL_SOLVERS[name]
        assert facts["summary"] == solver.summary
        assert facts["assumes"] == solver.assumes
        assert facts["avoid"] == solver.avoid
        assert facts["least_lights"] == solver.least_lights
        assert facts["pays_from"] == solver.pays_from
        assert [option["name"] for option in facts["options"]] == [option.name for option in options_of(solver)]


@pytest.mark.parametrize("name", sorted(NORMAL_SOLVERS))
def test_the_options_of_one(run, name):
    told, record = run("solvers", name), run("solvers", name, "--json").record
    assert told.code == 0
    assert told.out == ""
    assert record["name"] == name
    for option in options_of(NORMAL_SOLVERS[name]):
        assert f" {option.name} " in told.err
        assert {"name": option.name, "kind": option.kind, "default": option.default, "meaning": option.meaning} in (
            record["options"]
        )
    assert f"--solver {name} --option KEY=VALUE" in told.text


def test_an_unknown_solver_is_told_with_the_nearest(run):
    done = run("solvers", "robst", "--json")
    assert done.code == 3
    assert "robst" in done.record["error"]["given"]
    assert done.record["error"]["remedy"] == "Did you mean robust?"


@pytest.mark.parametrize(("family", "members"), [("depth", INTEGRATORS), ("shading", SHADING_METHODS)])
def test_other_families_are_listed_too(run, family, members):
    done, record = run("solvers", "--for", family), run("solvers", "--for", family, "--json").record
    assert list(record) == list(members)
    for name, method in members.items():
        assert f" {name} " in done.err
        assert record[name]["summary"] == method.summary
        assert [one["name"] for one in record[name]["options"]] == [one.name for one in options_of(method)]
    name = next(iter(members))
    told = run("solvers", name, "--for", family)
    assert told.code == 0
    assert f" {name} --option KEY=VALUE" in told.text


def test_an_unknown_family_is_refused(run):
    done = run("solvers", "--for", "depht")
    assert done.code == 3
    assert "Did you mean depth?" in done.text
