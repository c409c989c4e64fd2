"""A map of radiances as a few beams, by splitting it where its light is spread most."""

import heapq
from itertools import count as counter
from itertools import pairwise

import numpy as np

from psstereo.lights.lat_long import cell_solid_angles, cell_squares, cell_vectors
from psstereo.types import FloatArray

__all__ = ["split_map"]

_CELLS = 64
"""Pixels for each rectangle that is wanted, at least, so that cuts fall near where they should [1]."""

_Box = tuple[int, int, int, int]


def split_map(radiance: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Return four beams for each of some rectangles that share out the light of a map.

    A rectangle of flux Φ = ∫ L dω and vector irradiance D = ∫ L ω dω is spread by Φ − |D|, half its angular variance
    for a narrow one. Starting from octants of the sphere, the most spread one is cut in two, along the row or column
    for which the sum of both parts' spreads is least, until there are enough. Unlike a cut at the median of the light,
    this does not go through lamps [1]_.

    One beam could keep only Φ or D: with D it sends too little to surfaces whose horizon cuts the rectangle, with Φ too
    much to all others. Four of Φ/4, at the corners of a smaller rectangle, keep both and the variance along its axes.

    Parameters
    ----------
    radiance : float64 array (h, w, c)
        L of the pixels [W m⁻² sr⁻¹], or relative.
    count : int
        How many rectangles are wanted; there may be fewer, or 8 if less is asked for [1].

    Returns
    -------
    tuple of float64 arrays (k, 3) and (k, c)
        Unit vectors [1] and irradiances of surfaces that face them [W m⁻²], or relative. Read-only.

    References
    ----------
    .. [1] K. Viriyothai, P. Debevec, "Variance Minimization Light Probe Sampling", SIGGRAPH 2009 Posters.
    """
    # Pixels of a coarse map are cut too, or its beams would be no finer than they are.
    finer = max(1, int(np.ceil(np.sqrt(_CELLS * count / (radiance.shape[0] * radiance.shape[1])))))
    cells = radiance.repeat(finer, axis=0).repeat(finer, axis=1)
    height, width, _ = cells.shape
    share = (cells / cells.mean(axis=(0, 1))).sum(axis=-1)  # so that every channel counts the same
    solid = cell_solid_angles(height, width)
    fluxes = np.concatenate([cell_vectors(height, width), np.full((height, width, 1), solid[:, None, None])], axis=-1)
    fluxes *= share[..., None]
    squares = cell_squares(height, width)
    directions, powers = [], []
    for a, b, c, d in _boxes(fluxes, [0, height // 2, height], [width * k // 4 for k in range(5)], count):
        directions.append(_corners(fluxes[a:b, c:d].sum(axis=(0, 1)), squares(share, a, b, c, d)))
        powers.append(0.25 * np.einsum("i,ijc->c", solid[a:b], cells[a:b, c:d]))
    around, sent = np.concatenate(directions), np.repeat(powers, 4, axis=0)
    around.flags.writeable = sent.flags.writeable = False
    return around, sent


def _corners(flux: FloatArray, square: FloatArray) -> FloatArray:
    """Return four unit vectors (4, 3) with the mean of a flux (4,), spread like its ∫ L ω ωᵀ dω (3, 3)."""
    length = np.sqrt(flux[:3] @ flux[:3])
    middle = flux[:3] / length
    across = np.eye(3) - np.outer(middle, middle)
    values, axes = np.linalg.eigh(across @ square @ across)
    first = axes[:, 2] - (axes[:, 2] @ middle) * middle
    first /= np.sqrt(first @ first)
    shares = np.maximum(values[1:], 0.0)
    cosine = min(length / flux[3], 1.0)
    narrow, wide = np.sqrt((1.0 - cosine) * (1.0 + cosine) * shares / shares.sum())
    along, aside = wide * first, narrow * np.cross(middle, first)
    return np.stack([cosine * middle + i * along + j * aside for i in (1, -1) for j in (1, -1)])


def _boxes(fluxes: FloatArray, rows: list[int], columns: list[int], count: int) -> list[_Box]:
    """Return rectangles with light in them, of fluxes (h, w, 4), in the order in which they were cut."""
    order = counter()  # decides between equals, so that the outcome is the same everywhere
    heap: list[tuple[float, int, _Box, tuple[_Box, _Box]]] = []
    done: list[_Box] = []

    def add(box: _Box) -> None:
        part = fluxes[box[0] : box[1], box[2] : box[3]]
        if not part[..., 3].any():
            return
        cut = _best_cut(part, box)
        if cut is None:
            done.append(box)
        else:
            heapq.heappush(heap, (-float(_spread(part.sum(axis=(0, 1)))), next(order), box, cut))

    for a, b in pairwise(rows):
        for c, d in pairwise(columns):
            add((a, b, c, d))
    while heap and len(heap) + len(done) < count:
        for half in heapq.heappop(heap)[3]:
            add(half)
    return sorted(done + [entry[2] for entry in heap])


def _spread(flux: FloatArray) -> FloatArray:
    """Return Φ − |D| of fluxes (..., 4)."""
    return np.asarray(flux[..., 3] - np.sqrt((flux[..., :3] ** 2).sum(axis=-1)))


def _best_cut(part: FloatArray, box: _Box) -> tuple[_Box, _Box] | None:
    """Return the two halves of a box whose spreads add up to the least, or None for a single pixel."""
    a, b, c, d = box
    best, halves = np.inf, None
    for axis, length in ((0, b - a), (1, d - c)):
        if length < 2:
            continue
        lines = part.sum(axis=1 - axis)
        before, after = np.cumsum(lines, axis=0)[:-1], np.cumsum(lines[::-1], axis=0)[-2::-1]
        spread = _spread(before) + _spread(after)
        at = int(np.argmin(spread))
        if spread[at] < best:
            best, k = float(spread[at]), at + 1
            halves = ((a, a + k, c, d), (a + k, b, c, d)) if axis == 0 else ((a, b, c, c + k), (a, b, c + k, d))
    return halves
