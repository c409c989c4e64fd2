"""One image that is there twice, and one light that is written down twice."""

from typing import ClassVar, Literal

import numpy as np

from psstereo.plan.diagnosis.case import Case
from psstereo.plan.diagnosis.check import Check, angle_between, listed
from psstereo.plan.diagnosis.finding import Finding
from psstereo.types import FloatArray

__all__ = ["DuplicateImage", "DuplicateLight"]

_APART = np.radians(2.0)
"""Angle between lights from which their images must differ [rad]."""
_TOGETHER = np.radians(0.05)
"""Angle between rows of a light file that count as the same [rad]."""
_DIFFERS = 0.1
"""Difference over brightness from which two images were lit differently."""
_PROMISED = 0.05
"""The same that a fit must promise of two images before their likeness means anything."""
_CERTAIN = 1.5
"""Promised difference over the misfit of the fit from which it is believed."""
_LIKE = 0.2
"""Share of the promised difference below which they are alike."""
_ALIKE = 0.2
"""Difference over brightness above which two images are not alike, whatever a fit promises."""
_DARK = 0.02
"""Brightness over that of the brightest image below which an image is not compared."""


class DuplicateImage(Check):
    """Two images that are the same although their lights are not."""

    name: ClassVar[str] = "duplicate-image"
    summary: ClassVar[str] = "Two images are the same although their lights differ."
    stage: ClassVar[Literal["plain", "order", "fit"]] = "plain"

    def look(self, case: Case) -> Finding | None:
        """Return a finding if two images are equal, or equal up to noise; see :meth:`Check.look`."""
        sample = case.sample
        shown = _differences(sample.values)
        for i, j in _closest(shown):
            angle = angle_between(sample.directions[i], sample.directions[j])
            if angle < _APART:
                continue
            equal = sample.raw is not None and bool((sample.raw[i] == sample.raw[j]).all())
            if not (_curved(sample.values, i) if equal else _too_alike(case, i, j, float(shown[i, j]))):
                continue
            how = "equal to the last bit" if equal else f"equal to {shown[i, j]:.1%} of their brightness"
            sentence = (
                f"Images {listed((i, j), sample.names)} are {how}, and their lights are {np.degrees(angle):.0f}° "
                "apart: one image seems to have been saved twice."
            )
            remedy = "Find the lost image, or leave one of the two and its light out."
            figure = (float(np.degrees(angle)), "°")
            return self.finding("fault", figure, (sentence, remedy), 1.0 if equal else 0.85, (i, j))
        return None


class DuplicateLight(Check):
    """Two rows of lights that are the same although their images are not."""

    name: ClassVar[str] = "duplicate-light"
    summary: ClassVar[str] = "Two rows of the light file are the same although their images differ."
    stage: ClassVar[Literal["plain", "order", "fit"]] = "plain"

    def look(self, case: Case) -> Finding | None:
        """Return a finding if images under one light differ; see :meth:`Check.look`."""
        sample = case.sample
        lights = sample.directions
        near = np.argwhere(np.triu(lights @ lights.T > np.cos(2 * _TOGETHER), 1))
        pairs = [(int(i), int(j)) for i, j in near if angle_between(lights[i], lights[j]) < _TOGETHER]
        if not pairs:
            return None
        shown = _differences(sample.values)
        worst = max(pairs, key=lambda pair: shown[pair])
        difference = float(shown[worst])
        if not difference > _DIFFERS:
            return None
        sentence = (
            f"Images {listed(worst, sample.names)} have the same light in the light file and differ by "
            f"{difference:.0%} of their brightness: a row seems to stand there twice."
        )
        remedy = "Look the two rows up in the list that the light file was made from."
        return self.finding("fault", (100 * difference, "%"), (sentence, remedy), 0.95, worst)


def _differences(values: FloatArray) -> FloatArray:
    """Return the root mean square of the difference of each two images over their brightness, (m, m)."""
    whole = values[:, np.isfinite(values).all(axis=0)]
    if not whole.size:
        return np.full((len(values), len(values)), np.nan)
    gram = whole @ whole.T
    square = np.diag(gram)
    with np.errstate(invalid="ignore", divide="ignore"):
        found = np.sqrt(np.maximum(square[:, None] + square - 2 * gram, 0.0) / (square[:, None] + square) * 2)
    dark = square <= _DARK**2 * square.max(initial=0.0)
    found[dark] = found[:, dark] = np.nan
    return np.asarray(found)


def _closest(shown: FloatArray) -> list[tuple[int, int]]:
    """Return pairs of images from the most alike, some of them."""
    count = len(shown)
    upper = np.where(np.triu(np.ones(shown.shape, np.bool_), 1) & np.isfinite(shown), shown, np.inf)
    order = np.argsort(upper, axis=None, kind="stable")[: 4 * count]
    return [divmod(int(k), count) for k in order if np.isfinite(upper.flat[k])]


def _curved(values: FloatArray, image: int) -> bool:
    """Whether other images vary against this one: on a plane, or with a light between, equal images prove nothing."""
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = values / values[image]
    fine = np.isfinite(ratio) & (values[image] > _PROMISED * np.nanmax(values, initial=0.0))
    for row, keep in zip(ratio, fine, strict=True):
        if keep.any() and float(np.ptp(np.quantile(row[keep], (0.1, 0.9)))) > _DIFFERS:
            return True
    return False


def _too_alike(case: Case, i: int, j: int, shown: float) -> bool:
    """Whether the fit to many images promises that these two differ far more than they do."""
    sample = case.sample
    if (
        shown > _ALIKE or len(sample.directions) < 6 or case.contest.moved
    ):  # with lights exchanged the fit promises nothing
        return False
    good = np.isfinite(sample.albedo)
    if not good.any():
        return False
    model = np.maximum(sample.directions[[i, j]] @ (sample.normals[good] * sample.albedo[good, None]).T, 0.0)
    size = float(np.sqrt((model * model).mean()))
    promised = float(np.sqrt(((model[0] - model[1]) ** 2).mean())) / size if size > 0 else 0.0
    misfit = float(np.sqrt(np.nanmean(sample.residual[:, good] ** 2))) / size if size > 0 else float("inf")
    return promised > max(_PROMISED, _CERTAIN * misfit) and shown < _LIKE * promised
