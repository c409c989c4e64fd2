"""What the solvers with a reflectance of their own have in common: whence they start, and how they tell an answer."""

from typing import NamedTuple

import numpy as np

from psstereo.flags import Flag, fatal_mask
from psstereo.kernels.bipolynomial import across
from psstereo.normals.solver import PixelNormals, Samples
from psstereo.normals.verdict import Verdict, VerdictArray
from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["ABOVE", "DARK", "IGNORED", "Told", "as_rows", "put"]

ABOVE, DARK = 2.0, 3.0
"""Shares of observations that are lit but not looked at, and of those in shadow."""

IGNORED = 0.1
"""Share of its full weight below which an observation is all but ignored."""


class Told(NamedTuple):
    """A reflectance fit's answer at all pixels of a block.

    Attributes
    ----------
    normal : float64 array (p, 3)
        Unit normals; NaN where there was no fit.
    brightness : float64 array (p,)
        Albedo.
    spread : float64 array (p, 3)
        Covariance of the normal along its tangents; see :func:`psstereo.kernels.bipolynomial.tangents` [rad²].
    share : float64 array (p, m)
        Weight of each observation, 0 … 1, negative for values below the fit; `ABOVE`, `DARK`; NaN where not usable.
    settled, good : bool arrays (p,)
        Whether the fit converged, and whether it stands.
    """

    normal: FloatArray
    brightness: FloatArray
    spread: FloatArray
    share: FloatArray
    settled: BoolArray
    good: BoolArray


def as_rows(samples: Samples) -> tuple[FloatArray, FloatArray]:
    """Return values and weights with a row a pixel; (0, 0) for no weights."""
    values = np.ascontiguousarray(samples.values.T, np.float64)
    if samples.weights is None:
        return values, np.zeros((0, 0))
    return values, np.ascontiguousarray(samples.weights.T, np.float64)


def put(found: PixelNormals, told: Told) -> None:
    """Put a fit's answer in the place of its start where it stands, in place."""
    rows: IntArray = np.flatnonzero(told.good & ~fatal_mask(found.flags))
    normal, share = told.normal[rows], told.share[rows]
    with np.errstate(invalid="ignore"):
        taking_part = np.abs(share) <= 1
        used = taking_part & (np.abs(share) >= IGNORED)
    covariance = across(normal, told.spread[rows])
    found.scaled[rows] = normal * told.brightness[rows, None]
    found.uncertainty[rows] = np.sqrt(covariance[:, 0] + covariance[:, 2] + covariance[:, 5])
    found.used[rows] = used.sum(axis=1)
    flags = np.zeros(len(rows), np.uint16)
    for where, flag in (
        (~told.settled[rows], Flag.NOT_CONVERGED),
        (np.isnan(share).any(axis=1), Flag.UNUSABLE_SAMPLE),
        ((share == DARK).any(axis=1), Flag.SHADOWED),
    ):
        flags[where] |= np.uint16(flag)
    found.flags[rows] = flags
    if found.covariance is not None:
        found.covariance[rows] = covariance
    if found.verdicts is not None:
        found.verdicts[:, rows] = _verdicts(share).T


def _verdicts(share: FloatArray) -> VerdictArray:
    verdicts = np.full(share.shape, Verdict.USED, np.uint8)
    with np.errstate(invalid="ignore"):
        ignored = np.abs(share) < IGNORED
        verdicts[ignored & ~np.signbit(share)] = Verdict.HIGHLIGHT
        verdicts[ignored & np.signbit(share)] = Verdict.DARK_OUTLIER
        verdicts[share == ABOVE] = Verdict.NOT_NEEDED
        verdicts[share == DARK] = Verdict.SHADOW
    verdicts[np.isnan(share)] = Verdict.UNUSABLE
    return verdicts
