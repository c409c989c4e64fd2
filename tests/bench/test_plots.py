"""Plots: what is drawn is what was measured, nothing overlaps, and the folder is whole or not there."""

import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from psstereo.bench import Summary
from psstereo.bench.folder import (
    BENCH,
    PAGE,
    bench_content,
    fitted,
    implied_sweeps,
    read_bench,
    require_bench_place,
    write_bench,
)
from psstereo.bench.front import error_key, pareto_front
from psstereo.bench.plots import draw
from psstereo.bench.sweep import Sweep, fit_slope
from psstereo.errors import ExistingResultError, InputError


def summary(problem, method, seconds, *, declined=None, sizes=None, spread=0.0, **error):
    return Summary(
        problem=problem,
        method=method,
        seconds=math.nan if declined else seconds,
        ratio=math.nan if declined else 1.0,
        error=error,
        sizes=sizes or {},
        spread=spread,
        declined=declined,
    )


def swept(axis="lights", measure="error"):
    values = {f"hills, {n}": n for n in (4, 8, 16, 32)}
    found = [
        summary(problem, method, 1e-3 * k * n**k, mean_deg=k / n, sizes={"pixels": n})
        for problem, n in values.items()
        for k, method in ((1, "plain"), (2, "thorough"))
    ]
    return found, Sweep(title="hills", axis=axis, values=values, measure=measure)


# -- slopes ------------------------------------------------------------------------------------------------------------


@given(st.floats(-3, 3), st.floats(1e-6, 1e6))
def test_a_power_law_gives_its_power_back(power, factor):
    x = [1.0, 3.0, 10.0, 1000.0]
    found = fit_slope(x, [factor * v**power for v in x])
    assert found.slope == pytest.approx(power, abs=1e-12)
    assert found.factor == pytest.approx(factor, rel=1e-11)
    assert found.error < 1e-12


def test_the_standard_error_is_that_of_linear_regression():
    rng = np.random.default_rng(3)
    x = rng.uniform(1, 100, 12)
    y = 2 * x**1.5 * rng.lognormal(0, 0.2, 12)
    line, covariance = np.polyfit(np.log(x), np.log(y), 1, cov=True)
    slope, error = line[0], math.sqrt(covariance[0, 0])
    found = fit_slope(list(x), list(y))
    assert (found.slope, found.error) == pytest.approx((slope, error), rel=1e-9)
    assert str(found) == f"{slope:.2f} ± {error:.2f}"
    assert math.isnan(fit_slope([1, 2], [3, 4]).error)
    assert "±" not in str(fit_slope([1, 2], [3, 4]))


@pytest.mark.parametrize(
    ("x", "y"),
    [([1], [1]), ([2, 2], [1, 3]), ([1, 2], [1]), ([0, 1], [1, 1]), ([1, 2], [1, -1]), ([1, math.nan], [1, 1])],
)
def test_slopes_that_do_not_exist_are_refused(x, y):
    with pytest.raises(InputError, match="slope"):
        fit_slope(x, y)


@pytest.mark.parametrize(("measure", "value"), [("memory", 1.0), ("error", 0.0), ("error", math.inf)])
def test_a_series_needs_positive_numbers_and_a_known_measure(measure, value):
    with pytest.raises(InputError, match="sweep"):
        Sweep(title="t", axis="a", values={"p": value}, measure=measure)


def test_slopes_are_fitted_to_series_of_time_only():
    found, sweep = swept(measure="seconds")
    assert [(f["method"], round(f["slope"], 9)) for f in fitted(found, [sweep])] == [("plain", 1.0), ("thorough", 2.0)]
    assert fitted(*[swept()[0], [swept()[1]]]) == []


def test_growth_is_seen_where_one_method_alone_was_measured():
    disc = [summary(f"disc {n}", "poisson", n / 1e6, sizes={"pixels": n}) for n in (100, 400, 1600)]
    pair = [summary("pair", m, 1.0, sizes={"pixels": 5}) for m in "ab"]
    (sweep,) = implied_sweeps(disc + pair)
    assert (sweep.axis, sweep.measure, sweep.values) == (
        "pixels",
        "seconds",
        {"disc 100": 100, "disc 400": 400, "disc 1600": 1600},
    )
    assert implied_sweeps(disc[:2] + pair) == []


# -- the front ---------------------------------------------------------------------------------------------------------


