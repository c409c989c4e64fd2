"""The sky over an object in the sun, found from the object's own shadows and shades.

An outdoor image shows ``I = ρ (E_sun max(0, n·l) v + E_sky(n))``. Over one day the suns stand on a cone, on which a
constant cannot be told from a tilt of the normals as long as everything is in the sun: it is the shaded side of things
that tells how bright the sky is. First one number is found, the strength of an even sky over a dim ground; then, image
by image, the harmonics that depart from it as far as the images ask, each in turn with the normals under it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from psstereo.capture import Capture
from psstereo.errors import InputError, OptionError
from psstereo.flags import fatal_mask
from psstereo.lights import Rig, real_harmonics
from psstereo.normals.sky import SkyLeastSquares, even_skies
from psstereo.normals.solver import PixelNormals, Samples
from psstereo.normals.thinning import sample_grid
from psstereo.types import BoolArray, FloatArray, Map, Progress, no_progress

__all__ = ["SkyEstimate", "SkyOptions", "estimate_sky"]

_PIXELS = 700
"""Pixels used: every round solves all of them."""
_STRENGTHS = (0.0, 0.02, 0.05, 0.1, 0.2, 0.4, 0.8)
"""Irradiance of an even sky on the ground over the sun's on what faces it, tried first; clear skies have 0.05 to 0.2
[1]."""
_FINER = 4
_EFFECTIVE = 100.0
"""Pixels that count as independent: what is wrong with the model is wrong over whole regions."""
_DEPARTURE = 0.2
"""Expected departure of a harmonic from that of an even sky, over the even sky's mean."""
_FLOOR = 0.005
_COSINE = np.array([np.pi, *[2.0 * np.pi / 3.0] * 3, *[np.pi / 4.0] * 5])
_LEAST_SHADE = 0.02
"""Share of observations in the shade below which the sky is not told."""


