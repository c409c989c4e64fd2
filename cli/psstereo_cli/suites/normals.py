"""Suite normals: error against time of every solver, and its error over noise, lights and the cone they fill."""

import math
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from psstereo_cli.suites.parts import parts_of
from psstereo_cli.suites.size import dimensions

if TYPE_CHECKING:
    from psstereo.bench import Problem, Record
    from psstereo.capture import Capture, Truth
    from psstereo.types import Map, Progress

__all__ = ["CONES", "LIGHTS", "NOISES", "SCENES", "gallery_problem", "normals"]

SCENES = ("glossy", "metallic")
"""Scenes of the gallery, beside the matte ones that are made here and the one with highlights; also under few lights.
"""
NOISES = (0.001, 0.003, 0.01, 0.03, 0.1)
"""Standard deviation of the noise over the brightness of a white pixel that faces its light."""
LIGHTS = (4, 8, 16, 32, 64, 96)
SIDES = (1, 2, 4)
"""Sides of the images over which time is looked at, as multiples of those of the series."""
CONES = (60.0, 30.0, 10.0, 5.0, 2.0, 1.0)
"""Largest angle between a light and the view [deg]."""
_SIZE, _SWEEP_SIZE = "128x96", "64x48"
_SWEEP_LIGHTS = 24
_SWEEP_NOISE = 0.003
_ROUNDS = 3
"""Rounds at most over sizes of images."""
_LARGE = 8.0
"""About how much longer a problem takes than one of a series."""

_Case = tuple[str, str, str, str, dict[float, "Problem"]]
"""Title, axis, unit, what is looked at, and problems by what varies."""


def normals(
    repeats: int, size: str | None, lights: int, _threads: int, over: "Map", progress: "Progress"
) -> tuple[list["Record"], str, dict[str, Any]]:
    """Run every solver where solvers differ, in rounds; then once along each quantity that matters."""
    from psstereo.bench import run_solvers
    from psstereo.bench.sweep import Sweep
    from psstereo.normals import NORMAL_SOLVERS
    from psstereo_synth.problems import solver_problems

    width, height = dimensions(size or _SIZE)
    methods = {name: kind() for name, kind in NORMAL_SOLVERS.items()}
    problems = solver_problems(width, height, lights)
    problems += [gallery_problem(name, (height, width), lights) for name in SCENES]
    cases = _cases(dimensions(size or _SWEEP_SIZE))
    # Errors are the same in every round; times are not.
    rounds = {"error": 1, "seconds": min(repeats, _ROUNDS)}
    series = {
        kind: [problem for *_, what, case in cases if what == kind for problem in case.values()] for kind in rounds
    }
    weights = [_LARGE * (repeats + 1) * len(problems), *(rounds[kind] * len(found) for kind, found in series.items())]
    parts = parts_of(progress, "normals", weights)
    records = run_solvers("normals", problems, methods, repeats=repeats, over=over, progress=next(parts))
    sweeps: list[Sweep] = []
    for kind, found in series.items():
        records += run_solvers(
            "normals", found, methods, repeats=rounds[kind], warm_up=False, over=over, progress=next(parts)
        )
    for title, axis, unit, measure, case in cases:
        values = {problem.name: value for value, problem in case.items()}
        sweeps.append(Sweep(title=title, axis=axis, unit=unit, values=values, measure=measure))
    notes = [
        f"{width} × {height} pixels, {lights} lights; the series of errors have one round each, so their times count"
        " for little.",
        "Times include fetching the samples, which costs every solver the same.",
    ]
    return records, "least-squares", {"sweeps": sweeps, "notes": notes}


def _cases(shape: tuple[int, int]) -> list[_Case]:
    matte = partial(_hills, shape)
    shiny: dict[float, Problem] = {count: _highlights(shape, count) for count in LIGHTS}
    by_count: dict[float, Problem] = {count: matte(lights=count, name=f"noise, {count} lights") for count in LIGHTS}
    by_noise: dict[float, Problem] = {
        100 * noise: matte(noise=noise, name=f"noise of {100 * noise:g} %") for noise in NOISES
    }
    by_cone: dict[float, Problem] = {cone: matte(cone=cone, name=f"lights to {cone:g}°") for cone in CONES}
    by_size: dict[float, Problem] = {
        side * side * shape[0] * shape[1]: _hills(
            (side * shape[0], side * shape[1]), name=f"noise, {side * shape[0]} × {side * shape[1]}"
        )
        for side in SIDES
    }
    noise = f"noise of {100 * _SWEEP_NOISE:g} %"
    scenes = [(f"{name}, a scene of the gallery", "lights", "", "error", _scene(name, shape)) for name in SCENES]
    return [
        (f"matte, {_SWEEP_LIGHTS} lights to 60°", "noise", "%", "error", by_noise),
        (f"matte, {noise}", "lights", "", "error", by_count),
        ("highlights, no noise", "lights", "", "error", shiny),
        *scenes,
        (f"matte, {_SWEEP_LIGHTS} lights, {noise}", "cone half-angle", "°", "error", by_cone),
        (f"matte, {_SWEEP_LIGHTS} lights, {noise}", "pixels", "px", "seconds", by_size),
    ]


def _hills(
    shape: tuple[int, int],
    *,
    name: str,
    noise: float = _SWEEP_NOISE,
    lights: int = _SWEEP_LIGHTS,
    cone: float = 60.0,
) -> "Problem":
    from psstereo.bench import Problem

    def make() -> "tuple[Capture, Truth]":
        from psstereo_synth.albedo import checker
        from psstereo_synth.capture import lambertian_capture
        from psstereo_synth.hills import hills
        from psstereo_synth.rigs import spiral

        width, height = shape
        surface, directions = hills(width, height, steepness=1.0), spiral(lights, max_tilt=math.radians(cone))
        return lambertian_capture(surface, checker((height, width)), directions, noise=noise)

    return Problem(name=name, summary="matte hills, 16 bit", make=make)


def _scene(name: str, shape: tuple[int, int]) -> "dict[float, Problem]":
    width, height = shape
    found = {count: gallery_problem(name, (height, width), count) for count in LIGHTS}
    return {count: replace(problem, name=f"{name}, {count} lights") for count, problem in found.items()}


def _highlights(shape: tuple[int, int], count: int) -> "Problem":
    from psstereo.bench import Problem
    from psstereo_synth.problems import solver_problems

    found = next(problem for problem in solver_problems(*shape, count) if problem.name == "highlights")
    return Problem(name=f"highlights, {count} lights", summary=found.summary, make=found.make)


def gallery_problem(name: str, shape: tuple[int, int], lights: int) -> "Problem":
    """Return a scene of the gallery as a problem.

    Parameters
    ----------
    name : str
        The scene.
    shape : (int, int)
        Rows and columns.
    lights : int
        How many.
    """
    from psstereo.bench import Problem

    def make() -> "tuple[Capture, Truth]":
        from psstereo_synth.gallery import gallery_scene
        from psstereo_synth.rendering import render
        from psstereo_synth.scenes.file import Changes

        view = render(gallery_scene(name, Changes(size=shape, lights=lights)))[0]
        return view.capture, view.truth

    return Problem(name=name, summary="a scene of the gallery", make=make)
