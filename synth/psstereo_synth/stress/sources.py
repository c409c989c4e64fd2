"""Lights with an extent: a disc from a point to the hemisphere, and solid angles, against 40 digits."""

from collections.abc import Callable
from functools import partial
from importlib import import_module
from typing import Any

import numpy as np

from psstereo.bench.stress import Answer, StressCase
from psstereo.lights import Disc, Led, Sun
from psstereo.radiometry import (
    cap_solid_angle,
    disc_solid_angle,
    polygon_solid_angle,
    sphere_solid_angle,
    triangle_solid_angle,
    tube_solid_angle,
)
from psstereo.types import FloatArray

__all__ = ["source_cases"]

_CLOSE = 1e-12
"""Relative error that is let pass, and beside the irradiance of a surface that faces the source [1]."""
_DIGITS = 60


def source_cases() -> list[StressCase]:
    """Return the cases of this family."""
    cases = []
    exact = partial(StressCase, family="sources", needs="mpmath")
    for name, run in _SOLID.items():
        cases.append(exact(name="solid angle", parameter=name, run=partial(_solid, run)))
    for ratio in (1e-8, 1e-4, 1e-2, 1.0, 1e2, 1e4, 1e8):
        for tilt in (0.0, 40.0):
            cases.append(
                exact(
                    name="disc from point to hemisphere",
                    parameter=f"radius over height {ratio:.0e}, surface tilted {tilt:g}°",
                    run=partial(_disc, ratio, tilt),
                )
            )
    for ratio in (1e-2, 1e-4, 1e-6):
        cases.append(
            exact(name="disc against a lamp", parameter=f"radius over height {ratio:.0e}", run=partial(_point, ratio))
        )
    for angle in (1e-6, 4.65e-3, 0.5, np.pi / 2):
        cases.append(
            exact(name="sun's disc", parameter=f"angular radius {angle:.3g} rad", run=partial(_sun, float(angle)))
        )
    for decades in (1, 2, 4, 8):
        cases.append(
            exact(
                name="fall-off of a lamp", parameter=f"{decades} decades of irradiance", run=partial(_falloff, decades)
            )
        )
    return cases


def _relative(found: FloatArray, wanted: list[Any]) -> FloatArray:
    mp = import_module("mpmath")
    pairs = zip(np.ravel(found), wanted, strict=True)
    with mp.workdps(_DIGITS):
        return np.array([float(abs(mp.mpf(float(a)) / b - 1)) if np.isfinite(a) else np.nan for a, b in pairs])


def _solid(run: Callable[[str], tuple[FloatArray, list[Any]]], kind: str) -> Answer:
    found, wanted = run(kind)
    return Answer(error=_relative(found, wanted), bound=_CLOSE)


def _caps(kind: str) -> tuple[FloatArray, list[Any]]:
    mp = import_module("mpmath")
    angles = np.array([1e-18, 1e-9, 1e-6, 4.65e-3, 0.5, 1.5, 3.0], kind)
    with mp.workdps(_DIGITS):
        return cap_solid_angle(angles), [4 * mp.pi * mp.sin(mp.mpf(float(a)) / 2) ** 2 for a in angles]


def _spheres(kind: str) -> tuple[FloatArray, list[Any]]:
    mp = import_module("mpmath")
    away = np.array([1.0001, 1.5, 10.0, 215.0, 1.784e6, 1e12], kind)
    with mp.workdps(_DIGITS):
        return sphere_solid_angle(np.ones_like(away), away), [
            2 * mp.pi * (1 - mp.sqrt(1 - 1 / mp.mpf(float(d)) ** 2)) for d in away
        ]


def _tubes(kind: str) -> tuple[FloatArray, list[Any]]:
    mp = import_module("mpmath")
    lengths = np.array([1e-8, 0.3, 1.0, 1e3, 1e6, 1e10], kind)
    with mp.workdps(_DIGITS):
        wanted = [2 * mp.pi * (1 - mp.mpf(float(x)) / mp.sqrt(1 + mp.mpf(float(x)) ** 2)) for x in lengths]
    return tube_solid_angle(np.ones_like(lengths), lengths), wanted


