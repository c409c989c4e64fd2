r"""Which pixels have a usable normal, and the steps of the depth between neighbours: the readable reference in NumPy.

A chord of a plane or of a sphere is perpendicular to the sum of the two unit normals at its ends
(:mod:`psstereo.depth.edges` has the derivation). With the mid normal n = n_a + n_b the step from pixel a to b is

* parallel projection: ``z_b − z_a = −n·(x_b − x_a) / n_z`` with the points x of the plane z = 0;
* central projection: ``ln z_b − ln z_a = ln(−n·d_a) − ln(−n·d_b) = log1p(n·(d_b − d_a) / (−n·d_b))`` with the rays d,
  which keeps all digits where both are nearly the same.

Rays and points are given as a matrix M with M (column, row, 1) for each pixel, or as an array where no matrix does.
"""

import numpy as np

from psstereo.types import Array, BoolArray, FloatArray, IntArray

__all__ = ["AWAY", "BAD_WEIGHT", "INSIDE", "NO_NORMAL", "SHORTEST", "SMALLEST_COSINE", "SMALLEST_WEIGHT", "UNWEIGHED"]
__all__ += ["classify", "components", "steps", "unit_normals"]

INSIDE, NO_NORMAL, AWAY, UNWEIGHED, BAD_WEIGHT = range(1, 6)
"""What :func:`classify` says of a pixel that is wanted; 0 for those that are not."""
SMALLEST_COSINE = 1e-8
"""A slope of 10⁸ pixels a pixel is no information; its square is where double precision ends."""
SHORTEST = 1e-290
"""A vector without a component as large as this counts as zero: its inverse would overflow."""
SMALLEST_WEIGHT = 1e-30
"""Relative weight below which an edge counts as absent."""


def places_of(matrix: FloatArray, array: FloatArray, first: int, last: int, width: int) -> FloatArray:
    """Return the vectors of the pixels of some rows.

    Parameters
    ----------
    matrix : float64 array (3, 3)
        The vector of a pixel is the matrix times (column, row, 1).
    array : float64 array (h, w, 3) or of size 0
        The vectors themselves, instead.
    first, last : int
        Rows.
    width : int
        Columns.

    Returns
    -------
    float64 array (last − first, w, 3)
        Vectors.
    """
    if array.size:
        return array[first:last]
    columns = np.arange(width, dtype=np.float64)
    rows = np.arange(first, last, dtype=np.float64)
    return np.asarray(columns[None, :, None] * matrix[:, 0] + (rows[:, None, None] * matrix[:, 1] + matrix[:, 2]))


def unit_normals(normals: Array, first: int, last: int) -> tuple[FloatArray, BoolArray]:
    """Return float64 normals of unit length, and where there is one (zero elsewhere).

    Parameters
    ----------
    normals : float array (h, w, 3)
        Vectors of any length.
    first, last : int
        Rows.

    Returns
    -------
    unit : float64 array (last − first, w, 3)
        Unit vectors.
    known : bool array (last − first, w)
        Finite and not zero.
    """
    part = normals[first:last]
    known: BoolArray = np.asarray(np.isfinite(part).all(axis=-1))
    unit = np.where(known[..., None], part, 0.0).astype(np.float64, copy=False)
    # Divided by the largest component first, so that squares neither overflow nor vanish.
    largest = np.abs(unit).max(axis=-1, keepdims=True)
    known &= largest[..., 0] >= SHORTEST
    unit = unit / np.maximum(largest, SHORTEST)
    length = np.sqrt(np.sum(unit * unit, axis=-1, keepdims=True))
    return unit / np.where(length > 0, length, 1.0), known


def classify(
    normals: Array,
    wanted: BoolArray,
    weights: FloatArray,
    matrix: FloatArray,
    rays: FloatArray,
    state: Array,
    counts: IntArray,
    first: int,
    last: int,
) -> None:
    """Say of each pixel whether it can be used, and why not.

    Parameters
    ----------
    normals : float array (h, w, 3)
        Vectors of any length.
    wanted : bool array (h, w)
        The mask.
    weights : float64 array (h, w) or of size 0
        Weights of the pixels.
    matrix, rays : float64 arrays (3, 3) and (h, w, 3) or of size 0
        Viewing rays, see :func:`places_of`.
    state : uint8 array (h, w)
        Filled on the rows.
    counts : int64 array (h, 6)
        Number of pixels in each state; filled on the rows.
    first, last : int
        Rows.
    """
    unit, known = unit_normals(normals, first, last)
    direction = places_of(matrix, rays, first, last, normals.shape[1])
    facing = np.sum(unit * direction, axis=-1) < 0
    found = np.where(known, np.where(facing, INSIDE, AWAY), NO_NORMAL)
    if weights.size:
        weight = weights[first:last]
        good = (weight >= 0) & np.isfinite(weight)
        found = np.where((found == INSIDE) & ~(weight > 0), UNWEIGHED, found)
        found = np.where(((found == INSIDE) | (found == UNWEIGHED)) & ~good, BAD_WEIGHT, found)
    state[first:last] = np.where(wanted[first:last], found, 0)
    for k in range(6):
        counts[first:last, k] = np.count_nonzero(state[first:last] == k, axis=1)


