"""Dense matching of a rectified pair by the difference of linear radiance in units of its noise."""

from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Any

import numpy as np

from psstereo.errors import OptionError
from psstereo.kernels.dispatch import kernel
from psstereo.matching.checks import require_overlap, vertical_offset
from psstereo.matching.disparity import Disparity, agree, fill_from_behind, hidden, without_specks
from psstereo.matching.exposure import compare_exposures, refine_exposure, require_same_exposure
from psstereo.matching.features import Scale, encode, guide
from psstereo.matching.flags import MatchFlag
from psstereo.matching.images import ViewImages, require_comparable
from psstereo.matching.smoothing import Smoothing, row_blocks
from psstereo.results import Step
from psstereo.types import Array, BoolArray, FlagArray, FloatArray, Map, Progress, no_progress

__all__ = ["RectifiedMatcher"]

_BREAK_EVEN = 50_000
"""Labels of all pixels from which compiled code is sooner done, loading included [1]."""


@dataclass(frozen=True, kw_only=True)
class RectifiedMatcher:
    """Disparities of a pair whose rows correspond.

    A matte point has the same radiance in both views under each light, so its match is sought where all m radiances
    are equal. The cost of a match is the difference, in standard deviations of the noise and of what else makes views
    differ, up to a bound; so are the slopes of brightness, which do not mind an offset. Costs are averaged over lights
    and smoothed by :class:`Smoothing`. Do not use it for mirror-like or transparent surfaces, whose brightness moves
    with the viewer, nor for images that are not rectified.

    Attributes
    ----------
    first, count : int
        Smallest disparity and number of disparities that are tried [px].
    brightness, gradient : float
        Weights of brightness and of its slopes [1].
    top : float
        Difference from which on it does not matter how large it is [standard deviations].
    floor, relative : float
        What views differ by beside noise: anywhere, and over the signal [share of full scale, 1].
    smoothing : Smoothing
        Penalties.
    exposure : {"same", "estimate"}
        Whether both views have the same exposure, which is checked, or gain and offset are to be found.
    checks : bool
        Whether to look for vertical offset, differing exposure and missing overlap. Without, a wrong pair gives a
        wrong map instead of an error.
    tolerance : float
        Largest difference between the two views' disparities [px].
    specks : int
        Largest patch that is thrown away [px].
    median : 0, 3 or 5
        Side of the median filter; 0 for none [px].
    least_margin : float
        Confidence below which a match is flagged as weak [1].
    fill : bool
        Whether gaps are filled from behind, and flagged so.

    Raises
    ------
    OptionError
        If a number is out of range.
    """

    first: int = 0
    count: int = 64
    brightness: float = 0.5
    gradient: float = 1.0
    top: float = 6.0
    floor: float = 0.02
    relative: float = 0.02
    smoothing: Smoothing = field(default_factory=Smoothing)
    exposure: str = "same"
    checks: bool = True
    tolerance: float = 1.0
    specks: int = 60
    median: int = 5
    least_margin: float = 0.02
    fill: bool = False

    def __post_init__(self) -> None:
        fine = 2 <= self.count <= 4096 and abs(self.first) <= 16384 and self.median in (0, 3, 5) and self.specks >= 0
        fine = fine and self.floor >= 0 and self.relative >= 0 and self.tolerance > 0 and self.least_margin >= 0
        if not fine or self.exposure not in ("same", "estimate"):
            raise OptionError(
                given=f"The matcher tries {self.count} disparities from {self.first}, with a median of {self.median}, "
                f"patches of {self.specks}, tolerances {self.floor}, {self.relative}, {self.tolerance} and "
                f"{self.least_margin}, and the exposure {self.exposure!r}.",
                needed="2 to 4096 disparities, a median of 0, 3 or 5, nothing negative, and same or estimate.",
                remedy="Leave the option out to get the usual one.",
            )

    @classmethod
    def for_linear(cls, **changes: Any) -> "RectifiedMatcher":
        """Return the matcher for linear values of known noise: brightness alone, with little room beside the noise.

        The slopes of brightness change where a surface is seen aslant; brightness itself does not, if the camera is
        linear. The usual values are for photographs that are not quite linear and whose noise nobody has measured.

        Parameters
        ----------
        **changes
            Other attributes.

        Returns
        -------
        RectifiedMatcher
            The matcher.
        """
        return cls(**{"brightness": 1.0, "gradient": 0.0, "floor": 0.001, "relative": 0.003, **changes})

    def match(
        self, left: ViewImages, right: ViewImages, *, over: Map = map, progress: Progress = no_progress
    ) -> Disparity:
        """Match two views.

        Parameters
        ----------
        left, right : ViewImages
            Photographs under the same lights; a point is in the same row of both.
        over : map-like
            Executes pieces of the work.
        progress : callable
            Told how far it is.

        Returns
        -------
        Disparity
            For the left view.

        Raises
        ------
        InputError
            If the images do not fit each other: in number, size, rows, exposure, or in what they show.
        """
        require_comparable(left, right, same_size=True)
        if self.first > left.size[1] - 1 or self.first + self.count - 1 < 1 - left.size[1]:
            raise OptionError(
                given=f"Disparities from {self.first} to {self.first + self.count - 1} are to be tried in images of "
                f"{left.size[1]} columns.",
                needed="Disparities smaller than the image.",
                remedy="Give the range in pixels of these images.",
            )
        started, steps = perf_counter(), []
        right = right.in_exposure_of(left)
        if self.checks:
            rows, least = vertical_offset(left, right, self.first, self.count)
            steps.append(rows)
        gain, offset = 1.0, 0.0
        if self.exposure == "estimate":
            gain, offset, right = self._estimate(left, right, over)
            reason = f"The right view was taken times {gain:.4g} plus {offset:+.4g} of full scale."
            steps.append(Step(name="exposure", done=True, reason=reason))
        elif self.checks:
            steps.append(require_same_exposure(left, right))
        progress("matching", 1, 4)
        checked = perf_counter()
        label, margin, other, seconds = self._labels(left, right, over)
        progress("matching", 3, 4)
        result = self._judge(left, label, margin, other)
        if self.checks:
            apart = 0.0 if rows.done else self._apart(left, right, result)
            require_overlap(result.matched, apart, left, right, least=least, step=rows)
        progress("matching", 4, 4)
        seconds |= {"checks": checked - started, "total": perf_counter() - started}
        facts = {
            "first": self.first,
            "count": self.count,
            "lights": left.lights,
            "matched": float(result.matched[left.mask].mean()),
            "seconds": seconds,
        }
        return replace(result, gain=gain, offset=offset, facts=facts, steps=tuple(steps))

    def _apart(self, left: ViewImages, right: ViewImages, result: Disparity) -> float:
        """Return the median difference of brightness at matches, in standard deviations; 0 without any."""
        rows, columns = np.nonzero(result.matched)
        target = np.rint(columns - result.disparity[rows, columns]).astype(np.intp)
        noise = left.noise.with_tolerance(self.floor, self.relative)
        one, two = left.values[0, :, rows, columns], right.values[0, :, rows, target]
        size = np.abs(one - two) / (noise.sigma(one) * np.sqrt(2.0))
        return float(np.median(size)) if size.size else 0.0

    def _labels(
        self, left: ViewImages, right: ViewImages, over: Map
    ) -> tuple[FloatArray, FloatArray, FloatArray, dict[str, float]]:
        """Return disparities of both views and margins, with seconds by stage."""
        begun = perf_counter()
        cost, changes = self._costs(left, right, over)
        made = perf_counter()
        halves = self.smoothing.aggregate(cost, *changes, over)
        smooth = perf_counter()
        label, margin, other = self.smoothing.winners(halves, self.first, paired=True, over=over)
        seconds = {"costs": made - begun, "smoothing": smooth - made, "choosing": perf_counter() - smooth}
        return label + np.float32(self.first), margin, other + np.float32(self.first), seconds

    def _costs(self, left: ViewImages, right: ViewImages, over: Map) -> tuple[Array, tuple[FloatArray, FloatArray]]:
        noise = left.noise.with_tolerance(self.floor, self.relative)
        brightest = float(max(left.values.max(), right.values.max()))
        scale = Scale.of(noise, brightest, brightness=self.brightness, gradient=self.gradient, top=self.top)
        jobs = [lambda: encode(left, scale, mirrored=False), lambda: encode(right, scale, mirrored=True)]
        mine, theirs = over(lambda job: job(), jobs)
        cost = np.zeros((*left.size, self.count), np.uint8)
        run = kernel("matching", "pair_costs", cost.size, _BREAK_EVEN)

        def block(rows: tuple[int, int]) -> None:
            run(mine.encoded, theirs.encoded, self.first, mine.tops, mine.multiplier, rows, cost)

        list(over(block, row_blocks(left.size[0])))
        return cost, guide(mine.levels)

    def _estimate(self, left: ViewImages, right: ViewImages, over: Map) -> tuple[float, float, ViewImages]:
        """Find gain and offset from brightness alone, and again from what then matches."""
        first = compare_exposures(left, right)
        roughly = right.corrected(first.gain, first.offset)
        label, margin, other, _ = self._labels(left, roughly, over)
        sure = agree(label, other, self.tolerance) & (margin > self.least_margin) & left.mask
        change = refine_exposure(left, roughly, label, sure)
        gain, offset = first.gain * change.gain, first.offset * change.gain + change.offset
        return gain, offset, right.corrected(gain, offset)

    def _judge(self, left: ViewImages, label: FloatArray, margin: FloatArray, other: FloatArray) -> Disparity:
        """Keep what can be believed, and say why the rest cannot."""
        flags = np.zeros(left.size, np.uint16)
        flags[~left.mask] |= np.uint16(MatchFlag.OUTSIDE_MASK)
        flags[np.isnan(label)] |= np.uint16(MatchFlag.OUT_OF_VIEW)
        flags[left.saturated.any(axis=(0, 1))] |= np.uint16(MatchFlag.SATURATED)
        flags[left.mask & np.isfinite(label) & (margin < self.least_margin)] |= np.uint16(MatchFlag.WEAK)
        smooth, other = _median(label, self.median), _median(other, self.median)
        consistent = agree(smooth, other, self.tolerance)
        kept = consistent & left.mask
        behind = left.mask & ~consistent
        flags[behind] |= np.uint16(MatchFlag.INCONSISTENT)
        flags[behind & hidden(other)] |= np.uint16(MatchFlag.OCCLUDED)
        large = without_specks(np.where(kept, smooth, np.nan), self.specks, 2 * self.tolerance)
        flags[kept & ~large] |= np.uint16(MatchFlag.SPECKLE)
        disparity = np.where(kept & large, smooth, np.nan).astype(np.float32)
        if self.fill:
            disparity = self._filled(disparity, left.mask, flags)
        confidence = np.where(left.mask, margin, 0.0).astype(np.float32)
        return Disparity(disparity=disparity, confidence=confidence, flags=flags)

    @staticmethod
    def _filled(disparity: FloatArray, mask: BoolArray, flags: FlagArray) -> FloatArray:
        full = np.where(mask, fill_from_behind(disparity), np.nan)
        flags[mask & np.isnan(disparity) & np.isfinite(full)] |= np.uint16(MatchFlag.FILLED)
        return np.asarray(full, np.float32)


def _median(label: FloatArray, side: int) -> FloatArray:
    """Return labels through a median filter; NaN stay where they are and count as the nearest number to the left."""
    import cv2

    if side == 0:
        return label
    gaps = np.isnan(label)
    solid = np.nan_to_num(label) if gaps.any() else label
    return np.where(gaps, np.float32(np.nan), cv2.medianBlur(np.ascontiguousarray(solid, np.float32), side))