@settings(max_examples=60)
@given(st.lists(st.tuples(st.integers(1, 6), st.integers(0, 6)), min_size=1, max_size=12))
def test_nothing_beats_the_front_and_the_front_beats_the_rest(points):
    found = [summary("p", str(i), float(t), mean_deg=float(e)) for i, (t, e) in enumerate(points)]
    found += [summary("p", "no", 0, declined="too few"), summary("p", "untold", 1e-9)]
    front = pareto_front(found, "mean_deg")
    pairs = {(s.seconds, s.error["mean_deg"]) for s in front}
    best = {(t, e) for t, e in points if not any((a <= t and b <= e and (a, b) != (t, e)) for a, b in points)}
    assert pairs == best
    assert [s.seconds for s in front] == sorted(s.seconds for s in front)


def test_the_error_is_one_that_methods_share():
    assert error_key([summary("p", "a", 1, rmse=1.0, mean_deg=1.0), summary("p", "b", 1, rmse=2.0)]) == "rmse"
    assert error_key([summary("p", "a", 1, mean_deg=1.0), summary("p", "b", 1)]) == "mean_deg"
    assert error_key([summary("p", "a", 1, colour=1.0)]) is None


# -- figures -----------------------------------------------------------------------------------------------------------


def many():
    methods = [f"a method of the name {i}" for i in range(11)]
    found = [
        summary(f"scene {p}", m, 10 ** ((i % 5) - 3), mean_deg=10 ** (-i / 4 + p), spread=10 ** ((i % 5) - 4))
        for p in range(4)
        for i, m in enumerate(methods)
    ]
    return [*found, summary("scene 0", "shy", 0, declined="There are 3 lights."), summary("alone", "one", 1, rmse=1.0)]


def markers(axes):
    """Return the points of a panel: time, error, and whether they are filled."""
    lines = [line for line in axes.get_lines() if line.get_marker() not in {"None", None, ""}]
    return {(line.get_xdata()[0], line.get_ydata()[0], line.get_markerfacecolor() != "none") for line in lines}


def test_every_method_is_drawn_and_the_front_is_filled():
    found = many()
    figures = draw("normals", found)
    assert list(figures) == ["error_time"]
    panels = figures["error_time"].axes
    assert [axes.get_title(loc="left") for axes in panels] == [f"scene {p}" for p in range(4)]
    for axes in panels:
        own = [s for s in found if s.problem == axes.get_title(loc="left") and not s.declined]
        front = pareto_front(own, "mean_deg")
        assert 1 <= len(front) < len(own)
        assert markers(axes) == {(s.seconds, s.error["mean_deg"], s in front) for s in own}
        assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
        assert (axes.get_xlabel(), axes.get_ylabel()) == ("time [s]", "mean angular error [°]")
    (legend,) = figures["error_time"].legends
    assert "shy (scene 0)" in legend.get_title().get_text()
    assert [text.get_text() for text in legend.get_texts()] == [f"a method of the name {i}" for i in range(11)]


def test_nothing_overlaps():
    series, sweep = swept(measure="seconds")
    error, other = swept("noise")
    figures = draw("all", [*many(), *series], [sweep]) | draw("all", error, [other])
    assert set(figures) == {"error_time", "time_lights", "error_noise"}
    for figure in figures.values():
        figure.draw_without_rendering()
        page = figure.bbox
        boxes = [axes.get_tightbbox() for axes in figure.axes]
        boxes += [legend.get_window_extent() for legend in figure.legends]
        boxes.append(figure._suptitle.get_window_extent())
        for i, box in enumerate(boxes):
            assert page.x0 <= box.x0 <= box.x1 <= page.x1
            assert page.y0 <= box.y0 <= box.y1 <= page.y1
            assert not any(box.padded(-1).overlaps(later) for later in boxes[i + 1 :])
        for axes in figure.axes:
            for axis in (axes.xaxis, axes.yaxis):
                labels = [label.get_window_extent() for label in axis.get_ticklabels() if label.get_text()]
                assert len(labels) >= 2
                assert not any(a.overlaps(b) for i, a in enumerate(labels) for b in labels[i + 1 :])


def test_series_are_lines_and_leave_the_panels():
    found, sweep = swept()
    figures = draw("normals", [*found, *many()], [sweep])
    assert list(figures) == ["error_time", "error_lights"]
    assert all(not axes.get_title(loc="left").startswith("hills") for axes in figures["error_time"].axes)
    (axes,) = figures["error_lights"].axes
    assert [list(line.get_xdata()) for line in axes.get_lines()] == [[4, 8, 16, 32]] * 2
    assert list(axes.get_lines()[1].get_ydata()) == [0.5, 0.25, 0.125, 0.0625]


def test_growth_tells_its_slope():
    found, sweep = swept(measure="seconds")
    (axes,) = draw("scaling", found, [sweep])["time_lights"].axes
    assert [text.get_text() for text in axes.get_legend().get_texts()] == [
        "plain: slope 1.00 ± 0.000",
        "thorough: slope 2.00 ± 0.000",
    ]


