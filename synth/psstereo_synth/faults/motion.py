"""A camera or object that moves between exposures."""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from psstereo.types import FloatArray
from psstereo_synth.faults.checks import require, require_size
from psstereo_synth.faults.fault import Draws, Fault

__all__ = ["Motion"]


@dataclass(frozen=True, kw_only=True)
class Motion(Fault):
    """Each image is shifted against the first by some pixels or less; the first stays.

    The image is resampled by cubic splines and continued beyond its edges by the nearest pixel, so detail near the
    limit of the sampling is damped or rings by some per cent; negative rings are cut off. Do not use it for turns or
    changes of scale, and not where the border of the image matters.

    Attributes
    ----------
    rms : float
        Root-mean-square length of a shift for ``"jitter"``, of a step from one exposure to the next for ``"walk"``,
        where shifts grow with the root of the number of steps [px].
    kind : str
        ``"jitter"`` for shifts spread evenly over a square about the first image's place, ``"walk"`` for Gaussian steps
        that add up.

    Raises
    ------
    OptionError
        If the size is negative or not finite, or the kind unknown.
    """

    name: ClassVar[str] = "motion"
    summary: ClassVar[str] = "The camera or the object moves by a fraction of a pixel between images."
    rms: float = 0.5
    kind: Literal["jitter", "walk"] = "jitter"

    def __post_init__(self) -> None:
        require_size("motion", self.rms)
        require(self.kind in ("jitter", "walk"), "kind of motion", repr(self.kind), "jitter or walk")

    def shift(self, index: int, draws: Draws) -> FloatArray:
        """Return how far the content of an exposure lies from its place in the first one.

        Parameters
        ----------
        index : int
            Of the exposure.
        draws : Draws
            Random numbers.

        Returns
        -------
        float64 array (2,)
            To the right and down, along columns and rows [px].
        """
        if index == 0:
            return np.zeros(2)
        if self.kind == "walk":
            steps = draws.capture().normal(0.0, self.rms / np.sqrt(2), (index, 2))
            return np.asarray(steps.sum(axis=0))
        half = self.rms * np.sqrt(1.5)  # the mean square over an interval ± half is half² / 3, and there are two
        return draws.image(index).uniform(-half, half, 2)

    def shifts(self, count: int, draws: Draws) -> FloatArray:
        """Return the true shifts of the first `count` exposures, float64 (count, 2), to the right and down [px]."""
        return np.array([self.shift(i, draws) for i in range(count)]).reshape(-1, 2)

    def radiance(self, image: FloatArray, index: int, draws: Draws) -> FloatArray:
        """Return the shifted image; see :meth:`Fault.radiance`."""
        from scipy.ndimage import shift

        right, down = self.shift(index, draws)
        if right == 0 and down == 0:
            return image
        source = np.asarray(image, np.float64)
        moved = np.zeros(source.shape)
        for channel in range(source.shape[2]):
            shift(source[..., channel], (down, right), output=moved[..., channel], order=3, mode="nearest")
        return np.maximum(moved, 0.0, out=moved)
