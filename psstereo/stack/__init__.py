"""Image stacks: in memory or decoded when read, and the samples that solvers work on."""

from psstereo.stack.colour import COLOUR_CHOICES, PROJECTIONS, ColourReading, Projection, colour_reading
from psstereo.stack.files import FileStack
from psstereo.stack.gather import Conversion, PixelSet, gather
from psstereo.stack.gray import GRAY, PER_CHANNEL, GrayWeights, gray_weights
from psstereo.stack.memory import MemoryStack
from psstereo.stack.response import LINEAR, Response
from psstereo.stack.stack import ImageStack
from psstereo.stack.store import MemoryStore, SampleStore, SpillStore
from psstereo.stack.unmixed import Mixing, UnmixedStack

__all__ = [
    "COLOUR_CHOICES",
    "GRAY",
    "LINEAR",
    "PER_CHANNEL",
    "PROJECTIONS",
    "ColourReading",
    "Conversion",
    "FileStack",
    "GrayWeights",
    "ImageStack",
    "MemoryStack",
    "MemoryStore",
    "Mixing",
    "PixelSet",
    "Projection",
    "Response",
    "SampleStore",
    "SpillStore",
    "UnmixedStack",
    "colour_reading",
    "gather",
    "gray_weights",
]
