"""Shape from one image where it is singular: places that face the light, images of nothing else, few pixels."""

from functools import partial

import numpy as np

from psstereo.bench.stress import Answer, Rule, StressCase
from psstereo.camera import Orthographic
from psstereo.errors import InputError, UnsupportedError
from psstereo.flags import Flag
from psstereo.lights import Directional
from psstereo.sfs import SHADING_METHODS, ShadedImage, ShadingResult
from psstereo.sfs.eikonal import Eikonal
from psstereo.types import FloatArray

__all__ = ["shading_cases"]

_GRID = 65
_FLAT = float(np.radians(1.0))
"""Angle that is let pass where the image shows a plane that faces the light [rad]."""


def shading_cases() -> list[StressCase]:
    """Return the cases of this family."""
    cases = []
    remarks = Flag.NOT_CONVERGED | Flag.NO_DEPTH | Flag.UNLIT | Flag.OVER_BRIGHT
    told = partial(StressCase, family="shading", rule=Rule.TOLD, remarks=remarks, limit=20.0)
    refusals = (InputError, UnsupportedError)
    for name in SHADING_METHODS:
        for what in ("faces the light everywhere", "1 × 64, faces the light", "one pixel", "twice too bright"):
            cases.append(
                told(name=f"{name}", parameter=what, run=partial(_facing, name, what), unit="rad", refusals=refusals)
            )
        cases.append(
            StressCase(
                family="shading",
                name=f"{name}",
                parameter="black",
                run=partial(_black, name),
                rule=Rule.REFUSED,
                refusals=refusals,
            )
        )
    for kind_of in ("paraboloid", "saddles", "cone"):
        for order in (1, 2):
            cases.append(
                told(
                    name=f"eikonal of order {order}",
                    parameter=f"{kind_of}, known at its singular points",
                    run=partial(_surface, kind_of, order),
                )
            )
    cases.append(told(name="eikonal of order 2", parameter="flat top of many singular pixels", run=_plateau))
    return cases


def _sun(direction: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> Directional:
    return Directional(direction=np.array(direction), strength=np.ones(1))


def _off(found: ShadingResult, truth: FloatArray) -> Answer:
    normals = np.asarray(found.normals.normals, np.float64)
    angle = np.arctan2(np.linalg.norm(np.cross(normals, truth), axis=-1), (normals * truth).sum(axis=-1))
    return Answer(error=angle.ravel(), bound=_FLAT, flags=found.normals.flags.ravel())


def _facing(name: str, what: str, kind: str) -> Answer:
    shapes = {"1 × 64, faces the light": (1, 64), "one pixel": (1, 1)}
    image = np.full(shapes.get(what, (32, 40)), 2.0 if what == "twice too bright" else 1.0, kind)
    found = SHADING_METHODS[name]().recover(ShadedImage(image=image, light=_sun()))
    return _off(found, np.array([0.0, 0.0, 1.0]))


def _black(name: str, kind: str) -> Answer:
    found = SHADING_METHODS[name]().recover(ShadedImage(image=np.zeros((24, 24), kind), light=_sun()))
    return _off(found, np.array([0.0, 0.0, 1.0]))


def _surface(what: str, order: int, kind: str) -> Answer:
    """Recover a surface that is known where it faces the light, and on the border where saddles send paths out."""
    line = np.linspace(-1.0, 1.0, _GRID)
    x, y = np.meshgrid(line, -line)
    step = 2.0 / (_GRID - 1)
    if what == "paraboloid":
        z, slope = -0.5 * (x * x + y * y), np.hypot(x, y)
        known = slope == 0.0
    elif what == "cone":
        z, slope = -np.hypot(x, y), np.ones_like(x)
        known = z == 0.0
    else:
        a, b = np.pi * x, np.pi * y
        z = 0.3 * np.cos(a) * np.cos(b)
        slope = 0.3 * np.pi * np.hypot(np.sin(a) * np.cos(b), np.cos(a) * np.sin(b))
        known = slope < 1e-9
    image = (1.0 / np.sqrt(1.0 + slope**2)).astype(kind)
    camera = Orthographic(pixel_size=step, length_unit="mm")
    given = ShadedImage(image=image, light=_sun(), camera=camera, heights=np.where(known, z, np.nan))
    found = Eikonal(order=order).recover(given)
    # The monotone scheme is of first order, with a logarithm where paths leave a point.
    bound = step * (2.0 + np.log(1.0 / step))
    error = np.abs(np.asarray(found.depth.depth, np.float64) - z).ravel()
    return Answer(error=error, bound=bound, flags=found.normals.flags.ravel())


def _plateau(kind: str) -> Answer:
    """Recover a table mountain: all of its top faces the light and none of it is a point."""
    line = np.linspace(-1.0, 1.0, _GRID)
    far = np.hypot(*np.meshgrid(line, line))
    beyond = np.maximum(far - 0.4, 0.0)
    image = (1.0 / np.sqrt(1.0 + (2.0 * beyond) ** 2)).astype(kind)
    step = 2.0 / (_GRID - 1)
    camera = Orthographic(pixel_size=step, length_unit="mm")
    found = Eikonal().recover(ShadedImage(image=image, light=_sun(), camera=camera))
    depth = np.asarray(found.depth.depth, np.float64)
    middle = depth[_GRID // 2, _GRID // 2]
    error = np.abs(depth - middle + beyond**2).ravel()
    return Answer(error=error, bound=step * (2.0 + np.log(1.0 / step)), flags=found.normals.flags.ravel())
