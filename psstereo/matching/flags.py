"""Why a pixel has no match, or one to be careful with."""

from enum import IntFlag

import numpy as np

from psstereo.types import FlagArray

__all__ = ["MATCH_SENTENCES", "MatchFlag", "count_match_flags"]


class MatchFlag(IntFlag):
    """Bits of a uint16 flag array."""

    OUTSIDE_MASK = 1
    OUT_OF_VIEW = 2
    INCONSISTENT = 4
    OCCLUDED = 8
    SPECKLE = 16
    WEAK = 32
    SATURATED = 64
    FILLED = 128
    REJECTED = 256


MATCH_SENTENCES: dict[MatchFlag, str] = {
    MatchFlag.OUTSIDE_MASK: "The pixel lies outside the mask.",
    MatchFlag.OUT_OF_VIEW: "No label of the range leads into the other image.",
    MatchFlag.INCONSISTENT: "The other view's match leads back to another pixel.",
    MatchFlag.OCCLUDED: "No pixel of the other view leads there: the point is hidden in it or outside its image.",
    MatchFlag.SPECKLE: "The match stands alone in a patch too small to be believed.",
    MatchFlag.WEAK: "Another label costs hardly more, so the match is a guess.",
    MatchFlag.SATURATED: "At least one of the images is saturated there.",
    MatchFlag.FILLED: "The value was taken from the neighbours farther away, not matched.",
    MatchFlag.REJECTED: "The match contradicts the normals or the albedo.",
}
"""What each bit means."""


def count_match_flags(flags: FlagArray) -> dict[str, int]:
    """Count the pixels that carry each flag, by name; flags that no pixel carries are left out."""
    return {
        str(flag.name): count for flag in MatchFlag if (count := int(np.count_nonzero(flags & np.uint16(int(flag)))))
    }
