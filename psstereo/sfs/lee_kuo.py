"""The method of Lee and Kuo: heights of a triangulated surface, by linearising its brightness again and again."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from psstereo.camera import Camera, Orthographic
from psstereo.errors import OptionError
from psstereo.lights import Directional, Light
from psstereo.sfs.assumption import Assumption, Basis
from psstereo.sfs.image import ShadedImage
from psstereo.sfs.method import ShadingMethod, ShadingSolution
from psstereo.sfs.sun import Sunlit, solution_from_heights, sunlit
from psstereo.types import FloatArray, IntArray, Progress

__all__ = ["LeeKuo"]

_PIN = 1e-9
"""Weight that ties every height to its last value, so that free constants stay where they are [1]."""


@dataclass(frozen=True, kw_only=True)
class LeeKuo(ShadingMethod):
    """Least squares on the brightness of triangles, with smoothness [1]_, for comparison.

    The heights of pixels are joined to triangles, whose brightness is linearised around the last surface; the sum of
    squared misfits plus the thin plate's energy is minimised, and so on. The first linearisation, around a flat
    surface, is Pentland's with smoothness; under light from the camera it is zero and the surface stays flat. The
    method finds a minimum near its start, not the lowest one. Each round factorises a sparse matrix: a megapixel
    takes minutes.

    Attributes
    ----------
    smoothness : float
        Weight of the thin plate's energy beside squared brightness [px²].
    rounds : int
        Linearisations at most.
    tolerance : float
        The heights' largest change, as a share of their range, at which rounds end [1].

    References
    ----------
    .. [1] K. M. Lee, C.-C. J. Kuo, "Shape from shading with a linear triangular element surface model", IEEE Trans.
       Pattern Anal. Mach. Intell. 15, 1993. doi:10.1109/34.236247
    """

    name: ClassVar[str] = "lee-kuo"
    summary: ClassVar[str] = "Triangles whose brightness is linearised again and again; a baseline."
    lights: ClassVar[tuple[type[Light], ...]] = (Directional,)
    cameras: ClassVar[tuple[type[Camera], ...]] = (Orthographic,)
    smoothness: float = 0.1
    rounds: int = 30
    tolerance: float = 0.01

    def __post_init__(self) -> None:
        if not (self.smoothness > 0 and self.rounds >= 1 and self.tolerance > 0):
            raise OptionError(
                given=f"Smoothness {self.smoothness:g}, {self.rounds} rounds, tolerance {self.tolerance:g}.",
                needed="Numbers above zero.",
                remedy="0.1, 30 and 0.01 are usual.",
            )

    def solve(self, image: ShadedImage, progress: Progress) -> ShadingSolution:
        """Return the heights that fit the triangles' brightness; see :meth:`ShadingMethod.solve`."""
        sun = sunlit(image)
        triangles = _Triangles.on(sun)
        plate = self.smoothness * _thin_plate(triangles.places)
        heights: FloatArray = np.zeros(int(np.count_nonzero(sun.inside)))
        energy, change, share, done = triangles.energy(heights, plate), 1.0, 1.0, 0
        for done in range(1, self.rounds + 1):
            step = triangles.step(heights, plate)
            heights, lower, share = _descend(triangles, plate, heights, step, energy)
            change = share * float(np.abs(step).max(initial=0.0)) / max(float(np.ptp(heights)), 1e-12)
            energy = lower
            progress("shape from shading", done, self.rounds)
            if change <= self.tolerance or share == 0:
                break
        full = np.zeros(sun.inside.shape)
        full[sun.inside] = heights
        assumptions = (
            Assumption(
                name="smoothness",
                basis=Basis.ASSUMED,
                sentence=f"Of surfaces that fit alike the smoother is taken, with weight {self.smoothness:g}.",
            ),
            Assumption(name="start", basis=Basis.ASSUMED, sentence="A flat surface; the nearest minimum was taken."),
        )
        return solution_from_heights(
            full,
            sun,
            image,
            assumptions,
            iterations=done,
            residual=change,
            converged=change <= self.tolerance and (share > 0 or not step.any()),
            facts={"triangles": int(triangles.corners.shape[0])},
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Triangles:
    """Right-angled triangles of pixel centres: corner (k, 3), the right angle first, its columns' and rows' signs."""

    corners: IntArray
    along: FloatArray
    shading: FloatArray
    direction: FloatArray
    places: IntArray

    @classmethod
    def on(cls, sun: Sunlit) -> "_Triangles":
        """Cut every square of four pixels inside into two triangles."""
        places = np.where(sun.inside, np.cumsum(sun.inside).reshape(sun.inside.shape) - 1, -1)
        corners, along = [], []
        for right, up in ((1, -1), (-1, 1)):  # the right angle at the upper left, and at the lower right
            here, beside, over = _squares(places, right, up)
            whole = (here >= 0) & (beside >= 0) & (over >= 0)
            corners.append(np.stack([here[whole], beside[whole], over[whole]], axis=1))
            along.append(np.broadcast_to([float(right), float(up)], (int(whole.sum()), 2)))
        joined = np.concatenate(corners)
        shading = sun.shading[sun.inside][joined].mean(axis=1)
        return cls(corners=joined, along=np.concatenate(along), shading=shading, direction=sun.direction, places=places)

    def brightness(self, heights: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the brightness n·l of each triangle, not clipped, and its derivatives by the slopes p and q."""
        z = heights[self.corners]
        slope = (z[:, 1:] - z[:, :1]) * self.along
        length = np.sqrt(1.0 + (slope * slope).sum(axis=1))
        facing = (self.direction[2] - slope @ self.direction[:2]) / length
        change = -self.direction[:2] / length[:, None] - slope * (facing / length**2)[:, None]
        return facing, change[:, 0], change[:, 1]

    def misfit(self, heights: FloatArray) -> tuple[FloatArray, Any]:
        """Return what each triangle lacks in brightness, and the sparse derivative of brightness by the heights."""
        from scipy import sparse

        facing, by_p, by_q = self.brightness(heights)
        # In shadow the brightness is 0 whatever the slope, unless the image shows light there.
        free = (facing <= 0) & (self.shading <= 0)
        by_right, by_up = by_p * self.along[:, 0], by_q * self.along[:, 1]
        values = np.stack([-by_right - by_up, by_right, by_up], axis=1) * ~free[:, None]
        rows = np.repeat(np.arange(len(values)), 3)
        derivative = sparse.csr_array((values.ravel(), (rows, self.corners.ravel())), shape=(len(values), len(heights)))
        return np.where(free, 0.0, self.shading - facing), derivative

    def energy(self, heights: FloatArray, plate: Any) -> float:
        """Return squared misfit plus the plate's energy."""
        lack = self.misfit(heights)[0]
        return float(lack @ lack + heights @ (plate @ heights))

    def step(self, heights: FloatArray, plate: Any) -> FloatArray:
        """Return the step to the minimum of the linearised problem."""
        from scipy import sparse
        from scipy.sparse.linalg import splu

        lack, derivative = self.misfit(heights)
        system = sparse.csc_array(derivative.T @ derivative + plate + _PIN * sparse.eye_array(len(heights)))
        solved = splu(system, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        step: FloatArray = solved.solve(derivative.T @ lack - plate @ heights)
        return step


def _descend(
    triangles: _Triangles, plate: Any, heights: FloatArray, step: FloatArray, energy: float
) -> tuple[FloatArray, float, float]:
    """Go the largest of 1, ½, ¼, … of the step that lowers the energy; no step at all if none does."""
    share = 1.0
    while share > 1e-4:
        moved = heights + share * step
        lower = triangles.energy(moved, plate)
        if lower <= energy:
            return moved, lower, share
        share *= 0.5
    return heights, energy, 0.0


def _squares(places: IntArray, right: int, up: int) -> tuple[IntArray, IntArray, IntArray]:
    """Return the pixels at the right angle, beside it and above or below it, of every square of four pixels."""
    upper, lower = slice(None, -1), slice(1, None)
    row, other_row = (upper, lower) if up < 0 else (lower, upper)
    column, other_column = (upper, lower) if right > 0 else (lower, upper)
    return places[row, column], places[row, other_column], places[other_row, column]


def _thin_plate(places: IntArray) -> Any:
    """Return the matrix of Σ z_xx² + 2 z_xy² + z_yy² over the pixels inside, second differences where all exist."""
    from scipy import sparse

    count = int(places.max()) + 1
    total = sparse.csr_array((count, count))
    upper, middle, lower = slice(None, -2), slice(1, -1), slice(2, None)
    every, first, last = slice(None), slice(None, -1), slice(1, None)
    stencils = (
        (1.0, ((every, upper), (every, middle), (every, lower)), (1.0, -2.0, 1.0)),
        (1.0, ((upper, every), (middle, every), (lower, every)), (1.0, -2.0, 1.0)),
        (2.0, ((first, first), (first, last), (last, first), (last, last)), (1.0, -1.0, -1.0, 1.0)),
    )
    for weight, cuts, factors in stencils:
        nodes = np.stack([places[cut].ravel() for cut in cuts], axis=1)
        nodes = nodes[(nodes >= 0).all(axis=1)]
        rows = np.repeat(np.arange(len(nodes)), len(factors))
        values = np.tile(factors, len(nodes))
        bend = sparse.csr_array((values, (rows, nodes.ravel())), shape=(len(nodes), count))
        total = total + weight * (bend.T @ bend)
    return total