def _discs(kind: str) -> tuple[FloatArray, list[Any]]:
    """Off the axis: polar coordinates about the observer's foot, from there to the rim."""
    mp = import_module("mpmath")
    table = np.array(
        [(1.0, 1.0, 0.0), (1.0, 0.3, 0.7), (1.0, 1e-3, 0.5), (1.0, 2.0, 3.0), (1.0, 0.1, 40.0), (1e-6, 1.0, 0.5)], kind
    )
    wanted = []
    with mp.workdps(30):
        for radius, height, offset in table:
            a, h, p = (mp.mpf(float(x)) for x in (radius, height, offset))
            wanted.append(_disc_angle(a, h, p))
    return disc_solid_angle(*table.T), wanted


def _disc_angle(a: Any, h: Any, p: Any) -> Any:
    mp = import_module("mpmath")

    def beyond(s: Any) -> Any:
        return h / mp.sqrt(h * h + s * s)

    if p < a:

        def whole(turn: Any) -> Any:
            return 1 - beyond(p * mp.cos(turn) + mp.sqrt(a * a - (p * mp.sin(turn)) ** 2))

        return 2 * mp.quad(whole, [0, mp.pi / 4, mp.pi / 2, 3 * mp.pi / 4, mp.pi])
    last = mp.asin(a / p)

    def strip(share: Any) -> Any:  # the substitution takes the square root's end away
        turn = last * mp.sin(share)
        half = mp.sqrt(a * a - (p * mp.sin(turn)) ** 2)
        near, far = p * mp.cos(turn) - half, p * mp.cos(turn) + half
        return (beyond(near) - beyond(far)) * last * mp.cos(share)

    return 2 * mp.quad(strip, [0, mp.pi / 4, mp.pi / 2])


def _triangles(kind: str) -> tuple[FloatArray, list[Any]]:
    corners, wanted = [], []
    for size in (1.0, 1e-3, 1e-6, 1e-9, 1e-12):
        corner = np.array([[0.3, 0.1, 1.0], [0.3, 0.1, 1.0], [0.3, 0.1, 1.0]])
        corner[1, 0] += 1.0
        corner[2, 1] += 1.3
        # The observer moves away instead of the triangle shrinking, whose edges would drown in its place.
        corner[:, 2] = 1.0 / size
        corners.append(corner.astype(kind))
        wanted.append(_triangle_angle(corners[-1]))
    return triangle_solid_angle(np.stack(corners)), wanted


def _triangle_angle(corners: FloatArray) -> Any:
    mp = import_module("mpmath")
    with mp.workdps(_DIGITS):
        a, b, c = (mp.matrix([mp.mpf(float(x)) for x in row]) for row in corners)

        def dot(u: Any, v: Any) -> Any:
            return sum(u[i] * v[i] for i in range(3))

        la, lb, lc = (mp.sqrt(dot(u, u)) for u in (a, b, c))
        triple = mp.det(mp.matrix([[u[i] for i in range(3)] for u in (a, b, c)]))
        return 2 * mp.atan2(triple, la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb)


def _polygons(kind: str) -> tuple[FloatArray, list[Any]]:
    mp = import_module("mpmath")
    found, wanted = [], []
    for far in (0.5, 1.0, 1e3, 1e6):
        square = np.array([[1, 1, far], [-1, 1, far], [-1, -1, far], [1, -1, far]], kind)
        found.append(float(polygon_solid_angle(square)))
        with mp.workdps(_DIGITS):
            h = mp.mpf(float(square[0, 2]))
            wanted.append(4 * mp.asin(1 / (1 + h * h)))
    return np.array(found), wanted


_SOLID: dict[str, Callable[[str], tuple[FloatArray, list[Any]]]] = {
    "caps": _caps,
    "spheres": _spheres,
    "tubes": _tubes,
    "discs off their axis": _discs,
    "triangles": _triangles,
    "squares": _polygons,
}


