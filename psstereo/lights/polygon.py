"""A flat lamp with straight edges: a soft box, a window, a screen."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from psstereo.errors import RigError
from psstereo.lights.beam import Beam
from psstereo.lights.led import Led
from psstereo.lights.light import Light
from psstereo.lights.motion import rigid_motion
from psstereo.lights.patch import patch_beam, towards
from psstereo.lights.vectors import strengths
from psstereo.radiometry.polygon_irradiance import polygon_irradiance
from psstereo.radiometry.quadrature import triangle_rule
from psstereo.types import FloatArray

__all__ = ["Polygon"]

_TOLERANCE = 1e-6
"""How far vertices may be off their plane, and corners turn inward: text files hold seven digits [sizes]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Polygon(Light):
    """A flat convex polygon of even radiance that shines to one side.

    From ten times its size away :class:`~psstereo.lights.led.Led` with mu = 1 is within one per cent and much cheaper.
    At heights below its size beams need a large count, as for :class:`~psstereo.lights.disc.Disc`.
    Not for lamps with a grid or a hot spot, whose radiance varies. A polygon with inward corners is to be split into
    convex ones, a light each.

    Attributes
    ----------
    vertices : float array (n, 3)
        At least 3 vertices in one plane, without repeating the first, counter-clockwise as seen from the lit side;
        x right, y up, z toward the camera [length].
    radiance : float array (c,)
        L, the same in every direction [W m⁻² sr⁻¹], or relative.
    """

    name: ClassVar[str] = "polygon"
    positional: ClassVar[bool] = True
    extended: ClassVar[bool] = True
    vertices: FloatArray
    radiance: FloatArray

    def __post_init__(self) -> None:
        corners = np.array(self.vertices, np.float64)
        _require_convex(corners)
        corners.flags.writeable = False
        object.__setattr__(self, "vertices", corners)
        object.__setattr__(self, "radiance", strengths(self.radiance, "polygon radiance"))

    @cached_property
    def axis(self) -> FloatArray:
        """Unit normal on the lit side (3,) [1]."""
        areas = self._triangles[1].sum(axis=0)
        axis = np.asarray(areas / np.sqrt(areas @ areas))
        axis.flags.writeable = False  # it is kept
        return axis

    @property
    def area(self) -> float:
        """Area [length²]."""
        return float(self._triangles[1].sum(axis=0) @ self.axis)

    @property
    def centroid(self) -> FloatArray:
        """Middle of its area, float64 (3,) [length]."""
        corners, areas = self._triangles
        return np.asarray((areas @ self.axis) @ corners.mean(axis=1) / self.area)

    @cached_property
    def _triangles(self) -> tuple[FloatArray, FloatArray]:
        """Fan from the first vertex: corners (k, 3, 3) and area vectors (k, 3)."""
        v = self.vertices
        first = np.broadcast_to(v[0], v[2:].shape)
        return np.stack([first, v[1:-1], v[2:]], axis=1), 0.5 * np.cross(v[1:-1] - v[0], v[2:] - v[0])

    @property
    def channels(self) -> int:
        """See :attr:`Light.channels`."""
        return int(self.radiance.size)

    def directions(self, points: FloatArray) -> FloatArray:
        """Return unit vectors to the centroid, NaN at the centroid itself; see :meth:`Light.directions`."""
        return towards(points, self.centroid)[0]

    def irradiance(self, points: FloatArray, normals: FloatArray) -> FloatArray:
        """Return the irradiance, also where the horizon cuts it; NaN on the polygon; see :meth:`Light.irradiance`."""
        factor = polygon_irradiance(1.0, np.asarray(points)[None], np.asarray(normals)[None], self.vertices)
        return np.asarray(factor[0, ..., None] * self.radiance)

    def beams(self, points: FloatArray, count: int) -> Iterator[Beam]:
        """Yield Gauss rules over triangles, at least one beam for each of the n − 2; see :meth:`Light.beams`."""
        corners, areas = self._triangles
        if count < 2:
            yield patch_beam(points, self.centroid, self.axis, self.area * self.radiance)
            return
        places, weights = triangle_rule(max(1, round(np.sqrt(count / len(corners)))))
        for triangle, area in zip(corners, areas @ self.axis, strict=True):
            for place, weight in zip(places, weights, strict=True):
                yield patch_beam(points, place @ triangle, self.axis, weight * area * self.radiance)

    def moved(self, rotation: FloatArray, translation: FloatArray) -> "Polygon":
        """Move the vertices, by a proper rotation only, which keeps the lit side; see :meth:`Light.moved`."""
        turn, shift = rigid_motion(rotation, translation)
        return Polygon(vertices=self.vertices @ turn.T + shift, radiance=self.radiance)

    def idealised(self) -> Led:
        """Return the Lambertian lamp of the same flux at the centroid; see :meth:`Light.idealised`."""
        return Led(position=self.centroid, axis=self.axis, mu=1.0, flux=self.area * self.radiance)


def _require_convex(corners: FloatArray) -> None:
    """Refuse vertices that are not those of a flat convex polygon."""
    if corners.ndim != 2 or corners.shape[1:] != (3,) or len(corners) < 3 or not np.isfinite(corners).all():
        raise RigError(
            given=f"A polygon has vertices of the shape {corners.shape}, or some that are not finite.",
            needed="Three vertices or more are needed, of three finite numbers each.",
            remedy="Correct the light's vertices.",
        )
    about = corners - corners.mean(axis=0)
    size = np.abs(about).max()
    about = about / (size if size > 0.0 else 1.0)
    edges = np.roll(about, -1, axis=0) - about
    normal = 0.5 * np.cross(about, np.roll(about, -1, axis=0)).sum(axis=0)
    area = np.sqrt(normal @ normal)
    if not (area > _TOLERANCE**2 and np.abs(about @ normal).max() <= _TOLERANCE * area):
        raise RigError(
            given=f"The vertices {corners.tolist()} enclose the area {area * size**2:.4g} or do not lie in one plane.",
            needed="A polygon light is flat and has an area.",
            remedy="Correct the vertices, or give one light for each of its flat parts.",
        )
    # Turning left at every corner is not enough: a pentagram does, twice around.
    lengths = np.sqrt((edges * edges).sum(axis=1))
    following = np.roll(edges, -1, axis=0)
    left = np.cross(edges, following) @ (normal / area)
    turn = np.arctan2(left, (edges * following).sum(axis=1)).sum()
    if (lengths == 0.0).any() or (left < -_TOLERANCE * lengths * np.roll(lengths, -1)).any() or turn > 3.0 * np.pi:
        raise RigError(
            given=f"The polygon of {len(corners)} vertices is not convex, crosses itself or repeats a vertex.",
            needed="A polygon light turns the same way at each of its corners, once around in all.",
            remedy="Split it into convex polygons, and give a light for each.",
        )
