"""Single images of matte surfaces with known shape, on which methods of shape from shading are compared."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from psstereo.errors import OptionError
from psstereo.lights import Directional
from psstereo.sfs import ShadedImage
from psstereo.types import BoolArray, FloatArray
from psstereo_synth.hills import normals_of_slopes
from psstereo_synth.shapes import Vase

__all__ = ["SHADED", "Shaded", "coarsened", "shaded"]

Parts = tuple[FloatArray, FloatArray, FloatArray]
"""Height and its slopes to the right and up."""

_STEEPEST = 4.0
"""Slope beyond which the vase's sides are left out: their pixels cover a fast change of brightness."""


@dataclass(frozen=True, eq=False)
class Shaded:
    """A surface and its image.

    Attributes
    ----------
    image : ShadedImage
        Brightness with unit albedo under one sun; heights are known on the rim.
    height : float64 array (h, w)
        True heights, NaN outside the mask [px].
    normals : float64 array (h, w, 3)
        True normals, NaN outside [1].
    summits : float64 array (h, w)
        The rim's heights and those at the pixels that face the sun best among their neighbours; NaN elsewhere [px].
    """

    image: ShadedImage
    height: FloatArray
    normals: FloatArray
    summits: FloatArray


def shaded(
    name: str,
    size: int,
    *,
    azimuth: float = np.radians(135.0),
    elevation: float = np.radians(60.0),
    noise: float = 0.0,
    bits: int | None = None,
    seed: int = 0,
) -> Shaded:
    """Make one of the images; attached shadows are black, no shadow is cast.

    Parameters
    ----------
    name : str
        One of `SHADED`.
    size : int
        Width and height [px].
    azimuth, elevation : float
        Of the sun, from x right toward y up and above the image plane [rad].
    noise : float
        Standard deviation of what is added to brightness, of which 1 is a surface that faces the sun [1].
    bits : int, optional
        Rounds brightness to so many bits.
    seed : int
        Of the noise.

    Returns
    -------
    Shaded
        The image and its truth.

    Raises
    ------
    OptionError
        If the surface is unknown.
    """
    if name not in SHADED:
        raise OptionError(
            given=f"The surface {name!r} is unknown.", needed=f"Known are {', '.join(SHADED)}.", remedy="Choose one."
        )
    half = size / 2.0
    x = np.broadcast_to((np.arange(size) - (size - 1) / 2.0) / half, (size, size))
    height, right, up = SHADED[name](x, -x.T)
    with np.errstate(invalid="ignore"):
        mask = np.isfinite(height) & (np.hypot(right, up) < _STEEPEST)
    normals = np.where(mask[..., None], normals_of_slopes(right, up), np.nan)
    sun = np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)
    cosine = np.maximum(normals @ np.array(sun), 0.0)
    brightness = cosine + noise * np.random.default_rng(seed).normal(size=mask.shape)
    if bits is not None:
        top = 2**bits - 1
        brightness = np.clip(np.round(brightness * top), 0, top) / top
    height = np.where(mask, height * half, np.nan)
    rim = _rim(mask)
    image = ShadedImage(
        image=np.where(mask, brightness, np.nan),
        light=Directional(direction=np.array(sun), strength=np.ones(1)),
        mask=mask,
        heights=np.where(rim, height, np.nan),
    )
    return Shaded(image, height, normals, np.where(rim | _summits(cosine, mask), height, np.nan))


def coarsened(height: FloatArray, block: int) -> tuple[FloatArray, float]:
    """Return heights as a coarse sensor tells them: means over blocks, interpolated linearly between their middles.

    Parameters
    ----------
    height : float64 array (h, w)
        Heights, NaN where there is none.
    block : int
        Side of a block [px].

    Returns
    -------
    rough : float64 array (h, w)
        Interpolated means, NaN where there is no height.
    sigma : float
        Root mean square of what they lack [unit of the heights].
    """
    from scipy import ndimage

    known = np.isfinite(height)
    rows, columns = (-(-length // block) for length in height.shape)
    labels = (np.arange(height.shape[0]) // block)[:, None] * columns + np.arange(height.shape[1]) // block
    sums = np.bincount(labels[known], height[known], rows * columns)
    counts = np.bincount(labels[known], minlength=rows * columns)
    with np.errstate(invalid="ignore", divide="ignore"):
        means = (sums / counts).reshape(rows, columns)
    empty = np.isnan(means)
    if empty.any():  # the nearest block that has a mean stands in
        nearest = ndimage.distance_transform_edt(empty, return_distances=False, return_indices=True)
        means = means[tuple(nearest)]
    middle = [(np.arange(length) + 0.5) / block - 0.5 for length in height.shape]
    rough = ndimage.map_coordinates(means, np.meshgrid(*middle, indexing="ij"), order=1, mode="nearest")
    rough = np.where(known, rough, np.nan)
    return rough, float(np.sqrt(np.nanmean((rough - height) ** 2)))


def _vase(x: FloatArray, y: FloatArray) -> Parts:
    found = Vase().evaluate(x, y)
    return found.height, found.slope_x, found.slope_y


def _gaussians(
    table: tuple[tuple[float, float, float, float, float], ...],
) -> Callable[[FloatArray, FloatArray], Parts]:
    """Return a surface that is a sum of Gaussians: middle x and y, widths to the right and up, height."""

    def evaluate(x: FloatArray, y: FloatArray) -> Parts:
        height, right, up = np.zeros(x.shape), np.zeros(x.shape), np.zeros(x.shape)
        for middle_x, middle_y, wide, tall, top in table:
            one = top * np.exp(-(((x - middle_x) / wide) ** 2 + ((y - middle_y) / tall) ** 2) / 2.0)
            height += one
            right -= one * (x - middle_x) / wide**2
            up -= one * (y - middle_y) / tall**2
        return height, right, up

    return evaluate


SHADED: dict[str, Callable[[FloatArray, FloatArray], Parts]] = {
    "vase": _vase,
    "four hills": _gaussians(
        (
            (-0.45, 0.45, 0.22, 0.22, 0.20),
            (0.45, 0.45, 0.22, 0.22, 0.26),
            (-0.45, -0.45, 0.22, 0.22, 0.26),
            (0.45, -0.45, 0.22, 0.22, 0.20),
        )
    ),
    "face": _gaussians(
        (
            (0.0, 0.0, 0.45, 0.55, 0.45),  # the head
            (0.0, -0.02, 0.07, 0.16, 0.09),  # nose
            (-0.2, 0.22, 0.12, 0.06, 0.05),  # brows
            (0.2, 0.22, 0.12, 0.06, 0.05),
            (-0.19, 0.1, 0.09, 0.05, -0.06),  # eyes
            (0.19, 0.1, 0.09, 0.05, -0.06),
            (0.0, -0.3, 0.14, 0.04, 0.04),  # mouth
            (0.0, -0.5, 0.12, 0.08, 0.05),  # chin
        )
    ),
}
"""Surfaces over the square from −1 to 1, by name."""


def _rim(mask: BoolArray) -> BoolArray:
    """Return the pixels of the mask with a neighbour outside."""
    known = np.pad(mask, 1)
    return mask & ~(known[:-2, 1:-1] & known[2:, 1:-1] & known[1:-1, :-2] & known[1:-1, 2:])


def _summits(cosine: FloatArray, mask: BoolArray) -> BoolArray:
    """Return the pixels that face the sun to within the step of a pixel, one each."""
    from scipy import ndimage

    values = np.where(mask, cosine, -1.0)
    highest = values == ndimage.maximum_filter(values, size=5)
    return np.asarray(mask & highest & (values > 0.999))
