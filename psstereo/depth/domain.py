"""What an integrator works on: checked normals on the pixels that have one facing the camera."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from psstereo.camera import Camera, Orthographic, Pinhole
from psstereo.depth.rows import Rows
from psstereo.errors import InputError
from psstereo.kernels.dispatch import kernel
from psstereo.kernels.poisson_steps import AWAY, BAD_WEIGHT, INSIDE, NO_NORMAL, UNWEIGHED, places_of, unit_normals
from psstereo.results import DepthKind
from psstereo.types import Array, BoolArray, FloatArray, IntArray

__all__ = ["COMPILED", "Domain", "make_domain"]

COMPILED = 100_000
"""Pixels from which loading the compiled loops pays."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Domain:
    """Normals on the usable pixels, cut to their bounding rectangle.

    Attributes
    ----------
    given : float array (H, W, 3)
        Normals of the whole image, of any length and with anything outside [1].
    inside : bool array (h, w)
        Pixels with a usable normal.
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
    matrix : float64 array (3, 3)
        `places` of a pixel are this times (column, row, 1), counted from the rectangle's corner, ...
    array : float64 array (h, w, 3) or of size 0
        ... or these, for cameras that no matrix describes.
    prior : float64 array (h, w) or None
        Depth known beforehand, as the values that are solved for: heights, or logarithms of distances; 0 where unknown.
    prior_weight : float64 array (h, w) or None
        Its weight beside an edge of two pixels of weight 1 that face the camera; 0 where there is none [1].
    """

    given: Array
    inside: BoolArray
    kind: DepthKind
    weights: FloatArray | None
    window: tuple[slice, slice]
    shape: tuple[int, int]
    left_out: Mapping[str, int]
    matrix: FloatArray
    array: FloatArray
    prior: FloatArray | None = None
    prior_weight: FloatArray | None = None

    @cached_property
    def normals(self) -> FloatArray:
        """Unit normals, x right, y up, z toward the camera; zero outside; float64 (h, w, 3) [1]."""
        unit = unit_normals(self.given[self.window], 0, self.inside.shape[0])[0]
        return np.where(self.inside[..., None], unit, 0.0)

    @cached_property
    def places(self) -> FloatArray:
        """Where the pixels look, float64 (h, w, 3).

        For distances the viewing rays with z component −1 [1]; for heights the points of the plane z = 0 [camera's
        unit].
        """
        return places_of(self.matrix, self.array, 0, *self.inside.shape)


def make_domain(
    normals: Array, camera: Camera, mask: Array | None, weights: Array | None, *, threads: int = 1
) -> Domain:
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
    threads : int
        Threads at most.

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
    heavy = np.zeros((0, 0)) if weights is None else _checked_weights(weights, shape)
    rays, matrix = _matrices(camera)
    ray_array = np.zeros((0, 0, 0)) if rays is not None else camera.rays(shape)
    state, counts = np.zeros(shape, np.uint8), np.zeros((shape[0], 6), np.int64)
    with Rows(threads) as rows:
        part = (normals, wanted, heavy, _or_zero(rays), ray_array, state, counts)
        rows(kernel("poisson_steps", "classify", wanted.size, COMPILED), part, 0, *shape)
    number = counts.sum(axis=0)
    _refuse_bad_weights(int(number[BAD_WEIGHT]))
    left_out = {
        "no_normal": int(number[NO_NORMAL]),
        "facing_away": int(number[AWAY]),
        "zero_weight": int(number[UNWEIGHED]),
    }
    _refuse_empty(int(number[INSIDE]), int(number[1:].sum()), left_out)
    window = _bounding_window(state, counts)
    inside = state[window] == INSIDE
    array: FloatArray = np.zeros((0, 0, 0))
    if matrix is None:
        array = ray_array if camera.depth_kind is DepthKind.DISTANCE else camera.points(np.zeros(shape))
        array = np.ascontiguousarray(array[window], np.float64)
    else:
        matrix[:, 2] += matrix[:, 0] * window[1].start + matrix[:, 1] * window[0].start
    return Domain(
        given=normals,
        inside=inside,
        kind=camera.depth_kind,
        weights=None if weights is None else _relative(heavy[window], inside),
        window=window,
        shape=shape,
        left_out=left_out,
        matrix=_or_zero(matrix),
        array=array,
    )


