"""Depth from several calibrated views: planes are swept through the scene, and each pixel keeps the one that fits."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import numpy as np

from psstereo.camera import Pinhole
from psstereo.errors import InputError, OptionError, UnsupportedError
from psstereo.matching.features import guide
from psstereo.matching.flags import MatchFlag
from psstereo.matching.geometry import CalibratedView, covisible
from psstereo.matching.images import ViewImages, require_comparable
from psstereo.matching.noise import Noise
from psstereo.matching.smoothing import Smoothing
from psstereo.types import Array, BoolArray, FlagArray, FloatArray, Map, Progress, no_progress

__all__ = ["PlaneSweep", "SweptDepth", "agreeing_views", "inside_box", "nearest_views"]

_FLIP = np.diag([1.0, -1.0, -1.0])
"""From x right, y up, z toward the camera to the frame of a camera matrix, and back."""

_LEAST_BASELINE = 0.01
"""Distance of two cameras over the typical one, below which they stand at the same place [1]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SweptDepth:
    """Depth of one view.

    Attributes
    ----------
    depth : float32 array (h, w)
        Distance along the optical axis; NaN where there is no plane to be trusted [length].
    confidence : float32 array (h, w)
        1 − cost of the plane over that of the best other one [1].
    flags : uint16 array (h, w)
        Bits of :class:`~psstereo.matching.flags.MatchFlag`.
    facts : mapping
        Plain figures for the record.
    """

    depth: FloatArray
    confidence: FloatArray
    flags: FlagArray
    facts: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class PlaneSweep:
    """Depth maps of calibrated pinhole views by brightness constancy.

    For each of a number of planes, equally spaced in inverse depth and parallel to the image, the other views are
    carried over onto the reference view by the homography that the plane makes [1]_. The cost is the difference of
    linear brightness in units of noise, up to a bound, averaged over a small window, and over the better half of the
    views, since a point may be hidden in the others. It is smoothed as for pairs. Do not use it where the light moves
    with the camera, nor for surfaces that are not matte.

    Attributes
    ----------
    planes : int
        Number of planes.
    window : int
        Side of the window, odd [px].
    top : float
        Difference from which on it does not matter how large it is [standard deviations].
    floor, relative : float
        What views differ by beside noise: anywhere, and over the signal [share of full scale, 1].
    smoothing : Smoothing
        Penalties.
    least_margin : float
        Confidence below which a pixel is left out and flagged as weak [1].
    most_cost : float
        Average difference, as a share of `top`, above which no plane fits [1].

    Raises
    ------
    OptionError
        If a number is out of range.

    References
    ----------
    .. [1] Collins, "A space-sweep approach to true multi-image matching", IEEE Conference on Computer Vision and
       Pattern Recognition, 1996. doi:10.1109/CVPR.1996.517097
    """

    planes: int = 128
    window: int = 5
    top: float = 6.0
    floor: float = 0.02
    relative: float = 0.02
    smoothing: Smoothing = field(default_factory=Smoothing)
    least_margin: float = 0.05
    most_cost: float = 0.7

    def __post_init__(self) -> None:
        fine = 3 <= self.planes <= 4096 and self.window % 2 == 1 and 1 <= self.window <= 51 and self.top > 0
        if not (fine and self.floor >= 0 and self.relative >= 0 and self.least_margin >= 0 and self.most_cost > 0):
            raise OptionError(
                given=f"The sweep has {self.planes} planes and a window of {self.window}, with bounds {self.top}, "
                f"{self.floor}, {self.relative}, {self.least_margin} and {self.most_cost}.",
                needed="3 to 4096 planes, an odd window up to 51, and no negative bounds.",
                remedy="Leave the option out to get the usual one.",
            )

    def depth(
        self,
        images: Sequence[ViewImages],
        views: Sequence[CalibratedView],
        near: float,
        far: float,
        *,
        over: Map = map,
        progress: Progress = no_progress,
    ) -> SweptDepth:
        """Find the depth of the first view.

        Parameters
        ----------
        images : sequence of ViewImages
            The reference view, then one other view or more, under the same lights.
        views : sequence of CalibratedView
            Their cameras.
        near, far : float
            Range of distances [length].
        over : map-like
            Executes planes.
        progress : callable
            Told how many planes are done.

        Returns
        -------
        SweptDepth
            Of the reference view.

        Raises
        ------
        InputError
            If there is one view only, counts disagree, or the range is none.
        UnsupportedError
            If a camera is no pinhole.
        """
        _require(images, views, near, far)
        started = perf_counter()
        noise = images[0].noise.with_tolerance(self.floor, self.relative)
        levels = [_levels(one, images[0], noise) for one in images]
        inverse = np.linspace(1 / far, 1 / near, self.planes)
        cost = np.zeros((*images[0].size, self.planes), np.uint8)

        def plane(k: int) -> None:
            cost[:, :, k] = self._plane_cost(levels, images, views, float(inverse[k]))

        for done, _ in enumerate(over(plane, range(self.planes)), 1):
            progress("sweeping planes", done, self.planes)
        halves = self.smoothing.aggregate(cost, *guide(levels[0]), over)
        label, margin, _ = self.smoothing.winners(halves, 0, paired=False, over=over)
        flags = self._flags(images[0], label, margin, cost)
        solid = (flags & np.uint16(MatchFlag.OUTSIDE_MASK | MatchFlag.WEAK)) == 0
        at = np.interp(label.astype(np.float64), np.arange(self.planes), inverse)
        facts = {
            "planes": self.planes,
            "views": len(images),
            "near": near,
            "far": far,
            "matched": float(solid[images[0].mask].mean()),
            "seconds": {"total": perf_counter() - started},
        }
        return SweptDepth(
            depth=np.where(solid, 1 / at, np.nan).astype(np.float32),
            confidence=np.where(images[0].mask, margin, 0).astype(np.float32),
            flags=flags,
            facts=facts,
        )

    def _flags(self, reference: ViewImages, label: FloatArray, margin: FloatArray, cost: Array) -> FlagArray:
        flags = np.zeros(reference.size, np.uint16)
        flags[~reference.mask] |= np.uint16(MatchFlag.OUTSIDE_MASK)
        flags[reference.saturated.any(axis=(0, 1))] |= np.uint16(MatchFlag.SATURATED)
        index = np.clip(np.rint(label), 0, self.planes - 1).astype(np.intp)
        paid = np.take_along_axis(cost, index[..., None], axis=2)[..., 0]
        # At either end of the range the best plane may be beyond it.
        end = (index == 0) | (index == self.planes - 1)
        weak = (margin < self.least_margin) | (paid > 240 * self.most_cost) | end
        flags[weak & reference.mask] |= np.uint16(MatchFlag.WEAK)
        return flags

    def _plane_cost(
        self, levels: list[FloatArray], images: Sequence[ViewImages], views: Sequence[CalibratedView], inverse: float
    ) -> Array:
        """Return the cost of a plane, uint8 (h, w), 240 at most."""
        import cv2

        height, width = images[0].size
        found = []
        for level, one, view in zip(levels[1:], images[1:], views[1:], strict=True):
            matrix = _homography(views[0], view, inverse)
            flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
            seen = cv2.warpPerspective(one.mask.astype(np.uint8), matrix, (width, height), flags=flags) > 0
            total = np.zeros((height, width), np.float32)
            for mine, theirs in zip(levels[0], level, strict=True):
                moved = cv2.warpPerspective(theirs, matrix, (width, height), flags=flags)
                total += np.minimum(np.abs(mine - moved), np.float32(self.top))
            total /= len(level)
            total[~seen] = self.top
            found.append(total)
        better = np.sort(np.stack(found), axis=0)[: (len(found) + 1) // 2].mean(axis=0)
        if self.window > 1:
            better = cv2.blur(better, (self.window, self.window), borderType=cv2.BORDER_REPLICATE)
        return np.asarray(better * np.float32(240 / self.top)).astype(np.uint8)


def nearest_views(views: Sequence[CalibratedView], reference: int, count: int) -> list[int]:
    """Return the views that stand closest to one of them and look the same way, nearest first.

    Views from the very same place are left out: they cannot tell distances.

    Parameters
    ----------
    views : sequence of CalibratedView
        All views.
    reference : int
        Which one.
    count : int
        How many others.

    Returns
    -------
    list of int
        Their numbers, without the reference itself.
    """
    pose = views[reference].pose
    ways = np.array([np.linalg.norm(view.pose.position - pose.position) for view in views])
    same = [float(view.pose.rotation[:, 2] @ pose.rotation[:, 2]) > 0 for view in views]
    least = _LEAST_BASELINE * float(np.median(ways))
    order = sorted((float(way), n) for n, way in enumerate(ways) if n != reference and way > least and same[n])
    return [number for _, number in order[:count]]


def agreeing_views(
    depths: Sequence[FloatArray], views: Sequence[CalibratedView], reference: int, *, tolerance: float
) -> Array:
    """Count the other views whose own depth says that the same point is there.

    Parameters
    ----------
    depths : sequence of float array (h, w)
        Depth of each view, NaN where unknown [length].
    views : sequence of CalibratedView
        Their cameras.
    reference : int
        Whose points are looked at.
    tolerance : float
        Difference of distances that is still the same point, over the distance [1].

    Returns
    -------
    int array (h, w)
        Number of views that agree.
    """
    count = np.zeros(depths[reference].shape, np.int64)
    for number, depth in enumerate(depths):
        if number != reference:
            shape = (depth.shape[0], depth.shape[1])
            _, _, seen = covisible(
                np.asarray(depths[reference], np.float64),
                views[reference],
                views[number],
                shape,
                other_depth=np.asarray(depth, np.float64),
                tolerance=tolerance,
            )
            count += seen
    return count


def _require(images: Sequence[ViewImages], views: Sequence[CalibratedView], near: float, far: float) -> None:
    if len(images) < 2 or len(images) != len(views):
        raise InputError(
            given=f"There are {len(images)} sets of images and {len(views)} cameras.",
            needed="A camera for each view, and two views or more.",
            remedy="Add views, or check the file of cameras.",
        )
    for one in images[1:]:
        require_comparable(images[0], one, same_size=False)
    if not 0 < near < far < np.inf:
        raise InputError(
            given=f"Distances from {near} to {far} are to be searched.",
            needed="Two positive lengths, the nearer one first.",
            remedy="Give the range in the unit of the cameras' positions.",
        )
    for view in views:
        if not isinstance(view.camera, Pinhole):
            raise UnsupportedError(
                given=f"The camera of {view.name} is {view.camera.name}.",
                needed="Pinholes: planes carry one image over onto another by a homography.",
                remedy="Match parallel projections as a rectified pair.",
            )


def _levels(one: ViewImages, reference: ViewImages, noise: Noise) -> FloatArray:
    """Return brightness on the scale on which noise is 1, float32 (k, h, w)."""
    values = one.in_exposure_of(reference).values
    level = noise.stabilised(np.asarray(values, np.float32))
    return np.asarray(level.reshape(-1, *values.shape[2:]), np.float32)


def _homography(reference: CalibratedView, other: CalibratedView, inverse: float) -> FloatArray:
    """Return the 3 × 3 matrix from the reference's pixels to the other's, over the plane at a distance of 1 / inverse.

    A pixel's ray r has z = −1, so the point at distance Z is Z r, and in the other camera's frame
    Z A r + b ∝ (A − b e_zᵀ / Z) r.
    """
    assert isinstance(reference.camera, Pinhole)
    assert isinstance(other.camera, Pinhole)
    back = other.pose.rotation.T
    turn = back @ reference.pose.rotation
    move = back @ (reference.pose.position - other.pose.position)
    through = turn - inverse * np.outer(move, [0.0, 0.0, 1.0])
    return np.asarray(other.camera.matrix @ _FLIP @ through @ _FLIP @ np.linalg.inv(reference.camera.matrix))


def inside_box(points: FloatArray, low: FloatArray, high: FloatArray) -> BoolArray:
    """Return which points (..., 3) lie in a box with corners (3,) [length]."""
    with np.errstate(invalid="ignore"):
        return np.asarray(((points >= low) & (points <= high)).all(axis=-1))