def test_many_problems_take_pages_and_an_error_of_zero_has_a_place():
    found = [summary(f"p{i}", m, t, mean_deg=e) for i in range(11) for m, t, e in (("a", 1.0, 0.3), ("b", 2.0, 0.0))]
    figures = draw("s", found)
    assert [len(figure.axes) for figure in figures.values()] == [9, 2]
    assert list(figures) == ["error_time", "error_time_2"]
    assert markers(figures["error_time"].axes[0]) == {(1.0, 0.3, True), (2.0, 0.3 / 3, True)}
    assert "exactly 0" in figures["error_time"].legends[0].get_title().get_text()
    assert draw("s", [summary("p", "a", 1.0)]) == {}


# -- the folder --------------------------------------------------------------------------------------------------------


def content(found, sweeps=()):
    return bench_content("normals", found, baseline="plain", threads=2, repeats=3, sweeps=sweeps, facts={"notes": []})


def test_the_folder_holds_what_was_measured_and_is_the_same_each_time(tmp_path):
    found, sweep = swept()
    found.append(summary("hills, 4", "shy", 0, declined="There are 4 lights."))
    names, measured = {}, content(found, [sweep])  # once, since the process's memory is among it
    for place in ("a", "b"):
        names[place] = write_bench(tmp_path / place, measured, draw("normals", found, [sweep]))
    files = [BENCH, PAGE, "error_lights.svg", "error_lights.png"]
    assert names["a"] == files
    assert sorted(p.name for p in (tmp_path / "a").iterdir()) == sorted(files)
    for name in files[1:]:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    assert (tmp_path / "a" / files[2]).read_text(encoding="utf-8").startswith("<?xml")
    assert (tmp_path / "a" / files[3]).read_bytes()[:4] == b"\x89PNG"
    told = read_bench(tmp_path / "a" / BENCH)
    assert told["rows"][-1]["declined"] == "There are 4 lights."
    assert told["rows"][-1]["seconds"] is None
    assert told["rows"][0]["error"] == {"mean_deg": 0.25}
    assert told["sweeps"][0]["values"] == dict(sweep.values)
    assert {"python", "psstereo", "numpy"} <= set(told["versions"])
    assert set(told) == {
        "schema", "suite", "baseline", "threads", "repeats", "rows", "sweeps", "slopes", "facts", "versions",
        "machine", "memory", "files",
    }  # fmt: skip


def test_only_an_earlier_run_is_replaced_and_only_when_asked(tmp_path):
    place = tmp_path / "plots"
    write_bench(place, content(swept()[0]), {})
    before = (place / BENCH).read_bytes()
    with pytest.raises(ExistingResultError, match="earlier run"):
        require_bench_place(place, overwrite=False)
    found, sweep = swept()
    write_bench(place, content(found, [sweep]), draw("normals", found, [sweep]), overwrite=True)
    assert len(list(place.iterdir())) == 4
    assert (place / BENCH).read_bytes() != before
    (place / "mine.txt").write_text("keep me", encoding="utf-8")
    with pytest.raises(ExistingResultError, match="no benchmark has written"):
        write_bench(place, content(found), {}, overwrite=True)
    assert (place / "mine.txt").read_text(encoding="utf-8") == "keep me"
    with pytest.raises(ExistingResultError, match="is a file"):
        require_bench_place(place / "mine.txt", overwrite=True)
    (tmp_path / "empty").mkdir()
    assert require_bench_place(tmp_path / "empty", overwrite=False) == frozenset()


def test_a_figure_that_cannot_be_written_leaves_nothing(tmp_path):
    class Broken:
        def savefig(self, *_words, **_options):
            raise OSError("no space left")

    with pytest.raises(OSError, match="no space"):
        write_bench(tmp_path / "plots", content(swept()[0]), {"error_time": Broken()})
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"schema": 0}, "another one"),
        ({"rows": {}}, "rows"),
        ({"machine": None}, "machine"),
        ({"rows": [{"problem": "p"}]}, "other fields"),
        ({"files": ["../elsewhere"]}, "not in its folder"),
    ],
)
def test_what_is_no_bench_is_refused(tmp_path, change, why):
    path = tmp_path / BENCH
    whole = content(swept()[0]) | {"files": [BENCH]}
    path.write_text(json.dumps(whole), encoding="utf-8")
    assert read_bench(path)["files"] == [BENCH]
    path.write_text(json.dumps(whole | change), encoding="utf-8")
    with pytest.raises(InputError, match=why):
        read_bench(path)
    path.write_text("rubbish", encoding="utf-8")
    with pytest.raises(InputError, match="Expecting value"):
        read_bench(path)
