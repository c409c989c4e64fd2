"""What one image tells of its light and paint, if the object is what the estimator takes it for.

Each of these reads a number from the statistics of brightness. They hold for a convex matte object of one paint that is
seen whole, such as a fruit or a head against its outline, and they are off by tens of degrees for anything else. Use
them to start from, never instead of a light that is known.

References
----------
.. [1] C.-H. Lee, A. Rosenfeld, "Improved methods of estimating shape from shading using the light source coordinate
   system", Artif. Intell. 26, 1985. doi:10.1016/0004-3702(85)90026-8
.. [2] Q. Zheng, R. Chellappa, "Estimation of illuminant direction, albedo, and shape from shading", IEEE Trans. Pattern
   Anal. Mach. Intell. 13, 1991. doi:10.1109/34.85658
"""

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np

from psstereo.errors import InputError
from psstereo.types import BoolArray, FloatArray

__all__ = [
    "LightEstimate",
    "TiltRule",
    "estimate_albedo_and_ambient",
    "estimate_light",
    "estimate_slant_and_albedo",
    "estimate_tilt",
    "first_moment",
    "second_moment",
]


class TiltRule(Enum):
    """How the tilt is read from the gradients of brightness."""

    MEAN_GRADIENT = "mean-gradient"
    """Mean of the gradients, after Lee and Rosenfeld: strong edges count most."""
    MEAN_DIRECTION = "mean-direction"
    """Mean of the gradients' directions, after Zheng and Chellappa: every pixel counts alike."""


@dataclass(frozen=True, kw_only=True)
class LightEstimate:
    """A distant light and the paint it shows.

    Attributes
    ----------
    tilt : float
        Angle of the light's projection into the image, from x right toward y up [rad].
    slant : float
        Angle between the light and the direction to the camera [rad].
    albedo : float
        Brightness of the surface where it faces the light [unit of the image].
    clearness : float
        Length of the mean of directions that the tilt rests on: 0 where they cancel, 1 where all agree [1].
    """

    tilt: float
    slant: float
    albedo: float
    clearness: float

    @property
    def direction(self) -> FloatArray:
        """Unit vector toward the light, float64 (3,) [1]."""
        across = math.sin(self.slant)
        return np.array([across * math.cos(self.tilt), across * math.sin(self.tilt), math.cos(self.slant)])


def first_moment(slant: float) -> float:
    """Return the mean of max(0, n·l) over the disc that a sphere fills, light at an angle to the view [1].

    Parameters
    ----------
    slant : float
        Angle between light and view, 0 to π [rad].

    Returns
    -------
    float
        ``(2/3π) (sin σ + (π − σ) cos σ)``; 2/3 for light from the camera, 0 for light from behind.
    """
    return 2.0 / (3.0 * math.pi) * (math.sin(slant) + (math.pi - slant) * math.cos(slant))


def second_moment(slant: float) -> float:
    """Return the mean of max(0, n·l)² over the disc that a sphere fills [1].

    Parameters
    ----------
    slant : float
        Angle between light and view, 0 to π [rad].

    Returns
    -------
    float
        ``(1 + cos σ)² / 8``; 1/2 for light from the camera.
    """
    return (1.0 + math.cos(slant)) ** 2 / 8.0


def estimate_tilt(
    image: FloatArray, mask: BoolArray | None = None, *, rule: TiltRule = TiltRule.MEAN_DIRECTION
) -> tuple[float, float]:
    """Estimate the light's tilt from the gradients of brightness.

    On a convex object brightness grows toward the light more often than away from it.

    Parameters
    ----------
    image : float array (h, w)
        Linear brightness [relative].
    mask : bool array (h, w), optional
        Pixels of the object.
    rule : TiltRule
        Which mean is taken.

    Returns
    -------
    tilt : float
        From x right toward y up [rad].
    clearness : float
        Length of the mean of directions, 0 to 1 [1].

    Raises
    ------
    InputError
        If there is no gradient, or all of them cancel.
    """
    values, inside = _checked(image, mask)
    right, up, whole = _gradient(values, inside)
    length = np.hypot(right, up)[whole]
    moving = length > 0
    if not moving.any():
        raise InputError(
            given=f"Brightness does not change over the {int(np.count_nonzero(inside))} pixels of the object.",
            needed="Shading, that is brightness that changes over the surface.",
            remedy="Give the light's direction instead.",
        )
    x, y, length = right[whole][moving], up[whole][moving], length[moving]
    clear = math.hypot(float((x / length).mean()), float((y / length).mean()))
    if rule is TiltRule.MEAN_DIRECTION:
        x, y = x / length, y / length
    mean = float(x.mean()), float(y.mean())
    if math.hypot(*mean) <= 1e-6 * float(np.hypot(x, y).mean()):
        raise InputError(
            given="The gradients of brightness cancel, as they do under light from the camera.",
            needed="Light from the side.",
            remedy="Give the light's direction instead; 90 degrees of elevation is light from the camera.",
        )
    return math.atan2(mean[1], mean[0]), clear