def _matrices(camera: Camera) -> tuple[FloatArray | None, FloatArray | None]:
    """Return what turns (column, row, 1) into rays and into places, or None twice if no matrix does."""
    if isinstance(camera, Orthographic):
        rays = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
        return rays, np.diag([camera.pixel_size, -camera.pixel_size, 0.0])
    if isinstance(camera, Pinhole):
        rays = np.linalg.inv(camera.matrix) * np.array([[1.0], [-1.0], [-1.0]])
        return rays, rays.copy()
    return None, None


def _or_zero(matrix: FloatArray | None) -> FloatArray:
    return np.zeros((3, 3)) if matrix is None else matrix


def _checked_normals(normals: Array) -> FloatArray:
    normals = np.asarray(normals)
    if normals.ndim != 3 or normals.shape[2] != 3 or not np.issubdtype(normals.dtype, np.floating):
        raise InputError(
            given=f"The normals are an array of shape {normals.shape} and type {normals.dtype}.",
            needed="They must be floating-point numbers of shape (rows, columns, 3).",
            remedy="Decode a normal map picture to vectors first; its integers are not components.",
        )
    if normals.dtype not in (np.float32, np.float64):
        normals = normals.astype(np.float64)
    return np.ascontiguousarray(normals)


def _checked_mask(mask: Array, shape: tuple[int, int]) -> BoolArray:
    mask = np.asarray(mask)
    if mask.shape != shape or mask.dtype != np.bool_:
        raise InputError(
            given=f"The mask is an array of shape {mask.shape} and type {mask.dtype}, the normals have {shape} pixels.",
            needed="It must be true or false for each pixel of the normals.",
            remedy="Use the mask that belongs to the normals, compared with zero (mask > 0) if it is a picture.",
        )
    return np.ascontiguousarray(mask)


def _checked_weights(weights: Array, shape: tuple[int, int]) -> FloatArray:
    weights = np.asarray(weights)
    if weights.shape != shape or weights.dtype.kind not in "fiub":
        raise InputError(
            given=f"The weights are an array of shape {weights.shape} and type {weights.dtype}.",
            needed=f"There must be one real number for each of the {shape} pixels of the normals.",
            remedy="Give one weight a pixel, or leave the weights out.",
        )
    return np.ascontiguousarray(weights, np.float64)


def _refuse_bad_weights(bad: int) -> None:
    if bad:
        raise InputError(
            given=f"{bad} pixels that have a normal have a weight that is negative or not finite.",
            needed="Weights must be 0 (leave the pixel out) or positive numbers.",
            remedy="Replace them, for instance by 0, or by a typical weight where the uncertainty is unknown.",
        )


def _refuse_empty(inside: int, wanted: int, left_out: Mapping[str, int]) -> None:
    if not inside:
        raise InputError(
            given=(
                f"None of {wanted} pixels in the mask can be integrated: {left_out['no_normal']} have no normal, "
                f"{left_out['facing_away']} face away from the camera, {left_out['zero_weight']} have weight 0."
            ),
            needed="At least one pixel needs a normal toward the camera and a weight above 0.",
            remedy="Check the mask and the axes: x right, y up, z toward the camera.",
        )


def _bounding_window(state: Array, counts: IntArray) -> tuple[slice, slice]:
    """Return the rows and columns that hold all pixels inside."""
    if int(counts[:, INSIDE].sum()) == state.size:
        return slice(0, state.shape[0]), slice(0, state.shape[1])
    rows = np.flatnonzero(counts[:, INSIDE])
    top, bottom = int(rows[0]), int(rows[-1]) + 1
    columns = np.flatnonzero((state[top:bottom] == INSIDE).any(axis=0))
    return slice(top, bottom), slice(int(columns[0]), int(columns[-1]) + 1)


def _relative(weights: FloatArray, inside: BoolArray) -> FloatArray:
    weights = np.where(inside, weights, 0.0)
    return np.asarray(weights / weights.max())
