"""A ball in the picture: what is seen of it, how well, and where that puts it in space."""

from dataclasses import dataclass, field, replace

import numpy as np

from psstereo.calibrate.viewing import pixel_rays
from psstereo.camera import Camera, Orthographic, Pinhole
from psstereo.errors import InputError
from psstereo.types import BoolArray, FloatArray

__all__ = ["Ball", "inside", "outline_points", "sphere_of"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Ball:
    """A ball as the camera sees it.

    Under parallel projection its outline is a circle, ``seen = (x, y, r)``. Through a pinhole it is an ellipse, whose
    three free numbers are written in the same way: (x, y) is where the ball's *centre* is seen, which is not the
    middle of the ellipse, and r = f sin α with α the half angle of the cone of rays that touch it and f the geometric
    mean of the focal lengths.

    Attributes
    ----------
    seen : float64 array (3,)
        Column and row of the centre, and size; the centre of the first pixel is at (0, 0) [px].
    covariance : float64 array (3, 3)
        Of the errors of `seen`; a quarter of a pixel each if nothing was said [px²].
    camera : Camera
        What sees it, a pinhole or a parallel projection.
    radius : float
        True radius, which tells a pinhole how far away the ball is; with 1 lengths are in radii of the ball. Unused
        under parallel projection, where the outline is as large as the ball [length].
    height : float
        Under parallel projection, height of the ball's centre, which its outline does not tell [length].

    Raises
    ------
    InputError
        If numbers are not finite, sizes not positive, or the ball does not fit into the cone of a pinhole's rays.
    """

    seen: FloatArray
    covariance: FloatArray = field(default_factory=lambda: np.eye(3) / 16.0)
    camera: Camera = field(default_factory=Orthographic)
    radius: float = 1.0
    height: float = 0.0

    def __post_init__(self) -> None:
        seen, covariance = np.array(self.seen, np.float64), np.array(self.covariance, np.float64)
        _check(seen, covariance, self.radius, self.height)
        focal = _focal(self.camera)
        if focal is not None and seen[2] >= focal:
            raise InputError(
                given=f"A ball of the size {seen[2]:.4g} px is seen by a camera of the focal length {focal:.4g} px.",
                needed="The size is the focal length times the sine of the half angle, and stays below it.",
                remedy="Check the camera matrix: its focal length is in pixels of these images.",
            )
        seen.flags.writeable = covariance.flags.writeable = False
        object.__setattr__(self, "seen", seen)
        object.__setattr__(self, "covariance", covariance)

    @classmethod
    def circle(cls, x: float, y: float, r: float, *, sigma: float = 0.25) -> "Ball":
        """Return the ball of a circle under parallel projection.

        Parameters
        ----------
        x, y : float
            Column and row of the middle, the centre of the first pixel at (0, 0) [px].
        r : float
            Radius [px].
        sigma : float
            Standard error of each of the three numbers [px].

        Returns
        -------
        Ball
            The ball.

        Raises
        ------
        InputError
            If a number is not finite, or the radius or the error not positive.
        """
        return cls(seen=np.array([x, y, r]), covariance=np.eye(3) * sigma * sigma)

    @property
    def sphere(self) -> tuple[FloatArray, float]:
        """Centre (3,) and radius in space, x right, y up, z toward the camera [length]."""
        centre, radius = sphere_of(self, self.seen)
        return centre, float(radius)

    def moved(self, x: float, y: float) -> "Ball":
        """Return the ball in a picture whose first pixel is x columns and y rows further up the left [px]."""
        return replace(self, seen=self.seen + np.array([x, y, 0.0]))


def sphere_of(ball: Ball, seen: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return where balls are in space that are seen in certain ways.

    Parameters
    ----------
    ball : Ball
        Its camera, radius and height are used.
    seen : float array (..., 3)
        Column, row and size [px].

    Returns
    -------
    centres : float64 array (..., 3)
        Centres, x right, y up, z toward the camera [length].
    radii : float64 array (...)
        Radii [length].
    """
    origins, rays = pixel_rays(ball.camera, seen[..., :2])
    focal = _focal(ball.camera)
    if focal is not None:
        distance = ball.radius * focal / seen[..., 2]
        return distance[..., None] * rays, np.full(seen.shape[:-1], ball.radius)
    size = ball.camera.pixel_size if isinstance(ball.camera, Orthographic) else 1.0
    return origins + np.array([0.0, 0.0, ball.height]), seen[..., 2] * size


def outline_points(ball: Ball, angles: FloatArray, scale: float | FloatArray = 1.0) -> FloatArray:
    """Return where the outline of a ball is in the image.

    Parameters
    ----------
    ball : Ball
        The ball.
    angles : float array (k,)
        Places on the outline, from x toward y up [rad].
    scale : float or float array (s,)
        Of another ball at the same place, so many times as large: above 1 it is outside of the outline [1].

    Returns
    -------
    float64 array (k, 2) or (s, k, 2)
        Columns and rows [px].
    """
    from psstereo.calibrate.viewing import project

    around = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    focal, times = _focal(ball.camera), np.asarray(scale, np.float64)[..., None, None]
    if focal is None:
        return np.asarray(ball.seen[:2] + times * ball.seen[2] * around * np.array([1.0, -1.0]))
    sine = np.minimum(times * float(ball.seen[2]) / focal, 0.999)
    axis = pixel_rays(ball.camera, ball.seen[:2])[1]
    across = np.cross(np.array([0.0, 1.0, 0.0]), -axis)
    across /= np.sqrt(across @ across)
    upward = np.cross(-axis, across)
    ring = around[:, :1] * across + around[:, 1:] * upward
    return project(ball.camera, np.sqrt(1.0 - sine * sine) * axis + sine * ring)


def inside(ball: Ball, shape: tuple[int, int], share: float = 1.0) -> BoolArray:
    """Return the pixels that see a ball.

    Parameters
    ----------
    ball : Ball
        The ball.
    shape : (int, int)
        Rows and columns of the image.
    share : float
        Of the outline: the pixels within so many radii, seen from the camera [1].

    Returns
    -------
    bool array (h, w)
        True on the ball.
    """
    rows, columns = np.indices(shape, dtype=np.float64)
    focal = _focal(ball.camera)
    if focal is None:
        return np.asarray(np.hypot(columns - ball.seen[0], rows - ball.seen[1]) < share * ball.seen[2])
    rays = pixel_rays(ball.camera, np.stack([columns, rows], axis=-1))[1]
    axis = pixel_rays(ball.camera, ball.seen[:2])[1]
    off = np.cross(rays, axis)
    sine = np.sqrt((off * off).sum(axis=-1))
    return np.asarray((sine < share * ball.seen[2] / focal) & (rays @ axis > 0))


def _focal(camera: Camera) -> float | None:
    return float(np.sqrt(camera.fx * camera.fy)) if isinstance(camera, Pinhole) else None


def _check(seen: FloatArray, covariance: FloatArray, radius: float, height: float) -> None:
    sound = seen.shape == (3,) and np.isfinite(seen).all() and seen[2] > 0
    if not (sound and np.isfinite([radius, height]).all() and radius > 0):
        raise InputError(
            given=f"A ball is given as {np.array2string(seen, precision=4)}, of the radius {radius}, at the height "
            f"{height}.",
            needed="Column, row and radius in the picture, all finite, and radii above 0.",
            remedy="Give x,y,r in pixels, such as 253.5,148,119.5.",
        )
    regular = covariance.shape == (3, 3) and np.isfinite(covariance).all()
    if not regular or np.abs(covariance - covariance.T).max() > 1e-9 * np.abs(covariance).max():
        regular = False
    if not regular or np.linalg.eigvalsh(covariance)[0] <= 0:
        raise InputError(
            given=f"The covariance of a ball's outline is {np.array2string(covariance, precision=3)}.",
            needed="A symmetric, positive 3 × 3 matrix of squared pixels.",
            remedy="Give the standard error of the circle in pixels, above 0, or leave it out.",
        )
