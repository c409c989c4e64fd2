"""Cameras and surfaces that the tests of views share."""

from functools import cache

import numpy as np

from psstereo.camera import Pinhole, Pose
from psstereo_synth.shapes import (
    RELIEFS,
    HeightGrid,
)
from psstereo_synth.view import centred_orthographic, centred_pinhole, view_relief

SHAPE = (56, 71)


def turned(tilt, turn=0.3):
    """Rotation of a camera that is tilted about its x axis, then turned about the scene's z axis."""
    c, s = np.cos(tilt), np.sin(tilt)
    a, b = np.cos(turn), np.sin(turn)
    return np.array([[a, -b, 0], [b, a, 0], [0, 0, 1]]) @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def oblique(tilt=1.0, width=2.6, shape=SHAPE):
    return *centred_orthographic(shape, width=width, rotation=turned(tilt)), shape


def above(shape=SHAPE, focal=141.42, distance=4.0):
    return *centred_pinhole(shape, focal=focal, distance=distance), shape


def askance(shape=SHAPE):
    camera = Pinhole(fx=105.0, fy=98.0, cx=33.5, cy=28.6, skew=2.1)
    return camera, Pose.looking_at(np.array([1.4, -1.9, 1.6]), np.array([0.1, 0.0, 0.0])), shape


VIEWS = {
    "oblique": oblique,
    "above": above,
    "askance": askance,
    "straight": lambda: (*centred_orthographic(SHAPE), SHAPE),
}


def bumpy_grid():
    rows, columns = np.indices((12, 12))
    return HeightGrid(heights=0.1 * np.sin(rows) * np.cos(0.8 * columns), spacing=(0.15, 0.17))


def make(name):
    return bumpy_grid() if name == "grid" else RELIEFS[name]()


@cache
def seen(name, where):
    """Return surface, camera, pose, and what is seen; for all tests of the same pair."""
    relief, (camera, pose, shape) = make(name), VIEWS[where]()
    return relief, camera, pose, view_relief(relief, camera, pose, shape)


def residual(relief, view):
    """Largest |z − f(x, y)| across the surface [length]."""
    p = view.geometry.points
    found = relief.evaluate(p[:, 0], p[:, 1])
    return np.abs((p[:, 2] - found.height) / np.hypot(1, np.hypot(found.slope_x, found.slope_y)))
