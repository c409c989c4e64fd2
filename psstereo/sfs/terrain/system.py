"""One Gauss–Newton step of a window: its normal equations, and conjugate gradients for them.

The unknowns are changes of the heights and of every image's exposure and haze. The latter, two an image, are
eliminated: with H the matrix of the heights, C the columns that couple both and S the small matrix of the exposures,
the heights solve (H − Cᵀ S⁻¹ C) u = b − Cᵀ S⁻¹ t. H is never formed: a product is two passes of band tables
(:mod:`psstereo.kernels.terrain_product`). The preconditioner is H with the mean of its coefficients, on a torus, where
plane waves diagonalise it; in single precision, since it only steers.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from psstereo.depth.rows import Rows
from psstereo.kernels.dispatch import kernel
from psstereo.kernels.terrain_product import HALO
from psstereo.sfs.terrain.stencils import Stencils
from psstereo.sfs.terrain.sunlight import Sunlight
from psstereo.sfs.terrain.tie import Tie
from psstereo.types import FloatArray

__all__ = ["COMPILED", "MARGIN", "Step", "System"]

COMPILED = 4_000
"""Pixels from which the compiled product is sooner done, loading included; over several rounds of many products."""
MARGIN = 2 * HALO
"""Pixels around a window that are kept still: with so many, its equations are rows of the whole grid's [px]."""
_WRAP = 16
"""Empty pixels that part opposite borders on the torus [px]."""
_RIDGE = 1e-6
"""Share of the diagonal of the exposures' matrix that is added to it, so that nothing is divided by zero [1]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Step:
    """A step that was found.

    Attributes
    ----------
    heights : float64 array (h, w)
        Change of heights; 0 outside of the window [length].
    exposures : float64 array (2k,)
        Change of exposure and haze of each image, in units of its exposure [1].
    information : float64 array (2k,)
        How well the window knows them, in pixels [1].
    iterations : int
        Iterations of conjugate gradients.
    residual : float
        Residual left, relative to the first, in the norm of the preconditioner [1].
    """

    heights: FloatArray
    exposures: FloatArray
    information: FloatArray
    iterations: int
    residual: float


@dataclass(kw_only=True, eq=False)
class System:
    """The normal equations of a window, filled image by image.

    Attributes
    ----------
    stencils : Stencils
        Differences on the window with its margin.
    inner : (slice, slice)
        The window proper in it; heights outside are kept.
    tie : Tie
        What the coarse elevation says of the window proper.
    bend : float
        Weight of the bending energy [1].
    images : int
        Number of images.
    rows : Rows
        Executes passes.
    """

    stencils: Stencils
    inner: tuple[slice, slice]
    tie: Tie
    bend: float
    images: int
    rows: Rows
    xx: FloatArray = field(init=False)
    xy: FloatArray = field(init=False)
    yy: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        shape = self.stencils.shape
        self.xx, self.xy, self.yy, self._pull_x, self._pull_y = np.zeros((5, *shape))
        self._columns = np.zeros((2 * self.images, *(part.stop - part.start for part in self.inner)))
        self._small = np.zeros((2 * self.images, 2 * self.images))
        self._target = np.zeros(2 * self.images)
        self._fields = [np.zeros((shape[0] + 2 * HALO, shape[1] + 2 * HALO)) for _ in range(3)]
        self._image = np.zeros(shape)
        work = float(shape[0] * shape[1])
        self._fill = kernel("terrain_product", "fill_flows", work, COMPILED)
        self._gather = kernel("terrain_product", "gather", work, COMPILED)

    def add(self, number: int, found: Sunlight) -> None:
        """Add what one image says."""
        weighted_x, weighted_y = found.weight * found.along_x, found.weight * found.along_y
        self.xx += weighted_x * found.along_x
        self.xy += weighted_x * found.along_y
        self.yy += weighted_y * found.along_y
        self._pull_x += weighted_x * found.residual
        self._pull_y += weighted_y * found.residual
        first, second = 2 * number, 2 * number + 1
        own = found.weight[self.inner]
        value, residual = found.value[self.inner], found.residual[self.inner]
        back = self.stencils.slopes_back
        self._columns[first] = back(weighted_x * found.value, weighted_y * found.value)[self.inner]
        self._columns[second] = back(weighted_x, weighted_y)[self.inner]
        dark = found.dark_weight[self.inner]
        self._small[first, first] = np.sum(own * value * value)
        self._small[first, second] = self._small[second, first] = np.sum(own * value)
        self._small[second, second] = np.sum(own) + np.sum(dark)
        self._target[first] = np.sum(own * value * residual)
        self._target[second] = np.sum(own * residual) + np.sum(dark * found.dark_residual[self.inner])

    def solve(
        self, heights: FloatArray, pull_of_tie: FloatArray, *, tolerance: float, limit: int, exposures: bool
    ) -> Step:
        """Return the step from heights (h, w) of the window with its margin.

        Parameters
        ----------
        heights : float64 array (h, w)
            Heights now [length].
        pull_of_tie : float64 array
            Pull of the coarse elevation, on the window proper.
        tolerance : float
            Relative residual wanted [1].
        limit : int
            Iterations at most.
        exposures : bool
            Whether exposures and haze change too.
        """
        whole = self.stencils.slopes_back(self._pull_x, self._pull_y) - self.bend * self.stencils.bend(heights)
        right_side = whole[self.inner] + pull_of_tie
        information = self._information()
        if not exposures:
            change, done, left = self._iterate(right_side, self._multiply, tolerance, limit)
            return self._step(change, np.zeros(2 * self.images), information, done, left)
        # An image without weight leaves zeros on the diagonal; the floor keeps its exposure where it is.
        ridge = _RIDGE * np.diag(self._small) + 1e-12
        inverse = np.linalg.inv(self._small + np.diag(ridge))
        columns = self._columns.reshape(2 * self.images, -1)

        def reduced(value: FloatArray) -> FloatArray:
            coupled = columns.T @ (inverse @ (columns @ value.ravel()))
            return self._multiply(value) - coupled.reshape(value.shape)

        right_side = right_side - (columns.T @ (inverse @ self._target)).reshape(right_side.shape)
        change, done, left = self._iterate(right_side, reduced, tolerance, limit)
        found = inverse @ (self._target - columns @ change.ravel())
        return self._step(change, found, information, done, left)

    def _step(self, change: FloatArray, exposures: FloatArray, information: FloatArray, done: int, left: float) -> Step:
        heights = np.zeros(self.stencils.shape)
        heights[self.inner] = change
        return Step(heights=heights, exposures=exposures, information=information, iterations=done, residual=left)

    def _information(self) -> FloatArray:
        """Return the pixels' spread of shading, which tells exposure and haze apart, for each image twice."""
        out = np.zeros(2 * self.images)
        for k in range(self.images):
            a, b, c = self._small[2 * k, 2 * k], self._small[2 * k, 2 * k + 1], self._small[2 * k + 1, 2 * k + 1]
            out[2 * k : 2 * k + 2] = max(a - b * b / c, 0.0) if c > 0 else 0.0
        return out

    def _multiply(self, value: FloatArray) -> FloatArray:
        """Return the matrix of the heights times a change of the window proper."""
        height, width = self.stencils.shape
        padded, flow_x, flow_y = self._fields
        padded[HALO:-HALO, HALO:-HALO][self.inner] = value
        x, y, x_back, y_back = self.stencils.slope_bands
        self.rows(self._fill, (x, y, self.xx, self.xy, self.yy, padded, flow_x, flow_y), 0, height, width)
        bend = self._bend_bands()
        self.rows(self._gather, (x_back, y_back, *bend, padded, flow_x, flow_y, self._image), 0, height, width)
        return self._image[self.inner] + self.tie.product(value)

    def _bend_bands(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        x, y, x_twist, y_twist = self.stencils.bend_bands
        return x * self.bend, y * self.bend, x_twist * self.bend, y_twist

    def _preconditioner(self, shape: tuple[int, int]) -> Callable[[FloatArray], FloatArray]:
        """Return the inverse of the mean matrix on a torus."""
        from scipy.fft import fftfreq, irfft2, next_fast_len, rfft2, rfftfreq

        size = tuple(int(next_fast_len(n + _WRAP, real=True)) for n in shape)
        rows, columns = 2 * np.pi * fftfreq(size[0])[:, None], 2 * np.pi * rfftfreq(size[1])[None]
        x, y, bend = self.stencils.symbols(rows, columns)
        xx, xy, yy = (float(part[self.inner].mean()) for part in (self.xx, self.xy, self.yy))
        symbol = xx * x * x + 2.0 * xy * x * y + yy * y * y + self.bend * bend + self.tie.box(rows, columns)
        symbol = np.maximum(symbol, 1e-9 * float(symbol.max()))
        steer: Any = (1.0 / (symbol / float(symbol.mean()))).astype(np.float32)

        def apply(residual: FloatArray) -> FloatArray:
            scale = float(np.abs(residual).max(initial=0.0)) or 1.0
            waves = rfft2((residual / scale).astype(np.float32), s=size)
            back = irfft2(waves * steer, s=size)[: shape[0], : shape[1]]
            return back.astype(np.float64) * scale

        return apply

    def _iterate(
        self, right_side: FloatArray, product: Callable[[FloatArray], FloatArray], tolerance: float, limit: int
    ) -> tuple[FloatArray, int, float]:
        """Return the solution, iterations, and the relative residual left."""
        precondition = self._preconditioner(right_side.shape)
        change, residual = np.zeros_like(right_side), right_side.copy()
        direction = value = precondition(residual)
        first = energy = float(np.sum(residual * value))
        done = 0
        while done < limit and energy > tolerance**2 * first:
            image = product(direction)
            curvature = float(np.sum(direction * image))
            if not curvature > 0:
                break
            length = energy / curvature
            change += length * direction
            residual -= length * image
            value = precondition(residual)
            following = float(np.sum(residual * value))
            direction = value + (following / energy) * direction
            energy, done = following, done + 1
        return change, done, float(np.sqrt(max(energy, 0.0) / first)) if first > 0 else 0.0
