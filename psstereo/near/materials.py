"""The materials of an object under near lamps, told from pixels all over it.

:mod:`psstereo.normals.exemplar_shared` says why and how; here each pixel has lamps of its own.
"""

from typing import NamedTuple

import numpy as np

from psstereo.kernels.exemplar_lobes import lights_table, lobes
from psstereo.kernels.exemplar_terms import FAILED
from psstereo.near.exemplars import fit_block, share_of
from psstereo.near.frames import eye_frames
from psstereo.near.level import Level
from psstereo.near.pull import Places
from psstereo.normals.exemplar import ExemplarState
from psstereo.normals.exemplar_shared import common_materials, trusted
from psstereo.types import FloatArray

__all__ = ["Look", "look"]

_LEAST_FITTED = 50
"""Fitted pixels from which materials can be told."""

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
    materials : float64 array (q, 12) or None
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
    good = trusted(fit)
    table = lights_table(places.lamps(lamps).directions[good])
    d = free.dictionary
    columns = lobes(fit.normal[good], table, d.kinds, d.shapes)
    share = np.abs(fit.share[good])
    found, _ = common_materials(values[good], share, columns, fit.amounts[good], count)
    return Look(len(sample), broken, found)
