"""Plots of measurements: error against time, error against what varies, and time against size.

Colours are mostly those of Okabe and Ito, which people with defective colour vision tell apart; markers differ as well.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from psstereo.bench.front import ERRORS, error_key, pareto_front
from psstereo.bench.run import Summary
from psstereo.bench.sweep import Sweep, fit_slope

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["draw"]

_COLOURS = (
    "#0072B2",
    "#D55E00",
    "#009E73",
    "#CC79A7",
    "#E69F00",
    "#56B4E9",
    "#000000",
    "#8C6D31",
    "#7F7F7F",
    "#882255",
    "#332288",
)
_MARKERS = "osD^vP*X<>hp"
_PANELS = 9
"""Panels on one page."""
_COLUMNS = 3
_PANEL = (4.1, 3.3)
"""Size of a panel [inch]."""
_NARROW = 60.0
"""Ratio of the ends of an axis below which more than its powers of ten are labelled."""
_SPAN = 7.0
"""Ratio of the ends of an axis at least."""

_LETTER = 0.025
"""Width of a digit of a label over that of a panel."""

_Look = Mapping[str, tuple[str, str]]
"""Colour and marker by method."""


def draw(suite: str, summaries: Sequence[Summary], sweeps: Sequence[Sweep] = ()) -> "dict[str, Figure]":
    """Draw all that the measurements of a suite allow.

    Do not compare times between plots of different machines: only ratios within one run mean something.

    Parameters
    ----------
    suite : str
        Name, for the titles.
    summaries : sequence of Summary
        What was measured.
    sweeps : sequence of Sweep
        Series among the problems; these are drawn against what varies, all others as error against time.

    Returns
    -------
    dict
        Figures by name of file, without ending: ``error_time`` (``error_time_2`` … where a page does not suffice), and
        one ``error_…`` or ``time_…`` a quantity that varies. Empty if nothing can be drawn.
    """
    look = _looks(summaries)
    figures: dict[str, Figure] = {}
    varied = {problem for sweep in sweeps for problem in sweep.values}
    panels = _panels([s for s in summaries if s.problem not in varied])
    for start in range(0, len(panels), _PANELS):
        name = "error_time" if start == 0 else f"error_time_{start // _PANELS + 1}"
        figures[name] = _error_time(suite, panels[start : start + _PANELS], look)
    groups: dict[tuple[str, str], list[Sweep]] = {}
    for sweep in sweeps:
        if sum(s.problem in sweep.values and s.declined is None for s in summaries) > 1:
            groups.setdefault((sweep.measure, sweep.axis), []).append(sweep)
    for (measure, axis), chosen in groups.items():
        name = f"{'time' if measure == 'seconds' else 'error'}_{'_'.join(axis.split())}"
        figures[name] = _swept(suite, chosen, summaries, look)
    return figures


def _looks(summaries: Sequence[Summary]) -> _Look:
    methods = list(dict.fromkeys(s.method for s in summaries))
    return {name: (_COLOURS[i % len(_COLOURS)], _MARKERS[i % len(_MARKERS)]) for i, name in enumerate(methods)}


def _panels(summaries: Sequence[Summary]) -> list[tuple[str, str, list[Summary]]]:
    """Return the problems that can be drawn, each with its error and what was measured."""
    by_problem: dict[str, list[Summary]] = {}
    for one in summaries:
        by_problem.setdefault(one.problem, []).append(one)
    found = []
    for problem, own in by_problem.items():
        key = error_key(own)
        # One method alone has nothing to be weighed against.
        if key is not None and sum(key in s.error for s in own) > 1:
            found.append((problem, key, own))
    return found


def _grid(count: int, *, taller: float = 0.0) -> "tuple[Figure, list[Axes]]":
    from matplotlib.figure import Figure

    columns = min(count, _COLUMNS) if count != 4 else 2
    rows = -(-count // columns)
    size = (max(_PANEL[0] * columns, 6.4), (_PANEL[1] + taller) * rows + 1.1)
    figure = Figure(figsize=size, layout="constrained")
    axes = [figure.add_subplot(rows, columns, i + 1) for i in range(count)]
    for one in axes:
        one.set_xscale("log")
        one.set_yscale("log")
        one.grid(True, which="major", color="0.88", linewidth=0.7)
        one.set_axisbelow(True)
        one.tick_params(labelsize=9)
        for side in ("top", "right"):
            one.spines[side].set_visible(False)
    return figure, axes


def _error_time(suite: str, panels: Sequence[tuple[str, str, list[Summary]]], look: _Look) -> "Figure":
    figure, axes = _grid(len(panels))
    exact = False
    for one, (problem, key, own) in zip(axes, panels, strict=True):
        shown = [s for s in own if s.declined is None and key in s.error]
        floor = _floor([s.error[key] for s in shown])
        front = pareto_front(own, key)
        exact = exact or any(s.error[key] == 0 for s in shown)
        _draw_front(one, [(s.seconds, max(s.error[key], floor)) for s in front])
        for s in shown:
            colour, marker = look[s.method]
            one.errorbar(
                s.seconds,
                max(s.error[key], floor),
                xerr=s.spread / 2 if s.spread < s.seconds else None,
                color=colour,
                marker=marker,
                markersize=8,
                markeredgewidth=1.6,
                markerfacecolor=colour if s in front else "none",
                elinewidth=1,
                zorder=3,
            )
        what, unit = ERRORS[key]
        one.set_title(problem, fontsize=10.5, loc="left")
        one.set_ylabel(f"{what} [{unit}]", fontsize=9)
        one.set_xlabel("time [s]", fontsize=9)
        _limits(one, [s.seconds for s in shown], [max(s.error[key], floor) for s in shown])
    told = {s.method for _, key, own in panels for s in own if s.declined is None and key in s.error}
    words = ["Filled: no other method is both faster and more exact (grey line)."]
    if any(s.spread for _, _, own in panels for s in own):
        words[0] += " Bars: quartiles of the time."
    if exact:
        words.append("Errors of exactly 0 lie on the lower edge.")
    figure.suptitle(f"{suite}: error against time", fontsize=12)
    _legend(figure, [name for name in look if name in told], look, words + _declines(panels))
    return figure


def _draw_front(axes: "Axes", points: Sequence[tuple[float, float]]) -> None:
    """Draw the border of what is beaten: steps from each method on the front to the next, open at both ends."""
    if not points:
        return
    x, y = zip(*points, strict=True)
    # Far beyond the limits, which are set afterwards and cut the ends off.
    steps = ([x[0], *x, x[-1] * 1e6], [y[0] * 1e6, *y, y[-1]])
    axes.step(*steps, where="post", color="0.6", linewidth=1.4, zorder=1)


def _declines(panels: Sequence[tuple[str, str, list[Summary]]]) -> list[str]:
    """Return who declined, by method, in lines that fit below the panels."""
    import textwrap

    by_method: dict[str, list[str]] = {}
    for problem, _, own in panels:
        for s in own:
            if s.declined is not None:
                by_method.setdefault(s.method, []).append(problem)
    if not by_method:
        return []
    everywhere = len({problem for problem, _, _ in panels})
    words = [
        name if len(problems) == everywhere else f"{name} ({', '.join(problems)})"
        for name, problems in by_method.items()
    ]
    return textwrap.wrap(f"Declined, with reasons in bench.json: {', '.join(words)}.", width=110)


def _swept(suite: str, sweeps: Sequence[Sweep], summaries: Sequence[Summary], look: _Look) -> "Figure":
    timed = sweeps[0].measure == "seconds"
    figure, axes = _grid(len(sweeps), taller=1.0 if timed else 0.0)
    told: set[str] = set()
    for one, sweep in zip(axes, sweeps, strict=True):
        own = [s for s in summaries if s.problem in sweep.values and s.declined is None]
        key = None if timed else error_key(own)
        told |= _draw_sweep(one, sweep, own, key, look)
        one.set_title(sweep.title, fontsize=10.5, loc="left")
        one.set_xlabel(sweep.axis + (f" [{sweep.unit}]" if sweep.unit else ""), fontsize=9)
        what, unit = ("time", "s") if key is None else ERRORS[key]
        one.set_ylabel(f"{what} [{unit}]", fontsize=9)
        if timed:
            one.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), fontsize=8, frameon=False)
    if not timed:
        _legend(figure, [name for name in look if name in told], look, [])
    what = "time" if timed else "error"
    figure.suptitle(f"{suite}: {what} against {sweeps[0].axis}", fontsize=12)
    return figure


def _draw_sweep(axes: "Axes", sweep: Sweep, own: Sequence[Summary], key: str | None, look: _Look) -> set[str]:
    """Draw one line a method, with the fitted power law where it is time that is looked at."""
    measured = [(s.method, sweep.values[s.problem], s.seconds if key is None else s.error.get(key)) for s in own]
    points = [(method, x, y) for method, x, y in measured if y is not None]
    floor = _floor([y for _, _, y in points])
    for method in dict.fromkeys(method for method, _, _ in points):
        line = sorted((x, max(y, floor)) for name, x, y in points if name == method)
        x, y = zip(*line, strict=True)
        colour, marker = look[method]
        style: dict[str, Any] = {"color": colour, "marker": marker, "markersize": 6, "linewidth": 1.3}
        if key is not None or len(set(x)) < 2:
            axes.plot(x, y, label=method, **style)
            continue
        found = fit_slope(x, y)
        axes.plot(x, y, label=f"{method}: slope {found}", **style | {"linestyle": "none"})
        axes.plot(x, [found.factor * value**found.slope for value in x], color=colour, linewidth=1.1, linestyle="--")
    _limits(axes, [x for _, x, _ in points], [max(y, floor) for _, _, y in points])
    _label_values(axes, sorted(set(sweep.values.values())))
    return {method for method, _, _ in points}


def _floor(errors: Sequence[float]) -> float:
    """Return where an error of 0 is drawn on a logarithmic axis."""
    positive = [e for e in errors if e > 0]
    return min(positive) / 3 if positive else 1e-16


def _limits(axes: "Axes", x: Sequence[float], y: Sequence[float]) -> None:
    """Give the data room, and label axes that span little more than a power of ten in between."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter

    for axis, values, setter in ((axes.xaxis, x, axes.set_xlim), (axes.yaxis, y, axes.set_ylim)):
        low, high = min(values), max(values)
        # Never so little that fewer than two numbers would be labelled.
        room = max((high / low) ** 0.08, 1.3, math.sqrt(_SPAN * low / high))
        low, high = low / room, high * room
        setter(low, high)
        axis.set_major_locator(FixedLocator(_ticks(low, high)))
        axis.set_major_formatter(FuncFormatter(_number))
        axis.set_minor_formatter(NullFormatter())


