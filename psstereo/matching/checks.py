"""Whether a pair is what it is said to be: rectified, and of the same thing."""

import numpy as np

from psstereo.errors import InputError
from psstereo.matching.images import ViewImages
from psstereo.results import Step
from psstereo.types import Array, BoolArray, FloatArray

__all__ = ["require_overlap", "vertical_offset"]

_CORNERS = 40
_HALF = 7
"""Half the side of the patches that are looked for [px]."""
_SEARCH = 8
"""Rows up and down in which they are looked for [px]."""
_ALIKE = 0.85
"""Correlation from which on a patch counts as found."""
_LEAST = 12
"""Found patches below which nothing is said."""
_ALLOWED = 0.75
"""Vertical offset that is still taken for rectified [px]."""
_OVERLAP_FOUND, _OVERLAP_UNKNOWN, _OVERLAP_LOST = 0.03, 0.2, 0.5
"""Share of the object that has to match: where corners are found in the other view, where there are too few to tell,
and where they are not found. Smoothing lets a tenth to a half of two unrelated images match each other."""
_APART = 1.2
"""Median difference of brightness above which matches are doubtful; it is 0.7 for those of nothing but noise [standard
deviations]."""
_OVERLAP_APART = 0.75
"""Share of the object that has to match where corners are not found and brightness differs as much."""


