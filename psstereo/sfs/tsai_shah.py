"""The method of Tsai and Shah: a height for each pixel by Newton steps on its own brightness."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.camera import Camera, Orthographic
from psstereo.errors import OptionError
from psstereo.lights import Directional, Light
from psstereo.sfs.assumption import Assumption, Basis
from psstereo.sfs.image import ShadedImage
from psstereo.sfs.method import ShadingMethod, ShadingSolution
from psstereo.sfs.sun import Sunlit, solution_from_heights, sunlit
from psstereo.types import FloatArray, Progress

__all__ = ["TsaiShah"]

_DOUBT = 1e-8
"""Variance that is granted to the brightness, beside 1 for the first guess of the height."""


@dataclass(frozen=True, kw_only=True)
class TsaiShah(ShadingMethod):
    """Local linearisation of brightness in height [1]_, for comparison.

    Slopes are differences to the left and to the upper neighbour; each pixel's height then goes a Newton step, weighted
    like a Kalman filter's, towards its brightness, with the neighbours held. Fast and simple; nothing makes the slopes
    of neighbours agree, so the relief is noisy and its scale is lost. It starts from a flat surface, on which nothing
    moves under light from the camera, since the derivative is zero there.

    Do not use it where the answer matters.

    Attributes
    ----------
    iterations : int
        Passes over the image; the authors use a few.

    References
    ----------
    .. [1] P.-S. Tsai, M. Shah, "Shape from shading using linear approximation", Image Vis. Comput. 12, 1994.
       doi:10.1016/0262-8856(94)90002-7
    """

    name: ClassVar[str] = "tsai-shah"
    summary: ClassVar[str] = "Newton steps on each pixel's brightness; a baseline."
    lights: ClassVar[tuple[type[Light], ...]] = (Directional,)
    cameras: ClassVar[tuple[type[Camera], ...]] = (Orthographic,)
    iterations: int = 5

    def __post_init__(self) -> None:
        if self.iterations < 1:
            raise OptionError(
                given=f"{self.iterations} iterations are asked for.", needed="At least one.", remedy="5 is usual."
            )

    def solve(self, image: ShadedImage, progress: Progress) -> ShadingSolution:
        """Return the heights after a number of passes; see :meth:`ShadingMethod.solve`."""
        sun = sunlit(image)
        heights: FloatArray = np.zeros(sun.shading.shape)
        variance: FloatArray = np.ones(sun.shading.shape)
        for done in range(self.iterations):
            heights, variance = _newton(heights, variance, sun)
            progress("shape from shading", done + 1, self.iterations)
        assumptions = (
            Assumption(name="boundary", basis=Basis.ASSUMED, sentence="The surface is level beyond its border."),
            Assumption(
                name="accuracy",
                basis=Basis.ASSUMED,
                sentence="A fixed number of passes was made; the method has no solution to converge to.",
            ),
        )
        return solution_from_heights(heights, sun, image, assumptions, iterations=self.iterations)


def _newton(heights: FloatArray, variance: FloatArray, sun: Sunlit) -> tuple[FloatArray, FloatArray]:
    """Go one step from heights [px] and their variances; neighbours outside count as level."""
    padded = np.pad(np.where(sun.inside, heights, np.nan), ((1, 0), (1, 0)), constant_values=np.nan)
    right = np.nan_to_num(heights - padded[1:, :-1], nan=0.0)
    up = np.nan_to_num(padded[:-1, 1:] - heights, nan=0.0)
    x, y, z = sun.direction
    length = np.sqrt(1.0 + right * right + up * up)
    facing = (z - x * right - y * up) / length
    # Raising a pixel raises the slope to the right by 1 and lowers that to the top by 1.
    change = (-x + y) / length - facing * (right - up) / length**2
    change = np.where(facing > 0, change, 0.0)
    gain = variance * change / (_DOUBT + variance * change * change)
    moved = heights + gain * (sun.shading - np.maximum(facing, 0.0))
    return np.where(sun.inside, moved, 0.0), (1.0 - gain * change) * variance
