"""What is to be seen of the samples while they are at hand: small images, and how far the fit is from them."""

from dataclasses import dataclass

import numpy as np

from psstereo.normals.gathered import Gathered
from psstereo.results import NormalsResult
from psstereo.types import BoolArray, FloatArray

__all__ = ["SampleViews", "views_of"]

_BLOCK = 1 << 12
"""Pixels that are looked at together; their samples stay in the processor's cache."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SampleViews:
    """Pictures of the samples.

    Attributes
    ----------
    images : float32 array (m, h', w')
        Every image, thinned: brightness over the light's strength; NaN outside the mask or where unusable.
    names : tuple of str
        The images' names.
    residual : float32 array (h, w)
        Root-mean-square deviation from the matte surface that was found, over the observations that it shows light in,
        as a share of the pixel's brightness where it faces a light; NaN where unknown [1].
    """

    images: FloatArray
    names: tuple[str, ...]
    residual: FloatArray


def views_of(samples: Gathered, result: NormalsResult, *, side: int = 96) -> SampleViews:
    """Look through the samples once.

    Parameters
    ----------
    samples : Gathered
        Of a capture under distant lights.
    result : NormalsResult
        What was found in them.
    side : int
        Longer side of the small images [px].

    Returns
    -------
    SampleViews
        Pictures of them.
    """
    height, width = samples.pixels.shape
    step = max(1, -(-max(height, width) // side))
    row, column = np.divmod(samples.pixels.indices, width)
    thin: BoolArray = (row % step == 0) & (column % step == 0)
    count = samples.store.shape[1]
    small = np.full((count, -(-height // step), -(-width // step)), np.nan, np.float32)
    residual = np.full(height * width, np.nan, np.float32)
    directions = samples.capture.rig.directions.astype(np.float32)
    normals = result.normals.reshape(-1, 3).astype(np.float32)
    total = len(samples.pixels.indices)
    for start in range(0, total, _BLOCK):
        stop = min(total, start + _BLOCK)
        read = samples.store.read(start, stop)
        values = read[0] if len(read) == 1 else read.mean(axis=0)
        places = samples.pixels.indices[start:stop]
        chosen = thin[start:stop]
        small[:, row[start:stop][chosen] // step, column[start:stop][chosen] // step] = values[:, chosen]
        residual[places] = _deviation(values, directions @ normals[places].T)
    return SampleViews(images=small, names=samples.capture.stack.names, residual=residual.reshape(height, width))


def _deviation(values: FloatArray, facing: FloatArray) -> FloatArray:
    """Return the relative deviation of samples (m, p) from the matte surface with cosines (m, p) that fits best."""
    with np.errstate(invalid="ignore", divide="ignore"):
        lit = np.isfinite(values) & (facing > 0)
        kept, shade = np.where(lit, values, np.float32(0.0)), np.where(lit, facing, np.float32(0.0))
        scale = np.einsum("ij,ij->j", kept, shade) / np.einsum("ij,ij->j", shade, shade)
        kept -= scale * shade  # 0 where nothing is lit
        mean = np.einsum("ij,ij->j", kept, kept) / np.maximum(np.count_nonzero(lit, axis=0), 1)
        return np.asarray(np.where(lit.any(axis=0), np.sqrt(mean) / scale, np.nan))
