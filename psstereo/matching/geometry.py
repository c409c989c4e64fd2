"""Cameras that know where they stand: from pixels to points of the scene and back."""

from dataclasses import dataclass

import numpy as np

from psstereo.camera import Camera, Orthographic, Pinhole, Pose
from psstereo.errors import InputError, UnsupportedError
from psstereo.results import DepthKind
from psstereo.types import BoolArray, FloatArray

__all__ = ["CalibratedView", "covisible", "rectified_views"]


@dataclass(frozen=True, kw_only=True, eq=False)
class CalibratedView:
    """A camera and its pose in the scene.

    Attributes
    ----------
    camera : Camera
        Projection, without lens distortion.
    pose : Pose
        From the camera's frame to the scene's.
    name : str
        For messages.
    """

    camera: Camera
    pose: Pose
    name: str = "view"

    def points(self, depth: FloatArray) -> FloatArray:
        """Return the points of a depth map (h, w) in the scene's frame, float64 (h, w, 3) [length]."""
        return self.pose.to_scene(self.camera.points(depth))

    def project(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return where points of the scene appear.

        Parameters
        ----------
        points : float array (..., 3)
            Points in the scene's frame [length].

        Returns
        -------
        column, row : float64 array (...)
            Pixel coordinates; NaN behind a pinhole [px].
        distance : float64 array (...)
            How far from the camera along its axis, growing away from it [length].

        Raises
        ------
        UnsupportedError
            If the camera is of a kind whose projection is not known here.
        """
        x, y, z = np.moveaxis(self.pose.to_camera(points), -1, 0)
        camera = self.camera
        if isinstance(camera, Pinhole):
            with np.errstate(divide="ignore", invalid="ignore"):
                ahead = np.where(z < 0, -z, np.nan)
                right, down = x / ahead, -y / ahead
            return camera.cx + camera.fx * right + camera.skew * down, camera.cy + camera.fy * down, ahead
        if isinstance(camera, Orthographic):
            return x / camera.pixel_size, -y / camera.pixel_size, -z
        raise UnsupportedError(
            given=f"The camera is {camera.name}.",
            needed="A pinhole or an orthographic camera.",
            remedy="Undistort the images and describe the camera by its matrix.",
        )


def rectified_views(left: Pinhole, baseline: float, *, shift: float = 0.0) -> tuple[CalibratedView, CalibratedView]:
    """Return two pinholes side by side with parallel axes, as a rectified pair has them.

    Parameters
    ----------
    left : Pinhole
        The left camera; the scene's frame is its own.
    baseline : float
        How far to the right the other one stands [length].
    shift : float
        Column of the right principal point minus that of the left one [px].

    Returns
    -------
    left, right : CalibratedView
        The views.

    Raises
    ------
    InputError
        If the baseline is not positive.
    """
    if not 0 < baseline < np.inf:
        raise InputError(
            given=f"The baseline is {baseline}.",
            needed="A positive length: the right camera stands to the right of the left one.",
            remedy="Swap the images, or correct the length.",
        )
    right = Pinhole(fx=left.fx, fy=left.fy, cx=left.cx + shift, cy=left.cy, skew=left.skew)
    pose = Pose(position=np.array([baseline, 0.0, 0.0]))
    return CalibratedView(camera=left, pose=Pose(), name="left"), CalibratedView(camera=right, pose=pose, name="right")


def covisible(
    depth: FloatArray,
    view: CalibratedView,
    other: CalibratedView,
    shape: tuple[int, int],
    *,
    other_depth: FloatArray | None = None,
    tolerance: float = 0.01,
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return where the points of one view appear in another, and which of them it sees.

    With the other view's own depth a point is seen if that depth is its distance. Without it, the points themselves
    hide each other: of those that fall into the same pixel or the next, the nearest is seen.

    Parameters
    ----------
    depth : float array (h, w)
        Of the first view, NaN where unknown [length].
    view, other : CalibratedView
        The views.
    shape : (int, int)
        Rows and columns of the other view.
    other_depth : float array (h', w'), optional
        Of the other view [length].
    tolerance : float
        Difference of distances that is still the same point, over the distance from the camera, or over the range of
        depths for a parallel projection [1].

    Returns
    -------
    column, row : float64 array (h, w)
        In the other image; NaN where it has no such pixel [px].
    seen : bool array (h, w)
        Where the other view sees the point.
    """
    column, row, distance = other.project(view.points(depth))
    height, width = shape
    with np.errstate(invalid="ignore"):
        inside = (column >= 0) & (column <= width - 1) & (row >= 0) & (row <= height - 1) & np.isfinite(distance)
    j = np.rint(np.where(inside, column, 0)).astype(np.intp)
    i = np.rint(np.where(inside, row, 0)).astype(np.intp)
    parallel = other.camera.depth_kind is DepthKind.HEIGHT
    if other_depth is None:
        nearest = np.full(shape, np.inf)
        np.minimum.at(nearest, (i[inside], j[inside]), distance[inside])
        nearest = _least_around(nearest)
    else:
        nearest = np.nan_to_num(-other_depth if parallel else other_depth, nan=-np.inf)
    room = tolerance * (np.ptp(distance[inside]) if parallel and inside.any() else distance)
    with np.errstate(invalid="ignore"):
        seen = inside & (distance <= nearest[i, j] + room)
        if other_depth is not None:
            seen &= distance >= nearest[i, j] - room
    return np.where(inside, column, np.nan), np.where(inside, row, np.nan), np.asarray(seen)


def _least_around(values: FloatArray) -> FloatArray:
    """Return the least value of each 3 × 3 neighbourhood."""
    padded = np.pad(values, 1, constant_values=np.inf)
    rows = np.minimum(np.minimum(padded[:-2], padded[1:-1]), padded[2:])
    return np.asarray(np.minimum(np.minimum(rows[:, :-2], rows[:, 1:-1]), rows[:, 2:]))