def steps(
    normals: Array,
    top: int,
    left: int,
    inside: BoolArray,
    weights: FloatArray,
    matrix: FloatArray,
    places: FloatArray,
    central: bool,
    exponent: float,
    keen: float,
    right: FloatArray,
    down: FloatArray,
    right_weight: FloatArray,
    down_weight: FloatArray,
    lost: IntArray,
    first: int,
    last: int,
) -> None:
    """Fill the steps and weights of the edges to the right of and below some rows.

    Parameters
    ----------
    normals : float array (h', w', 3)
        Vectors of any length, of the whole image.
    top, left : int
        Where the domain's rectangle begins in it.
    inside : bool array (h, w)
        Pixels of the rectangle to use.
    weights : float64 array (h, w) or of size 0
        Weights of the pixels.
    matrix, places : float64 arrays (3, 3) and (h, w, 3) or of size 0
        Rays or points, see :func:`places_of`.
    central : bool
        Whether these are rays.
    exponent : float
        An edge weighs the cosine of its slant to this power [1].
    keen : float
        ... and is divided by (1 + keen · d²)², with d the distance between the tips of both unit normals [1].
    right, right_weight : float64 arrays (h, w − 1)
        Filled on the rows.
    down, down_weight : float64 arrays (h − 1, w)
        Filled on the rows.
    lost : int64 array (h,)
        Edges inside the domain that are not usable; filled on the rows.
    first, last : int
        Rows.
    """
    end = min(last + 1, inside.shape[0])
    unit = unit_normals(normals[:, left : left + inside.shape[1]], top + first, top + end)[0]
    where = places_of(matrix, places, first, end, inside.shape[1])
    heavy = weights[first:end] if weights.size else weights
    used, rows, below = inside[first:end], last - first, end - first - 1
    everything = slice(None)
    along = ((slice(0, rows), slice(None, -1)), (slice(0, rows), slice(1, None)))
    lost[first:last] = _fill(
        unit, where, used, heavy, along, central, exponent, keen, right[first:last], right_weight[first:last]
    )
    across = ((slice(0, below), everything), (slice(1, below + 1), everything))
    part = slice(first, first + below)
    lost[part] += _fill(unit, where, used, heavy, across, central, exponent, keen, down[part], down_weight[part])


def _fill(
    unit: FloatArray,
    where: FloatArray,
    used: BoolArray,
    heavy: FloatArray,
    ends: tuple[tuple[slice, slice], tuple[slice, slice]],
    central: bool,
    exponent: float,
    keen: float,
    step: FloatArray,
    weight: FloatArray,
) -> IntArray:
    """Fill steps and weights of the edges between two sets of pixels; return how many of each row are unusable."""
    a, b = ends
    pairs = used[a] & used[b]
    chord, cosine = _chord(unit[a] + unit[b], where[a], where[b], central)
    usable = pairs & (cosine > SMALLEST_COSINE)
    apart = unit[a] - unit[b]
    found = np.where(usable, cosine, 0.0) ** exponent / (1.0 + keen * _dot(apart, apart)) ** 2
    if heavy.size:
        total = heavy[a] + heavy[b]
        found = found * (2.0 * heavy[a] * (heavy[b] / np.where(total > 0, total, 1.0)))
    usable &= found > SMALLEST_WEIGHT
    step[...], weight[...] = np.where(usable, chord, 0.0), np.where(usable, found, 0.0)
    return np.asarray(np.count_nonzero(pairs & ~usable, axis=1))


def _chord(middle: FloatArray, a: FloatArray, b: FloatArray, central: bool) -> tuple[FloatArray, FloatArray]:
    """Return the steps and the cosine between the mid normal and the direction to the camera (smaller of both ends).

    A cosine of 0 or less means that the chord never meets the other ray in front of the camera; the step is then 0.
    """
    length = np.sqrt(_dot(middle, middle))
    # Outside the domain normals may be zero: any positive length keeps the division quiet, the result is not used.
    length = np.where(length > 0, length, 1.0)
    if not central:
        facing = middle[..., 2]
        usable = facing > SMALLEST_COSINE * length
        return np.where(usable, -_dot(middle, b - a) / np.where(usable, facing, 1.0), 0.0), facing / length
    at_a, at_b = -_dot(middle, a), -_dot(middle, b)
    cosine = np.minimum(at_a / np.sqrt(_dot(a, a)), at_b / np.sqrt(_dot(b, b))) / length
    usable = cosine > SMALLEST_COSINE
    return np.log1p(np.where(usable, _dot(middle, b - a) / np.where(usable, at_b, 1.0), 0.0)), cosine


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2])


def components(inside: BoolArray, right_weight: FloatArray, down_weight: FloatArray, labels: IntArray) -> int:
    """Number the pieces of a domain that edges hold together.

    Parameters
    ----------
    inside : bool array (h, w)
        Pixels of the domain.
    right_weight, down_weight : float64 arrays (h, w − 1) and (h − 1, w)
        Weights of the edges.
    labels : int32 array (h, w)
        Filled: 1, 2, … in the order of each component's first pixel; 0 outside.

    Returns
    -------
    int
        Number of components.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    index = np.cumsum(inside).reshape(inside.shape) - 1
    right, below = right_weight > 0, down_weight > 0
    start = np.concatenate([index[:, :-1][right], index[:-1][below]])
    stop = np.concatenate([index[:, 1:][right], index[1:][below]])
    count = int(np.count_nonzero(inside))
    graph = coo_array((np.ones(start.size, np.int8), (start, stop)), shape=(count, count))
    number, found = connected_components(graph, directed=False)
    labels[...] = 0
    labels[inside] = found + 1
    return int(number)
