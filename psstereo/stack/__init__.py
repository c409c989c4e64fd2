"""Image stacks: in memory or decoded when read, and the samples that solvers work on."""

from psstereo.stack.files import FileStack
from psstereo.stack.gather import Conversion, PixelSet, gather
from psstereo.stack.gray import GRAY, PER_CHANNEL, GrayWeights, gray_weights
from psstereo.stack.memory import MemoryStack
from psstereo.stack.response import LINEAR, Response
from psstereo.stack.stack import ImageStack
from psstereo.stack.store import MemoryStore, SampleStore, SpillStore

__all__ = [
    "GRAY",
    "LINEAR",
    "PER_CHANNEL",
    "Conversion",
    "FileStack",
    "GrayWeights",
    "ImageStack",
    "MemoryStack",
    "MemoryStore",
    "PixelSet",
    "Response",
    "SampleStore",
    "SpillStore",
    "gather",
    "gray_weights",
]
