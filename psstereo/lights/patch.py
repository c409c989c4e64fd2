"""Small flat pieces of a shining surface, of which area lights are made."""

import numpy as np

from psstereo.lights.beam import Beam
from psstereo.types import FloatArray

__all__ = ["patch_beam", "towards"]


def towards(points: FloatArray, place: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return unit vectors from points to a place and the distances, NaN at the place itself.

    Parameters
    ----------
    points : float array (..., 3)
        From where [length].
    place : float array (3,)
        To where [length].

    Returns
    -------
    tuple of float64 arrays (..., 3) and (...)
        Unit vectors [1] and distances [length].
    """
    arm = place - np.asarray(points, np.float64)
    largest = np.abs(arm).max(axis=-1, keepdims=True)
    largest = np.where(largest > 0.0, largest, np.nan)  # squares neither overflow nor underflow
    arm = arm / largest
    length = np.sqrt((arm * arm).sum(axis=-1, keepdims=True))
    return arm / length, (length * largest)[..., 0]


def patch_beam(points: FloatArray, place: FloatArray, axis: FloatArray, power: FloatArray) -> Beam:
    """Return the light from a small Lambertian patch, L cosθ dA / r² for a surface that faces it; 0 behind the patch.

    Parameters
    ----------
    points : float array (..., 3)
        Surface points [length].
    place : float array (3,)
        Where the patch is [length].
    axis : float array (3,)
        Its unit normal on the side to which it shines [1].
    power : float array (c,)
        L dA [W sr⁻¹], or relative.

    Returns
    -------
    Beam
        Directions (..., 3), irradiance (..., c) and distances (...); NaN at the patch itself.
    """
    direction, distance = towards(points, place)
    cosine = np.maximum(-(direction @ axis), 0.0)
    share = cosine / distance / distance
    return Beam(directions=direction, irradiance=share[..., None] * power, distances=distance)
