"""``psstereo bench``: small suites; figures of time are never tested, only that they are there."""

import math
import sys

import pytest

from psstereo.bench import read_records, summarise
from psstereo.bench.folder import read_bench
from psstereo.normals import NORMAL_SOLVERS
from psstereo_synth.problems import lambertian_problems


@pytest.fixture(scope="module")
def names():
    return [problem.name for problem in lambertian_problems(32)]


def test_accuracy_as_record_and_as_table(run, tmp_path, names):
    words = ("bench", "accuracy", "--size", "32x32", "--repeats", "2", "--threads", "1")
    done = run(*words, "--json", "-o", tmp_path / "records.jsonl")
    assert done.code == 0
    assert done.err == ""
    record = done.record
    assert (record["suite"], record["repeats"], record["threads"]) == ("accuracy", 2, 1)
    methods = list(dict.fromkeys(row["method"] for row in record["rows"]))
    assert [method.split()[-1] for method in methods] == ["none", "auto"]
    assert record["baseline"] == methods[0]
    assert [(row["problem"], row["method"]) for row in record["rows"]] == [(p, m) for p in names for m in methods]
    for row in record["rows"]:
        assert row["seconds"] > 0
        assert row["ratio"] > 0
        assert all(math.isfinite(value) for value in row["error"].values())
        assert row["method"] != methods[0] or row["ratio"] == 1
    errors = {(row["problem"], row["method"]): row["error"]["mean_deg"] for row in record["rows"]}
    assert errors["exact", methods[1]] < 1e-6
    assert errors["exact", methods[0]] > 1  # attached shadows, taken for data
    assert errors["16 bit", methods[1]] < errors["8 bit", methods[1]] < errors["noise", methods[1]] < 2

    records = read_records(tmp_path / "records.jsonl")
    assert len(records) == 2 * len(names) * len(methods)
    assert {r.sizes["width"] for r in records} == {32}
    rows = [(s.problem, s.method, s.seconds, s.ratio) for s in summarise(records, methods[0])]
    assert rows == [(r["problem"], r["method"], r["seconds"], r["ratio"]) for r in record["rows"]]
    assert [p.name for p in tmp_path.iterdir()] == ["records.jsonl"]


def test_accuracy_for_a_person(run, names):
    done = run("bench", "--size", "16x16", "--repeats", "1")
    assert done.code == 0
    assert done.out == ""
    assert "suite accuracy: medians of 1 rounds" in done.text
    for name in names:
        assert name in done.text


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (
            ("acuracy",),
            ("acuracy", "quick, normals, accuracy, solvers, lights, coverage, reading,", "Did you mean accuracy?"),
        ),
        (("accuracy", "--size", "32"), ("'32'", "WIDTHxHEIGHT")),
        (("accuracy", "--size", "4x4"), ("'4x4'", "from 8")),
        (("accuracy", "--size", "²²x²²"), ("WIDTHxHEIGHT",)),
        (("accuracy", "--size", "32x16"), ("32x16", "squares", "32x32")),
        (("accuracy", "-o", "no folder/records.jsonl"), ("no folder", "does not exist")),
        (("accuracy", "-o", "."), ("is a folder",)),
        (("accuracy", "--suite", "lights"), ("Two suites", "accuracy and lights")),
        (("photographs",), ("no images of its own", "--folder")),
        (("photographs", "--size", "64x64", "--folder", "."), ("'64x64'", "as large as they are")),
        (("photographs", "--folder", "nowhere"), ("nowhere", "no capture with true normals")),
    ],
)
def test_nonsense_is_told_before_anything_is_measured(run, tmp_path, monkeypatch, words, parts):
    import psstereo.bench

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(psstereo.bench, "run_solvers", lambda *_a, **_k: pytest.fail("something was measured"))
    done = run("bench", *words, "--json")
    assert done.code == 3
    error = done.record["error"]
    assert done.err == f"psstereo: {error['given']}\n  {error['needed']}\n  {error['remedy']}\n"
    for part in parts:
        assert part in done.err
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_reading_measures_decoding_library_command_and_memory(run, tmp_path, monkeypatch, environment):
    monkeypatch.setenv("PYTHONPATH", environment["PYTHONPATH"])
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    words = ("bench", "reading", "--size", "64x48", "--lights", "6", "--repeats", "1", "--threads", "2")
    done = run(*words, "--json", "-o", tmp_path / "records.jsonl")
    assert done.code == 0
    record = done.record
    assert record["baseline"] == "decoding alone"
    assert [row["method"] for row in record["rows"]] == [
        "decoding alone",
        "library, gate none",
        "library, gate auto",
        "command, normals only",
        "command, with depth and mesh",
    ]
    sizes = record["sizes"]
    assert (sizes["lights"], sizes["width"], sizes["height"], sizes["threads"]) == (6, 64, 48, 2)
    assert 0 < sizes["pixels"] < 64 * 48
    assert record["memory"].keys() == {"in memory", "in 30 MB"}
    for grown in record["memory"].values():
        assert grown["samples"] == sizes["pixels"] * 6 * 4
        if sys.platform == "linux":
            assert grown["peak"] > grown["before"] > 0
    assert len(read_records(tmp_path / "records.jsonl")) == 5
    assert not list(tmp_path.glob("psstereo-bench-*"))