def _label_values(axes: "Axes", values: Sequence[float]) -> None:
    """Label the values themselves where they lie far enough apart."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    low, high = axes.get_xlim()
    gaps = [math.log(b / a) / math.log(high / low) for a, b in pairwise(values)]
    widest = max(len(f"{value:.6g}") for value in values)
    if len(values) > 1 and min(gaps) > _LETTER * (widest + 1):
        axes.xaxis.set_major_locator(FixedLocator(values))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _position: f"{value:.6g}"))
        axes.xaxis.set_minor_locator(NullLocator())


def _ticks(low: float, high: float) -> list[float]:
    """Return numbers to label, at most about six: powers of ten, every second one …, or 1, 2 and 5 times these."""
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    heads = (1, 2, 5) if high / low < _NARROW else (1,)
    step = max(1, -(-(last - first) // 6))
    powers = [power for power in range(first, last + 1) if power % step == 0]
    return [head * 10.0**power for power in powers for head in heads if low <= head * 10.0**power <= high]


def _number(value: float, _position: int = 0) -> str:
    """Write a number of an axis; powers of ten where digits would be many."""
    if value <= 0 or 1e-3 <= value < 1e5:
        return f"{value:g}"
    power = math.floor(math.log10(value) + 1e-9)
    head = round(value / 10.0**power)
    return f"$10^{{{power}}}$" if head == 1 else f"${head}·10^{{{power}}}$"


def _legend(figure: "Figure", methods: Sequence[str], look: _Look, words: Sequence[str]) -> None:
    """Put the methods below the panels, under what is to be said of them: one block, so that nothing overlaps."""
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=look[name][0], marker=look[name][1], linestyle="none", markersize=7, label=name)
        for name in methods
    ]
    widest = max((len(name) for name in methods), default=1)
    columns = max(1, min(len(handles), int(figure.get_figwidth() * 13 / (widest + 6))))
    figure.legend(
        handles=handles,
        loc="outside lower center",
        ncols=columns,
        fontsize=9,
        frameon=False,
        title="\n".join(words) or None,
        title_fontsize=8.5,
    )
