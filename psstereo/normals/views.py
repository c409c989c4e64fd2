"""What is to be seen of the samples while they are at hand: small images, and how far the fit is from them."""

from dataclasses import dataclass

import numpy as np

from psstereo.capture import Capture
from psstereo.errors import UnsupportedError
from psstereo.lights import Led
from psstereo.normals.gathered import Gathered
from psstereo.results import DepthResult, NormalsResult
from psstereo.stack.linear import LinearStack
from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["SampleViews", "lamp_directions", "views_of", "views_under_lamps"]

_BLOCK = 1 << 12
"""Pixels that are looked at together; their samples stay in the processor's cache."""

_LARGE_BLOCK = 1 << 16
"""The same where an image is looked at at a time: enough that loops in Python count for nothing."""


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


def views_under_lamps(
    capture: Capture, result: NormalsResult, depth: DepthResult | None, *, side: int = 96
) -> SampleViews:
    """Look once more through the images of a capture under near lamps, whose light depends on where the surface is.

    Every image is decoded once; in memory there are a few numbers a pixel, whatever the number of lamps. Values with a
    saturated channel take no part. Not for distant lights, whose samples are at hand when they are solved.

    Parameters
    ----------
    capture : Capture
        Images, lamps, camera.
    result : NormalsResult
        What was found.
    depth : DepthResult or None
        The surface, in the unit of the lamps' positions; residuals stay unknown without one.
    side : int
        Longer side of the small images [px].

    Returns
    -------
    SampleViews
        Pictures of the images and of how far they are from a matte surface there.

    Raises
    ------
    UnsupportedError
        If a light is no lamp at a place.
    """
    lamps = [light for light in capture.rig.lights if isinstance(light, Led)]
    if len(lamps) < len(capture.rig):
        raise UnsupportedError(
            given=f"{len(capture.rig) - len(lamps)} of the {len(capture.rig)} lights are no lamps at places.",
            needed="Lamps with a position each.",
            remedy="Look at the samples of distant lights while they are gathered (views_of).",
        )
    height, width = capture.shape
    step = max(1, -(-max(height, width) // side))
    mask = capture.effective_mask
    indices = np.flatnonzero(mask)
    points = None if depth is None else capture.camera.points(np.asarray(depth.depth, np.float64)).reshape(-1, 3)
    normals = result.normals.reshape(-1, 3)
    small = np.full((len(lamps), -(-height // step), -(-width // step)), np.nan, np.float32)
    sums = np.zeros((4, len(indices)))
    light = LinearStack(capture.stack, response=capture.response, dark=capture.dark, flat=capture.flat)
    for index, lamp in enumerate(lamps):
        frame = light.frame(index)
        channels = frame.shape[2]
        flux = np.broadcast_to(lamp.flux, (channels,))
        thinned = (frame[::step, ::step] / (flux * capture.stack.white)).mean(axis=2)
        small[index] = np.where(mask[::step, ::step], thinned, np.nan)
        if points is not None:
            _add(sums, frame.reshape(-1, channels), lamp, points=points, normals=normals, indices=indices)
    residual = np.full(height * width, np.nan, np.float32)
    if points is not None:
        residual[indices] = _left_over(*sums)
    return SampleViews(images=small, names=capture.stack.names, residual=residual.reshape(height, width))


def _add(
    sums: FloatArray, frame: FloatArray, lamp: Led, *, points: FloatArray, normals: FloatArray, indices: IntArray
) -> None:
    """Add an image's products of value and shading, (4, p): vv, vs, ss, and how many it shows light in."""
    flux = np.broadcast_to(lamp.flux, frame.shape[1:])
    for start in range(0, len(indices), _LARGE_BLOCK):
        part = slice(start, start + _LARGE_BLOCK)
        places = indices[part]
        value = (frame[places] / flux).mean(axis=1, dtype=np.float64)
        with np.errstate(invalid="ignore"):
            shade = lamp.irradiance(points[places], normals[places])[:, 0] / lamp.flux[0]
            lit = np.isfinite(value) & (shade > 0)
        value, shade = np.where(lit, value, 0.0), np.where(lit, shade, 0.0)
        sums[:, part] += np.stack([value * value, value * shade, shade * shade, lit.astype(np.float64)])


def _left_over(vv: FloatArray, vs: FloatArray, ss: FloatArray, count: FloatArray) -> FloatArray:
    """Return the deviation from the matte surface that fits best over its brightness, both as root mean squares.

    Brightness that faces a lamp would be another under each lamp.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        rest = np.maximum(vv - vs * vs / ss, 0.0) / count
        return np.asarray(np.where(count > 0, np.sqrt(rest) / (vs / ss * np.sqrt(ss / count)), np.nan))


def lamp_directions(capture: Capture, depth: DepthResult) -> FloatArray | None:
    """Return where lamps stand seen from the middle of the surface, (m, 3); None if one is no lamp at a place.

    Parameters
    ----------
    capture : Capture
        Lamps and camera.
    depth : DepthResult
        The surface, in the unit of the lamps' positions.
    """
    lamps = [light for light in capture.rig.lights if isinstance(light, Led)]
    points = capture.camera.points(np.asarray(depth.depth, np.float64)).reshape(-1, 3)
    if len(lamps) < len(capture.rig) or not np.isfinite(points).all(axis=1).any():
        return None
    middle = np.nanmedian(points, axis=0)
    offset = np.array([lamp.position for lamp in lamps]) - middle
    length = np.sqrt((offset * offset).sum(axis=1, keepdims=True))
    return np.asarray(offset / np.where(length > 0, length, np.nan))


def _deviation(values: FloatArray, facing: FloatArray) -> FloatArray:
    """Return the relative deviation of samples (m, p) from the matte surface with cosines (m, p) that fits best."""
    with np.errstate(invalid="ignore", divide="ignore"):
        lit = np.isfinite(values) & (facing > 0)
        kept, shade = np.where(lit, values, np.float32(0.0)), np.where(lit, facing, np.float32(0.0))
        scale = np.einsum("ij,ij->j", kept, shade) / np.einsum("ij,ij->j", shade, shade)
        kept -= scale * shade  # 0 where nothing is lit
        mean = np.einsum("ij,ij->j", kept, kept) / np.maximum(np.count_nonzero(lit, axis=0), 1)
        return np.asarray(np.where(lit.any(axis=0), np.sqrt(mean) / scale, np.nan))
