"""Observations that are wrong, up to nearly half of them, and lights of unknown strengths over three decades."""

from functools import partial

import numpy as np

from psstereo.bench.stress import DOUBLE, Answer, Rule, StressCase
from psstereo.capture import Capture
from psstereo.errors import InputError, RigError
from psstereo.flags import Flag
from psstereo.forward import lambertian_images
from psstereo.lights import Rig
from psstereo.normals import NORMAL_SOLVERS
from psstereo.normals.strengths import estimate_strengths
from psstereo.results import Outcome
from psstereo.stack import MemoryStack
from psstereo.types import Array, FloatArray
from psstereo_synth.hills import hills
from psstereo_synth.rigs import spiral
from psstereo_synth.stress.pixels import angles, cap, eps, exact_bound, solved

__all__ = ["outlier_cases"]

_COUNT = 96
_PIXELS = 200
_ROBUST = ("robust", "sparse-bayesian", "low-rank", "trimmed")


def outlier_cases() -> list[StressCase]:
    """Return the cases of this family."""
    cases = []
    for name in _ROBUST:
        for share in (10, 30, 49):
            for what in ("highlights", "shadows", "both"):
                cases.append(
                    StressCase(
                        family="outliers",
                        name=f"{name}, {what}",
                        parameter=f"{share} % of observations",
                        run=partial(_spoilt, name, share, what),
                        rule=Rule.TOLD,
                        unit="rad",
                    )
                )
    strengths = partial(StressCase, family="strengths", rule=Rule.TOLD, refusals=(InputError, RigError), limit=20.0)
    for decades in (1, 2, 3):
        remarks = Flag.NOT_CONVERGED
        spread = partial(strengths, parameter=f"over 1e{decades}", remarks=remarks)
        cases.append(spread(name="exact images", run=partial(_strengths, decades, None)))
        for bits in (16, 8):
            cases.append(spread(name=f"{bits}-bit images", run=partial(_strengths, decades, bits), kinds=DOUBLE))
    return cases


def _spoilt(name: str, share: float, what: str, kind: str) -> Answer:
    """Spoil observations at random; the others agree to the last digit, and are more than half."""
    rng = np.random.default_rng(int(share))
    directions, normals = spiral(_COUNT), cap(_PIXELS, np.radians(25.0))
    values = 0.7 * directions @ normals.T
    count = int(share / 100.0 * _COUNT)
    for pixel in range(_PIXELS):
        chosen = rng.permutation(_COUNT)[:count]
        bright = chosen[: {"highlights": count, "shadows": 0, "both": count // 2}[what]]
        dark = chosen[len(bright) :]
        values[bright, pixel] += rng.uniform(0.1, 3.0, len(bright))
        values[dark, pixel] *= rng.uniform(0.0, 0.1, len(dark))
    found = solved(values.astype(kind), directions, NORMAL_SOLVERS[name]())
    bound = 4.0 * exact_bound(directions, kind, iterates=True)
    return Answer(error=angles(found, normals), bound=bound, flags=found.flags[0], bar=found.uncertainty[0])


def _strengths(decades: int, bits: int | None, kind: str) -> Answer:
    """Estimate strengths that are spread evenly over decades; the error that the estimate expects may tell its own."""
    count, surface = 24, hills(64, 64, steepness=1.0)
    directions = spiral(count, max_tilt=float(np.radians(50.0)))
    truth = 10.0 ** (decades * np.random.default_rng(3).permutation(count) / (count - 1.0))
    images = lambertian_images(surface.normals, np.full((64, 64), 0.5), Rig.distant(directions, truth))
    images = images * surface.mask[..., None] / images.max() * 0.9
    stack = MemoryStack(_shown(images, bits, kind))
    found = estimate_strengths(Capture(stack=stack, rig=Rig.distant(directions), mask=surface.mask))
    ratio = found.strengths / truth
    error = np.sqrt(np.mean((ratio / np.median(ratio) - 1.0) ** 2, keepdims=True))  # what the expected error is of
    bar = np.array([found.health.expected_error]) if bits is not None else None
    flags = np.zeros(1, np.uint16)
    if found.outcome is not Outcome.SOLVED:
        flags |= np.uint16(Flag.NOT_CONVERGED)
    return Answer(error=error, bound=1e-6 + 100.0 * eps(kind), flags=flags, bar=bar)


def _shown(images: FloatArray, bits: int | None, kind: str) -> Array:
    if bits is None:
        return np.asarray(images, np.dtype(kind))
    return np.asarray(np.rint(images * (2**bits - 1)), np.uint8 if bits == 8 else np.uint16)
