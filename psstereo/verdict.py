"""What a solver made of each observation."""

from enum import IntEnum
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

__all__ = ["OUTSIDE", "TAKING_PART", "Verdict", "VerdictArray"]

VerdictArray: TypeAlias = npt.NDArray[np.uint8]
"""Values of :class:`Verdict`, and `OUTSIDE`."""


class Verdict(IntEnum):
    """One observation's part in the answer; a person can edit a stack of these and feed it back."""

    USED = 0
    """It took part."""
    SHADOW = 1
    """In attached or cast shadow, and left out."""
    HIGHLIGHT = 2
    """Brighter than the model by more than the noise, and left out or all but ignored."""
    DARK_OUTLIER = 3
    """Darker than the model by more than the noise without being in shadow, and left out or all but ignored."""
    UNUSABLE = 4
    """Saturated, out of the valid range, masked by the user, or not a number."""
    NOT_NEEDED = 5
    """Sound, but outside the ranks that the method looks at."""


OUTSIDE = 255
"""Stands in a stack of verdicts where the pixel lies outside the mask, so that nobody looked."""

TAKING_PART = (Verdict.USED, Verdict.NOT_NEEDED)
"""Verdicts that let an observation take part when a stack of them is fed back; all others leave it out."""
