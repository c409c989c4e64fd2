"""Image stacks: in memory or decoded when read, and the samples that solvers work on."""

from psstereo.stack.brackets import BracketStack
from psstereo.stack.colour import COLOUR_CHOICES, PROJECTIONS, ColourReading, Projection, colour_reading
from psstereo.stack.cropped import BinnedStack, CroppedStack
from psstereo.stack.files import FileStack
from psstereo.stack.flat import FlatField
from psstereo.stack.gather import Conversion, PixelSet, gather
from psstereo.stack.gray import GRAY, PER_CHANNEL, GrayWeights, gray_weights
from psstereo.stack.linear import LinearStack
from psstereo.stack.memory import MemoryStack
from psstereo.stack.response import LINEAR, Response
from psstereo.stack.stack import ImageStack
from psstereo.stack.store import MemoryStore, SampleStore, SpillStore
from psstereo.stack.unmixed import Mixing, UnmixedStack
from psstereo.stack.warped import WarpedStack

__all__ = [
    "COLOUR_CHOICES",
    "GRAY",
    "LINEAR",
    "PER_CHANNEL",
    "PROJECTIONS",
    "BinnedStack",
    "BracketStack",
    "ColourReading",
    "Conversion",
    "CroppedStack",
    "FileStack",
    "FlatField",
    "GrayWeights",
    "ImageStack",
    "LinearStack",
    "MemoryStack",
    "MemoryStore",
    "Mixing",
    "PixelSet",
    "Projection",
    "Response",
    "SampleStore",
    "SpillStore",
    "UnmixedStack",
    "WarpedStack",
    "colour_reading",
    "gather",
    "gray_weights",
]
