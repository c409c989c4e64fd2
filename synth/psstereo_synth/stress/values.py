"""Pixel values that are hard: tiny, huge, coarse, clipped, in shadow, of very different albedo, or grazing."""

from functools import partial

import numpy as np

from psstereo.bench.stress import DOUBLE, Answer, Rule, StressCase
from psstereo.errors import InputError
from psstereo.flags import Flag
from psstereo.normals import NORMAL_SOLVERS
from psstereo.types import BoolArray, FloatArray
from psstereo_synth.rigs import spiral
from psstereo_synth.stress.pixels import angles, cap, exact_bound, relative, solved, spread

__all__ = ["value_cases"]

_COUNT = 48
_PIXELS = 120
_KNOWN = 0.5
"""Bound from which on the answer's own error bar has to tell [rad]."""
_FEW = 12
"""Lights of the cases in shadow."""


def value_cases() -> list[StressCase]:
    """Return the cases of this family."""
    return [*_scales(), *_albedos(), *_rounded(), *_saturated(), *_shadowed(), *_grazing()]


def _design(name: str, directions: FloatArray) -> FloatArray:
    """Return the light matrix, with a column of ones where a constant is unknown too."""
    more = NORMAL_SOLVERS[name].unknowns > 3
    return np.column_stack([directions, np.ones(len(directions))]) if more else directions


def _bound(name: str, directions: FloatArray, kind: str) -> float:
    return exact_bound(_design(name, directions), kind, iterates=name != "least-squares")


def _scales() -> list[StressCase]:
    return [
        StressCase(
            family="values", name=f"radiance scale, {name}", parameter=f"{scale:.0e}", run=partial(_scaled, name, scale)
        )
        for scale in (1e-30, 1e-20, 1e-10, 1e10, 1e20, 1e30)
        for name in NORMAL_SOLVERS
    ]


def _scaled(name: str, scale: float, kind: str) -> Answer:
    directions, normals = spiral(_COUNT), cap(_PIXELS, np.radians(25.0))
    values = (0.7 * scale * (directions @ normals.T)).astype(kind)
    found = solved(values, directions, NORMAL_SOLVERS[name]())
    return spread(found, 0.7 * scale * normals, _bound(name, directions, kind))


def _albedos() -> list[StressCase]:
    cases = [
        StressCase(
            family="values", name=f"albedo ratio, {name}", parameter="1e6 in an image", run=partial(_painted, name)
        )
        for name in NORMAL_SOLVERS
    ]
    for bits in (8, 16):
        cases.append(
            StressCase(
                family="values",
                name="albedo ratio, rounded",
                parameter=f"1e6, {bits} bit",
                run=partial(_painted_coarsely, bits),
                rule=Rule.TOLD,
                unit="rad",
                kinds=DOUBLE,
            )
        )
    return cases


def _paint() -> FloatArray:
    return np.asarray(10.0 ** np.linspace(-6.0, 0.0, _PIXELS))


def _painted(name: str, kind: str) -> Answer:
    directions, normals, albedo = spiral(_COUNT), cap(_PIXELS, np.radians(25.0)), _paint()
    values = (albedo * (directions @ normals.T)).astype(kind)
    found = solved(values, directions, NORMAL_SOLVERS[name]())
    return spread(found, albedo[:, None] * normals, _bound(name, directions, kind))


def _painted_coarsely(bits: int, kind: str) -> Answer:
    """Round an image whose paint spans six decades: what is below a step is black, and has to be said to be."""
    del kind
    directions, normals, albedo = spiral(_COUNT), cap(_PIXELS, np.radians(25.0)), _paint()
    return _coarse(bits, directions, normals, albedo)


def _coarse(bits: int, directions: FloatArray, normals: FloatArray, albedo: FloatArray) -> Answer:
    """Solve values that are rounded to a number of bits; half a step on each is what they may be off."""
    top = 2**bits - 1
    levels = np.rint(0.9 * top * albedo * (directions @ normals.T))
    found = solved(levels.astype(np.uint8 if bits <= 8 else np.uint16), directions, white=float(top))
    largest = np.linalg.norm(np.linalg.pinv(directions), 2) * np.sqrt(len(directions)) * 0.5 / (0.9 * top * albedo)
    bound = np.where(largest < np.sin(_KNOWN), np.arcsin(np.minimum(largest, 1.0)), _KNOWN)
    return Answer(error=angles(found, normals), bound=bound, flags=found.flags[0], bar=found.uncertainty[0])


def _rounded() -> list[StressCase]:
    common = partial(StressCase, family="values", rule=Rule.TOLD, unit="rad", refusals=(InputError,), kinds=DOUBLE)
    cases = [
        common(name="rounding", parameter=f"{bits} bit", run=partial(_rounding, bits, 60.0))
        for bits in (1, 2, 3, 4, 6, 8, 10, 12, 16)
    ]
    cases += [
        common(name=f"rounding, cone of {half:g}°", parameter=f"{bits} bit", run=partial(_rounding, bits, half))
        for bits in (8, 16)
        for half in (5.0, 0.5, 0.05)
    ]
    return cases


