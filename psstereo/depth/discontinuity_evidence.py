"""What normals alone say about each step between neighbours: whether it is broken, and how far to trust it.

Turning. Within a smooth surface the normal turns between two neighbours about as much as between the pairs next to
them on the same line. At a cliff, a crease or the outline of something in front it turns by far more; the ratio of the
turn to that of the pairs two and three pixels on, whichever side turns more, tells them apart at any curvature and
any noise, since noise raises both.

Bridging. A cliff's two sides have the same normals where its height is largest or constant along it, so that the line
of outliers has gaps there. A gap between two runs of outliers on a straight line that are both long compared with it
is taken for part of the line.

Trust. From the plane through one pixel follows a step, from that through the other another; the chord of
:mod:`psstereo.depth.edges` is their mean but for terms of third order. The distance of the two therefore measures what
the chord may be wrong by: nothing on planes, and much on steep folds that the grid resolves badly, which bias whatever
hangs on them.
"""

import numpy as np

from psstereo.depth.domain import Domain
from psstereo.results import DepthKind
from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["bridged", "centred_prior", "cosines", "edge_ends", "medians", "pixel_pitch", "plane_steps", "turning"]

_SMALLEST_COSINE = 1e-8
"""A plane that never meets the other ray is cut off here: its step only says "not to be trusted" [1]."""
_SHEARS = (-1.0, -0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0)
_SHORTEST_RUN = 5
_GAP_TO_RUN = 0.5
_FLOOR = 0.5
"""Share of the typical turn that is added to that of the pairs next to an edge, lest flat parts flag rounding [1]."""

