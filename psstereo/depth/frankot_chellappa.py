"""Integration by one Fourier transform: for surfaces that repeat beyond the borders of the image."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.depth.domain import Domain
from psstereo.depth.integrator import Integrator, Solution
from psstereo.errors import UnsupportedError
from psstereo.results import DepthKind
from psstereo.types import Progress

__all__ = ["FrankotChellappa"]


@dataclass(frozen=True, kw_only=True)
class FrankotChellappa(Integrator):
    """Least squares over the slopes of a periodic surface, by the Fourier transform [1]_.

    The slopes of each pixel are projected on the nearest gradient field: every wave of the surface is found by itself,
    ``Z = −i (ω_u P + ω_v Q) / (ω_u² + ω_v²)``. Exact, to rounding, for surfaces that repeat and hold no wave shorter
    than two pixels, such as tiles of a texture; nothing is faster.

    Do not use it for anything else: what does not repeat is bent until it does, most at the borders. A plane comes out
    flat. :class:`~psstereo.depth.poisson.Poisson` leaves the border free and takes masks, weights and perspective.

    References
    ----------
    .. [1] R. T. Frankot, R. Chellappa, "A method for enforcing integrability in shape from shading algorithms", IEEE
       PAMI 10(4), 1988. doi:10.1109/34.3909

    Examples
    --------
    >>> import numpy as np
    >>> from psstereo.camera import Orthographic
    >>> angle = np.tile(2 * np.pi * np.arange(8) / 8, (4, 1))
    >>> slope = 2 * np.pi / 8 * np.cos(angle)
    >>> normals = np.dstack([-slope, 0 * slope, np.ones_like(slope)])
    >>> depth = FrankotChellappa().integrate(normals, Orthographic()).depth
    >>> bool(np.allclose(depth, np.sin(angle)))
    True
    """

    name: ClassVar[str] = "frankot-chellappa"
    summary: ClassVar[str] = "One Fourier transform; full rectangles whose surface repeats, orthographic."
    any_domain: ClassVar[bool] = False

    def solve(self, domain: Domain, progress: Progress) -> Solution:
        """Project the slopes; see :meth:`Integrator.solve`.

        Raises
        ------
        UnsupportedError
            If a pixel of the image has no usable normal, weights are given, or the camera is not orthographic.
        """
        from scipy.fft import irfft2, rfft2

        whole = domain.inside.shape == domain.shape and bool(domain.inside.all())
        if not whole or domain.weights is not None or domain.kind is not DepthKind.HEIGHT:
            raise UnsupportedError(
                given=f"{np.count_nonzero(domain.inside)} of {math.prod(domain.shape)} pixels have a normal; "
                f"weights are {'given' if domain.weights is not None else 'not given'}; depth is {domain.kind.value}.",
                needed="A Fourier transform needs every pixel of a rectangle, equal weights and parallel projection.",
                remedy="Use the integrator poisson.",
            )
        height, width = domain.shape
        if domain.array.size:  # points of the plane z = 0 that no matrix gives are no regular grid
            raise UnsupportedError(
                given="The camera's pixels do not lie on a regular grid.",
                needed="A Fourier transform needs equal steps.",
                remedy="Use the integrator poisson.",
            )
        across, down = domain.matrix[:, 0], domain.matrix[:, 1]
        x, y, z = (np.asarray(domain.given[..., k], np.float64) for k in range(3))
        right = rfft2(-(x * across[0] + y * across[1]) / z, workers=self.threads)
        below = rfft2(-(x * down[0] + y * down[1]) / z, workers=self.threads)
        columns = 2.0 * np.pi * np.fft.rfftfreq(width)
        rows = 2.0 * np.pi * np.fft.fftfreq(height)[:, None]
        # The shortest wave of an even number of pixels has no slope at the pixels.
        if width % 2 == 0:
            columns[-1] = 0.0
        if height % 2 == 0:
            rows[height // 2] = 0.0
        square = rows**2 + columns**2
        spectrum = -1j * (columns * right + rows * below) / np.where(square > 0, square, 1.0)
        values = irfft2(np.where(square > 0, spectrum, 0.0), s=(height, width), workers=self.threads)
        progress("integrate", 100, 100)
        return Solution(
            values=np.asarray(values),
            components=np.ones(domain.shape, np.int32),
            centred=True,
            facts={"path": "Fourier transform"},
        )
