"""One resolution of the variational problem, and the pyramid of them."""

from dataclasses import dataclass

import numpy as np

from psstereo.types import Array, BoolArray, FloatArray

__all__ = ["Grid", "coarser", "edges_of", "finer", "pyramid"]

_SMALLEST = 16
"""Shorter side below which a grid is not made coarser [px]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Grid:
    """Everything that the energy needs at one resolution; lengths in its own pixels.

    Attributes
    ----------
    inside, free : bool arrays (h, w)
        Pixels of the surface, and those of them whose height is not known.
    east, south : bool arrays (h, w)
        Whether a pixel has an edge to its right and to the one below.
    target, weight : float64 arrays (h, w)
        Brightness as a share of the light's greatest, and the weight of its square; 0 where it says nothing [1].
    dark : bool array (h, w)
        Pixels whose brightness is only a bound.
    frame : float64 array (3, 3, 3)
        Normals from slopes, see :mod:`psstereo.kernels.shading_step`.
    light : float64 array (10,)
        The same for the light.
    known : float64 array (h, w)
        Heights of the pixels inside that are not free, 0 elsewhere [px].
    prior, prior_weight : float64 arrays (h, w) or of size 0
        Heights wanted [px], and the weight of the square of a deviation [1].
    """

    inside: BoolArray
    free: BoolArray
    east: BoolArray
    south: BoolArray
    target: FloatArray
    weight: FloatArray
    dark: BoolArray
    frame: FloatArray
    light: FloatArray
    known: FloatArray
    prior: FloatArray
    prior_weight: FloatArray


def edges_of(inside: BoolArray) -> tuple[BoolArray, BoolArray]:
    """Return which pixels have a neighbour to the right and below, bool (h, w) each."""
    east, south = np.zeros_like(inside), np.zeros_like(inside)
    east[:, :-1] = inside[:, :-1] & inside[:, 1:]
    south[:-1] = inside[:-1] & inside[1:]
    return east, south


def pyramid(finest: Grid) -> list[Grid]:
    """Return a grid and its coarser ones, halved while the shorter side stays above 16 pixels, finest first."""
    grids = [finest]
    while min(grids[-1].inside.shape) >= 2 * _SMALLEST:
        following = coarser(grids[-1])
        if not following.free.any():
            break
        grids.append(following)
    return grids


def coarser(grid: Grid) -> Grid:
    """Return the same problem with half the rows and columns.

    A coarse pixel is inside if two of its four are. Brightness is the mean of those that say something; a coarse pixel
    is dark if most of them are, and known if one of them is.
    """
    count = _sums(grid.inside)
    inside = count >= 2
    east, south = edges_of(inside)
    weight = _sums(grid.weight)
    known_count = _sums(grid.inside & ~grid.free)
    free = inside & (known_count == 0)
    prior = prior_weight = np.zeros((0, 0))
    if grid.prior_weight.size:
        total = _sums(grid.prior_weight)
        prior = 0.5 * _sums(grid.prior_weight * grid.prior) / np.where(total > 0, total, 1.0)
        # A deviation is half as long in coarse pixels, so its square counts four times, on the mean of four pixels.
        prior_weight = np.where(inside, total, 0.0)
    frame = grid.frame.copy()
    frame[:, 0] += 0.5 * (grid.frame[:, 1] + grid.frame[:, 2])
    frame[:, 1:] *= 2.0
    known = 0.5 * _sums(np.where(grid.free, 0.0, grid.known)) / np.maximum(known_count, 1)
    return Grid(
        inside=inside,
        free=free,
        east=east,
        south=south,
        target=np.where(inside, _sums(grid.weight * grid.target) / np.where(weight > 0, weight, 1.0), 0.0),
        weight=np.where(inside, weight / np.maximum(count, 1), 0.0),
        dark=inside & (2 * _sums(grid.dark) > count),
        frame=frame,
        light=grid.light,
        known=np.where(inside & ~free, known, 0.0),
        prior=prior,
        prior_weight=prior_weight,
    )


def _sums(values: Array) -> FloatArray:
    """Return the sums over blocks of two by two pixels; a last odd row or column stands alone."""
    height, width = values.shape
    padded = np.zeros((height + height % 2, width + width % 2))
    padded[:height, :width] = values
    return np.asarray(padded[::2, ::2] + padded[1::2, ::2] + padded[::2, 1::2] + padded[1::2, 1::2])


def finer(values: FloatArray, coarse: Grid, fine: Grid) -> FloatArray:
    """Return heights of a coarse grid on the next finer one, known heights in their place.

    Bilinear between the centres of coarse pixels, of those that are inside; where none is, the nearest one's.
    """
    known = coarse.inside.astype(np.float64)
    total, weight = _spread(values * known, fine.inside.shape), _spread(known, fine.inside.shape)
    near = total / np.where(weight > 0, weight, 1.0)
    lost = fine.inside & (weight <= 0)
    if lost.any():
        from scipy.ndimage import distance_transform_edt

        rows, columns = distance_transform_edt(weight <= 0, return_distances=False, return_indices=True)
        near = np.where(lost, near[rows, columns], near)
    return np.where(fine.inside, np.where(fine.free, 2.0 * near, fine.known), 0.0)


def _spread(values: FloatArray, shape: tuple[int, int]) -> FloatArray:
    """Return values interpolated to twice the rows and columns: three quarters of the nearer, one of the farther."""
    for axis, size in enumerate(shape):
        moved = np.moveaxis(values, axis, 0)
        before = np.concatenate([moved[:1], moved[:-1]])
        after = np.concatenate([moved[1:], moved[-1:]])
        both = np.stack([0.75 * moved + 0.25 * before, 0.75 * moved + 0.25 * after], axis=1)
        values = np.moveaxis(both.reshape(-1, *moved.shape[1:])[:size], 0, axis)
    return np.ascontiguousarray(values)
