"""From normals that are larger than memory to edges in files: what is done once, tile by tile."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from psstereo.camera import Camera
from psstereo.depth.domain import COMPILED, Domain, make_domain
from psstereo.depth.edges import EdgeSteps, components_of, edge_steps
from psstereo.depth.poisson import Poisson
from psstereo.depth.prior import Prior, prior_values
from psstereo.depth.tiles import FileArray, Tile, Window
from psstereo.kernels.dispatch import kernel
from psstereo.kernels.poisson_steps import INSIDE
from psstereo.results import DepthKind
from psstereo.types import Array, BoolArray, FloatArray, IntArray

__all__ = ["EdgeFiles", "Piece", "Source", "classify", "find_edges", "join"]


@dataclass(frozen=True, kw_only=True)
class EdgeFiles:
    """The equations of the image, in files; the edges stand at their left or upper pixel.

    Attributes
    ----------
    inside, labels : FileArray
        Pixels of the domain (uint8), and the components (int32).
    right, down, right_weight, down_weight : FileArray
        Steps and weights of the edges (float64).
    prior, prior_weight : FileArray or None
        Prior and its weight (float64).
    """

    inside: FileArray
    labels: FileArray
    right: FileArray
    down: FileArray
    right_weight: FileArray
    down_weight: FileArray
    prior: FileArray | None
    prior_weight: FileArray | None

    @classmethod
    def make(cls, folder: Path, shape: tuple[int, int], *, prior: bool) -> "EdgeFiles":
        """Make the files, all zero.

        Parameters
        ----------
        folder : Path
            Where.
        shape : (int, int)
            Rows and columns of the image.
        prior : bool
            Whether there is a prior.

        Returns
        -------
        EdgeFiles
            The files.
        """

        def new(name: str, dtype: str = "f8") -> FileArray:
            return FileArray.make(folder / name, shape, dtype)

        return cls(
            inside=new("inside", "u1"),
            labels=new("labels", "i4"),
            right=new("right"),
            down=new("down"),
            right_weight=new("right_weight"),
            down_weight=new("down_weight"),
            prior=new("prior") if prior else None,
            prior_weight=new("prior_weight") if prior else None,
        )

    def steps(self, window: Window) -> tuple[EdgeSteps, FloatArray, FloatArray]:
        """Return the edges within a window, and the prior and its weight there, of size 0 if there is none."""
        rows, columns = window
        across, below = (rows, slice(columns.start, columns.stop - 1)), (slice(rows.start, rows.stop - 1), columns)
        steps = EdgeSteps(
            right=self.right.read(across),
            down=self.down.read(below),
            right_weight=self.right_weight.read(across),
            down_weight=self.down_weight.read(below),
            left_out=0,
        )
        none = np.zeros((0, 0))
        if self.prior is None or self.prior_weight is None:
            return steps, none, none
        return steps, self.prior.read(window), self.prior_weight.read(window)


@dataclass(frozen=True, kw_only=True, eq=False)
class Source:
    """What the caller gave, and how windows of it are read.

    Attributes
    ----------
    normals, mask, weights : path, array or None
        Arrays or what can be sliced like one, or ``.npy`` files, which are opened for each window.
    shape : (int, int)
        Rows and columns.
    camera : Camera
        The camera.
    integrator : Poisson
        How edges are weighed.
    prior : Prior or None
        Depth known beforehand; its arrays may be memory maps.
    compiled : bool
        Whether to use the compiled loops.
    largest : float
        The largest weight of a pixel of the domain; 1 until it is known.
    """

    normals: Any
    mask: Any
    weights: Any
    shape: tuple[int, int]
    camera: Camera
    integrator: Poisson
    prior: Prior | None
    compiled: bool
    largest: float = 1.0

    def read(self, given: Any, window: Window) -> Array:
        """Return a window of one of the arrays in memory."""
        whole = np.load(given, mmap_mode="r") if isinstance(given, Path) else given
        return np.ascontiguousarray(whole[window[0], window[1]])

    def directions(self, window: Window) -> tuple[DepthKind, FloatArray, FloatArray]:
        """Return what is looked for, and the matrices of rays and of places by columns and rows of a window."""
        # One pixel whose normal faces the camera: only the camera's matrix is wanted.
        facing = make_domain(np.array([[[0.0, 0.0, 1.0]]]), self.camera, None, None)
        places = facing.matrix.copy()
        places[:, 2] += places[:, 0] * window[1].start + places[:, 1] * window[0].start
        if facing.kind is DepthKind.DISTANCE:
            return facing.kind, places, places
        return facing.kind, np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, -1.0]]), places

    def domain(self, window: Window, inside: BoolArray) -> Domain:
        """Return a window as a domain of its own, not cut to the pixels inside."""
        kind, _, places = self.directions(window)
        weights = None
        if self.weights is not None:
            heavy = self.read(self.weights, window).astype(np.float64)
            weights = np.where(inside, heavy, 0.0) / self.largest
        return Domain(
            given=_normals(self.read(self.normals, window)),
            inside=inside,
            kind=kind,
            weights=weights,
            window=(slice(0, inside.shape[0]), slice(0, inside.shape[1])),
            shape=(inside.shape[0], inside.shape[1]),
            left_out={},
            matrix=places,
            array=np.zeros((0, 0, 0)),
        )

    def prior_of(self, window: Window, domain: Domain) -> tuple[FloatArray, FloatArray]:
        """Return the prior's values and weights on a window."""
        if self.prior is None:
            return np.zeros((0, 0)), np.zeros((0, 0))
        depth = self.read(self.prior.depth, window)
        if not (domain.inside & ~np.isnan(depth)).any():
            return np.zeros(depth.shape), np.zeros(depth.shape)
        sigma = self.prior.sigma if np.ndim(self.prior.sigma) == 0 else self.read(self.prior.sigma, window)
        return prior_values(replace(self.prior, depth=depth, sigma=sigma), domain, self.camera)


