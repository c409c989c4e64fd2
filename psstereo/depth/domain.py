"""What an integrator works on: checked normals on the pixels that have one facing the camera."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from psstereo.camera import Camera
from psstereo.errors import InputError
from psstereo.results import DepthKind
from psstereo.types import Array, BoolArray, FloatArray

__all__ = ["Domain", "make_domain"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Domain:
    """Normals on the usable pixels, cut to their bounding rectangle.

    Attributes
    ----------
    normals : float64 array (h, w, 3)
        Unit normals, x right, y up, z toward the camera; zero outside [1].
    inside : bool array (h, w)
        Pixels with a usable normal.
    places : float64 array (h, w, 3)
        For distances the viewing rays with z component −1 [1]; for heights the points of the plane z = 0 [camera's
        unit].
    kind : DepthKind
        What is looked for: heights or distances.
    weights : float64 array (h, w) or None
        Weights of the pixels in 0 to 1, the largest 1; None where all count alike [1].
    window : (slice, slice)
        Rows and columns of the rectangle in the image.
    shape : (int, int)
        Rows and columns of the image.
    left_out : mapping
        Number of pixels of the mask that are not in the domain, by reason.
    """

    normals: FloatArray
    inside: BoolArray
    places: FloatArray
    kind: DepthKind
    weights: FloatArray | None
    window: tuple[slice, slice]
    shape: tuple[int, int]
    left_out: Mapping[str, int]


def make_domain(normals: Array, camera: Camera, mask: Array | None, weights: Array | None) -> Domain:
    """Check what an integrator is given and keep the pixels that can be used.

    Parameters
    ----------
    normals : float array (h, w, 3)
        Normals of any length, x right, y up, z toward the camera; NaN or zero where unknown [1].
    camera : Camera
        The camera.
    mask : bool array (h, w) or None
        Pixels wanted; None for all.
    weights : float array (h, w) or None
        Confidence of each pixel, an inverse variance of any common scale; 0 leaves a pixel out [1].

    Returns
    -------
    Domain
        Mask and finite normal and normal toward the camera and weight above zero.

    Raises
    ------
    InputError
        If shapes or types do not fit, a weight is negative or not a number, or nothing is left.
    """
    normals = _checked_normals(normals)
    shape = (normals.shape[0], normals.shape[1])
    wanted = np.ones(shape, np.bool_) if mask is None else _checked_mask(mask, shape)
    window = _bounding_window(wanted)
    unit, known = _unit(normals[window])
    kind = camera.depth_kind
    rays = camera.rays(shape)[window]
    wanted = wanted[window]
    facing = known & (np.sum(unit * rays, axis=-1) < 0)
    heavy = np.ones(wanted.shape, np.bool_)
    if weights is not None:
        weights = _checked_weights(weights, shape)[window]
        _refuse_bad_weights(weights, wanted & facing)
        heavy = weights > 0
    inside = wanted & facing & heavy
    left_out = {
        "no_normal": int(np.count_nonzero(wanted & ~known)),
        "facing_away": int(np.count_nonzero(wanted & known & ~facing)),
        "zero_weight": int(np.count_nonzero(wanted & facing & ~heavy)),
    }
    _refuse_empty(inside, int(np.count_nonzero(wanted)), left_out)
    inner = _bounding_window(inside)
    places = rays if kind is DepthKind.DISTANCE else camera.points(np.zeros(shape))[window]
    return Domain(
        normals=np.where(inside[..., None], unit, 0.0)[inner],
        inside=inside[inner],
        places=np.asarray(places[inner], np.float64),
        kind=kind,
        weights=None if weights is None else _relative(weights, inside)[inner],
        window=(_within(window[0], inner[0]), _within(window[1], inner[1])),
        shape=shape,
        left_out=left_out,
    )


def _checked_normals(normals: Array) -> FloatArray:
    normals = np.asarray(normals)
    if normals.ndim != 3 or normals.shape[2] != 3 or not np.issubdtype(normals.dtype, np.floating):
        raise InputError(
            given=f"The normals are an array of shape {normals.shape} and type {normals.dtype}.",
            needed="They must be floating-point numbers of shape (rows, columns, 3).",
            remedy="Decode a normal map picture to vectors first; its integers are not components.",
        )
    return normals


def _checked_mask(mask: Array, shape: tuple[int, int]) -> BoolArray:
    mask = np.asarray(mask)
    if mask.shape != shape or mask.dtype != np.bool_:
        raise InputError(
            given=f"The mask is an array of shape {mask.shape} and type {mask.dtype}, the normals have {shape} pixels.",
            needed="It must be true or false for each pixel of the normals.",
            remedy="Use the mask that belongs to the normals, compared with zero (mask > 0) if it is a picture.",
        )
    return mask


def _checked_weights(weights: Array, shape: tuple[int, int]) -> FloatArray:
    weights = np.asarray(weights)
    if weights.shape != shape or weights.dtype.kind not in "fiub":
        raise InputError(
            given=f"The weights are an array of shape {weights.shape} and type {weights.dtype}.",
            needed=f"There must be one real number for each of the {shape} pixels of the normals.",
            remedy="Give one weight a pixel, or leave the weights out.",
        )
    return np.asarray(weights, np.float64)


def _refuse_bad_weights(weights: FloatArray, used: BoolArray) -> None:
    bad = used & ~((weights >= 0) & np.isfinite(weights))
    if bad.any():
        raise InputError(
            given=f"{np.count_nonzero(bad)} pixels that have a normal have a weight that is negative or not finite.",
            needed="Weights must be 0 (leave the pixel out) or positive numbers.",
            remedy="Replace them, for instance by 0, or by a typical weight where the uncertainty is unknown.",
        )


def _refuse_empty(inside: BoolArray, wanted: int, left_out: Mapping[str, int]) -> None:
    if not inside.any():
        raise InputError(
            given=(
                f"None of {wanted} pixels in the mask can be integrated: {left_out['no_normal']} have no normal, "
                f"{left_out['facing_away']} face away from the camera, {left_out['zero_weight']} have weight 0."
            ),
            needed="At least one pixel needs a normal toward the camera and a weight above 0.",
            remedy="Check the mask and the axes: x right, y up, z toward the camera.",
        )


def _bounding_window(mask: BoolArray) -> tuple[slice, slice]:
    """Return the rows and columns that hold all true pixels; everything where there is none."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if rows.size == 0:
        return slice(0, mask.shape[0]), slice(0, mask.shape[1])
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)


def _within(outer: slice, inner: slice) -> slice:
    return slice(outer.start + inner.start, outer.start + inner.stop)


def _unit(normals: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return float64 normals of unit length, and where there is one (zero elsewhere)."""
    known: BoolArray = np.asarray(np.isfinite(normals).all(axis=-1))
    unit = np.where(known[..., None], normals, 0.0).astype(np.float64, copy=False)
    # Divided by the largest component first, so that squares neither overflow nor vanish.
    largest = np.abs(unit).max(axis=-1, keepdims=True)
    known &= largest[..., 0] > 0
    unit = unit / np.where(largest > 0, largest, 1.0)
    length = np.sqrt(np.sum(unit * unit, axis=-1, keepdims=True))
    return unit / np.where(length > 0, length, 1.0), known


def _relative(weights: FloatArray, inside: BoolArray) -> FloatArray:
    weights = np.where(inside, weights, 0.0)
    return np.asarray(weights / weights.max())