def _disc(ratio: float, tilt: float, kind: str) -> Answer:
    """On its axis, π L sin²θ cos τ while the disc is whole; a plane that fills the sky, cut by the horizon."""
    mp = import_module("mpmath")
    radius = float(np.asarray(ratio, kind))
    disc = Disc(centre=np.array([0, 0, 1.0]), axis=np.array([0, 0, -1.0]), radius=radius, radiance=np.ones(1))
    turn = np.radians(tilt)
    normal = np.array([np.sin(turn), 0.0, np.cos(turn)])
    found = float(disc.irradiance(np.zeros((1, 3)), normal[None])[0, 0])
    with mp.workdps(_DIGITS):
        wanted = _tilted_disc(mp.mpf(radius), [mp.mpf(float(x)) for x in normal])
    return Answer(error=_relative(np.array([found]), [wanted]), bound=_CLOSE)


def _tilted_disc(radius: Any, normal: list[Any]) -> Any:
    """Integrate max(0, n·l) over the cone: in closed form where the horizon leaves it whole, ring by ring elsewhere."""
    mp = import_module("mpmath")
    edge = mp.atan(radius)
    across, along = mp.sqrt(normal[0] ** 2 + normal[1] ** 2), normal[2]
    if radius * across <= along:
        return mp.pi * mp.sin(edge) ** 2 * along

    def ring(polar: Any) -> Any:
        c, s = along * mp.cos(polar), across * mp.sin(polar)
        if c >= s:
            return 2 * mp.pi * c * mp.sin(polar)
        lit = mp.acos(-c / s)
        return 2 * (c * lit + s * mp.sin(lit)) * mp.sin(polar)

    kink = mp.atan2(along, across)
    with mp.workdps(30):
        return mp.quad(ring, [0, kink, (kink + edge) / 2, edge])


def _point(ratio: float, kind: str) -> Answer:
    """A small disc is a lamp but for (R / d)²."""
    radius = float(np.asarray(ratio, kind))
    centre, axis = np.array([0.4, 0.2, 1.0]), np.array([0, 0, -1.0])
    disc = Disc(centre=centre, axis=axis, radius=radius, radiance=np.ones(1))
    lamp = Led(position=centre, axis=axis, mu=1.0, flux=np.array([np.pi * radius**2]))
    at, up = np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]])
    error = abs(disc.irradiance(at, up) / lamp.irradiance(at, up) - 1.0).ravel()
    return Answer(error=error, bound=2.0 * radius**2 + _CLOSE)


def _sun(angle: float, kind: str) -> Answer:
    """A sun of any size over a surface that faces it, and one that its disc leaves whole."""
    mp = import_module("mpmath")
    angle = float(np.asarray(angle, kind))
    sun = Sun(direction=np.array([0, 0, 1.0]), radiance=np.ones(1), angular_radius=min(angle, 0.5 * np.pi))
    normals = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    found = sun.irradiance(np.zeros((2, 3)), normals)[:, 0]
    with mp.workdps(_DIGITS):
        facing = mp.pi * mp.sin(mp.mpf(sun.angular_radius)) ** 2
    error = np.append(_relative(found[:1], [facing]), abs(found[1]) / float(facing))
    return Answer(error=error, bound=_CLOSE)


def _falloff(decades: int, kind: str) -> Answer:
    mp = import_module("mpmath")
    lamp = Led(position=np.zeros(3), axis=np.array([0, 0, -1.0]), mu=1.5, flux=np.ones(1))
    z = -np.logspace(-decades / 4.0, decades / 4.0, 9).astype(kind).astype(np.float64)
    points = np.stack([0.3 * z, np.zeros(9), z], axis=1)
    found = lamp.irradiance(points, np.tile([0.0, 0.0, 1.0], (9, 1)))[:, 0]
    wanted = []
    with mp.workdps(_DIGITS):
        for x, _, down in points:
            far = mp.sqrt(mp.mpf(float(x)) ** 2 + mp.mpf(float(down)) ** 2)
            wanted.append((-mp.mpf(float(down)) / far) ** mp.mpf("2.5") / far**2)
    return Answer(error=_relative(found, wanted), bound=_CLOSE)
