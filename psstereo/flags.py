"""Why a pixel has no answer, or one to be careful with: every flag bit, declared once.

A float array holds NaN where a value could not be recovered, and the flag array says why. A *fatal* bit goes with NaN;
the others are remarks on a value that stands.
"""

from dataclasses import dataclass
from enum import IntFlag

import numpy as np

from psstereo.types import BoolArray, FlagArray

__all__ = ["FATAL", "FLAGS", "Flag", "FlagInfo", "count_flags", "describe_flags", "fatal_mask"]


class Flag(IntFlag):
    """Bits of a uint16 flag array."""

    OUTSIDE_MASK = 1
    TOO_FEW_LIGHTS = 2
    RANK_DEFICIENT = 4
    NO_SIGNAL = 8
    NOT_FINITE = 16
    NOT_CONVERGED = 32
    UNUSABLE_SAMPLE = 64
    SHADOWED = 128
    NO_REDUNDANCY = 256
    FACING_AWAY = 512
    NO_DEPTH = 1024
    OVER_BRIGHT = 2048
    UNLIT = 4096


@dataclass(frozen=True, kw_only=True)
class FlagInfo:
    """One flag: its bit, whether it goes with NaN, and its sentence.

    Attributes
    ----------
    flag : Flag
        The bit.
    fatal : bool
        Whether the normal of a pixel that carries it is NaN.
    sentence : str
        The meaning, for a person.
    """

    flag: Flag
    fatal: bool
    sentence: str


FLAGS: tuple[FlagInfo, ...] = (
    FlagInfo(flag=Flag.OUTSIDE_MASK, fatal=True, sentence="The pixel lies outside the mask."),
    FlagInfo(
        flag=Flag.TOO_FEW_LIGHTS,
        fatal=True,
        sentence="Fewer than three observations are usable, so the normal is not determined.",
    ),
    FlagInfo(
        flag=Flag.RANK_DEFICIENT,
        fatal=True,
        sentence="The usable lights lie in one plane with the point, so the normal is not determined.",
    ),
    FlagInfo(flag=Flag.NO_SIGNAL, fatal=True, sentence="The pixel is black under every light."),
    FlagInfo(flag=Flag.NOT_FINITE, fatal=True, sentence="The solution is not a finite number."),
    FlagInfo(flag=Flag.NOT_CONVERGED, fatal=False, sentence="The solver stopped before it had converged."),
    FlagInfo(
        flag=Flag.UNUSABLE_SAMPLE,
        fatal=False,
        sentence="At least one observation was saturated, out of the valid range or not a number, and was left out.",
    ),
    FlagInfo(flag=Flag.SHADOWED, fatal=False, sentence="At least one observation was in shadow and left out."),
    FlagInfo(
        flag=Flag.NO_REDUNDANCY,
        fatal=False,
        sentence="Exactly three observations were used: the fit is exact and its error cannot be estimated.",
    ),
    FlagInfo(flag=Flag.FACING_AWAY, fatal=False, sentence="The normal points away from the camera."),
    FlagInfo(flag=Flag.NO_DEPTH, fatal=False, sentence="The pixel has no depth, although its normal may stand."),
    FlagInfo(
        flag=Flag.OVER_BRIGHT,
        fatal=False,
        sentence="The pixel is brighter than the light allows, and was taken as facing it.",
    ),
    FlagInfo(
        flag=Flag.UNLIT,
        fatal=False,
        sentence="The pixel received no light, so its brightness says nothing of its shape.",
    ),
)
"""The table of all flags."""

FATAL = np.uint16(sum(int(info.flag) for info in FLAGS if info.fatal))
"""All fatal bits."""


def fatal_mask(flags: FlagArray) -> BoolArray:
    """Return where a flag says that there is no normal.

    Parameters
    ----------
    flags : uint16 array of any shape
        Flag bits.

    Returns
    -------
    bool array of the same shape
        True where a fatal bit is set.
    """
    return np.asarray((flags & FATAL) != 0)


def count_flags(flags: FlagArray) -> dict[str, int]:
    """Count the pixels that carry each flag, by name; flags that no pixel carries are left out."""
    return {
        str(info.flag.name): count for info in FLAGS if (count := int(np.count_nonzero(flags & np.uint16(info.flag))))
    }


def describe_flags(bits: int) -> list[str]:
    """Return the sentences of the bits set in one pixel's flags.

    Examples
    --------
    >>> describe_flags(int(Flag.NO_SIGNAL))
    ['The pixel is black under every light.']
    """
    return [info.sentence for info in FLAGS if bits & int(info.flag)]