Pair = tuple[tuple[slice, slice], tuple[slice, slice]]


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return products of vectors; a reduction over an axis of three takes five times as long."""
    return np.asarray(a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2])


def edge_ends() -> tuple[Pair, Pair]:
    """Return the slices of both ends of the edges to the right, and of those downward."""
    everything, first, last = slice(None), slice(None, -1), slice(1, None)
    return ((everything, first), (everything, last)), ((first, everything), (last, everything))


def pixel_pitch(domain: Domain) -> float:
    """Return the distance of neighbouring pixels on the image's plane, the geometric mean of both directions.

    Parameters
    ----------
    domain : Domain
        The domain.

    Returns
    -------
    float
        Distance in the unit of the places, 1 for a single pixel [camera's unit, or 1].
    """
    found = [
        float(np.sqrt(np.sum((domain.places[b][:1, :1] - domain.places[a][:1, :1]) ** 2)))
        for a, b in edge_ends()
        if domain.places[b].size
    ]
    return float(np.exp(np.mean(np.log(found)))) if found else 1.0


def centred_prior(domain: Domain, components: IntArray) -> tuple[FloatArray | None, FloatArray]:
    """Return the domain's prior less its weighted mean over each component, and that mean at each pixel.

    Solvers stop relative to the size of the right side, which without the mean is the relief, not the distance.

    Parameters
    ----------
    domain : Domain
        The domain.
    components : int array (h, w)
        Connected components, from 1; 0 outside.

    Returns
    -------
    prior : float64 array (h, w) or None
        Values wanted where the prior has weight, 0 elsewhere; None without a prior [camera's unit, or 1].
    mean : float64 array (h, w)
        What was taken off, to be added to the solution [camera's unit, or 1].
    """
    if domain.prior is None or domain.prior_weight is None:
        return None, np.zeros(components.shape)
    labels, weight = components.ravel(), domain.prior_weight.ravel()
    total = np.bincount(labels, weight)
    mean = (np.bincount(labels, weight * domain.prior.ravel()) / np.where(total > 0, total, 1.0))[components]
    return np.where(domain.prior_weight > 0, domain.prior - mean, 0.0), mean


def cosines(domain: Domain) -> FloatArray:
    """Return the cosine between each normal and the direction to the camera, 0 outside.

    Parameters
    ----------
    domain : Domain
        The domain.

    Returns
    -------
    float64 array (h, w)
        The cosines [1].
    """
    if domain.kind is DepthKind.HEIGHT:
        return np.asarray(domain.normals[..., 2].copy())
    length = np.sqrt(_dot(domain.places, domain.places))
    return -_dot(domain.normals, domain.places) / length


def plane_steps(domain: Domain, ends: Pair) -> tuple[FloatArray, FloatArray]:
    """Return the steps that the planes through either end of each edge predict.

    Parameters
    ----------
    domain : Domain
        The domain.
    ends : pair of slices
        Both ends of the edges, from :func:`edge_ends`.

    Returns
    -------
    first, second : float64 arrays
        Value at the second end minus value at the first, by the plane through the first and through the second end; 0
        where there is no edge [camera's unit, or 1].
    """
    a, b = ends
    pairs = domain.inside[a] & domain.inside[b]
    if domain.kind is DepthKind.HEIGHT:
        across = domain.places[b] - domain.places[a]
        steps = [
            -(n[..., 0] * across[..., 0] + n[..., 1] * across[..., 1]) / np.maximum(n[..., 2], _SMALLEST_COSINE)
            for n in (domain.normals[a], domain.normals[b])
        ]
    else:
        steps = [
            np.log(np.maximum(-_dot(n, domain.places[a]), _SMALLEST_COSINE))
            - np.log(np.maximum(-_dot(n, domain.places[b]), _SMALLEST_COSINE))
            for n in (domain.normals[a], domain.normals[b])
        ]
    return np.where(pairs, steps[0], 0.0), np.where(pairs, steps[1], 0.0)


def medians(values: FloatArray, labels: IntArray, count: int) -> FloatArray:
    """Return the median of each component's values.

    Parameters
    ----------
    values : float64 array (n,)
        Values, without NaN [any unit].
    labels : int array (n,)
        Component of each value, from 1.
    count : int
        Number of components.

    Returns
    -------
    float64 array (count + 1,)
        Lower median of each component, 0 where it has no value.
    """
    found = np.zeros(count + 1)
    if count == 1 and values.size:
        found[1] = np.partition(values, (values.size - 1) // 2)[(values.size - 1) // 2]
    elif values.size:
        order = np.lexsort((values, labels))
        sizes = np.bincount(labels, minlength=count + 1)
        first = np.cumsum(sizes) - sizes
        held = sizes > 0
        found[held] = values[order[first[held] + (sizes[held] - 1) // 2]]
    return found


def turning(domain: Domain, components: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return by how much the normal turns across each edge, in terms of its turning nearby.

    Parameters
    ----------
    domain : Domain
        The domain.
    components : int array (h, w)
        Connected components, from 1; 0 outside.

    Returns
    -------
    right, down : float64 arrays (h, w − 1) and (h − 1, w)
        About 1 on smooth surfaces, far above at breaks; 0 where there is no pair, or none on either side of it [1].
    """
    turns, labels = [], []
    for a, b in edge_ends():
        difference = domain.normals[b] - domain.normals[a]
        pairs = domain.inside[a] & domain.inside[b]
        turns.append(np.where(pairs, np.sqrt(_dot(difference, difference)), np.nan))
        labels.append(np.where(pairs, components[a], 0))
    everything, owners = np.concatenate([t.ravel() for t in turns]), np.concatenate([p.ravel() for p in labels])
    known = owners > 0
    floor = _FLOOR * medians(everything[known], owners[known], int(components.max(initial=0)))
    ratios = []
    for turn, label, axis in zip(turns, labels, (1, 0), strict=True):
        beside = np.fmin(_shifted(turn, 2, axis), _shifted(turn, 3, axis))
        other = np.fmin(_shifted(turn, -2, axis), _shifted(turn, -3, axis))
        nearby = np.maximum(beside, other) + floor[label]
        usable = nearby > 0  # false for NaN as well
        ratios.append(np.where(usable & (label > 0), turn, 0.0) / np.where(usable, nearby, 1.0))
    return ratios[0], ratios[1]


def _shifted(array: FloatArray, by: int, axis: int) -> FloatArray:
    """Return the array moved along an axis, NaN where nothing came from."""
    moved = np.full_like(array, np.nan)
    size = array.shape[axis]
    if abs(by) >= size:
        return moved
    target, source = [slice(None)] * 2, [slice(None)] * 2
    target[axis] = slice(max(by, 0), size + min(by, 0))
    source[axis] = slice(max(-by, 0), size - max(by, 0))
    moved[tuple(target)] = array[tuple(source)]
    return moved


def bridged(outlier: BoolArray) -> BoolArray:
    """Return the gaps in lines of outliers that run down the image, straight or up to 45 degrees aslant.

    Parameters
    ----------
    outlier : bool array (h, w)
        Outliers among the edges to the right (transpose those downward).

    Returns
    -------
    bool array (h, w)
        Members of gaps that are at most half as long as the shorter of the runs at both ends.
    """
    filled = np.zeros(outlier.shape, np.bool_)
    rows, columns = np.nonzero(outlier)
    if rows.size == 0:
        return filled
    for shear in _SHEARS:
        lines = columns - np.rint(shear * rows).astype(columns.dtype)
        order = np.lexsort((rows, lines))
        row, line = rows[order], lines[order]
        together = np.diff(line) == 0
        step = np.diff(row)
        run = np.concatenate([[0], np.cumsum(~(together & (step == 1)))])
        lengths = np.bincount(run)
        shorter = np.minimum(lengths[run[:-1]], lengths[run[1:]])
        gap = together & (step > 1) & (shorter >= _SHORTEST_RUN) & (step - 1 <= _GAP_TO_RUN * shorter)
        for k in np.flatnonzero(gap):
            between = np.arange(row[k] + 1, row[k + 1])
            column = line[k] + np.rint(shear * between).astype(columns.dtype)
            filled[between, column] = True
    return filled & ~outlier