def _normals(part: Array) -> FloatArray:
    return part if part.dtype in (np.float32, np.float64) else part.astype(np.float64)


def classify(source: Source, files: EdgeFiles, tile: Tile) -> tuple[IntArray, float]:
    """Write which pixels of a tile are inside.

    Parameters
    ----------
    source : Source
        What was given.
    files : EdgeFiles
        Where it is written.
    tile : Tile
        The tile.

    Returns
    -------
    counts : int64 array (6,)
        Pixels in each of the states of :mod:`psstereo.kernels.poisson_steps`.
    largest : float
        Largest weight of a pixel inside; 0 if there is none.
    """
    normals = _normals(source.read(source.normals, tile.core))
    shape = normals.shape[:2]
    wanted = np.ones(shape, np.bool_) if source.mask is None else source.read(source.mask, tile.core)
    heavy = np.zeros((0, 0))
    if source.weights is not None:
        heavy = source.read(source.weights, tile.core).astype(np.float64)
    state, counts = np.zeros(shape, np.uint8), np.zeros((shape[0], 6), np.int64)
    rays = source.directions(tile.core)[1]
    run = kernel("poisson_steps", "classify", COMPILED if source.compiled else 0, COMPILED)
    run(normals, wanted, heavy, rays, np.zeros((0, 0, 0)), state, counts, 0, shape[0])
    inside = state == INSIDE
    files.inside.write(tile.core, inside)
    largest = float(heavy[inside].max(initial=0.0)) if heavy.size else float(inside.any())
    return counts.sum(axis=0), largest


@dataclass(frozen=True, kw_only=True, eq=False)
class Piece:
    """What a tile knows of its components, numbered from 1 within the tile.

    Attributes
    ----------
    first : int64 array (n + 1,)
        Index of each component's first pixel in the image; entry 0 means nothing.
    sizes : int64 array (n + 1,)
        Pixels.
    sums : float64 array (3, n + 1)
        Energy of the steps, weight of the prior, and weight times prior.
    top, bottom, left, right : int32 arrays
        Components along the borders.
    below, beside : bool arrays
        Where edges lead on to the tile below and to the one to the right.
    edges, edges_left_out : int
        Edges with weight, and pairs of neighbours without a usable step.
    largest : float
        Largest weight of an edge or of the prior.
    """

    first: IntArray
    sizes: IntArray
    sums: FloatArray
    top: IntArray
    bottom: IntArray
    left: IntArray
    right: IntArray
    below: BoolArray
    beside: BoolArray
    edges: int
    edges_left_out: int
    largest: float


