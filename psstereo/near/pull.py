"""How well exemplar materials explain a pixel where it is, and how that changes along its line of sight."""

from typing import NamedTuple

import numpy as np

from psstereo.kernels.exemplar_lobes import lights_table, lobes, slopes, tangents
from psstereo.kernels.exemplar_terms import WEAK, Dictionary, Fit
from psstereo.kernels.near import lamp_vectors
from psstereo.near.frames import SeenLamps, seen_lamps
from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["Places", "exemplar_energy", "exemplar_pull", "part_of"]

_STEP = 1e-4
"""Step of the central difference, over the distance to the nearest lamp [1]."""

_TINY = np.finfo(np.float64).tiny


class Places(NamedTuple):
    """Where some pixels are.

    Attributes
    ----------
    points : float64 array (p, 3)
        Points of the surface [length].
    motion : float64 array (p, 3)
        How a point moves along its line of sight, per unit of whatever measures the way [length].
    frames : float64 array (p, 3, 3)
        From :func:`psstereo.near.frames.eye_frames` [1].
    """

    points: FloatArray
    motion: FloatArray
    frames: FloatArray

    def lamps(self, lamps: FloatArray, way: FloatArray | float = 0.0) -> SeenLamps:
        """Return how the pixels see the lamps (m, 7), after moving some way along their lines of sight."""
        there = self.points + np.broadcast_to(way, len(self.points))[:, None] * self.motion
        light, _ = lamp_vectors(there, self.motion, lamps)
        return seen_lamps(light, self.frames)

    def part(self, pixels: IntArray) -> "Places":
        """Return some pixels."""
        return Places(self.points[pixels], self.motion[pixels], self.frames[pixels])


def part_of(fit: Fit, pixels: IntArray) -> Fit:
    """Return the fits of some pixels.

    Parameters
    ----------
    fit : Fit
        Of p pixels.
    pixels : int array (k,)
        Which.

    Returns
    -------
    Fit
        Copies of theirs.
    """
    return Fit._make(each[pixels] for each in fit)


def exemplar_energy(
    fit: Fit, dictionary: Dictionary, values: FloatArray, seen: SeenLamps, scale: FloatArray
) -> FloatArray:
    """Return the sum of the loss of Geman and McClure over the observations in light.

    Parameters
    ----------
    fit : Fit
        Of p pixels.
    dictionary : Dictionary
        What was fitted.
    values : float64 array (p, m)
        Brightness over the lamps' strengths; NaN where not usable.
    seen : SeenLamps
        The lamps.
    scale : float64 array (p,)
        Residual of the brightness that counts as large.

    Returns
    -------
    float64 array (p,)
        Between 0 and the number of observations; NaN where there is no fit [1].
    """
    shown = _shown(fit, dictionary, lights_table(seen.directions))
    t = np.where(_lit(fit), values - shown, 0.0) * seen.strengths / scale[:, None]
    square = t * t
    return np.where(np.isfinite(fit.normal[:, 0]), (square / (1.0 + square)).sum(axis=1), np.nan)


def exemplar_pull(
    fit: Fit,
    dictionary: Dictionary,
    values: FloatArray,
    places: Places,
    *,
    lamps: FloatArray,
    scale: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return the Gauss–Newton terms of the energy along the lines of sight, normal and amounts eliminated.

    When a point slides, its distances to the lamps change and with them the strengths of their light, and so do the
    directions. What a turn of the normal and other amounts of the materials could do as well tells nothing.

    Parameters
    ----------
    fit : Fit
        Of p pixels, each with a fit.
    dictionary : Dictionary
        What was fitted.
    values : float64 array (p, m)
        Brightness over the lamps' strengths; NaN where not usable.
    places : Places
        Where the pixels are.
    lamps : float64 array (m, 7)
        Position, axis, exponent.
    scale : float64 array (p,)
        Residual of the brightness that counts as large.

    Returns
    -------
    pull, stiffness : float64 arrays (p,)
        As of :class:`psstereo.kernels.near.NearFit`.
    """
    seen = places.lamps(lamps)
    table = lights_table(seen.directions)
    lit = _lit(fit)
    w = np.where(lit, np.abs(fit.share), 0.0)
    shown, free = _shown(fit, dictionary, table), _free(fit, dictionary, table)
    r = np.where(lit, values - shown, 0.0) * seen.strengths
    free = free * seen.strengths[:, None]
    change = _change(fit, dictionary, places, lamps)
    weighted = free * w[:, None]
    gram, across = weighted @ free.transpose(0, 2, 1), (weighted @ change[..., None])[..., 0]
    # An amount at zero has no column, and is held there.
    own = np.einsum("pkk->pk", gram)
    held = np.where(own > 0, WEAK * own, 1.0)
    gram = gram + np.eye(gram.shape[1]) * held[:, None]
    response = np.linalg.solve(gram, across[..., None])[..., 0]
    stiffness = (w * change * change).sum(axis=1) - (across * response).sum(axis=1)
    pull = (w * change * r).sum(axis=1) - (response * (weighted @ r[..., None])[..., 0]).sum(axis=1)
    return pull / scale**2, np.maximum(stiffness, 0.0) / scale**2


def _lit(fit: Fit) -> BoolArray:
    with np.errstate(invalid="ignore"):
        return np.asarray(np.abs(fit.share) <= 1.0)


def _parts(fit: Fit, d: Dictionary) -> FloatArray:
    """Return the amount of each lobe, (p, k)."""
    return fit.amounts if d.mix.size == 0 else np.asarray(fit.amounts @ d.mix)


def _shown(fit: Fit, d: Dictionary, table: FloatArray) -> FloatArray:
    """Return what the fit shows under lights of unit strength, (p, m)."""
    return np.asarray((_parts(fit, d)[:, None] @ lobes(fit.normal, table, d.kinds, d.shapes))[:, 0])


def _free(fit: Fit, d: Dictionary, table: FloatArray) -> FloatArray:
    """Return how that changes with the amounts that are not zero, and with two turns of the normal, (p, q + 2, m)."""
    columns = lobes(fit.normal, table, d.kinds, d.shapes)
    if d.mix.size:
        columns = np.asarray(d.mix @ columns)
    by, across = slopes(fit.normal, table, d.kinds, d.shapes, _parts(fit, d)), tangents(fit.normal)
    turned = (across @ table[:, :3]) * by[:, :1] + (across @ table[:, 3:6]) * by[:, 1:2]
    return np.concatenate([columns * (fit.amounts > 0)[..., None], turned + across[:, :, 2:] * by[:, 2:]], axis=1)


def _change(fit: Fit, d: Dictionary, places: Places, lamps: FloatArray) -> FloatArray:
    """Return how the brightness changes along the line of sight, normal and amounts as they are, (p, m)."""
    away = lamps[:, None, :3] - places.points
    nearest = np.sqrt((away * away).sum(axis=2).min(axis=0))
    step = _STEP * nearest / np.sqrt(np.maximum((places.motion * places.motion).sum(axis=1), _TINY))

    def brightness(way: FloatArray) -> FloatArray:
        seen = places.lamps(lamps, way)
        return seen.strengths * _shown(fit, d, lights_table(seen.directions))

    return np.asarray((brightness(step) - brightness(-step)) / (2.0 * step)[:, None])
