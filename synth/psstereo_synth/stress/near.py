"""Lamps near the surface: from grazing past it to so far away that nothing tells the distance."""

from functools import partial

import numpy as np

from psstereo.bench.stress import Answer, Rule, StressCase
from psstereo.camera import Pinhole
from psstereo.capture import Capture
from psstereo.errors import InputError, RigError
from psstereo.flags import Flag
from psstereo.lights import Led, Rig
from psstereo.near import NearOptions, NearResult, solve_near
from psstereo.stack import MemoryStack
from psstereo.types import BoolArray, FloatArray

__all__ = ["near_cases"]

_SIDE = 20
_RADIUS = 90.0
"""Of the sphere [mm]."""
_ANGLE = float(np.radians(0.2))
"""Angle that is let pass on exact data: what integration on so few pixels leaves of the points' places [rad]."""
_DEPTH = 2e-3
"""Relative error of the distance that is let pass [1]."""


def near_cases() -> list[StressCase]:
    """Return the cases of this family."""
    common = partial(
        StressCase,
        family="near lamps",
        rule=Rule.TOLD,
        refusals=(InputError, RigError),
        remarks=Flag.NOT_CONVERGED | Flag.NO_DEPTH,
        limit=30.0,
    )
    cases = [
        common(
            name="distance over object size",
            parameter=f"{ratio:g}",
            run=partial(_sphere, ratio * 2.0 * _RADIUS, 0.5, hold=False),
        )
        for ratio in (0.8, 5.0, 100.0)
    ]
    cases += [
        common(
            name="distance over object size, held",
            parameter=f"{ratio:g}",
            run=partial(_sphere, ratio * 2.0 * _RADIUS, 0.5, hold=True),
        )
        for ratio in (1000.0,)
    ]
    cases += [
        common(name="fall-off between lamps", parameter=f"{decades} decades", run=partial(_uneven, decades))
        for decades in (2, 4)
    ]
    cases.append(common(name="a lamp inside the object", parameter="1 of 12", run=_inside))
    return cases


def _scene(distance: float) -> tuple[Pinhole, FloatArray, FloatArray, BoolArray]:
    """Return camera, distances, normals and mask of a sphere's middle before a pinhole."""
    focal = 0.42 * _SIDE * distance / _RADIUS
    camera = Pinhole(fx=focal, fy=focal, cx=(_SIDE - 1) / 2 + 0.3, cy=(_SIDE - 1) / 2 - 0.7)
    rays, centre = camera.rays((_SIDE, _SIDE)), np.array([0.0, 0.0, -distance])
    a, b = (rays * rays).sum(axis=-1), rays @ centre
    inside = b * b - a * (centre @ centre - _RADIUS**2)
    mask = np.asarray(inside > 0.25 * _RADIUS**2)
    depth = np.where(mask, (b - np.sqrt(np.where(mask, inside, 0.0))) / a, np.nan)
    return camera, depth, (rays * depth[..., None] - centre) / _RADIUS, mask


def _lamps(distance: float, spread: float) -> list[Led]:
    """Return twelve lamps on two circles around the camera, aimed at the object."""
    lamps = []
    for i in range(12):
        turn, far = np.pi * i / 6, spread * distance * (1.0 if i % 2 else 0.5)
        place = np.array([far * np.cos(turn), far * np.sin(turn), 0.03 * distance * np.cos(3 * turn)])
        lamps.append(Led(position=place, axis=[0, 0, -distance] - place, mu=1.0, flux=np.array([1e5])))
    return lamps


def _solve(
    distance: float, lamps: list[Led], kind: str, options: NearOptions
) -> tuple[NearResult, FloatArray, FloatArray, BoolArray]:
    camera, depth, normals, mask = _scene(distance)
    points = np.where(mask[..., None], camera.points(np.where(mask, depth, 1.0)), [0.0, 0.0, -distance])
    facing = np.where(mask[..., None], normals, [0.0, 0.0, 1.0])
    images = 0.5 * np.stack([lamp.irradiance(points, facing) for lamp in lamps]) * mask[..., None]
    images = (images / images.max()).astype(kind)
    capture = Capture(stack=MemoryStack(images), rig=Rig(tuple(lamps)), camera=camera, mask=mask)
    return solve_near(capture, options), depth, normals, mask


def _scored(found: NearResult, depth: FloatArray, normals: FloatArray, mask: BoolArray) -> Answer:
    """Put angles beside their bound and distances beside theirs, so that one number has both."""
    got = np.asarray(found.normals.normals, np.float64)[mask]
    angle = np.arctan2(np.linalg.norm(np.cross(got, normals[mask]), axis=-1), (got * normals[mask]).sum(axis=-1))
    off = np.abs(np.asarray(found.depth.depth, np.float64)[mask] / depth[mask] - 1.0)
    flags = found.normals.flags[mask]
    flags = flags | np.where(found.converged, 0, int(Flag.NOT_CONVERGED)).astype(np.uint16)
    error = np.concatenate([angle / _ANGLE, off / _DEPTH])
    return Answer(error=error, bound=1.0, flags=np.tile(flags, 2), words="error over 0.2° or 0.2 %")


def _sphere(distance: float, spread: float, kind: str, *, hold: bool) -> Answer:
    options = NearOptions()
    if hold:
        options = NearOptions(distance=float(np.nanmedian(_scene(distance)[1])), hold_distance=True)
    return _scored(*_solve(distance, _lamps(distance, spread), kind, options))


def _uneven(decades: int, kind: str) -> Answer:
    """Half the lamps stand so much farther away than the others that they are decades weaker."""
    distance, lamps = 400.0, _lamps(400.0, 0.5)
    far = 10.0 ** (decades / 2.0)
    target = np.array([0.0, 0.0, -distance])
    for i in range(0, 12, 2):
        place = target + far * (lamps[i].position - target)
        lamps[i] = Led(position=place, axis=target - place, mu=1.0, flux=np.array([1e5]))
    return _scored(*_solve(distance, lamps, kind, NearOptions()))


def _inside(kind: str) -> Answer:
    distance, lamps = 400.0, _lamps(400.0, 0.5)
    lamps[3] = Led(position=np.array([0.0, 10.0, -distance]), axis=np.array([0, 0, 1.0]), mu=0.0, flux=np.array([1e5]))
    return _scored(*_solve(distance, lamps, kind, NearOptions()))