def find_edges(source: Source, files: EdgeFiles, tile: Tile) -> Piece:
    """Write the edges that begin in a tile, and the components within it.

    Parameters
    ----------
    source : Source
        What was given.
    files : EdgeFiles
        Where it is written.
    tile : Tile
        The tile.

    Returns
    -------
    Piece
        What it takes to join the tiles' components.
    """
    window = tile.grown(1, before=0)
    inside = files.inside.read(window).astype(np.bool_)
    domain = source.domain(window, inside)
    way = source.integrator
    steps = edge_steps(domain, slant_exponent=way.slant_exponent, turn=way.turn, threads=way.threads)
    height, width = (part.stop - part.start for part in tile.core)
    right, right_weight, beside_pairs = _cut(steps.right, steps.right_weight, inside, (0, 1), (height, width))
    down, down_weight, below_pairs = _cut(steps.down, steps.down_weight, inside, (1, 0), (height, width))
    for file, part in (
        (files.right, right),
        (files.down, down),
        (files.right_weight, right_weight),
        (files.down_weight, down_weight),
    ):
        file.write(tile.core, part)
    prior, prior_weight = source.prior_of(window, domain)
    prior, prior_weight = prior[:height, :width], prior_weight[:height, :width]
    if files.prior is not None and files.prior_weight is not None:
        files.prior.write(tile.core, prior)
        files.prior_weight.write(tile.core, prior_weight)
    within = EdgeSteps(
        right=right[:, :-1],
        down=down[:-1],
        right_weight=np.ascontiguousarray(right_weight[:, :-1]),
        down_weight=np.ascontiguousarray(down_weight[:-1]),
        left_out=0,
    )
    labels = components_of(within, np.ascontiguousarray(inside[:height, :width]))
    files.labels.write(tile.core, labels)
    flat, most = labels.ravel(), int(labels.max(initial=0)) + 1
    energy = right_weight * right**2 + down_weight * down**2
    edges = int(np.count_nonzero(right_weight) + np.count_nonzero(down_weight))
    zero = np.zeros(most)
    return Piece(
        first=_first(labels, tile),
        sizes=np.bincount(flat, minlength=most),
        sums=np.stack(
            [
                np.bincount(flat, energy.ravel(), most),
                np.bincount(flat, prior_weight.ravel(), most) if prior.size else zero,
                np.bincount(flat, (prior_weight * prior).ravel(), most) if prior.size else zero,
            ]
        ),
        top=labels[0].copy(),
        bottom=labels[-1].copy(),
        left=labels[:, 0].copy(),
        right=labels[:, -1].copy(),
        below=down_weight[-1] > 0,
        beside=right_weight[:, -1] > 0,
        edges=edges,
        edges_left_out=beside_pairs + below_pairs - edges,
        largest=max(float(part.max(initial=0.0)) for part in (right_weight, down_weight, prior_weight)),
    )


def _cut(
    step: FloatArray, weight: FloatArray, inside: BoolArray, to: tuple[int, int], size: tuple[int, int]
) -> tuple[FloatArray, FloatArray, int]:
    """Return the steps and weights of the edges that begin in a tile, 0 at the image's border, and the pairs there."""
    found = np.zeros((2, *size))
    rows, columns = min(step.shape[0], size[0]), min(step.shape[1], size[1])
    found[0, :rows, :columns] = step[:rows, :columns]
    found[1, :rows, :columns] = weight[:rows, :columns]
    pairs = inside[:rows, :columns] & inside[to[0] : to[0] + rows, to[1] : to[1] + columns]
    return found[0], found[1], int(np.count_nonzero(pairs))


def _first(labels: IntArray, tile: Tile) -> IntArray:
    """Return the index in the image of each component's first pixel."""
    rows, columns = np.nonzero(labels)
    first = np.zeros(int(labels.max(initial=0)) + 1, np.int64)
    # Backwards, so that what is written last is the first.
    index = (rows + tile.core[0].start) * tile.shape[1] + columns + tile.core[1].start
    first[labels[rows, columns][::-1]] = index[::-1]
    return first


def join(tiles: Sequence[Tile], pieces: Sequence[Piece]) -> tuple[list[IntArray], int]:
    """Number the components of the image from those of the tiles.

    Parameters
    ----------
    tiles : sequence of Tile
        Row by row.
    pieces : sequence of Piece
        What is known of each.

    Returns
    -------
    numbers : list of int32 arrays
        For each tile the number in the image of each of its components; entry 0 is 0.
    count : int
        Components of the image; 1, 2, … in the order of their first pixels.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    at = {(tile.core[0].start, tile.core[1].start): k for k, tile in enumerate(tiles)}
    offsets = np.cumsum([0, *(piece.first.size - 1 for piece in pieces)])
    starts, stops = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    for k, (tile, piece) in enumerate(zip(tiles, pieces, strict=True)):
        rows, columns = tile.core
        for place, edges, own, side in (
            ((rows.stop, columns.start), piece.below, piece.bottom, "top"),
            ((rows.start, columns.stop), piece.beside, piece.right, "left"),
        ):
            if edges.any():
                other = at[place]
                pairs = np.stack([own[edges] + offsets[k], getattr(pieces[other], side)[edges] + offsets[other]])
                pairs = np.unique(pairs - 1, axis=1)
                starts.append(pairs[0])
                stops.append(pairs[1])
    total = int(offsets[-1])
    start, stop = np.concatenate(starts), np.concatenate(stops)
    graph = coo_array((np.ones(start.size, np.int8), (start, stop)), shape=(total, total))
    count, found = connected_components(graph, directed=False)
    first = np.full(count, np.iinfo(np.int64).max)
    np.minimum.at(first, found, np.concatenate([piece.first[1:] for piece in pieces]))
    rank = np.zeros(count, np.int32)
    rank[np.argsort(first)] = np.arange(1, count + 1, dtype=np.int32)
    whole = rank[found]
    numbers = [np.concatenate([np.zeros(1, np.int32), whole[offsets[k] : offsets[k + 1]]]) for k in range(len(pieces))]
    return numbers, int(count)
