"""The one number that normals cannot give: how far away the surface is."""

import math
from dataclasses import replace

import numpy as np

from psstereo.errors import InputError, UnsupportedError
from psstereo.results import DepthKind, DepthResult

__all__ = ["with_distance"]


def with_distance(result: DepthResult, *, distance: float, unit: str) -> DepthResult:
    """Scale relative distances so that their median over the whole map is a known one.

    All components are scaled by the same factor. Normals say nothing about how components lie to each other, so with
    more than one of them only the scale of the whole is right, not their relative distances: the facts say so
    (``components_relative_scale_known``).

    Parameters
    ----------
    result : DepthResult
        Distances of a pinhole camera.
    distance : float
        Median distance along the optical axis [`unit`].
    unit : str
        Unit of `distance`, such as ``"mm"``.

    Returns
    -------
    DepthResult
        The same, in `unit`.

    Raises
    ------
    UnsupportedError
        If the result holds heights: those are in the camera's unit already.
    InputError
        If the distance is not a positive number.
    """
    if result.kind is not DepthKind.DISTANCE:
        raise UnsupportedError(
            given="The depth holds heights of an orthographic camera.",
            needed="Only relative distances of a pinhole camera have a free scale.",
            remedy="Give the orthographic camera the size of its pixels instead.",
        )
    if not (math.isfinite(distance) and distance > 0):
        raise InputError(
            given=f"The distance is {distance}.",
            needed="It must be a positive length.",
            remedy="Measure from the camera to the middle of the surface, along the optical axis.",
        )
    factor = distance / float(np.nanmedian(result.depth))
    facts = {
        **result.facts,
        "median_distance": distance,
        "components_relative_scale_known": int(result.components.max()) <= 1,
    }
    return replace(result, depth=result.depth * factor, unit=unit, facts=facts)
