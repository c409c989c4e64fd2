"""Lights that hardly span space: conditions up to 1e12, narrow cones, lights that repeat, oppose or outshine others."""

from functools import partial

import numpy as np

from psstereo.bench.stress import Answer, Rule, StressCase
from psstereo.errors import RigError
from psstereo.flags import Flag
from psstereo.normals import NORMAL_SOLVERS
from psstereo.types import FloatArray
from psstereo_synth.rigs import ring, spiral
from psstereo_synth.stress.pixels import angles, cap, exact_bound, solved, spread

__all__ = ["light_cases"]

_KNOWN = 0.5
"""Bound from which on nothing can be known of a normal: the answer has to say so itself [rad]."""
_COUNT = 48
"""Lights, as many as every method takes."""
_PIXELS = 100
_FLAT = 1e9
"""Condition from which on lights count as lying in a plane; what is less than a factor of 2 from it is left alone."""


def light_cases() -> list[StressCase]:
    """Return the cases of this family."""
    return [*_conditions(), *_cones(), *_repeated(), *_strong()]


def _conditions() -> list[StressCase]:
    cases = []
    for decade in range(13):
        wanted = 10.0**decade
        names = tuple(NORMAL_SOLVERS) if decade in {1, 3, 6} else ("least-squares", "robust")
        for name in names:
            cases.append(
                StressCase(
                    family="lights",
                    name=f"condition, {name}",
                    parameter=f"{wanted:.0e}",
                    run=partial(_conditioned, name, wanted),
                    rule=Rule.REFUSED if wanted > 2 * _FLAT else Rule.TOLD,
                    unit="rad",
                    refusals=(RigError,) if _refusable(name, wanted) else (),
                )
            )
    return cases


def _refusable(name: str, wanted: float) -> bool:
    """Whether a refusal is right: beyond the condition of a plane, or where a further unknown makes it one."""
    return 2 * wanted > _FLAT or (NORMAL_SOLVERS[name].unknowns > 3 and wanted > 1e2)


def _conditioned(name: str, wanted: float, kind: str) -> Answer:
    method = NORMAL_SOLVERS[name]
    directions = flattened(wanted, _COUNT)
    rows = np.column_stack([directions, np.ones(_COUNT)]) if method.unknowns > 3 else directions
    return _matte(name, directions, exact_bound(rows, kind, iterates=name != "least-squares"), kind)


def flattened(wanted: float, count: int) -> FloatArray:
    """Return lights within 60° of the view, pressed into a plane until their matrix has a condition.

    Parameters
    ----------
    wanted : float
        Condition; the smallest is about 2 [1].
    count : int
        Number of lights.

    Returns
    -------
    float64 array (m, 3)
        Unit directions [1].
    """
    full = spiral(count)
    low, high = 0.0, 16.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if np.linalg.cond(_pressed(full, middle)) < wanted else (low, middle)
    return _pressed(full, low)


def _pressed(full: FloatArray, decades: float) -> FloatArray:
    pressed = full * [1.0, 10.0**-decades, 1.0]
    return np.asarray(pressed / np.linalg.norm(pressed, axis=1, keepdims=True))


def _matte(name: str, directions: FloatArray, bound: float, kind: str) -> Answer:
    """Solve matte pixels that all lights reach; where nothing can be known the answer's own error bar has to tell."""
    normals = cap(_PIXELS, np.radians(25.0))
    values = (0.7 * directions @ normals.T).astype(kind)
    found = solved(values, directions, NORMAL_SOLVERS[name]())
    if bound < _KNOWN:
        return spread(found, 0.7 * normals, bound)
    return Answer(error=angles(found, normals), bound=_KNOWN, flags=found.flags[0], bar=found.uncertainty[0])


def _cones() -> list[StressCase]:
    return [
        StressCase(
            family="lights",
            name=f"cone, {name}",
            parameter=f"half-angle {half}°",
            run=partial(_cone, name, half),
            rule=Rule.TOLD,
            unit="rad",
            refusals=(RigError,) if NORMAL_SOLVERS[name].unknowns > 3 and half < 10.0 else (),
        )
        for half in (60.0, 20.0, 5.0, 1.0, 0.2, 0.05)
        for name in (NORMAL_SOLVERS if half in {20.0, 1.0} else ("least-squares", "robust"))
    ]


