"""One normal from the scaled normals of several colour channels.

Channel c gives ``b_c ≈ ρ_c n``. The matrix of all b_c is of rank one up to noise, and its first singular vectors are
the maximum-likelihood normal and albedos for equal noise in all channels. The channels agree so well that a power
iteration from their sum is there in a few steps.
"""

import numpy as np

from psstereo.flags import Flag, fatal_mask
from psstereo.normals.solver import PixelNormals
from psstereo.normals.verdict import Verdict, VerdictArray
from psstereo.types import BoolArray, FlagArray, FloatArray

__all__ = ["combine_channels", "combine_covariances", "combine_verdicts"]

_STEPS = 100
_SETTLED = 1e-14

_MILDEST_FIRST = (
    Verdict.USED,
    Verdict.NOT_NEEDED,
    Verdict.SHADOW,
    Verdict.DARK_OUTLIER,
    Verdict.HIGHLIGHT,
    Verdict.UNUSABLE,
)


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


def combine_covariances(
    channels: list[PixelNormals], normals: FloatArray, albedo: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Propagate the channels' covariances, and say how many observations the sum rests on.

    The normal moves by ``Σ ρ_c² e_c / Σ ρ_c²`` for independent errors e_c. The estimate of such a sum of variances v_c
    with ν_c degrees of freedom each has about ``(Σ v_c)² / Σ (v_c² / ν_c)`` of them [1]_.

    Parameters
    ----------
    channels : list of PixelNormals
        One a channel, with covariances.
    normals : float64 array (p, 3)
        Unit normals that :func:`combine_channels` returned [1].
    albedo : float64 array (p, c)
        Albedo that it returned.

    Returns
    -------
    covariance : float64 array (p, 6)
        Covariance of the combined normal's error, entries xx, xy, yy, xz, yz, zz [rad²].
    used : float64 array (p,)
        Three more than the degrees of freedom [1].

    References
    ----------
    .. [1] F. E. Satterthwaite, "An approximate distribution of estimates of variance components", Biometrics Bulletin
       2(6), 1946. doi:10.2307/3002019
    """
    solved = np.isfinite(albedo)
    power = np.where(solved, albedo, 0.0) ** 2
    with np.errstate(invalid="ignore", divide="ignore"):
        share = power / power.sum(axis=1, keepdims=True)
        c = np.stack([np.zeros((len(normals), 6)) if one.covariance is None else one.covariance for one in channels], 1)
        parts = np.where(share[..., None] > 0, share[..., None] ** 2 * c, 0.0)
        x, y, z = normals.T
        whole = parts.sum(axis=1)
        xx, xy, yy, xz, yz, zz = whole.T
        # what the channels' own normals leave along the common one is taken off: P C P with P = I − n nᵀ
        along = np.stack([xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z])
        twice = (along * normals.T).sum(axis=0)
        pairs = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))
        n = normals.T
        flat = [whole[:, k] - along[i] * n[j] - n[i] * along[j] + twice * n[i] * n[j] for k, (i, j) in enumerate(pairs)]
        variance = parts[..., [0, 2, 5]].sum(axis=2)
        degrees = np.stack([one.used - 3.0 for one in channels], axis=1)
        freedom = variance.sum(axis=1) ** 2 / np.where(variance > 0, variance**2 / degrees, 0.0).sum(axis=1)
    covariance = np.stack(flat, axis=1)
    covariance[~np.isfinite(normals).all(axis=1)] = np.nan
    return covariance, np.asarray(freedom + 3.0)


def combine_verdicts(channels: list[PixelNormals]) -> VerdictArray:
    """Return one verdict an observation: the mildest that a channel gave, so that one left out is so in all of them.

    Parameters
    ----------
    channels : list of PixelNormals
        One a channel, with verdicts. A channel that found no normal has no say where another did.

    Returns
    -------
    uint8 array (m, p)
        Verdicts.
    """
    solved = np.stack([np.isfinite(channel.scaled).all(axis=1) for channel in channels])
    heard = solved | ~solved.any(axis=0)
    rank = np.zeros(256, np.uint8)
    rank[list(_MILDEST_FIRST)] = np.arange(len(_MILDEST_FIRST))
    mildest: VerdictArray | None = None
    for channel, says in zip(channels, heard, strict=True):
        given = np.zeros((0, 0), np.uint8) if channel.verdicts is None else rank[channel.verdicts]
        ranks = np.where(says, given, np.uint8(len(_MILDEST_FIRST) - 1))
        mildest = ranks if mildest is None else np.minimum(mildest, ranks)
    return np.asarray(np.array(_MILDEST_FIRST, np.uint8)[mildest], np.uint8)