def estimate_slant_and_albedo(image: FloatArray, mask: BoolArray | None = None) -> tuple[float, float]:
    """Estimate the light's slant and the albedo from the mean and the mean square of brightness.

    Both moments are those of a sphere that is seen whole, its shadowed part included: other convex objects whose
    normals are spread alike, such as ellipsoids that are nearly round, come close. Ambient light must be subtracted
    beforehand (:func:`estimate_albedo_and_ambient`).

    Parameters
    ----------
    image : float array (h, w)
        Linear brightness [relative].
    mask : bool array (h, w), optional
        Pixels of the whole object.

    Returns
    -------
    slant : float
        Angle between light and view, 0 to π/2 and beyond for light from behind [rad].
    albedo : float
        Brightness where the surface faces the light [unit of the image].

    Raises
    ------
    InputError
        If the object is black, or its brightness is more even than a sphere's can be.
    """
    from scipy.optimize import brentq

    values, inside = _checked(image, mask)
    known = np.maximum(values[inside], 0.0)
    scale = float(known.max())
    if scale == 0.0:
        raise InputError(
            given="The object is black.",
            needed="Light on it.",
            remedy="Check mask and ambient level, which is subtracted.",
        )
    known = known / scale  # so that squares neither overflow nor vanish
    ratio = float(known.mean()) ** 2 / float((known * known).mean())
    frontal, behind = first_moment(0.0) ** 2 / second_moment(0.0), 0.98 * math.pi
    least = first_moment(behind) ** 2 / second_moment(behind)
    if not least < ratio <= frontal * (1.0 + 1e-2):
        raise InputError(
            given=f"The square of the mean brightness is {ratio:.3g} of the mean square.",
            needed=f"A round object has {least:.2g} (light from behind) to {frontal:.3g} (light from the camera).",
            remedy="The object is flat, painted, or lit from all around: subtract ambient light, or give the light.",
        )

    def excess(slant: float) -> float:
        return first_moment(slant) ** 2 / second_moment(slant) - ratio

    slant = 0.0 if ratio >= frontal else float(brentq(excess, 0.0, behind, xtol=1e-12))
    return slant, scale * float(known.mean()) / first_moment(slant)


def estimate_albedo_and_ambient(
    image: FloatArray, mask: BoolArray | None = None, *, share: float = 0.001
) -> tuple[float, float]:
    """Estimate albedo and ambient level from the brightest and the darkest part of the object.

    Holds where some part faces the light and another is in shadow; a small share at both ends is left out as noise.

    Parameters
    ----------
    image : float array (h, w)
        Linear brightness [relative].
    mask : bool array (h, w), optional
        Pixels of the object.
    share : float
        What is left out at either end, 0 to 0.5 [1].

    Returns
    -------
    albedo : float
        Brightness that the light adds where the surface faces it [unit of the image].
    ambient : float
        Brightness in shadow [unit of the image].

    Raises
    ------
    InputError
        If the image is even, or the share is none.
    """
    values, inside = _checked(image, mask)
    if not 0 <= share < 0.5:
        raise InputError(
            given=f"The share is {share:g}.", needed="0 or more, below 0.5.", remedy="Use 0.001 unless noise is strong."
        )
    low, high = np.quantile(values[inside], [share, 1.0 - share]).tolist()
    if not high > low:
        raise InputError(
            given=f"The object has the same brightness everywhere, {low:g}.",
            needed="Light and shadow.",
            remedy="Give albedo and ambient level instead.",
        )
    return high - low, low


def estimate_light(
    image: FloatArray, mask: BoolArray | None = None, *, rule: TiltRule = TiltRule.MEAN_DIRECTION
) -> LightEstimate:
    """Estimate a distant light's direction, and the albedo, from one image of a round object.

    Parameters
    ----------
    image : float array (h, w)
        Linear brightness without ambient light [relative].
    mask : bool array (h, w), optional
        Pixels of the whole object.
    rule : TiltRule
        How the tilt is read.

    Returns
    -------
    LightEstimate
        The light.

    Raises
    ------
    InputError
        If the image says nothing of one of them; see the functions that this one calls. Under light from the camera
        itself the tilt is undefined and 0.
    """
    slant, albedo = estimate_slant_and_albedo(image, mask)
    if slant == 0.0:
        return LightEstimate(tilt=0.0, slant=0.0, albedo=albedo, clearness=0.0)
    tilt, clearness = estimate_tilt(image, mask, rule=rule)
    return LightEstimate(tilt=tilt, slant=slant, albedo=albedo, clearness=clearness)


def _checked(image: FloatArray, mask: BoolArray | None) -> tuple[FloatArray, BoolArray]:
    values = np.asarray(image, np.float64)
    inside = np.isfinite(values) if mask is None else np.asarray(mask, np.bool_)
    if values.ndim != 2 or inside.shape != values.shape:
        raise InputError(
            given=f"The image has the shape {values.shape}, the mask {inside.shape}.",
            needed="One brightness for each pixel (h, w), and a mask of the same pixels.",
            remedy="Turn colours into one channel, and crop both alike.",
        )
    inside = inside & np.isfinite(values)
    if not inside.any():
        raise InputError(
            given=f"None of {values.size} pixels is inside the mask and finite.",
            needed="At least one.",
            remedy="Check the mask.",
        )
    return values, inside


def _gradient(values: FloatArray, inside: BoolArray) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return central differences to the right and up, and where all four neighbours are inside."""
    known = np.pad(inside, 1)
    whole = inside & known[1:-1, 2:] & known[1:-1, :-2] & known[2:, 1:-1] & known[:-2, 1:-1]
    padded = np.pad(np.where(inside, values, 0.0), 1)
    right = 0.5 * (padded[1:-1, 2:] - padded[1:-1, :-2])
    up = 0.5 * (padded[:-2, 1:-1] - padded[2:, 1:-1])
    return right, up, whole
