"""One image that is saved twice."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.errors import InputError
from psstereo_synth.faults.checks import require
from psstereo_synth.faults.fault import Draws, Fault

__all__ = ["Duplicate"]


@dataclass(frozen=True, kw_only=True)
class Duplicate(Fault):
    """A written image is a copy of another, noise included; the one that belongs there is lost.

    Attributes
    ----------
    image : int, optional
        Which written image is replaced, counted from 0; drawn if absent.
    of : int, optional
        Which written image it copies; drawn from the others if absent.

    Raises
    ------
    OptionError
        If an index is negative, or both are the same.
    """

    name: ClassVar[str] = "duplicate"
    summary: ClassVar[str] = "One image is a copy of another one."
    image: int | None = None
    of: int | None = None

    def __post_init__(self) -> None:
        for value in (self.image, self.of):
            require(value is None or value >= 0, "index of an image", value, "zero or more")
        require(self.image is None or self.image != self.of, "image to be copied", self.of, "another one")

    def pair(self, count: int, draws: Draws) -> tuple[int, int]:
        """Return which of `count` written images is replaced, and by which.

        Raises
        ------
        InputError
            If there are fewer than two images, or those that are named do not exist.
        """
        if count < 2 or max(self.image or 0, self.of or 0) >= count:
            raise InputError(
                given=f"There are {count} images, and image {self.image} shall be a copy of image {self.of}.",
                needed="Two images at least are needed, and those that are named.",
                remedy="Name images from 0 to the last one, or leave this fault out.",
            )
        rng = draws.capture()
        drawn = [int(i) for i in rng.permutation(count)]
        image = next(i for i in drawn if i != self.of) if self.image is None else self.image
        return image, next(i for i in drawn if i != image) if self.of is None else self.of

    def order(self, order: Sequence[int], draws: Draws) -> Sequence[int]:
        """Return the order with one exposure twice; see :meth:`Fault.order`."""
        image, of = self.pair(len(order), draws)
        copied = np.array(order)
        copied[image] = copied[of]
        return tuple(int(i) for i in copied)
