"""Suite scaling: how time grows with pixels, lights and iterations, as slopes on logarithmic axes."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from psstereo_cli.suites.parts import parts_of
from psstereo_cli.suites.size import dimensions

if TYPE_CHECKING:
    from psstereo.bench import Record
    from psstereo.normals import NormalSolver
    from psstereo.types import Map, Progress

__all__ = ["LIGHTS", "SHARES", "STEPS", "scaling"]

SHARES = (16, 4, 1)
"""By how much fewer pixels than the largest images the others have."""
LIGHTS = (24, 48, 96, 192)
STEPS = (8, 32, 128)
"""Numbers of iterations for methods that do as many as they are told."""
_SIZE = "512x512"
_FIXED_LIGHTS = 24
_SOLVERS = ("least-squares", "robust", "response-bend")
_LEAST = 8

_Work = Mapping[str, Callable[[], object]]
_Series = tuple[str, str, str, dict[float, Callable[[], _Work]]]
"""Title, axis, unit, and a maker of the pieces of work by what varies."""


def scaling(
    repeats: int, size: str | None, _lights: int, _threads: int, _over: "Map", progress: "Progress"
) -> tuple[list["Record"], None, dict[str, Any]]:
    """Time methods at growing sizes, all on one thread, since small images cannot feed several."""
    from psstereo.bench import run_timed
    from psstereo.bench.sweep import Sweep

    width, height = dimensions(size or _SIZE)
    records: list[Record] = []
    sweeps: list[Sweep] = []
    series = [*_by_pixels(width, height), _by_lights(width // 4, height // 4), _by_steps(width // 8, height // 8)]
    parts = parts_of(progress, "scaling", [1.0] * len(series))
    for (title, axis, unit, makers), part in zip(series, parts, strict=True):
        names = {value: f"{title}, {value:g} {axis}" for value in makers}
        jobs = {(value, method): work for value, make in makers.items() for method, work in make().items()}
        # All sizes take turns, so that a machine that slows down does not look like growth.
        turns = {f"{value:g} {method}": work for (value, method), work in jobs.items()}
        found = run_timed("scaling", title, turns, repeats=repeats, sizes={}, progress=part)
        places = {f"{value:g} {method}": (value, method) for value, method in jobs}
        for record in found:
            value, method = places[record.method]
            records.append(replace(record, problem=names[value], method=method, sizes={axis: value}))
        values = {name: value for value, name in names.items()}
        sweeps.append(Sweep(title=title, axis=axis, unit=unit, values=values, measure="seconds"))
    notes = [
        "All on one thread. Slope 1: time grows as the number does; fixed costs of small cases flatten it.",
        f"Images are in memory; {_FIXED_LIGHTS} lights where pixels or iterations vary.",
    ]
    return records, None, {"sweeps": sweeps, "notes": notes}


def _sides(width: int, height: int) -> list[tuple[int, int]]:
    """Return growing sizes, each with about four times the pixels of the one before."""
    found = [(max(int(width / math.sqrt(s)), _LEAST), max(int(height / math.sqrt(s)), _LEAST)) for s in SHARES]
    return list(dict.fromkeys(found))


def _by_pixels(width: int, height: int) -> list[_Series]:
    solving: dict[float, Callable[[], _Work]] = {}
    integrating: dict[float, Callable[[], _Work]] = {}
    shading: dict[float, Callable[[], _Work]] = {}
    for w, h in _sides(width, height):
        solving[float(w * h)] = partial(_solvers, w, h, _FIXED_LIGHTS)
        integrating[float(w * h)] = partial(_integrators, w, h)
        # A square, and smaller: one image takes longer than its share of a stack.
        side = max(min(w, h) // 2, _LEAST)
        shading[float(side * side)] = partial(_shading, side)
    return [
        ("normals", "pixels", "px", solving),
        ("depth", "pixels", "px", integrating),
        ("one image", "pixels", "px", shading),
    ]


def _by_lights(width: int, height: int) -> _Series:
    shape = max(width, _LEAST), max(height, _LEAST)
    return "normals", "lights", "", {float(count): partial(_solvers, *shape, count) for count in LIGHTS}


def _by_steps(width: int, height: int) -> _Series:
    shape = max(width, _LEAST), max(height, _LEAST)
    return "fixed numbers", "iterations", "", {float(count): partial(_stepping, *shape, count) for count in STEPS}


def _solvers(width: int, height: int, lights: int) -> _Work:
    from psstereo.normals import NORMAL_SOLVERS

    return _solving(width, height, lights, {name: NORMAL_SOLVERS[name]() for name in _SOLVERS})


def _solving(width: int, height: int, lights: int, methods: "Mapping[str, NormalSolver[Any]]") -> _Work:
    from psstereo.normals import estimate_normals
    from psstereo_synth.problems import solver_problems

    capture, _ = next(p for p in solver_problems(width, height, lights) if p.name == "noise").make()
    return {name: partial(estimate_normals, capture, method) for name, method in methods.items()}


def _integrators(width: int, height: int) -> _Work:
    from psstereo.camera import Orthographic
    from psstereo.depth import Discontinuity, Poisson
    from psstereo_synth.reliefs import relieved

    surface = relieved("smooth", width, height)
    methods = (Poisson(threads=1), Discontinuity(threads=1))
    return {m.name: partial(m.integrate, surface.normals, Orthographic(), mask=surface.mask) for m in methods}


def _shading(side: int) -> _Work:
    from psstereo.sfs import SHADING_METHODS
    from psstereo_synth.shading_problems import shaded

    image = shaded("four hills", side).image
    return {name: partial(SHADING_METHODS[name](threads=1).recover, image) for name in ("variational", "eikonal")}


def _stepping(width: int, height: int, count: int) -> _Work:
    """Return methods that stop at a number of rounds; the tolerance is out of reach."""
    from psstereo.normals.sparse_bayesian import SparseBayesian
    from psstereo.sfs.tsai_shah import TsaiShah
    from psstereo_synth.shading_problems import shaded

    image = replace(shaded("four hills", min(width, height)).image, heights=None)
    endless = {"sparse-bayesian": SparseBayesian(rounds=count, tolerance=1e-300)}
    return {
        **_solving(width, height, _FIXED_LIGHTS, endless),
        "tsai-shah": partial(TsaiShah(threads=1, iterations=count).recover, image),
    }
