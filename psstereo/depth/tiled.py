"""Integration of normal maps that are larger than memory."""

import math
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from psstereo.camera import Camera
from psstereo.depth.poisson import Poisson
from psstereo.depth.prior import Prior
from psstereo.depth.tile_checks import checked_source, free_target, refuse_input
from psstereo.depth.tile_input import EdgeFiles, Piece, Source, classify, find_edges, join
from psstereo.depth.tile_output import Output, finish, relabel, totals
from psstereo.depth.tile_passes import Work
from psstereo.depth.tile_plan import TilePlan, plan_tiles
from psstereo.depth.tile_solve import Found, solve_tiles
from psstereo.depth.tiles import FileArray, Tile, make_tiles
from psstereo.kernels.poisson_steps import AWAY, INSIDE, NO_NORMAL, UNWEIGHED
from psstereo.results import DepthKind, Outcome
from psstereo.types import Array, FloatArray, IntArray, Map, Progress, no_progress

__all__ = ["TiledResult", "integrate_tiled"]

_TILE_TOLERANCE = 1e-2
"""Relative residual to which the tiles' own equations are solved in each iteration; smaller ones save none [1]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TiledResult:
    """A depth map in a file, and what belongs to it.

    Attributes
    ----------
    path : Path
        The ``.npy`` file of the depth, NaN outside.
    components_path : Path or None
        The ``.npy`` file of the components, int32, from 1; 0 outside. None if it was not asked for.
    kind : DepthKind
        Meaning of the numbers.
    unit : str
        As in :class:`~psstereo.results.DepthResult`.
    iterations : int
        Iterations over all tiles.
    residual : float
        Estimate of the worst component's relative error in the energy norm of the equations of the whole image [1].
    outcome : Outcome
        How the computation ended.
    facts : mapping
        Plain figures for the record, among them ``residual_length``: the length of the residual of the equations of
        the whole image, relative to their right side.
    """

    path: Path
    components_path: Path | None
    kind: DepthKind
    unit: str
    iterations: int
    residual: float
    outcome: Outcome
    facts: Mapping[str, Any] = field(default_factory=dict)

    @property
    def depth(self) -> FloatArray:
        """The depth as a memory map, read only, (h, w)."""
        return np.asarray(np.load(self.path, mmap_mode="r"))

    @property
    def components(self) -> IntArray | None:
        """The components as a memory map, read only, (h, w)."""
        return None if self.components_path is None else np.asarray(np.load(self.components_path, mmap_mode="r"))


def integrate_tiled(
    normals: Array | str | Path,
    camera: Camera,
    *,
    out: str | Path,
    mask: Array | str | Path | None = None,
    weights: Array | str | Path | None = None,
    prior: Prior | None = None,
    components: str | Path | None = None,
    integrator: Poisson | None = None,
    tolerance: float | None = None,
    max_memory: int = 1_000_000_000,
    tile: int | None = None,
    dtype: str = "float64",
    overwrite: bool = False,
    over: Map = map,
    progress: Progress = no_progress,
) -> TiledResult:
    r"""Integrate a normal map that is larger than memory, from file to file, without seams.

    The result is that of :class:`~psstereo.depth.poisson.Poisson` on the whole map, to the tolerance: the same edges,
    the same weights, the same equations, components numbered across all tiles. Edges are written to temporary files
    once. Each iteration then improves the depth in three ways that never raise the energy of the whole problem: a
    correction on a coarse grid of the whole image, in memory, and solves on tiles that overlap, in four sets, the
    values around a tile being held [1]_. The coarse grid is a level of the multigrid that preconditions the solution
    in memory, put together from the tiles to the last bit, so that corrections follow weights, holes and thin bridges,
    and the number of iterations does not grow with the number of tiles: 4 to 6 for smooth surfaces, 10 to 25 under
    much noise, thin bridges, or weights that jump from pixel to pixel.

    Do not use it where the map fits into memory: the integrator alone needs some 85 bytes a pixel and a sixth to a
    tenth of the time. Nor for mazes of corridors that run through many tiles: corrections creep along them, and the
    outcome may be that the tolerance was not met. Nor where the domain falls into millions of pieces: some 200 bytes
    are held in memory for each, beside `max_memory`. Of the integrators only Poisson is done by tiles; a depth that
    jumps needs another one.

    Parameters
    ----------
    normals : array (h, w, 3) or path
        Normals as for :meth:`~psstereo.depth.integrator.Integrator.integrate`: an array, anything that can be sliced
        like one (a memory map), or the path of an ``.npy`` file, which is opened for a tile at a time so that nothing
        of it counts as this process's memory [1].
    camera : Camera
        An orthographic or a pinhole camera of the whole map.
    out : path
        The ``.npy`` file for the depth; it appears whole or not at all. Temporary files go to its folder: some 60 bytes
        a pixel, 16 more with a prior.
    mask : bool array (h, w) or path, optional
        Pixels wanted.
    weights : array (h, w) or path, optional
        Confidence of each pixel [1].
    prior : Prior, optional
        Depth known beforehand; its arrays may be memory maps.
    components : path, optional
        An ``.npy`` file for the components.
    integrator : Poisson, optional
        How edges are weighed, tolerance, iterations over all tiles at most, and threads within a tile.
    tolerance : float, optional
        Relative error wanted, of each component in the energy norm; the integrator's if left out [1].
    max_memory : int
        Memory to stay below, beside the interpreter and its libraries, with one tile at a time; each further tile that
        `over` works on at the same time needs as much as a tile [B].
    tile : int, optional
        Side of a tile, rounded up to a multiple of the coarse grid's spacing (8, more where memory is short) and to
        four of them at least; as large as `max_memory` allows if left out [px].
    dtype : str
        Type of the depth in the file, ``"float64"`` or ``"float32"``.
    overwrite : bool
        Whether files that exist may be replaced.
    over : map
        How tiles are worked on: anything with the signature of ``map``. The result does not depend on it. With
        processes give paths rather than arrays, which would be sent to each of them.
    progress : callback
        Told how far the work has come, in per cent.

    Returns
    -------
    TiledResult
        Where the depth is and how it was found; free constants are settled as by the integrator.

    Raises
    ------
    InputError
        If shapes or types do not fit, no pixel can be used, or the disk has no room.
    OptionError
        If an option is out of range, or the memory is too small for this image.
    UnsupportedError
        If the camera is neither orthographic nor a pinhole, or the integrator is not Poisson.
    MissingFileError, UnreadableFileError
        If a path leads to no ``.npy`` file.
    ExistingResultError
        If a file is there already.

    References
    ----------
    .. [1] B. F. Smith, P. E. Bjørstad, W. D. Gropp, "Domain Decomposition", Cambridge University Press, 1996.
    """
    way = Poisson() if integrator is None else integrator
    source = checked_source(normals, camera, mask=mask, weights=weights, prior=prior, integrator=way, dtype=dtype)
    plan = plan_tiles(source.shape, max_memory=max_memory, tile=tile, prior=prior is not None)
    wanted = way.tolerance if tolerance is None else replace(way, tolerance=tolerance).tolerance
    target = free_target(out, overwrite)
    target_components = None if components is None else free_target(components, overwrite, other=target)
    with tempfile.TemporaryDirectory(prefix=f".{target.name}.", dir=target.parent) as name:
        run = _Run(folder=Path(name), source=source, plan=plan, over=over, progress=progress)
        run.read()
        found = run.solve(wanted)
        output = run.write(dtype, components=target_components is not None)
        output.depth.path.replace(target)
        if target_components is not None and output.components is not None:
            output.components.path.replace(target_components)
    missing = run.beyond + run.untied + (0 if mask is None else sum(run.left_out.values()))
    outcome = Outcome.PARTIAL if missing else Outcome.SOLVED
    return TiledResult(
        path=target,
        components_path=target_components,
        kind=camera.depth_kind,
        unit=camera.unit if prior is None else prior.unit,
        iterations=found.iterations,
        residual=found.residual,
        outcome=outcome if found.residual <= wanted else Outcome.NOT_CONVERGED,
        facts=run.facts(found),
    )


@dataclass(kw_only=True, eq=False)
class _Run:
    """One integration: what its stages hand on."""

    folder: Path
    source: Source
    plan: TilePlan
    over: Map
    progress: Progress
    left_out: dict[str, int] = field(default_factory=dict)
    pieces: list[Piece] = field(default_factory=list)
    beyond: int = 0
    untied: int = 0

    def read(self) -> None:
        """Go from normals to edges and components."""
        shape, prior = self.source.shape, self.source.prior is not None
        self.files = EdgeFiles.make(self.folder, shape, prior=prior)
        tiles = make_tiles(shape, self.plan.side)
        looks = list(self.over(partial(classify, self.source, self.files), tiles))
        counts = np.sum([one[0] for one in looks], axis=0)
        refuse_input(counts)
        self.pixels = int(counts[INSIDE])
        self.left_out = {
            "no_normal": int(counts[NO_NORMAL]),
            "facing_away": int(counts[AWAY]),
            "zero_weight": int(counts[UNWEIGHED]),
        }
        self.source = replace(self.source, largest=max(one[1] for one in looks))
        self.tiles: list[Tile] = [tile for tile, look in zip(tiles, looks, strict=True) if look[0][INSIDE]]
        self.pieces = list(self.over(partial(find_edges, self.source, self.files), self.tiles))
        numbers, self.count = join(self.tiles, self.pieces)
        self.sizes = self._gather(numbers, [piece.sizes for piece in self.pieces])
        energy, weight, moment = (self._gather(numbers, [piece.sums[k] for piece in self.pieces]) for k in range(3))
        self.tied = weight > 0
        refuse_input(counts, tied=bool(self.tied.any()) if prior else None)
        self.means = moment / np.where(self.tied, weight, 1.0)
        each = [self.means[one] for one in numbers]
        held = list(self.over(partial(relabel, self.files), zip(self.tiles, numbers, each, strict=True)))
        self.scales = np.sqrt(energy + self._gather(numbers, held))

    def _gather(self, numbers: Sequence[IntArray], parts: Sequence[Array]) -> Any:
        """Return sums over the image of what the tiles know of their components."""
        total = np.zeros(self.count + 1, parts[0].dtype)
        for number, part in zip(numbers, parts, strict=True):
            np.add.at(total, number[1:], part[1:])
        return total

    def solve(self, tolerance: float) -> Found:
        """Find the values."""
        way = self.source.integrator
        largest = max(piece.largest for piece in self.pieces)
        self.work = Work(
            files=self.files,
            values=FileArray.make(self.folder / "values", self.source.shape, "f8"),
            levels=self.plan.levels,
            overlap=self.plan.overlap,
            scale=1.0 / largest if largest > 0 else 1.0,
            sizes=self.scales,
            tolerance=_TILE_TOLERANCE,
            compiled=self.source.compiled,
            threads=way.threads,
        )

        def report(residual: float) -> None:
            share = math.log(min(max(residual, tolerance), 1.0)) / math.log(tolerance)
            self.progress("integrate", round(100 * share), 100)

        return solve_tiles(
            self.work,
            self.tiles,
            side=self.plan.side,
            tolerance=tolerance,
            max_iterations=way.max_iterations,
            over=self.over,
            report=report,
        )

    def write(self, dtype: str, *, components: bool) -> Output:
        """Settle the free constants and write what was asked for."""
        shape = self.source.shape
        output = Output(
            depth=FileArray.make(self.folder / "depth.npy", shape, dtype, fill=math.nan, npy=True),
            components=FileArray.make(self.folder / "components.npy", shape, "i4", npy=True) if components else None,
            kind=self.source.camera.depth_kind,
        )
        if self.source.prior is not None:
            constants = np.where(self.tied, self.means, math.nan)
        else:
            sums = np.zeros(self.count + 1)
            for first, part in self.over(partial(totals, self.work), self.tiles):
                sums[first : first + part.size] += part
            constants = -sums / np.maximum(self.sizes, 1)
        lost = list(self.over(partial(finish, self.work, output, constants), self.tiles))
        self.beyond, self.untied = (sum(one[k] for one in lost) for k in range(2))
        self.progress("integrate", 100, 100)
        return output

    def facts(self, found: Found) -> dict[str, Any]:
        """Return the figures for the record."""
        left_out = {**self.left_out, "beyond_range": self.beyond}
        if self.source.prior is not None:
            left_out["no_prior"] = self.untied
        return {
            "method": self.source.integrator.name,
            "options": asdict(self.source.integrator),
            "pixels": self.pixels,
            "left_out": left_out,
            "components": self.count,
            "largest_component": int(self.sizes.max()),
            "single_pixels": int(np.count_nonzero(self.sizes[1:] == 1)),
            "path": "tiles",
            "edges": sum(piece.edges for piece in self.pieces),
            "edges_left_out": sum(piece.edges_left_out for piece in self.pieces),
            "tiles": len(self.tiles),
            "tile": self.plan.side,
            "overlap": self.plan.overlap,
            "coarse_spacing": 1 << self.plan.levels,
            "tile_iterations": found.tile_iterations,
            "residual_length": found.residual_length,
        }
