"""The materials of an object under near lamps, told from pixels all over it.

:mod:`psstereo.normals.exemplar_shared` says why and how; here each pixel has lamps of its own.
"""

from typing import NamedTuple

import numpy as np

from psstereo.kernels.exemplar_lobes import CONSTANT, lights_table, lobes
from psstereo.kernels.exemplar_nnls import nnls
from psstereo.kernels.exemplar_terms import FAILED, Fit
from psstereo.near.exemplars import fit_block, share_of
from psstereo.near.frames import eye_frames
from psstereo.near.level import Level
from psstereo.near.pull import Places, part_of
from psstereo.normals.exemplar import LOBES, ExemplarState
from psstereo.types import FloatArray

__all__ = ["Look", "look"]

_LEAST_FITTED = 50
"""Fitted pixels from which materials can be told."""

_ROUNDS, _TIE = 20, 1e-6
"""Rounds between amounts and materials, and the tie of every unknown over the sum of weights."""

_PLAIN = 4.0
"""Evidence that a dictionary of every lobe finds where there is none; twice as much as with the object's materials."""


class Look(NamedTuple):
    """What some pixels of an object show.

    Attributes
    ----------
    pixels : int
        How many were looked at.
    broken : float
        Share of them at which the exemplars explain much that Lambert's law does not [1].
    materials : float64 array (q, 9) or None
        Amounts of each lobe in the object's materials; None if too few pixels could be fitted [1].
    """

    pixels: int
    broken: float
    materials: FloatArray | None


def look(
    sample: Level, lamps: FloatArray, q: FloatArray, start: FloatArray, free: ExemplarState, *, count: int
) -> Look:
    """Fit every lobe at some pixels, and tell materials from those.

    Parameters
    ----------
    sample : Level
        Some pixels of an image, see :func:`psstereo.near.level.sampled_level`.
    lamps : float64 array (m, 7)
        Position, axis, exponent.
    q : float64 array (p,)
        Where the surface is.
    start : float64 array (p, 3)
        Albedo times normal by Lambert's law.
    free : ExemplarState
        With every lobe for itself.
    count : int
        Materials to be told.

    Returns
    -------
    Look
        What they show.
    """
    points = sample.view.points(q)
    places = Places(points, sample.view.motion(points), eye_frames(sample.view.rays))
    brightness = sample.store.read(0, len(sample)).mean(axis=0, dtype=np.float64)
    fit, values = fit_block(free, brightness, places, lamps, start)
    stands = fit.outcome < FAILED
    broken = float(np.mean(np.where(stands, share_of(fit.evidence, len(lamps), _PLAIN), 0.0) > 0.5))
    if np.count_nonzero(stands) < 2 * _LEAST_FITTED:
        return Look(len(sample), broken, None)
    good = np.flatnonzero(stands & (fit.scale <= np.median(fit.scale[stands])))
    table = lights_table(places.lamps(lamps).directions[good])
    d = free.dictionary
    columns = lobes(fit.normal[good], table, d.kinds, d.shapes)
    return Look(len(sample), broken, _materials(values[good], part_of(fit, good), columns, count))


def _materials(values: FloatArray, fit: Fit, columns: FloatArray, count: int) -> FloatArray:
    """Return materials (q, k) of which every pixel's brightness is a non-negative sum, all pixels counting the same."""
    values = np.where(np.isfinite(values), values, np.nan)
    own = np.array([float(lobe.kind != CONSTANT) for lobe in LOBES])
    top = np.nanquantile(values, 0.95, axis=1)
    with np.errstate(invalid="ignore"):
        w = np.where(np.isfinite(values) & (np.abs(fit.share) <= 1.0), np.abs(fit.share), 0.0)
    y = np.where(w > 0, values, 0.0) / top[:, None]
    k = len(own)
    found = _start(fit.amounts * own / top[:, None], count)
    gram = np.einsum("pkm,pm,pjm->pkj", columns, w, columns, optimize=True)
    right = np.einsum("pkm,pm->pk", columns, w * y)
    mass = w.sum(axis=1)
    for _ in range(_ROUNDS):
        a = found @ gram @ found.T + np.eye(count) * (_TIE * mass)[:, None, None]
        part = nnls(a, right @ found.T, 0, np.zeros((len(y), count)), mass)
        whole = np.einsum("pq,pr,pkj->qkrj", part, part, gram, optimize=True).reshape(count * k, count * k)
        whole += np.eye(count * k) * _TIE * mass.sum()
        held = np.tile(own == 0, count)
        whole[held], whole[:, held] = 0.0, 0.0
        whole[held, held] = 1.0
        target = np.where(held, 0.0, (part.T @ right).ravel())
        found = nnls(whole[None], target[None], 0, np.zeros((1, count * k)), mass.sum()[None])[0].reshape(count, k)
        found = found[found.max(axis=1) > 0]
        count = len(found)
        found /= found.sum(axis=1, keepdims=True)
    return found


def _start(amounts: FloatArray, count: int) -> FloatArray:
    """Return amounts of pixels that are as unlike each other as can be, the first like the mean."""
    whole = amounts / np.maximum(amounts.sum(axis=1, keepdims=True), 1e-12)
    chosen = [whole.mean(axis=0)]
    while len(chosen) < count:
        far = np.min([((whole - one) ** 2).sum(axis=1) for one in chosen], axis=0)
        chosen.append(whole[int(np.argsort(far)[int(0.98 * (len(far) - 1))])])
    return np.array(chosen)
