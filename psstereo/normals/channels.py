"""One normal from the scaled normals of several colour channels.

Channel c gives ``b_c ≈ ρ_c n``. The matrix of all b_c is of rank one up to noise, and its first singular vectors are
the maximum-likelihood normal and albedos for equal noise in all channels. The channels agree so well that a power
iteration from their sum is there in a few steps.
"""

import numpy as np

from psstereo.flags import Flag, fatal_mask
from psstereo.normals.solver import PixelNormals
from psstereo.types import BoolArray, FlagArray, FloatArray

__all__ = ["combine_channels"]

_STEPS = 100
_SETTLED = 1e-14


def combine_channels(channels: list[PixelNormals]) -> tuple[FloatArray, FloatArray, FloatArray, FlagArray]:
    """Combine the channels of some pixels.

    A pixel is solved if one channel is; a channel that is not then has the albedo NaN.

    Parameters
    ----------
    channels : list of PixelNormals
        One a channel, each of the same p pixels.

    Returns
    -------
    normals : float64 array (p, 3)
        Unit normals, NaN where no channel was solved [1].
    albedo : float64 array (p, c)
        Albedo of each channel.
    uncertainty : float64 array (p,)
        Root-mean-square angle [rad].
    flags : uint16 array (p,)
        Remarks of all channels; fatal bits only where no channel was solved.
    """
    scaled = np.stack([channel.scaled for channel in channels], axis=1)  # (p, c, 3)
    solved: BoolArray = np.asarray(np.isfinite(scaled).all(axis=2))
    b = np.where(solved[..., None], scaled, 0.0)
    normals = _unit((b * np.sqrt((b * b).sum(axis=2, keepdims=True))).sum(axis=1))
    for _ in range(_STEPS):
        previous = normals
        along = np.einsum("pcx,px->pc", b, normals)
        normals = _unit(np.einsum("pc,pcx->px", along, b))
        if not np.nanmax(np.abs(normals - previous), initial=0.0) > _SETTLED:
            break
    albedo = np.where(solved, np.einsum("pcx,px->pc", b, normals), np.nan)
    flags = _flags(channels, np.asarray(solved.any(axis=1)))
    # channels that cancel each other, or lengths whose fourth powers leave the range of numbers
    flags[~fatal_mask(flags) & ~np.isfinite(normals).all(axis=1)] |= np.uint16(Flag.NOT_FINITE)
    return normals, albedo, _uncertainty(channels, albedo, solved), flags


def _unit(vectors: FloatArray) -> FloatArray:
    length = np.sqrt((vectors * vectors).sum(axis=1, keepdims=True))
    return np.asarray(vectors / np.where(length > 0, length, np.nan))


def _uncertainty(channels: list[PixelNormals], albedo: FloatArray, solved: BoolArray) -> FloatArray:
    """Propagate the channels' angles: to first order n moves by Σ ρ_c² δ_c / Σ ρ_c² for independent angles δ_c."""
    power = np.where(solved, albedo, 0.0) ** 2
    angle = np.stack([channel.uncertainty for channel in channels], axis=1)
    moved = np.where(power > 0, power * angle, 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.sqrt((moved * moved).sum(axis=1)) / power.sum(axis=1))


def _flags(channels: list[PixelNormals], any_solved: BoolArray) -> FlagArray:
    union = np.bitwise_or.reduce([channel.flags for channel in channels])
    common = np.bitwise_and.reduce([channel.flags for channel in channels])
    fatal_bits = np.uint16(sum(int(flag) for flag in Flag if fatal_mask(np.array([int(flag)], np.uint16))[0]))
    common_fatal = np.where(common & fatal_bits, common & fatal_bits, union & fatal_bits)
    return np.asarray((union & ~fatal_bits) | np.where(any_solved, np.uint16(0), common_fatal), np.uint16)
