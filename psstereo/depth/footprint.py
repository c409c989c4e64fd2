"""What a pixel covers: its neighbours, its steps in the image, its distance."""

import numpy as np

from psstereo.camera import Camera
from psstereo.depth.differences import Differences
from psstereo.depth.domain import Domain
from psstereo.errors import InputError
from psstereo.results import DepthKind
from psstereo.types import Array, FloatArray, IntArray

__all__ = ["distance_of", "image_steps", "labels_of"]


def labels_of(known: Array, components: IntArray | None) -> IntArray:
    """Return what belongs together: the components, or 1, on known pixels and 0 elsewhere.

    Parameters
    ----------
    known : bool array (h, w)
        Where something is known.
    components : int array (h, w) or None
        Connected components, 0 for none.

    Returns
    -------
    int array (h, w)
        Labels.

    Raises
    ------
    InputError
        If the components are no integers of this shape, or one is negative.
    """
    if components is None:
        return known.astype(np.int32)
    components = np.asarray(components)
    if components.shape != known.shape or components.dtype.kind not in "iu" or components.min(initial=0) < 0:
        raise InputError(
            given=f"The components are an array of shape {components.shape} and type {components.dtype}.",
            needed=f"There must be one integer, 0 or more, for each of the {known.shape} pixels.",
            remedy="Use the components of the depth result that belongs to this map, or leave them out.",
        )
    return np.where(known, components, 0)


def image_steps(domain: Domain) -> tuple[tuple[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]:
    """Return what a step of one pixel does to the point that a pixel sees on the plane across the optical axis.

    Parameters
    ----------
    domain : Domain
        The pixels.

    Returns
    -------
    right, down : (float, float) or (float64 array (h, w), float64 array (h, w)), each
        x and y of the step to the right and of the step down: in the camera's unit where heights are looked for,
        divided by the distance of the plane where distances are [1].
    """
    if not domain.array.size:
        step = domain.matrix
        return (step[0, 0], step[1, 0]), (step[0, 1], step[1, 1])
    x, y = domain.places[..., 0], domain.places[..., 1]
    across, along = (Differences(np.ones(domain.inside.shape, np.int32), axis=axis) for axis in (1, 0))
    return (across(x), across(y)), (along(x), along(y))


def distance_of(domain: Domain, camera: Camera, distance: float | FloatArray | None, unit: str | None) -> FloatArray:
    """Return the distances that belong to the pixels of a domain, 1 if none are given.

    Parameters
    ----------
    domain : Domain
        The pixels.
    camera : Camera
        Their camera.
    distance : float or float array (H, W) or None
        Distance along the optical axis, of the whole image; NaN where unknown [`unit`].
    unit : str or None
        Its unit.

    Returns
    -------
    float64 array () or (h, w)
        Distances, NaN where unknown or outside [`unit`].

    Raises
    ------
    InputError
        If a distance is not positive, comes without unit or for a camera without distances, or has another shape.
    """
    if distance is None and unit is None:
        return np.ones(())
    if distance is None or not unit or domain.kind is not DepthKind.DISTANCE:
        raise InputError(
            given=(
                f"The camera is {camera.name}, the distance {'absent' if distance is None else 'given'}, its unit "
                f"{unit!r}."
            ),
            needed="A distance, together with its unit, belongs to a pinhole camera.",
            remedy="Give both or neither to a pinhole camera; give an orthographic one the size of its pixels instead.",
        )
    away = np.asarray(distance)
    if away.shape not in {(), domain.shape} or away.dtype.kind not in "fiu":
        raise InputError(
            given=f"The distance is an array of shape {away.shape} and type {away.dtype}.",
            needed=f"It must be one number, or one for each of the {domain.shape} pixels.",
            remedy="Use the depth map that belongs to the normals.",
        )
    away = away.astype(np.float64)
    if away.ndim:
        away = np.where(domain.inside, away[domain.window], np.nan)
    if not np.isfinite(away).any() or bool(np.any((away <= 0) | np.isinf(away))):
        raise InputError(
            given="A distance is 0, negative or infinite, or none is known.",
            needed="Distances along the optical axis are positive lengths, NaN where unknown.",
            remedy="Check the depth map and its mask.",
        )
    return away
