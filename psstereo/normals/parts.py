"""Some of a block's pixels, given to another solver, and its answer put in their places."""

from dataclasses import replace

from psstereo.normals.solver import PixelNormals, Samples
from psstereo.types import IntArray

__all__ = ["fill", "some"]


def some(samples: Samples, pixels: IntArray) -> Samples:
    """Return the observations of some pixels."""
    weights = None if samples.weights is None else samples.weights[:, pixels]
    return replace(samples, values=samples.values[:, pixels], weights=weights)


def fill(found: PixelNormals, pixels: IntArray, part: PixelNormals) -> None:
    """Put another solver's answer where this one has none, in place."""
    found.scaled[pixels], found.uncertainty[pixels] = part.scaled, part.uncertainty
    found.flags[pixels], found.used[pixels] = part.flags, part.used
    if found.covariance is not None and part.covariance is not None:
        found.covariance[pixels] = part.covariance
    if found.verdicts is not None and part.verdicts is not None:
        found.verdicts[:, pixels] = part.verdicts
