"""Light from everywhere, as a map of radiances."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from psstereo.errors import InputError, RigError
from psstereo.lights.beam import Beam
from psstereo.lights.lat_long import (
    cell_solid_angles,
    cells_at,
    column_sums,
    horizon_irradiance,
)
from psstereo.lights.light import Light
from psstereo.lights.motion import rigid_motion
from psstereo.lights.regions import split_map
from psstereo.types import FloatArray

__all__ = ["Environment"]

_AT_ONCE = 1 << 19
"""Pieces of horizon that are worked on at a time, about 100 bytes each."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Environment(Light):
    """Distant light of which each direction's radiance stands in a latitude-longitude map, constant over each pixel.

    In the light's own frame (x right, y up, z toward the camera) row 0 looks to the zenith, +y, and the last row to −y.
    The middle of the map looks along +z, where the camera is; its left half along +x, its right half along −x, and
    both its sides along −z. It is a panorama as seen from inside. OpenEXR, USD's dome light and Mitsuba's ``envmap``
    have the same convention, so that Mitsuba's ``to_world`` is this light's rotation. In light probes after P. Debevec
    the middle looks along −z and the right half along +x: turn them by the rotation diag(−1, 1, −1).

    Irradiance is exact for such a map, at a cost that grows with rows plus columns, not with their product. Not for
    sources that are near the scene, and not for maps in 8 bits, whose brightest parts are cut off.

    Attributes
    ----------
    radiance : float array (h, w, c)
        Of the pixels, h ≥ 2 rows of w ≥ 4 columns; (h, w) is taken as one channel [W m⁻² sr⁻¹], or relative.
    rotation : float array (3, 3)
        R: light from ω in the map arrives from R ω in the scene; a proper rotation [1].

    Raises
    ------
    RigError
        If a radiance is negative or not finite, a channel is dark everywhere, or the shape is another one.
    InputError
        If R is no proper rotation.
    """

    name: ClassVar[str] = "environment"
    positional: ClassVar[bool] = False
    extended: ClassVar[bool] = True
    radiance: FloatArray
    rotation: FloatArray = field(default_factory=lambda: np.eye(3))

    def __post_init__(self) -> None:
        given = np.array(self.radiance, np.float64)
        table = given[..., None] if given.ndim == 2 else given
        if table.ndim != 3 or table.shape[0] < 2 or table.shape[1] < 4 or table.shape[2] == 0:
            raise RigError(
                given=f"An environment map has the shape {given.shape}.",
                needed="It needs 2 rows, 4 columns and 1 channel at least: an array (h, w, c).",
                remedy="Give a latitude-longitude map; other panoramas must be converted first.",
            )
        least, most = table.min(axis=(0, 1)), table.max(axis=(0, 1))
        if not (np.isfinite(most).all() and (least >= 0).all() and (most > 0).all()):  # NaN fails every comparison
            raise RigError(
                given=f"Radiances of an environment map reach from {least.tolist()} to {most.tolist()}, by channel.",
                needed="They must be finite and not negative, and no channel may be dark everywhere.",
                remedy="Mend those pixels, for example by the median of their neighbours.",
            )
        turn = np.array(rigid_motion(self.rotation, np.zeros(3))[0])
        table.flags.writeable = turn.flags.writeable = False
        object.__setattr__(self, "radiance", table)
        object.__setattr__(self, "rotation", turn)

    def __getstate__(self) -> dict[str, Any]:
        return {"radiance": self.radiance, "rotation": self.rotation}  # not the tables made from them

    @property
    def channels(self) -> int:
        """See :attr:`Light.channels`."""
        return int(self.radiance.shape[2])

    @property
    def solid_angles(self) -> FloatArray:
        """Exact solid angle of a pixel in each row, float64 (h,) [sr]."""
        return cell_solid_angles(*self.radiance.shape[:2])

    def radiance_from(self, directions: npt.ArrayLike) -> FloatArray:
        """Return the radiance that arrives from some directions: that of the pixel, without interpolation.

        Parameters
        ----------
        directions : float array (..., 3)
            Vectors toward where the light comes from, of any length but zero [1].

        Returns
        -------
        float64 array (..., c)
            Radiance [W m⁻² sr⁻¹], or relative.

        Raises
        ------
        InputError
            If the last axis has not three components, or one is not finite.
        """
        vectors = np.asarray(directions, np.float64)
        if vectors.ndim == 0 or vectors.shape[-1] != 3 or not np.isfinite(vectors).all():
            raise InputError(
                given=f"Directions have the shape {vectors.shape}, or are not all finite.",
                needed="Their last axis must hold finite x, y, z.",
                remedy="Give an array (..., 3) of unit vectors.",
            )
        return np.asarray(self.radiance[cells_at(vectors @ self.rotation, *self.radiance.shape[:2])])

    def directions(self, points: FloatArray) -> FloatArray:
        """Return NaN: it comes from no one direction; see :meth:`Light.directions`."""
        return np.full(np.shape(points), np.nan)

    def irradiance(self, points: FloatArray, normals: FloatArray) -> FloatArray:
        """Return the exact irradiance from the map, NaN where the normal is; see :meth:`Light.irradiance`."""
        del points  # a distant light looks the same from everywhere
        own = np.asarray(normals, np.float64) @ self.rotation
        flat = own.reshape(-1, 3)
        result = np.full((len(flat), self.channels), np.nan)
        block = max(1, _AT_ONCE // (2 * sum(self.radiance.shape[:2])))
        upward = flat[:, 1] >= 0.0
        for chosen, sums in ((upward, "_upper"), (flat[:, 1] < 0.0, "_lower")):
            where = np.flatnonzero(chosen & np.isfinite(flat).all(axis=1))
            for start in range(0, len(where), block):
                part = where[start : start + block]
                result[part] = horizon_irradiance(getattr(self, sums), flat[part])
        return result.reshape(*own.shape[:-1], self.channels)

    def beams(self, points: FloatArray, count: int) -> Iterator[Beam]:
        """Yield 2 count beams, of which half are below any surface: four for each of count / 2 parts of the map.

        Parts are rectangles that are split where the light in them is spread most, eight at least. Each keeps its flux
        and (for several channels, in their sum) its vector irradiance: what is wholly above the horizon of a surface
        sends it all it should. Dark parts are left out; see :meth:`Light.beams`.
        """
        del points
        directions, powers = self._reduced(max(1, count // 2))
        for direction, power in zip(directions @ self.rotation.T, powers, strict=True):
            yield Beam(directions=direction, irradiance=power)

    def moved(self, rotation: FloatArray, translation: FloatArray) -> "Environment":
        """Turn the map; see :meth:`Light.moved`."""
        turn, _ = rigid_motion(rotation, translation)
        return Environment(radiance=self.radiance, rotation=turn @ self.rotation)

    @cached_property
    def _upper(self) -> FloatArray:
        return column_sums(self.radiance)

    @cached_property
    def _lower(self) -> FloatArray:
        return column_sums(self.radiance[::-1])  # upside down, for normals upside down

    @cached_property
    def _reductions(self) -> dict[int, tuple[FloatArray, FloatArray]]:
        return {}

    def _reduced(self, count: int) -> tuple[FloatArray, FloatArray]:
        """Return directions (k, 3) in the map's frame and powers (k, c), worked out once for each count."""
        if count not in self._reductions:
            self._reductions[count] = split_map(self.radiance, count)
        return self._reductions[count]
