"""Whether a point keeps its brightness when the camera moves: measured at the same points of the surface."""

from dataclasses import dataclass

import numpy as np

from psstereo.capture import Capture
from psstereo.errors import InputError
from psstereo.matching.geometry import CalibratedView, covisible
from psstereo.matching.images import ViewImages, require_comparable
from psstereo.matching.noise import Noise
from psstereo.types import Array, BoolArray, FloatArray

__all__ = ["LEVEL", "Constancy", "brightness_constancy", "compare_values", "pair_constancy"]

LEVEL = 0.99
"""Share of points that noise alone explains if the noise is known well [1]."""
_GRAY = 96
"""Gray of pixels that are not compared, in pictures."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Constancy:
    """Brightness of the same points from two viewpoints.

    Attributes
    ----------
    compared : bool array (h, w)
        Pixels of the first view whose points were compared.
    difference : float32 array (m, c, h, w)
        First minus second value in standard deviations of that difference; NaN where not compared [1].
    absolute : float32 array (m, c, h, w)
        Its size [share of full scale].
    chi_squared : float32 array (h, w)
        Sum of squared differences over their number [1].
    explained : bool array (h, w)
        Points whose differences noise explains: below the 99 % point of χ².
    within_rounding : float
        Share of values that differ by at most one step, NaN if values have no steps [1].
    second : float32 array (m, c, h, w)
        The second view's values, arranged as the first view's pixels [share of full scale].
    """

    compared: BoolArray
    difference: FloatArray
    absolute: FloatArray
    chi_squared: FloatArray
    explained: BoolArray
    within_rounding: float
    second: FloatArray

    @property
    def count(self) -> int:
        """Points that were compared."""
        return int(np.count_nonzero(self.compared))

    @property
    def share_explained(self) -> float:
        """Share of the points that noise explains; 0.99 if there is nothing but noise [1]."""
        return float(self.explained[self.compared].mean())

    @property
    def failing(self) -> BoolArray:
        """Points, (h, w), whose differences are more than noise."""
        return self.compared & ~self.explained

    def rows(self) -> list[tuple[str, str]]:
        """Return the figures as rows of a table: what, and how much."""
        flat = self.absolute[:, :, self.compared]
        in_sigma = np.abs(self.difference[:, :, self.compared])
        rounding = "values have no steps" if np.isnan(self.within_rounding) else f"{self.within_rounding:.3%}"
        return [
            ("points compared", f"{self.count}"),
            ("equal within rounding", rounding),
            ("median difference", f"{float(np.median(flat)) * 255:.3f} of 255"),
            ("median difference over noise", f"{float(np.median(in_sigma)):.3g} (0.674 if it is noise alone)"),
            ("mean χ² over its number", f"{float(self.chi_squared[self.compared].mean()):.4g} (1 if it is noise)"),
            ("explained by noise", f"{self.share_explained:.2%} (99 % if it is noise alone)"),
        ]

    def per_light(self) -> list[tuple[int, float, float]]:
        """Return for each light its number, median difference [share of full scale] and mean χ² [1]."""
        found = []
        for light in range(len(self.difference)):
            size = self.absolute[light][:, self.compared]
            square = self.difference[light][:, self.compared] ** 2
            found.append((light, float(np.median(size)), float(square.mean())))
        return found

    def picture(self, *, top: float = 6.0) -> Array:
        """Draw the map: blue where the second view is brighter, red where the first is, white where they agree.

        Parameters
        ----------
        top : float
            Difference drawn in full colour [standard deviations].

        Returns
        -------
        uint8 array (h, w, 3)
            Picture; gray where nothing was compared. Of several lights the largest difference shows.
        """
        stack = self.difference.reshape(-1, *self.compared.shape)
        solid = np.where(np.isfinite(stack), stack, 0.0)
        which = np.abs(solid).argmax(axis=0)
        worst = np.clip(np.take_along_axis(solid, which[None], axis=0)[0] / top, -1, 1)
        red, blue = 1 - np.maximum(-worst, 0), 1 - np.maximum(worst, 0)
        image = np.stack([red, np.minimum(red, blue), blue], axis=-1)
        return np.where(self.compared[..., None], np.rint(255 * image), _GRAY).astype(np.uint8)


def compare_values(
    first: FloatArray,
    second: FloatArray,
    compared: BoolArray,
    noise: tuple[Noise, Noise],
    *,
    shares: FloatArray | float = 1.0,
    extra: FloatArray | float = 0.0,
) -> Constancy:
    """Compare values of the same points.

    Parameters
    ----------
    first, second : float array (m, c, h, w)
        Linear values of both views, arranged as the first view's pixels [share of full scale].
    compared : bool array (h, w)
        Pixels that count.
    noise : (Noise, Noise)
        Of both.
    shares : float array (h, w) or float
        Share of the second variance that is left after values were averaged between pixels [1].
    extra : float array (m, c, h, w) or float
        Further variance, such as that of interpolation [share of full scale²].

    Returns
    -------
    Constancy
        The comparison.

    Raises
    ------
    InputError
        If shapes disagree, or no point is compared.
    """
    from scipy.stats import chi2

    a, b = np.asarray(first, np.float64), np.asarray(second, np.float64)
    if a.shape != b.shape or a.ndim != 4 or compared.shape != a.shape[2:]:
        raise InputError(
            given=f"Values of the shapes {a.shape} and {b.shape} and points of {compared.shape}.",
            needed="Both (lights, colours, rows, columns), and rows and columns.",
            remedy="Arrange the second view's values as the first view's pixels.",
        )
    if not compared.any():
        raise InputError(
            given="No point is seen by both views.",
            needed="Views that overlap.",
            remedy="Check depth, cameras and the order of the views.",
        )
    delta = a - b
    # Under the hypothesis both values are the same; their mean says best how large the noise is.
    mean = 0.5 * (a + b)
    variance = noise[0].variance(mean) + shares * noise[1].variance(mean) + extra
    scaled = np.where(compared, delta / np.sqrt(variance), np.nan)
    number = a.shape[0] * a.shape[1]
    total = (scaled * scaled).sum(axis=(0, 1))
    with np.errstate(invalid="ignore"):
        explained = compared & (total <= chi2.ppf(LEVEL, number))
    step = max(noise[0].step, noise[1].step)
    size = np.abs(delta)
    within = float((size[:, :, compared] <= 1.001 * step).mean()) if step > 0 else float("nan")
    return Constancy(
        compared=compared,
        difference=scaled.astype(np.float32),
        absolute=np.where(compared, size, np.nan).astype(np.float32),
        chi_squared=(total / number).astype(np.float32),
        explained=explained,
        within_rounding=within,
        second=b.astype(np.float32),
    )


def brightness_constancy(
    capture_a: Capture | ViewImages,
    capture_b: Capture | ViewImages,
    depth: FloatArray,
    cameras: tuple[CalibratedView, CalibratedView],
    *,
    depth_b: FloatArray | None = None,
) -> Constancy:
    """Compare what two views show at the same points of a surface whose depth is known.

    The second view is interpolated between its pixels; how far a linear and a cubic interpolation differ counts as
    noise. Saturated values, masked pixels and the outlines of what hides something are left out. Where the rounding of
    the camera is to be seen, interpolation is too coarse: then render or photograph the points themselves and use
    :func:`compare_values`.

    Parameters
    ----------
    capture_a, capture_b : Capture or ViewImages
        Both views, under the same lights. Give ViewImages to say what the noise is; a capture's is its rounding.
    depth : float array (h, w)
        Of the first view, of its camera's kind; NaN where unknown [length].
    cameras : (CalibratedView, CalibratedView)
        Cameras and poses.
    depth_b : float array (h', w'), optional
        Of the second view: it tells what it sees [length].

    Returns
    -------
    Constancy
        The comparison, in the first view's pixels.

    Raises
    ------
    InputError
        If the views do not belong together, or share no point.
    """
    a, b = _images(capture_a), _images(capture_b)
    require_comparable(a, b, same_size=False)
    if depth.shape != a.size:
        raise InputError(
            given=f"The depth has the shape {depth.shape}; {a.name}, {a.size}.",
            needed="The depth of the first view.",
            remedy="Give the depth that belongs to these images.",
        )
    column, row, seen = covisible(depth, cameras[0], cameras[1], b.size, other_depth=depth_b)
    return _sampled(a, b.in_exposure_of(a), column, row, seen)


def pair_constancy(
    left: ViewImages, right: ViewImages, disparity: FloatArray, visible: BoolArray | None = None
) -> Constancy:
    """Compare a rectified pair at known disparities; see :func:`brightness_constancy`.

    Parameters
    ----------
    left, right : ViewImages
        The views.
    disparity : float array (h, w)
        Of the left view, NaN where unknown [px].
    visible : bool array (h, w), optional
        Points that the right view sees; all inside its image if absent.

    Returns
    -------
    Constancy
        The comparison, in the left view's pixels.

    Raises
    ------
    InputError
        If the views do not belong together, or share no point.
    """
    require_comparable(left, right, same_size=True)
    rows, columns = np.indices(left.size, dtype=np.float64)
    column = columns - disparity
    with np.errstate(invalid="ignore"):
        seen = (column >= 0) & (column <= left.size[1] - 1)
    return _sampled(left, right.in_exposure_of(left), column, rows, seen if visible is None else seen & visible)


def _images(given: Capture | ViewImages) -> ViewImages:
    return given if isinstance(given, ViewImages) else ViewImages.from_capture(given)


def _sampled(a: ViewImages, b: ViewImages, column: FloatArray, row: FloatArray, seen: BoolArray) -> Constancy:
    """Compare with the second view interpolated at given places."""
    import cv2

    x, y = np.nan_to_num(column).astype(np.float32), np.nan_to_num(row).astype(np.float32)
    good = (b.mask & ~b.saturated.any(axis=(0, 1))).astype(np.uint8)
    # One step further in, so that all four neighbours count.
    inner = cv2.erode(good, np.ones((3, 3), np.uint8), borderValue=1)
    there = cv2.remap(inner, x, y, cv2.INTER_NEAREST) > 0
    compared = np.asarray(seen & there & a.mask & ~a.saturated.any(axis=(0, 1)))
    linear, spread = np.zeros(a.values.shape), np.zeros(a.values.shape)
    for light in range(a.lights):
        for colour in range(a.values.shape[1]):
            image = np.asarray(b.values[light, colour], np.float32)
            linear[light, colour] = cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
            cubic = cv2.remap(image, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
            spread[light, colour] = (cubic - linear[light, colour]) ** 2
    u, v = x - np.floor(x), y - np.floor(y)
    left_over = ((1 - u) ** 2 + u**2) * ((1 - v) ** 2 + v**2)
    return compare_values(a.values, linear, compared, (a.noise, b.noise), shares=left_over, extra=spread)
