"""What one image says of the slopes at the heights of the moment: residual, derivatives, and how far to trust them."""

from dataclasses import dataclass

import numpy as np

from psstereo.forward.horizon import shadow_height
from psstereo.sfs.terrain.reflectance import Ground
from psstereo.types import BoolArray, FloatArray

__all__ = ["ImageScale", "Sunlight", "clear_of_shadow", "image_scale", "in_cast_shadow", "look"]

_DARK = 0.03
"""Share of the exposure below which a pixel counts as in shadow, whatever the terrain predicts [1]."""
_FADE = 0.05
"""Shares of the exposure, and of the cosine of incidence, over which weights rise from 0 to 1 [1]."""
_BRIGHT = 0.3
"""Share of the exposure above which a pixel is not in cast shadow, whatever the terrain predicts [1]."""
_EDGE = 5
"""Side of the square in which shadow beside a pixel takes from its weight [px]."""
_DEEP = 0.9
"""Share of shadow in that square from which the pixel tells the haze."""
_CAUCHY = 3.0
"""Scale of Cauchy's loss, in standard deviations of the residual."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Sunlight:
    """One image, linearised; brightness in shares of the image's exposure.

    Attributes
    ----------
    weight : float64 array (h, w)
        0 in and beside shadow and where nothing is known, falling with the residual [1].
    residual : float64 array (h, w)
        Measured less predicted; 0 where nothing is known [1].
    value, along_x, along_y : float64 arrays (h, w)
        Prediction, and its derivatives by the slopes [1].
    dark_weight : float64 array (h, w)
        Weight of pixels deep in cast shadow, whose brightness is the haze [1].
    dark_residual : float64 array (h, w)
        Their brightness above the haze [1].
    """

    weight: FloatArray
    residual: FloatArray
    value: FloatArray
    along_x: FloatArray
    along_y: FloatArray
    dark_weight: FloatArray
    dark_residual: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class ImageScale:
    """How large residuals of an image are as a whole, so that all tiles judge by the same measure.

    Attributes
    ----------
    cauchy : float
        Residual at which a pixel counts for half [1].
    spread : float
        Robust standard deviation of the residual [1].
    """

    cauchy: float
    spread: float


def in_cast_shadow(heights: FloatArray, cell: tuple[float, float], sun: FloatArray) -> BoolArray:
    """Return where terrain lies in its own cast shadow, bool (h, w)."""
    return np.asarray(heights < shadow_height(heights, cell, sun))


def clear_of_shadow(share: FloatArray, cast: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Return the weight that shadows leave, and the share of shadow around each pixel, float64 (h, w) each.

    The weight is 0 in shadow, and rises to 1 over two pixels beside it: sun and camera blur edges, and the terrain of
    the moment puts them in slightly wrong places. A pixel is in shadow if it is dark, or if the terrain says so and it
    is not bright.

    Parameters
    ----------
    share : float64 array (h, w)
        Image without haze in units of its exposure, NaN where unknown [1].
    cast : bool array (h, w)
        Shadow that the terrain predicts.
    """
    from scipy.ndimage import uniform_filter

    with np.errstate(invalid="ignore"):
        shadow = (share < _DARK) | (cast & (share < _BRIGHT))
    around = uniform_filter(shadow.astype(np.float64), _EDGE, mode="nearest")
    with np.errstate(invalid="ignore"):
        rising = np.clip((share - _DARK) / _FADE, 0.0, 1.0)
    weight = np.where(shadow | np.isnan(share), 0.0, np.clip(1.0 - 2.0 * around, 0.0, 1.0) * rising)
    return weight, np.where(cast, around, 0.0)


def look(
    share: FloatArray,
    ground: Ground,
    *,
    slopes: tuple[FloatArray, FloatArray],
    shadow: tuple[FloatArray, FloatArray],
    scale: ImageScale | None,
    albedo: FloatArray | None,
) -> Sunlight:
    """Linearise one image, or a window of it.

    Parameters
    ----------
    share : float64 array (h, w)
        Image without haze in units of its exposure, NaN where unknown [1].
    ground : Ground
        Reflectance under this sun.
    slopes : pair of float64 arrays (h, w)
        Slopes along x and y [1].
    shadow : pair of float64 arrays (h, w)
        What :func:`clear_of_shadow` returned.
    scale : ImageScale or None
        Scale of the loss; none, and weights do not depend on the residual.
    albedo : float64 array (h, w), optional
        Albedo; 1 if left out [1].

    Returns
    -------
    Sunlight
        Residuals, derivatives, weights.
    """
    shading = ground.shade(*slopes)
    tint = 1.0 if albedo is None else albedo
    value, along_x, along_y = (tint * part for part in (shading.value, shading.along_x, shading.along_y))
    clear, around = shadow
    weight = clear * np.clip(shading.cosine / _FADE, 0.0, 1.0)
    residual = np.where(np.isnan(share), 0.0, share - value)
    with np.errstate(invalid="ignore"):
        deep = (around >= _DEEP) & (share < _BRIGHT)
    dark_weight, dark_residual = deep.astype(np.float64), np.where(deep, share, 0.0)
    if scale is not None:
        weight = weight / (1.0 + (residual / scale.cauchy) ** 2)
        dark_weight = dark_weight / (1.0 + (dark_residual / scale.cauchy) ** 2)
    return Sunlight(
        weight=weight,
        residual=residual,
        value=value,
        along_x=along_x,
        along_y=along_y,
        dark_weight=dark_weight,
        dark_residual=dark_residual,
    )


def image_scale(found: Sunlight, noise: float) -> ImageScale:
    """Return the scale of an image's residuals, from the median of those that count; never below the noise."""
    sizes = np.abs(found.residual[found.weight > 0])
    spread = 1.4826 * float(np.median(sizes)) if sizes.size else noise
    return ImageScale(cauchy=_CAUCHY * max(spread, noise), spread=spread)