def test_forward_names_its_methods(run, monkeypatch):
    words = ("bench", "forward", "--size", "40x32", "--lights", "3", "--repeats", "1", "--threads", "2", "--json")
    record = run(*words).record
    methods = [row["method"] for row in record["rows"]]
    assert methods == [
        "writing PNG, 1 thread",
        "render, 1 thread",
        "render, 2 threads",
        "Mitsuba direct, 1 sample, 2 threads",
    ]
    assert all(row["seconds"] > 0 for row in record["rows"])
    monkeypatch.setitem(sys.modules, "mitsuba", None)
    record = run(*words).record
    assert [row["method"] for row in record["rows"]] == methods[:3]
    assert "Mitsuba is not installed" in record["notes"][0]


def test_a_measured_process_that_fails_is_told(monkeypatch):
    from psstereo.errors import InputError
    from psstereo_cli.suites.reading import _run_python

    with pytest.raises(InputError, match="No module named") as caught:
        _run_python("psstereo_no_such_module")
    assert "ended with 1" in caught.value.given


def test_records_are_not_overwritten_without_being_asked(run, tmp_path):
    kept = tmp_path / "mine.jsonl"
    kept.write_text("keep me", encoding="utf-8")
    words = ["bench", "accuracy", "--size", "32x32", "--repeats", "1", "--threads", "1", "-o", str(kept)]
    refused = run(*words)
    assert refused.code == 3
    assert "--overwrite" in refused.err
    assert kept.read_text(encoding="utf-8") == "keep me"
    assert run(*words, "--overwrite").code == 0
    assert len(read_records(kept)) > 1


def test_coverage_prints_a_table_and_records_each_cell(run, monkeypatch, tmp_path):
    from psstereo_cli.suites import coverage

    monkeypatch.setattr(coverage, "LIGHTS", (3, 12))
    monkeypatch.setattr(coverage, "NOISES", (0.01,))
    monkeypatch.setattr(coverage, "SCENES", ((40.0, 35.0), (60.0, 70.0)))
    monkeypatch.setattr(coverage, "METHODS", ("least-squares",))
    words = ("bench", "coverage", "--size", "64x64", "--repeats", "2", "--threads", "1")
    record = run(*words, "--json", "-o", tmp_path / "records.jsonl").record
    rows = record["table"]["rows"]
    assert [row[1:3] for row in rows] == [["1.0%", "3"], ["1.0%", "12"]] * 2
    assert [row[0] for row in rows][:2] == ["0%", "0%"]
    assert float(rows[3][0].rstrip("%")) > 5
    assert rows[0][3] == rows[2][3] == "not told"  # three observations leave no residual
    for row in (rows[1], rows[3]):
        assert 93 < float(row[3].rstrip("%")) < 97
        assert 0.2 < float(row[4].rstrip("°")) < 5
    assert len(read_records(tmp_path / "records.jsonl")) == 8
    told = run(*words)
    assert told.out == ""
    assert "true normals inside the 95 % region, 8192 pixels a row" in told.text
    assert "not told" in told.text


def test_quick_measures_a_little_of_everything_and_draws_it(run, tmp_path):
    words = ("bench", "--suite", "quick", "--size", "24x24", "--repeats", "1", "--threads", "1")
    done = run(*words, "--plots", tmp_path / "plots", "--json")
    assert done.code == 0
    rows = {(row["problem"], row["method"]): row for row in done.record["rows"]}
    assert {problem for problem, _ in rows} == {"matte", "noise", "highlights", "cliff", "one image", "folder"}
    assert rows["matte", "least-squares"]["error"]["mean_deg"] < 0.01
    assert rows["highlights", "robust"]["error"]["mean_deg"] < rows["highlights", "least-squares"]["error"]["mean_deg"]
    assert rows["cliff", "discontinuity"]["error"]["rmse"] < rows["cliff", "poisson"]["error"]["rmse"]
    assert rows["one image", "variational"]["error"]["mean_deg"] < 5
    assert rows["folder", "reading, least-squares"]["error"]["mean_deg"] < 2
    assert done.record["baseline"] is None
    files = ["bench.json", "report.html", "error_time.svg", "error_time.png"]
    assert done.record["files"] == files
    assert sorted(path.name for path in (tmp_path / "plots").iterdir()) == sorted(files)
    told = read_bench(tmp_path / "plots" / "bench.json")
    assert told["rows"] == done.record["rows"]


