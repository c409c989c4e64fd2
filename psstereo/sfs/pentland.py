"""Pentland's linear method: brightness as a linear function of slope, inverted frequency by frequency."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.camera import Camera, Orthographic
from psstereo.errors import OptionError, UnsupportedError
from psstereo.lights import Directional, Light
from psstereo.sfs.assumption import Assumption, Basis
from psstereo.sfs.image import ShadedImage
from psstereo.sfs.method import ShadingMethod, ShadingSolution
from psstereo.sfs.sun import solution_from_heights, sunlit
from psstereo.types import FloatArray, Progress

__all__ = ["Pentland"]

_FRONTAL = 0.05
"""Sine of the least slant: below, squares of the slope outweigh the linear term on slopes above a tenth."""


@dataclass(frozen=True, kw_only=True)
class Pentland(ShadingMethod):
    """Linear shape from shading [1]_, for comparison and for shallow relief under raking light.

    With slopes p and q small, ``I = l_z − l_x p − l_y q``, which Fourier transforms turn into a division by
    ``−i (l_x ω_x + l_y ω_y)``. Height that changes only across the light's direction leaves no trace in this and is
    missing, and what changes nearly so is damped. The image is taken as periodic.

    Do not use it for slopes above a fifth, nor under light from the camera: squares of the slope, which it leaves out,
    are all the shading there is.

    Attributes
    ----------
    damping : float
        Frequencies are damped where the divisor is below this, in radians per pixel times the sine of the slant [1].

    References
    ----------
    .. [1] A. P. Pentland, "Linear shape from shading", Int. J. Comput. Vis. 4, 1990. doi:10.1007/BF00127815
    """

    name: ClassVar[str] = "pentland"
    summary: ClassVar[str] = "Linear in slope, by Fourier transform; shallow relief under raking light; a baseline."
    lights: ClassVar[tuple[type[Light], ...]] = (Directional,)
    cameras: ClassVar[tuple[type[Camera], ...]] = (Orthographic,)
    any_mask: ClassVar[bool] = False
    damping: float = 0.02

    def __post_init__(self) -> None:
        if not self.damping > 0:
            raise OptionError(
                given=f"The damping is {self.damping:g}.", needed="A number above zero.", remedy="0.02 is usual."
            )

    def solve(self, image: ShadedImage, progress: Progress) -> ShadingSolution:
        """Return the heights whose linear shading is the image; see :meth:`ShadingMethod.solve`."""
        del progress  # two transforms
        sun = sunlit(image)
        slant = float(np.hypot(sun.direction[0], sun.direction[1]))
        if slant < _FRONTAL:
            raise UnsupportedError(
                given=f"The light stands {np.degrees(np.arcsin(slant)):.2g} degrees off the view.",
                needed=f"At least {np.degrees(np.arcsin(_FRONTAL)):.2g}: shading is not linear in slope below.",
                remedy="Use the method eikonal, which is made for light from the camera.",
            )
        heights = _invert(sun.shading, sun.direction, self.damping * slant)
        assumptions = (
            Assumption(name="slope", basis=Basis.ASSUMED, sentence="Squares of the slope are left out."),
            Assumption(name="boundary", basis=Basis.ASSUMED, sentence="The image repeats beyond its border."),
            Assumption(
                name="across the light",
                basis=Basis.ASSUMED,
                sentence="Height does not change along lines across the light, where shading shows nothing.",
            ),
        )
        return solution_from_heights(heights, sun, image, assumptions)


def _invert(shading: FloatArray, direction: FloatArray, damping: float) -> FloatArray:
    """Divide by −(l_x ∂_x + l_y ∂_y) in pixels, damped like a Wiener filter; rows run down and y up."""
    rows, columns = shading.shape
    right, down = 2.0 * np.pi * np.fft.rfftfreq(columns), 2.0 * np.pi * np.fft.fftfreq(rows)
    divisor = -1j * (direction[0] * right[None, :] - direction[1] * down[:, None])
    spectrum = np.fft.rfft2(shading - direction[2])
    return np.fft.irfft2(spectrum * np.conj(divisor) / (np.abs(divisor) ** 2 + damping**2), s=shading.shape)
