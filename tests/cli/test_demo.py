"""``psstereo demo``: from nothing to a scored result."""

from functools import partial

import numpy as np
import pytest

from psstereo.depth import INTEGRATORS, Poisson
from psstereo_cli.commands import demo as demo_module
from tests.cli.capture_files import TIMED


def test_it_leaves_a_scored_result(run, tmp_path):
    done = run("demo", "-o", tmp_path / "d", "--size", "96", "--json")
    assert done.code == 0
    names = {p.name for p in (tmp_path / "d").iterdir()}
    assert {"normals.npy", "depth.npy", "mesh.ply", "mesh.glb", "normals.png", "run.json"} <= names
    scores = done.record["scores"]
    # The result's own uncertainty is the root mean square that is expected for 16 bits and this noise.
    expected = np.load(tmp_path / "d" / "uncertainty.npy").astype(float)
    bound = float(np.sqrt(np.nanmean(expected**2)))
    assert 0 < bound < 1
    assert scores["normals"]["rmse_deg"] == pytest.approx(bound, rel=0.15)
    assert scores["normals"]["mean_deg"] < bound
    assert scores["normals"]["coverage"] == 1
    assert scores["depth"]["rmse"] < 0.02
    assert done.record["command"] == "demo"


def test_more_noise_more_error_and_more_lights_less(run, tmp_path):
    def mean(name, *options):
        done = run("demo", "-o", tmp_path / name, "--size", "64", "--json", *options)
        return done.record["scores"]["normals"]["mean_deg"]

    plain = mean("a")
    assert mean("b", "--noise", "0.004") == pytest.approx(2 * plain, rel=0.15)
    assert mean("c", "--lights", "48") == pytest.approx(plain / 2, rel=0.15)
    assert mean("d", "--noise", "0") < 0.05 * plain


def test_it_tells_a_person_the_same(run, tmp_path):
    record = run("demo", "-o", tmp_path / "a", "--size", "32", "--json").record
    done = run("demo", "-o", tmp_path / "b", "--size", "32")
    assert done.out == ""
    assert f"mean {record['scores']['normals']['mean_deg']:.4g}°" in done.text
    assert f"root mean square {record['scores']['depth']['rmse']:.4g} px" in done.text
    assert f"Look at {tmp_path / 'b' / 'normals.png'}" in done.err


def test_the_next_free_name_is_taken(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("psstereo-demo", "psstereo-demo-2", "psstereo-demo-3"):
        done = run("demo", "--size", "16", "--json")
        assert done.record["out"] == name
    assert sorted(p.name for p in tmp_path.iterdir()) == ["psstereo-demo", "psstereo-demo-2", "psstereo-demo-3"]


def files(folder):
    return {p.name: p.read_bytes() for p in folder.iterdir() if p.name not in TIMED}


def test_the_same_seed_gives_the_same_bytes(run, tmp_path):
    for name, words in {"a": (), "b": ("--threads", "1"), "c": ("--seed", "0"), "d": ("--seed", "1")}.items():
        assert run("demo", "-o", tmp_path / name, "--size", "40", *words).code == 0
    assert files(tmp_path / "a") == files(tmp_path / "b") == files(tmp_path / "c")
    other = files(tmp_path / "d")
    assert all(other[name] != data for name, data in files(tmp_path / "a").items() if name.endswith((".npy", ".ply")))


def test_the_folder_is_protected(run, tmp_path):
    assert run("demo", "-o", tmp_path / "a", "--size", "16").code == 0
    before = files(tmp_path / "a")
    refused = run("demo", "-o", tmp_path / "a", "--size", "20", "--json")
    assert refused.code == 3
    assert "--overwrite" in refused.record["error"]["remedy"]
    assert files(tmp_path / "a") == before
    assert run("demo", "-o", tmp_path / "a", "--size", "20", "--overwrite").code == 0
    assert np.load(tmp_path / "a" / "flags.npy").shape == (20, 20)


@pytest.mark.parametrize("options", [("--lights", "2"), ("--noise", "-1"), ("--noise", "2"), ("--seed", "-1")])
def test_numbers_out_of_range_are_usage_errors(run, tmp_path, options):
    assert run("demo", "-o", tmp_path / "a", *options).code == 2
    assert not list(tmp_path.iterdir())


def test_the_bundled_result_can_be_evaluated_again(run, tmp_path):
    run("demo", "-o", tmp_path / "a", "--size", "32")
    done = run("evaluate", tmp_path / "a", tmp_path / "a" / "normals.npy", "--json")
    assert done.record["normals"]["max_deg"] < 1e-4


def test_an_unfinished_integration_ends_with_4(run, tmp_path, monkeypatch):
    assert INTEGRATORS["poisson"] is Poisson
    monkeypatch.setattr("psstereo.depth.Poisson", partial(Poisson, max_iterations=1))
    done = run("demo", "-o", tmp_path / "a", "--size", "64", "--json")
    assert done.code == 4
    assert done.record["depth"]["outcome"] == "not_converged"


def test_free_names_skip_files_too(tmp_path):
    (tmp_path / "x").write_text("")
    (tmp_path / "x-2").mkdir()
    assert demo_module._free_name(tmp_path / "x") == tmp_path / "x-3"
    assert demo_module._free_name(tmp_path / "y") == tmp_path / "y"