def test_plots_go_into_no_folder_of_the_user(run, tmp_path, monkeypatch):
    import psstereo.bench

    monkeypatch.setattr(psstereo.bench, "run_solvers", lambda *_a, **_k: pytest.fail("something was measured"))
    (tmp_path / "mine.txt").write_text("keep me", encoding="utf-8")
    refused = run("bench", "accuracy", "--plots", tmp_path, "--overwrite")
    assert refused.code == 3
    assert "no benchmark has written" in refused.text
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_normals_has_series_and_tells_who_declined(run, monkeypatch, tmp_path):
    import psstereo.normals
    from psstereo_cli.suites import normals as suite

    solvers = psstereo.normals.NORMAL_SOLVERS
    few = {name: solvers[name] for name in ("least-squares", "robust", "bivariate")}
    monkeypatch.setattr(psstereo.normals, "NORMAL_SOLVERS", few)
    for name, values in (
        ("LIGHTS", (8, 20)),
        ("NOISES", (0.01, 0.1)),
        ("CONES", (60.0, 10.0)),
        ("SIDES", (1, 2)),
        ("SCENES", ()),
    ):
        monkeypatch.setattr(suite, name, values)
    words = ("bench", "normals", "--size", "16x16", "--lights", "20", "--repeats", "1", "--threads", "1")
    done = run(*words, "-o", tmp_path / "records.jsonl")
    assert done.code == 0
    assert done.out == ""
    assert "There are 8 lights. The solver bivariate needs 20 or more." in done.text
    assert "mean angular error in ° by cone half-angle in °" in done.text
    assert "time in ms by pixels in px" in done.text
    records = read_records(tmp_path / "records.jsonl")
    declined = {(r.problem, r.method) for r in records if r.declined}
    assert declined == {("noise, 8 lights", "bivariate"), ("highlights, 8 lights", "bivariate")}
    errors = {(r.problem, r.method): r.error.get("mean_deg") for r in records}
    assert errors["noise of 10 %", "least-squares"] > 5 * errors["noise of 1 %", "least-squares"]
    assert errors["lights to 10°", "least-squares"] > 2 * errors["lights to 60°", "least-squares"]


def test_scaling_fits_slopes(run, monkeypatch):
    from psstereo_cli.suites import scaling as suite

    for name, values in (("SHARES", (4, 1)), ("LIGHTS", (12, 24)), ("STEPS", (2, 8))):
        monkeypatch.setattr(suite, name, values)
    record = run("bench", "scaling", "--size", "64x64", "--repeats", "1", "--json").record
    assert {(s["title"], s["axis"], s["measure"]) for s in record["sweeps"]} == {
        ("normals", "pixels", "seconds"),
        ("depth", "pixels", "seconds"),
        ("one image", "pixels", "seconds"),
        ("normals", "lights", "seconds"),
        ("fixed numbers", "iterations", "seconds"),
    }
    assert len(record["slopes"]) == 3 + 2 + 2 + 3 + 2
    assert all(math.isfinite(found["slope"]) and found["error"] is None for found in record["slopes"])
    problems = {problem for sweep in record["sweeps"] for problem in sweep["values"]}
    assert {row["problem"] for row in record["rows"]} == problems


def test_photographs_are_solved_by_all_that_apply(run, folder):
    done = run("bench", "photographs", "--folder", folder, "--repeats", "1", "--json")
    assert done.code == 0
    rows = {row["method"]: row for row in done.record["rows"]}
    assert {row["problem"] for row in rows.values()} == {"capture"}
    assert rows["least-squares"]["error"]["mean_deg"] < 5
    lights = rows["least-squares"]["sizes"]["lights"]
    demanding = {name for name, kind in NORMAL_SOLVERS.items() if kind.least_lights > lights}
    assert {name for name, row in rows.items() if row["declined"]} == demanding
    assert {"response-bend", "bi-polynomial", "bivariate"} <= demanding
    assert rows["bivariate"]["seconds"] is None
    (folder / "Normal_gt.mat").unlink(missing_ok=True)
    for truth in folder.glob("*ormal_gt*"):
        truth.unlink()
    done = run("bench", "photographs", "--folder", folder)
    assert done.code == 3
    assert "no capture with true normals (1 without)" in done.text


def test_a_bar_that_begins_anew_forgets_how_fast_it_was(monkeypatch):
    from psstereo_cli import console

    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    monkeypatch.setattr(console, "_PATIENCE", 0.0)
    with console.progress_bars() as progress:
        for done in (1, 2, 3, 1):
            progress("suite", done, 4)
        (task,) = progress._drawn.tasks
        assert (task.completed, task.total) == (1, 4)
        assert len(task._progress) == 1  # one sample of speed, that of the new round


def test_parts_of_a_suite_are_one_bar_that_only_rises():
    from psstereo_cli.suites.parts import parts_of

    seen = []
    for part, rounds in zip(
        parts_of(lambda *told: seen.append(told), "depth", [3.0, 0.5, 0.5]), (4, 1, 0), strict=True
    ):
        for done in range(1, rounds + 1):
            part("anything", done, rounds)
    stages, done, totals = zip(*seen, strict=True)
    assert set(stages) == {"suite depth"}
    assert set(totals) == {1000}
    assert done == (188, 375, 562, 750, 875)
