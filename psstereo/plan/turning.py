"""Whether normals turn at once between neighbouring pixels, as they do at the foot and the rim of a cliff."""

import numpy as np

from psstereo.camera import Orthographic
from psstereo.depth.discontinuity_evidence import turning
from psstereo.depth.domain import make_domain
from psstereo.plan.sample import Sample
from psstereo.types import FloatArray, IntArray

__all__ = ["turning_share"]

_AT_ONCE = 4.0
"""Turn of a pair over that of the pairs next to it from which it is sudden, as the integrator has it."""


def turning_share(sample: Sample) -> float | None:
    """Return the share of neighbouring pixels between which the normal turns at once.

    Parameters
    ----------
    sample : Sample
        The sample; its blocks are laid side by side with a gap between them.

    Returns
    -------
    float or None
        Share of the pairs [1]; None if no pair has normals.
    """
    normals, blocks = _mosaic(sample)
    known = np.isfinite(normals).all(axis=-1) & (normals[..., 2] > 0)
    pairs = int((known[:, 1:] & known[:, :-1]).sum() + (known[1:] & known[:-1]).sum())
    if not pairs:
        return None
    domain = make_domain(np.where(known[..., None], normals, 0.0), Orthographic(), known, None)
    found = turning(domain, blocks[domain.window])
    return sum(int(np.count_nonzero(one > _AT_ONCE)) for one in found) / pairs


def _mosaic(sample: Sample) -> tuple[FloatArray, IntArray]:
    """Return the blocks' normals in one image, NaN between them, and the number of each block from 1."""
    count = int(sample.blocks.max()) + 1
    low = np.full((count, 2), np.iinfo(np.int64).max)
    np.minimum.at(low, sample.blocks, sample.pixels)
    place = sample.pixels - low[sample.blocks]
    side = int(place.max()) + 2
    columns = int(np.ceil(np.sqrt(count)))
    image = np.full((-(-count // columns) * side, columns * side, 3), np.nan)
    row, column = np.divmod(sample.blocks, columns)
    numbers = np.zeros(image.shape[:2], np.int64)
    where = row * side + place[:, 0], column * side + place[:, 1]
    image[where], numbers[where] = sample.normals, sample.blocks + 1
    return image, numbers
