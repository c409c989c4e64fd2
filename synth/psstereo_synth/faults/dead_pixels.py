"""Pixels that do not see the light."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.types import Array, BoolArray
from psstereo_synth.faults.checks import require, require_size
from psstereo_synth.faults.fault import Draws, Fault

__all__ = ["DeadPixels"]


@dataclass(frozen=True, kw_only=True)
class DeadPixels(Fault):
    """Some pixels deliver 0 and some full scale, the same ones in all images and in all channels.

    Attributes
    ----------
    dead : float
        Share of pixels that are always 0, rounded to whole pixels [1].
    hot : float
        Share of pixels that are always at full scale, rounded to whole pixels [1].

    Raises
    ------
    OptionError
        If a share is not between 0 and 1, or both together are more than 1.
    """

    name: ClassVar[str] = "dead-pixels"
    summary: ClassVar[str] = "Some pixels are black and some white in every image."
    dead: float = 0.001
    hot: float = 0.001

    def __post_init__(self) -> None:
        require_size("share of dead pixels", self.dead, below=1.0)
        require_size("share of hot pixels", self.hot, below=1.0)
        require(self.dead + self.hot <= 1, "share of dead and hot pixels", self.dead + self.hot, "1 or less")

    def masks(self, height: int, width: int, draws: Draws) -> tuple[BoolArray, BoolArray]:
        """Return where pixels are dead and where they are hot, two bool arrays (height, width)."""
        size = height * width
        dead = round(self.dead * size)
        hot = min(round(self.hot * size), size - dead)
        places = draws.capture().choice(size, dead + hot, replace=False)
        masks = np.zeros((2, size), bool)
        masks[0, places[:dead]] = True
        masks[1, places[dead:]] = True
        both = masks.reshape(2, height, width)
        return both[0], both[1]

    def values(self, image: Array, index: int, white: float, draws: Draws) -> Array:
        """Return the image with its dead and hot pixels; see :meth:`Fault.values`."""
        del index  # they are the same ones in all images
        dead, hot = self.masks(image.shape[0], image.shape[1], draws)
        if not (dead.any() or hot.any()):
            return image
        spoilt = image.copy()
        spoilt[dead] = 0
        spoilt[hot] = white
        return spoilt
