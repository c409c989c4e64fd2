"""What a refined elevation rests on at each pixel."""

from enum import IntFlag

import numpy as np

from psstereo.types import FlagArray

__all__ = ["TERRAIN_SENTENCES", "TerrainFlag", "count_terrain_flags"]


class TerrainFlag(IntFlag):
    """Bits of a uint16 flag array."""

    NO_IMAGE = 1
    NO_ELEVATION = 2
    UNKNOWN = 4
    SHADOWED = 8
    MISSING_SAMPLE = 16
    OUTLIER = 32
    NOT_CONVERGED = 64


TERRAIN_SENTENCES: dict[TerrainFlag, str] = {
    TerrainFlag.NO_IMAGE: "No image shows the pixel in the sun: its height is interpolated.",
    TerrainFlag.NO_ELEVATION: "The given elevation is unknown there: images and surroundings alone tell the height.",
    TerrainFlag.UNKNOWN: "Neither an image nor the given elevation says anything: the height is NaN.",
    TerrainFlag.SHADOWED: "At least one image shows the pixel in shadow, and was left out there.",
    TerrainFlag.MISSING_SAMPLE: "At least one image holds no number there.",
    TerrainFlag.OUTLIER: "At least one image contradicts the terrain there, and counted for less than half.",
    TerrainFlag.NOT_CONVERGED: "The rounds ended before the heights had settled.",
}
"""What each bit means."""


def count_terrain_flags(flags: FlagArray) -> dict[str, int]:
    """Count the pixels that carry each flag, by name; flags that no pixel carries are left out."""
    return {
        str(flag.name): count for flag in TerrainFlag if (count := int(np.count_nonzero(flags & np.uint16(int(flag)))))
    }
