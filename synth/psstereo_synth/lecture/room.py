"""A room around an observer: everything that can be seen adds up to the whole sphere."""

import numpy as np

from psstereo.radiometry import FULL_SPHERE, polygon_solid_angle
from psstereo.types import FloatArray
from psstereo_synth.lecture.example import Example
from psstereo_synth.lecture.statements import STATEMENTS

__all__ = ["room", "shares"]

_SIZE = np.array([5.0, 4.0, 2.5])
"""Width, depth and height of the room that the others are made from [m]."""
_SHEAR = np.array([[1.0, 0.3, 0.5], [0.0, 1.0, -0.4], [0.0, 0.0, 1.0]])
"""Pushes every wall out of the right angle [1]."""
_UNIT = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], np.float64)
_FACES = {
    "floor": (0, 2, 3, 1),
    "ceiling": (4, 5, 7, 6),
    "west": (0, 4, 6, 2),
    "east": (1, 3, 7, 5),
    "south": (0, 1, 5, 4),
    "north": (2, 6, 7, 3),
}
"""Corners of each face, counter-clockwise from outside."""


def _corners(kind: str) -> FloatArray:
    """Return the eight corners of a room (8, 3) [m]."""
    if kind == "skewed":
        return np.asarray(_UNIT * _SIZE @ _SHEAR.T)
    if kind == "attic":  # the ceiling is half as wide and as deep as the floor
        narrow = 1.0 - 0.5 * _UNIT[:, 2:]
        return np.asarray(np.concatenate([0.5 + narrow * (_UNIT[:, :2] - 0.5), _UNIT[:, 2:]], axis=1) * _SIZE)
    return np.asarray(_UNIT * _SIZE)


def shares(corners: FloatArray, observer: FloatArray) -> dict[str, float]:
    """Return the solid angle of each face of a room.

    Parameters
    ----------
    corners : float array (8, 3)
        Corners: x changes fastest, then y, then z; the faces have to be flat [m].
    observer : float array (3,)
        Where they are seen from [m].

    Returns
    -------
    dict of float
        Solid angle by the name of the face; negative for a face that is seen from outside [sr].
    """
    return {name: float(polygon_solid_angle(corners[list(face)], observer)) for name, face in _FACES.items()}


def room() -> Example:
    """Add up the solid angles of floor, ceiling and walls.

    *Statement.* A solid angle is the area that something covers on the unit sphere around the eye. Wherever one looks
    in a room, one looks at floor, ceiling or wall, and at one of them only: their solid angles add up to the whole
    sphere, 4π sr. It does not matter how large the room is, how crooked, or where in it one stands. From a point
    close to a corner the three faces that meet there fill seven eighths of the sphere together, if they meet at right
    angles.

    *Where it stops being true.* From outside, near faces are seen from their backs and count negative, far ones from
    their fronts, and the sum is zero. On a wall itself the other faces have 2π between them, and the wall's own share
    is a matter of which side one is on. A room with a window adds up to 4π only with the window.

    Returns
    -------
    Example
        The error is that of the sum, relative to 4π.
    """
    rows, errors = [], []
    for kind in ("box", "skewed", "attic"):
        corners = _corners(kind)
        middle, corner = corners.mean(axis=0), corners[0]
        places = {
            "middle": (middle, 1.0),
            "off the middle": (corners.T @ np.array([3, 1, 2, 1, 1, 4, 1, 1]) / 14.0, 1.0),
            "1 mm off a corner": (corner + 1e-3 * (middle - corner) / np.linalg.norm(middle - corner), 1.0),
            "1 nm off a corner": (corner + 1e-9 * (middle - corner) / np.linalg.norm(middle - corner), 1.0),
            "outside": (corner - (middle - corner), 0.0),
        }
        for place, (observer, expected) in places.items():
            seen = shares(corners, observer)
            walls = [seen[name] for name in ("west", "east", "south", "north")]
            total = sum(seen.values())
            rows.append((kind, place, seen["floor"], seen["ceiling"], sum(walls), total / FULL_SPHERE))
            errors.append(abs(total / FULL_SPHERE - expected))
    tolerance = 1e-14
    error = float(np.max(errors))
    return Example(
        title="A room fills the sphere",
        statement=STATEMENTS["room"],
        columns=("room", "seen from", "floor [sr]", "ceiling [sr]", "four walls [sr]", "sum / 4π [1]"),
        rows=tuple(rows),
        largest_error=error,
        tolerance=tolerance,
        holds=error <= tolerance,
    )