@dataclass(frozen=True, kw_only=True)
class SkyOptions:
    """How the sky is described and found.

    Attributes
    ----------
    terms : {1, 4, 9}
        Spherical harmonics an image: a level; and a gradient; and a curvature.
    ground : float
        Radiance of the ground over that of the even sky, which is the start, 0 … 1 [1].
    rounds : int
        Rounds of normals and harmonics in turn; 0 keeps the even sky.

    Raises
    ------
    OptionError
        If a value is out of range.
    """

    terms: Literal[1, 4, 9] = 4
    ground: float = 0.2
    rounds: int = 8

    def __post_init__(self) -> None:
        if self.terms not in (1, 4, 9) or not 0 <= self.ground <= 1 or not 0 <= self.rounds <= 1000:
            raise OptionError(
                given=f"The sky has {self.terms} terms, the ground is {self.ground} of it, in {self.rounds} rounds.",
                needed="1, 4 or 9 terms, a ground of 0 to 1, and 0 to 1000 rounds.",
                remedy="Leave them at their defaults.",
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class SkyEstimate:
    """The sky of each image.

    Attributes
    ----------
    coefficients : float64 array (m, 4 or 9)
        Radiance in spherical harmonics over the sun's strength of the same image [sr⁻¹ sr½].
    even : float
        Irradiance of the even sky on level ground over the strongest sun's on what faces it [1].
    shade : float
        Share of the observations that are in the shade [1].
    residual_before, residual_after : float
        Root-mean-square residual over the mean brightness, without sky and with it [1].
    verdict : str
        What was found, as a sentence.
    """

    coefficients: FloatArray
    even: float
    shade: float
    residual_before: float
    residual_after: float
    verdict: str

    def solver(self) -> SkyLeastSquares:
        """Return the normal solver that knows this sky."""
        return SkyLeastSquares(sky=tuple(tuple(float(c) for c in row) for row in self.coefficients))


def estimate_sky(
    capture: Capture,
    zenith: npt.ArrayLike,
    options: SkyOptions | None = None,
    *,
    gray: str | Sequence[float] = "mean",
    over: Map = map,
    progress: Progress = no_progress,
) -> SkyEstimate:
    """Find the sky of each image of an object in the sun.

    The strengths of the rig must be those of the suns, as far as they are known. Not for a flat relief that faces the
    sun all day: without a shaded side the sky is not told, and is refused.

    Parameters
    ----------
    capture : Capture
        Images of equal exposure and the suns over them.
    zenith : float array (3,)
        Upward in the camera's frame, R.T @ (0, 0, 1) of its rotation [1].
    options : SkyOptions, optional
        How.
    gray : str or sequence of float
        How channels become one value.
    over : map-like
        Executes the images.
    progress : callable
        Told how far it is.

    Returns
    -------
    SkyEstimate
        Harmonics, and the solver that uses them.

    Raises
    ------
    InputError
        If nothing is in the shade, or fewer than four images are given.
    RigError
        If the suns lie in a plane.
    """
    chosen = options or SkyOptions()
    if len(capture.rig) < 4:
        raise InputError(
            given=f"There are {len(capture.rig)} images.", needed="Four or more.", remedy="Take more over the day."
        )
    capture.rig.require_spanning()
    grid = sample_grid(capture, gray=gray, limit=_PIXELS, strengths=True, over=over, progress=progress)
    task = _Task(grid.values[0], capture.rig, even_skies(capture.rig, zenith, chosen.ground))
    even, loss = _even(task, progress)
    coefficients = even * task.pattern
    for k in range(chosen.rounds if even > 0 else 0):
        progress("finding the sky", k, chosen.rounds)
        coefficients = task.improved(coefficients, even, chosen.terms)
    progress("finding the sky", chosen.rounds, chosen.rounds)
    shade = task.shade(coefficients)
    if shade < _LEAST_SHADE:
        raise InputError(
            given=f"{100 * shade:.1f} % of the observations are in the shade.",
            needed=f"At least {100 * _LEAST_SHADE:.0f} %: only the shaded side tells how bright the sky is.",
            remedy="Use a rounded object, more hours, or a known sky; or solve without one.",
        )
    size = np.sqrt(np.nanmean(task.values**2))
    after = float(np.sqrt(task.loss(coefficients)) / size)
    before = float(np.sqrt(loss[0]) / size)
    return SkyEstimate(
        coefficients=coefficients[:, : 9 if chosen.terms == 9 else 4],
        even=even,
        shade=shade,
        residual_before=before,
        residual_after=after,
        verdict=f"The sky lights level ground with {100 * even:.0f} % of what the sun gives a surface that faces it; it"
        f" explains the images to {100 * after:.2g} %, against {100 * before:.2g} % without it.",
    )


def _even(task: "_Task", progress: Progress) -> tuple[float, list[float]]:
    """Return the strength of an even sky that explains the images best, and the losses of the first tries."""
    tried = list(_STRENGTHS)
    losses = []
    for k, strength in enumerate(tried):
        progress("strength of the sky", k, len(tried) + _FINER)
        losses.append(task.loss(strength * task.pattern))
    first = list(losses)
    for _ in range(_FINER):
        order = np.argsort(tried)
        at = [tried[k] for k in order]
        best = int(np.argmin([losses[k] for k in order]))
        gaps = [(at[i + 1] - at[i], 0.5 * (at[i] + at[i + 1])) for i in (best - 1, best) if 0 <= i < len(at) - 1]
        tried.append(max(gaps)[1])
        losses.append(task.loss(tried[-1] * task.pattern))
    return float(tried[int(np.argmin(losses))]), first


class _Task:
    """Samples under suns, on which skies are tried.

    Parameters
    ----------
    values : float64 array (m, p)
        Brightness over the sun's strength.
    rig : Rig
        The suns.
    pattern : float64 array (m, 9)
        Harmonics of an even sky of unit strength beside each sun.
    """

    def __init__(self, values: FloatArray, rig: Rig, pattern: FloatArray) -> None:
        self.values, self.rig, self.pattern = values, rig, pattern

    def solved(self, coefficients: FloatArray) -> PixelNormals:
        """Return normals under a sky."""
        solver = SkyLeastSquares(sky=tuple(tuple(row) for row in coefficients.tolist()))
        return solver.solve(solver.prepare(self.rig), Samples(self.values, verdicts=True))

    def _parts(self, found: PixelNormals) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Return the sun's part (m, p), the sky's harmonics times albedo (p, 9), and what is usable."""
        scaled = np.nan_to_num(found.scaled)
        albedo = np.linalg.norm(scaled, axis=1, keepdims=True)
        unit = scaled / np.where(albedo > 0, albedo, 1.0)
        lit = np.zeros(self.values.shape, np.bool_) if found.verdicts is None else found.verdicts == 0
        sun = np.where(lit, np.maximum(self.rig.directions @ scaled.T, 0.0), 0.0)
        usable = np.isfinite(self.values) & ~fatal_mask(found.flags)
        return sun, albedo * real_harmonics(unit) * _COSINE, usable

    def loss(self, coefficients: FloatArray) -> float:
        """Return the mean squared residual, of each pixel no more than ten times the middle one's."""
        found = self.solved(coefficients)
        sun, rows, usable = self._parts(found)
        residual = np.where(usable, self.values - sun - coefficients @ rows.T, 0.0)
        squares = (residual**2).sum(axis=0) / np.maximum(usable.sum(axis=0), 1)
        squares[~usable.any(axis=0)] = (np.nan_to_num(self.values) ** 2).mean(axis=0)[~usable.any(axis=0)]
        return float(np.minimum(squares, 10.0 * np.median(squares) + 1e-300).mean())

    def shade(self, coefficients: FloatArray) -> float:
        """Return the share of usable observations that are in the shade."""
        found = self.solved(coefficients)
        sun, _, usable = self._parts(found)
        return float((sun[usable] <= 0).mean()) if usable.any() else 0.0

    def improved(self, coefficients: FloatArray, even: float, terms: int) -> FloatArray:
        """Return the harmonics that explain each image best under the normals of the last ones."""
        sun, rows, usable = self._parts(self.solved(coefficients))
        prior = even * self.pattern
        answer = np.array(prior)
        for i, base in enumerate(prior):
            ok = usable[i]
            # One term scales the even sky; more depart from it by themselves.
            table = (rows[ok] @ base)[:, None] if terms == 1 else rows[ok][:, :terms]
            step = _step(table, self.values[i, ok], sun[i, ok] + rows[ok] @ base, 1.0 if terms == 1 else abs(base[0]))
            if terms == 1:
                answer[i] = base * max(1.0 + step[0], 0.0)
            else:
                answer[i, :terms] += step
        return answer


def _step(table: FloatArray, seen: FloatArray, expected: FloatArray, size: float) -> FloatArray:
    """Return the departure of one image's harmonics from the even sky's, held back by how far skies depart from it."""
    target = seen - expected
    if not len(target):
        return np.zeros(table.shape[1])
    scale = 1.4826 * np.median(np.abs(target - np.median(target))) + _FLOOR * float(np.abs(seen).mean())
    weighted = (table / (1.0 + (target / (3.0 * scale)) ** 2)[:, None]) * (_EFFECTIVE / len(target) / scale**2)
    normal = weighted.T @ table + np.eye(table.shape[1]) / (_DEPARTURE * size) ** 2
    return np.asarray(np.linalg.solve(normal, weighted.T @ target))