def _rounding(bits: int, half: float, kind: str) -> Answer:
    del kind
    directions = spiral(_COUNT, max_tilt=float(np.radians(half)))
    return _coarse(bits, directions, cap(_PIXELS, np.radians(25.0)), np.ones(_PIXELS))


def _saturated() -> list[StressCase]:
    return [
        StressCase(
            family="values",
            name=f"saturation, {name}",
            parameter=f"{share:g} % of samples",
            run=partial(_clipped, name, share),
            rule=Rule.TOLD,
        )
        for share in (10, 30, 60)
        for name in NORMAL_SOLVERS
    ]


def _clipped(name: str, share: float, kind: str) -> Answer:
    directions, normals = spiral(_COUNT), cap(_PIXELS, np.radians(25.0))
    shade = directions @ normals.T
    exposed = shade / np.quantile(shade, 1.0 - share / 100.0)
    values = np.minimum(exposed, 1.0).astype(kind)
    found = solved(values, directions, NORMAL_SOLVERS[name](), white=1.0)
    albedo = exposed[0, 0] / shade[0, 0]
    return spread(found, albedo * normals, _bounds(name, directions, exposed < 0.97, kind))


def _bounds(name: str, directions: FloatArray, usable: BoolArray, kind: str) -> FloatArray:
    """Return each pixel's bound by the lights (m, p) that tell something; 0 where they do not tell the normal."""
    design = _design(name, directions)
    told = [np.linalg.matrix_rank(design[one], tol=1e-6) == design.shape[1] for one in usable.T]
    return np.array(
        [_bound(name, directions[one], kind) if fine else 0.0 for one, fine in zip(usable.T, told, strict=True)]
    )


def _shadowed() -> list[StressCase]:
    cases = []
    for name, method in NORMAL_SOLVERS.items():
        for lit in range(4):
            cases.append(
                StressCase(
                    family="values",
                    name=f"cast shadow, {name}",
                    parameter=f"{lit} lit of {max(_FEW, method.least_lights)}",
                    run=partial(_shaded, name, lit),
                    rule=Rule.TOLD if lit == 3 else Rule.FLAGGED,
                    remarks=Flag.NOT_CONVERGED,
                    demanded=(Flag.NO_SIGNAL, Flag.TOO_FEW_LIGHTS, Flag.TOO_FEW_LIGHTS, Flag(0))[lit],
                )
            )
    return cases


def _shaded(name: str, lit: int, kind: str) -> Answer:
    """Leave a few lights to each pixel but the last, which keeps the capture from being refused as a whole."""
    rng = np.random.default_rng(lit)
    directions = spiral(max(_FEW, NORMAL_SOLVERS[name].least_lights), max_tilt=float(np.radians(45.0)))
    normals = cap(_PIXELS + 1, np.radians(25.0))
    shade = directions @ normals.T
    reached = np.zeros(shade.shape, np.bool_)
    for pixel in range(_PIXELS):
        reached[_spanning(directions, lit, rng), pixel] = True
    reached[:, -1] = True
    found = solved((0.7 * shade * reached).astype(kind), directions, NORMAL_SOLVERS[name]())
    bound = _bounds("least-squares", directions, reached, kind) + (0.0 if name == "least-squares" else 1e-6)
    few = slice(0, _PIXELS)
    return Answer(error=relative(found, 0.7 * normals)[few], bound=bound[few], flags=found.flags[0][few])


def _spanning(directions: FloatArray, count: int, rng: np.random.Generator) -> FloatArray:
    """Return lights, if there are three of a condition that is moderate."""
    while True:
        chosen = rng.choice(len(directions), count, replace=False)
        if count < 3 or np.linalg.cond(directions[chosen]) < 30.0:
            return np.asarray(chosen)


def _grazing() -> list[StressCase]:
    return [
        StressCase(
            family="values",
            name=f"grazing normals, {name}",
            parameter=f"{tilt}° from the view",
            run=partial(_tilted, name, tilt),
            rule=Rule.TOLD,
        )
        for tilt in (80.0, 89.0, 89.99)
        for name in ("least-squares", "robust", "trimmed", "sparse-bayesian", "low-rank")
        if name in NORMAL_SOLVERS
    ]


def _tilted(name: str, tilt: float, kind: str) -> Answer:
    turn = np.linspace(0.0, 2.0 * np.pi, _PIXELS, endpoint=False)
    z, r = np.cos(np.radians(tilt)), np.sin(np.radians(tilt))
    normals = np.stack([r * np.cos(turn), r * np.sin(turn), np.full(_PIXELS, z)], axis=1)
    directions = spiral(_COUNT, max_tilt=float(np.radians(75.0)))
    shade = directions @ normals.T
    found = solved(np.maximum(0.7 * shade, 0.0).astype(kind), directions, NORMAL_SOLVERS[name]())
    return spread(found, 0.7 * normals, _bounds(name, directions, shade > 0.1, kind))