def _cone(name: str, half: float, kind: str) -> Answer:
    directions = spiral(_COUNT, max_tilt=float(np.radians(half)))
    method = NORMAL_SOLVERS[name]
    rows = np.column_stack([directions, np.ones(_COUNT)]) if method.unknowns > 3 else directions
    return _matte(name, directions, exact_bound(rows, kind, iterates=name != "least-squares"), kind)


def _repeated() -> list[StressCase]:
    refused = partial(StressCase, family="lights", rule=Rule.REFUSED, refusals=(RigError,), kinds=("float64",))
    rigs = {
        "one direction": np.tile([[0.3, 0.2, 0.9]], (12, 1)),
        "two directions": np.tile([[0.3, 0.2, 0.9], [-0.3, 0.1, 0.9]], (6, 1)),
        "on a line over the object": np.array([[t, 0.4, 1.0] for t in np.linspace(-1, 1, 12)]),
        "opposite pairs": np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, 1.0, 0], [0, -1.0, 0]]),
        "one pair of opposites and one more": np.array([[1.0, 0, 0.1], [-1.0, 0, -0.1], [0, 0, 1.0]]),
    }
    cases = [
        refused(name="in a plane", parameter=name, run=partial(_refused, directions))
        for name, directions in rigs.items()
    ]
    base = ring(4)
    twice = {
        "each three times": np.repeat(base, 3, axis=0),
        "one forty times": np.concatenate([base, np.repeat(base[:1], 40, axis=0)]),
        "one twice, 1e-9 apart": np.concatenate([base, base[:1] + np.array([0.0, 1e-9, 0.0])]),
        "nearly opposite, 0.01° apart": np.array([[1, 0, 1e-4], [-1, 0, 1e-4], [0, 1, 1e-4], [0, -1, 1e-4], [0, 0, 1]]),
    }
    for name, directions in twice.items():
        cases.append(
            StressCase(
                family="lights",
                name="repeated",
                parameter=name,
                run=partial(_plain, directions / np.linalg.norm(directions, axis=1, keepdims=True)),
                rule=Rule.TOLD,
                remarks=Flag.NO_REDUNDANCY,
            )
        )
    return cases


def _refused(directions: FloatArray, kind: str) -> Answer:
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    normals = cap(_PIXELS, np.radians(25.0))
    found = solved(np.maximum(unit @ normals.T, 0.0).astype(kind), unit)
    return spread(found, normals, 1.0)


def _plain(directions: FloatArray, kind: str) -> Answer:
    """Solve pixels under a few lights; each pixel's bound has the condition of the lights that reach it."""
    normals = cap(_PIXELS, np.radians(25.0), seed=1)
    shade = directions @ normals.T
    found = solved(np.maximum(0.7 * shade, 0.0).astype(kind), directions)
    bound = np.array([_reached(directions[one > 0], kind) for one in shade.T])
    return spread(found, 0.7 * normals, bound)


def _reached(directions: FloatArray, kind: str) -> float:
    """Return the bound of a pixel that these lights reach; none if they do not tell its normal."""
    return exact_bound(directions, kind) if np.linalg.matrix_rank(directions) == 3 else 0.0


def _strong() -> list[StressCase]:
    return [
        StressCase(
            family="lights",
            name=f"one light stronger, {name}",
            parameter=f"{factor:.0e} times",
            run=partial(_outshone, name, factor),
            rule=Rule.TOLD,
        )
        for factor in (1e3, 1e6)
        for name in NORMAL_SOLVERS
    ]


def _outshone(name: str, factor: float, kind: str) -> Answer:
    directions = spiral(_COUNT)
    normals = cap(_PIXELS, np.radians(25.0))
    strengths = np.ones(_COUNT)
    strengths[5] = factor
    values = (0.7 * strengths[:, None] * (directions @ normals.T)).astype(kind)
    method = NORMAL_SOLVERS[name]
    found = solved(values, directions, method(), strengths=strengths)
    rows = np.column_stack([directions, np.ones(_COUNT)]) if method.unknowns > 3 else directions
    return spread(found, 0.7 * normals, exact_bound(rows, kind, iterates=name != "least-squares"))
