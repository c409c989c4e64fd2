"""A lens that is out of focus."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.types import FloatArray
from psstereo_synth.faults.checks import require_size
from psstereo_synth.faults.fault import Draws, Fault

__all__ = ["Blur"]


@dataclass(frozen=True, kw_only=True)
class Blur(Fault):
    """Every image is spread by the same Gaussian, all over.

    The image is continued beyond its edges by the nearest pixel. Below about 0.6 pixels a sampled Gaussian is narrower
    than it says; do not use it there. Blur that grows with the distance from the plane of focus is another matter.

    Attributes
    ----------
    sigma : float
        Standard deviation of the spread along rows and along columns [px].

    Raises
    ------
    OptionError
        If it is negative or not finite.
    """

    name: ClassVar[str] = "blur"
    summary: ClassVar[str] = "The images are out of focus."
    sigma: float = 1.0

    def __post_init__(self) -> None:
        require_size("width of the blur", self.sigma)

    def radiance(self, image: FloatArray, index: int, draws: Draws) -> FloatArray:
        """Return the blurred image; see :meth:`Fault.radiance`."""
        from scipy.ndimage import gaussian_filter

        del index, draws
        if self.sigma == 0:
            return image
        source = np.asarray(image, np.float64)
        return np.asarray(gaussian_filter(source, (self.sigma, self.sigma, 0.0), mode="nearest", truncate=6.0))