def vertical_offset(left: ViewImages, right: ViewImages, first: int, count: int) -> tuple[Step, float]:
    """Look for corners of the left view in the right one, in the same row and in the rows around it.

    Parameters
    ----------
    left, right : ViewImages
        The views.
    first, count : int
        Range of disparities [px].

    Returns
    -------
    step : Step
        What was found, or why nothing could be.
    least : float
        Share of the object that has to match in the end, the less is known here the more [1].

    Raises
    ------
    InputError
        If the views lie above each other, or are turned or scaled against each other.
    """
    name = "rectification"
    one, two = _gray(left), _gray(right)
    corners = _corners(one, left.mask)
    found = [hit for hit in (_find(one, two, corner, first, count) for corner in corners) if hit is not None]
    looked = sum(_fits(corner, one.shape, first, count) for corner in corners)
    if looked < _LEAST:
        return Step(name=name, done=False, reason=f"Only {looked} corners are there to check it by."), _OVERLAP_UNKNOWN
    hits = np.array(found).reshape(-1, 4)
    alike = hits[hits[:, 3] >= _ALIKE]
    if len(alike) < max(4, looked // 10):
        reason = (
            f"Of {looked} corners of {left.name} only {len(alike)} are found in {right.name}, up to {_SEARCH} rows "
            f"above or below and with disparities {first} to {first + count - 1}."
        )
        return Step(name=name, done=False, reason=reason), _OVERLAP_LOST
    tilted = _fit_rows(alike)
    offsets = tilted(np.array([[0, 0], [0, one.shape[0]], [one.shape[1], 0], [one.shape[1], one.shape[0]]], np.float64))
    typical = float(np.median(np.abs(alike[:, 2])))
    scatter = float(np.median(np.abs(alike[:, 2] - tilted(alike[:, :2]))))
    if typical > _ALLOWED and scatter > 0.5 * typical:
        reason = f"Corners are found only to within {scatter:.1f} rows."
        return Step(name=name, done=False, reason=reason), _OVERLAP_UNKNOWN
    if typical > _ALLOWED:
        middle = float(np.median(alike[:, 2]))
        raise InputError(
            given=f"The pair is not rectified: {right.name} lies {abs(middle):.1f} rows "
            f"{'lower' if middle > 0 else 'higher'} than {left.name} ({typical:.1f} px at a typical corner, "
            f"{offsets.min():+.1f} to {offsets.max():+.1f} px over the corners of the image).",
            needed="A point must be in the same row of both images, to within a pixel.",
            remedy="Rectify the pair, or match it as calibrated views by a plane sweep.",
        )
    reason = f"{len(alike)} corners lie {typical:.2f} px above or below, which is rectified."
    return Step(name=name, done=True, reason=reason), _OVERLAP_FOUND


def require_overlap(
    matched: BoolArray, apart: float, left: ViewImages, right: ViewImages, *, least: float, step: Step
) -> None:
    """Refuse a result in which hardly anything matches.

    Parameters
    ----------
    matched : bool array (h, w)
        What has a match.
    apart : float
        Median difference of brightness at the matches; it counts only where corners were not found [standard
        deviations].
    left, right : ViewImages
        The views.
    least : float
        Share of the object that has to [1].
    step : Step
        What :func:`vertical_offset` found.

    Raises
    ------
    InputError
        If less than that does, or what matches differs.
    """
    share = float(matched[left.mask].mean())
    doubtful = least == _OVERLAP_LOST and apart > _APART and share < _OVERLAP_APART
    if share < least or doubtful:
        why = "" if step.done else f" {step.reason}"
        raise InputError(
            given=f"{share:.1%} of {left.name} has a match in {right.name}, {apart:.1f} standard deviations off in "
            f"brightness: there is no overlap in this range.{why}",
            needed="Both views must show the same thing, and the range of disparities must hold it.",
            remedy="Check that the files belong together, left before right, and widen or move the range.",
        )


def _gray(view: ViewImages) -> Array:
    gray = np.asarray(view.values.mean(axis=(0, 1)), np.float32)
    top = float(np.percentile(gray[::4, ::4][view.mask[::4, ::4]], 99.5)) if view.mask[::4, ::4].any() else 1.0
    return np.asarray(np.clip(gray / max(top, 1e-12), 0, 1) * 255).astype(np.uint8)


def _corners(gray: Array, mask: BoolArray) -> Array:
    import cv2

    inner = cv2.erode(mask.astype(np.uint8), np.ones((2 * _HALF + 1, 2 * _HALF + 1), np.uint8), borderValue=0)
    spacing = max(8.0, 0.5 * float(np.sqrt(mask.sum() / _CORNERS)))
    found = cv2.goodFeaturesToTrack(gray, _CORNERS, 0.02, spacing, mask=inner)
    return np.zeros((0, 2), np.intp) if found is None else np.rint(found[:, 0]).astype(np.intp)


def _fits(corner: Array, shape: tuple[int, ...], first: int, count: int) -> bool:
    """Return whether the whole range lies inside the other image, so that the corner should be found."""
    x, y = int(corner[0]), int(corner[1])
    inside = x - first - count + 1 >= _HALF and x - first < shape[1] - _HALF
    return inside and _HALF <= y < shape[0] - _HALF


def _find(one: Array, two: Array, corner: Array, first: int, count: int) -> tuple[float, float, float, float] | None:
    """Return column, row, vertical offset and correlation of a corner's best match, None near the border."""
    import cv2

    if not _fits(corner, one.shape, first, count):
        return None
    x, y = int(corner[0]), int(corner[1])
    patch = one[y - _HALF : y + _HALF + 1, x - _HALF : x + _HALF + 1]
    top, bottom = max(0, y - _HALF - _SEARCH), min(two.shape[0], y + _HALF + _SEARCH + 1)
    start = x - first - count + 1 - _HALF
    part = two[top:bottom, start : x - first + _HALF + 1]
    score = cv2.matchTemplate(part, patch, cv2.TM_CCOEFF_NORMED)
    _, best, _, (_, row) = cv2.minMaxLoc(score)
    column = score.argmax() % score.shape[1]
    middle = 0.0
    if 0 < row < len(score) - 1:
        above, here, below = (float(score[row + i, column]) for i in (-1, 0, 1))
        bend = above - 2 * here + below
        middle = 0.5 * (above - below) / bend if bend < 0 else 0.0
    return float(x), float(y), top + row + middle + _HALF - y, float(best)


class _Rows:
    """Vertical offset as a plane over the image."""

    def __init__(self, coefficients: FloatArray) -> None:
        self._coefficients = coefficients

    def __call__(self, places: FloatArray) -> FloatArray:
        return np.asarray(np.column_stack([places, np.ones(len(places))]) @ self._coefficients)


def _fit_rows(hits: FloatArray) -> _Rows:
    """Fit a plane to vertical offsets, reweighted so that wrong matches do not count."""
    places = np.column_stack([hits[:, :2], np.ones(len(hits))])
    weight = np.ones(len(hits))
    coefficients = np.zeros(3)
    for _ in range(6):
        root = np.sqrt(weight)
        coefficients = np.linalg.lstsq(places * root[:, None], hits[:, 2] * root, rcond=None)[0]
        weight = 1 / np.maximum(np.abs(hits[:, 2] - places @ coefficients), 0.1)
    return _Rows(np.asarray(coefficients))
