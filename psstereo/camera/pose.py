"""Where a camera stands in a scene."""

from dataclasses import dataclass, field

import numpy as np

from psstereo.errors import InputError
from psstereo.types import FloatArray

__all__ = ["Pose"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Pose:
    """A rotation and a position: the point x of the camera's frame is R x + t in the scene's frame.

    Both frames have x right, y up, z toward the viewer; the camera looks along −z of its own.

    Attributes
    ----------
    rotation : float64 array (3, 3)
        R; its columns are the camera's axes in the scene [1].
    position : float64 array (3,)
        t, the origin of the camera's frame in the scene [length].

    Raises
    ------
    InputError
        If R is no proper rotation, or t is not finite.
    """

    rotation: FloatArray = field(default_factory=lambda: np.eye(3))
    position: FloatArray = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        r, t = np.array(self.rotation, np.float64), np.array(self.position, np.float64)
        proper = r.shape == (3, 3) and np.abs(r.T @ r - np.eye(3)).max() < 1e-9 and np.linalg.det(r) > 0
        if not proper or t.shape != (3,) or not np.isfinite(t).all():
            raise InputError(
                given=f"A camera's rotation is {r.tolist()} and its position {t.tolist()}.",
                needed="A proper rotation matrix, 3 × 3, and three finite numbers.",
                remedy="Build it with Pose.looking_at, or orthonormalise the matrix.",
            )
        r.flags.writeable = t.flags.writeable = False
        object.__setattr__(self, "rotation", r)
        object.__setattr__(self, "position", t)

    @classmethod
    def looking_at(cls, position: FloatArray, target: FloatArray, up: FloatArray | None = None) -> "Pose":
        """Place a camera somewhere and turn it toward a point.

        Parameters
        ----------
        position, target : float array (3,)
            Where it stands and what it looks at [length].
        up : float array (3,), optional
            What is up in its image; +y if absent, not along the line of sight [1].

        Returns
        -------
        Pose
            The pose.

        Raises
        ------
        InputError
            If the two points coincide, or `up` lies along the line of sight.
        """
        backward = np.asarray(position, np.float64) - np.asarray(target, np.float64)
        right = np.cross([0.0, 1.0, 0.0] if up is None else np.asarray(up, np.float64), backward)
        length, across = np.linalg.norm(backward), np.linalg.norm(right)
        if not across > 1e-12 * length:
            raise InputError(
                given=f"A camera at {np.asarray(position).tolist()} looks at {np.asarray(target).tolist()}.",
                needed="Two different points, and an upward direction across the line between them.",
                remedy="Move the camera, or give another `up`.",
            )
        z, x = backward / length, right / across
        return cls(rotation=np.stack([x, np.cross(z, x), z], axis=1), position=np.asarray(position, np.float64))

    def to_scene(self, points: FloatArray) -> FloatArray:
        """Return points (..., 3) of the camera's frame in the scene's."""
        return np.asarray(np.asarray(points, np.float64) @ self.rotation.T + self.position)

    def to_camera(self, points: FloatArray) -> FloatArray:
        """Return points (..., 3) of the scene's frame in the camera's."""
        return np.asarray((np.asarray(points, np.float64) - self.position) @ self.rotation)
