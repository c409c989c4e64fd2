"""Where to put lights: placements of a few shapes, the one whose shadows and noise harm normals least."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from psstereo.calibrate.rig.figures import noise_gain, normals_at
from psstereo.calibrate.rig.rating import RigRating, assess_rig
from psstereo.errors import OptionError
from psstereo.lights import Rig
from psstereo.types import BoolArray, FloatArray

__all__ = ["SHAPES", "RigProposal", "propose_rig"]

_LEVELS, _AROUND = 16, 23
"""Normals that a placement is judged by: levels of tilt, and azimuths, a prime number that few rings have in common."""
_COARSE, _FINEST = np.radians(4.0), np.radians(0.002)
"""Steps of the search over slants, first and last."""
_LOWEST = np.radians(2.0)
"""Smallest slant of a ring that is tried."""
_SINGULAR = 1e-12
"""Determinant of a normal matrix over the cube of its trace below which it tells no normal."""
_GOLDEN = np.pi * (3.0 - np.sqrt(5.0))
"""Azimuth from one light of a dome to the next [rad]."""
_MOST = 1000
_MANY = 64
"""Lights beyond which the first steps are twice as large, since one light more or less in shadow matters little."""

_Placement = Callable[[FloatArray], FloatArray]
"""Returns directions (m, 3) for slants."""
_Value = tuple[float, float]
"""Share of normals that cannot be told, and mean square error of the others; less is better, in this order."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RigProposal:
    """A placement of lights and what it promises.

    Attributes
    ----------
    rig : Rig
        Distant lights of equal strength.
    shape : str
        A key of :data:`SHAPES`.
    slants : float64 array (k,)
        Angles from the view of its rings, from the inner to the outer, 0 for a light at the camera; of a dome, its
        edge [rad].
    counts : tuple of int
        Lights of each ring.
    told : float
        Share of normals up to the asked tilt that three or more lights reach and tell, as a camera sees them on a
        ball [1].
    error_per_noise : float
        Root-mean-square angle of their error, for noise as large as the brightness of a surface that faces a
        light [rad].
    rating : RigRating
        Figures, verdict and advice of the placement.
    """

    rig: Rig
    shape: str
    slants: FloatArray
    counts: tuple[int, ...]
    told: float
    error_per_noise: float
    rating: RigRating


def propose_rig(*, lights: int, max_tilt: float, cone: float = np.radians(80.0), shape: str = "rings") -> RigProposal:
    """Place lights for an object whose normals reach a tilt.

    Of the placements of a shape the one is taken that leaves the fewest normals without three lights, and among those
    the one with the least mean square error of the pseudo-normal ρ n, ``σ² tr (LᵀL)⁻¹`` over the lights that are not
    in attached shadow. Normals count as a camera sees them on a ball, up to the tilt. Where nothing is in shadow the
    best ring stands at tan² s = 2, 54.7° from the view, whatever the number of lights [1]_ [2]_; steeper objects want
    it higher.

    It knows attached shadows only: for concave or cluttered objects take more lights than it asks for, and a narrower
    cone. Lights are distant: where they are near, their distance should be equal.

    Parameters
    ----------
    lights : int
        How many, 3 to 1000.
    max_tilt : float
        Largest angle between a normal and the view that must come out, up to 85 degrees [rad].
    cone : float
        Largest angle from the view at which a light can stand, 5 to 90 degrees [rad].
    shape : str
        A key of :data:`SHAPES`.

    Returns
    -------
    RigProposal
        The placement.

    Raises
    ------
    OptionError
        If the shape is unknown, or a number is out of its range.

    References
    ----------
    .. [1] O. Drbohlav, M. Chantler, "On optimal light configurations in photometric stereo", ICCV 2005.
    .. [2] A. D. Spence, M. J. Chantler, "Optimal illumination for three-image photometric stereo acquisition of
       surface texture", Texture 2003.
    """
    _check(lights, max_tilt, cone, shape)
    best: tuple[_Value, tuple[int, ...], FloatArray, FloatArray] | None = None
    for counts, rings, place in SHAPES[shape](lights):
        slants, value = _search(place, rings, cone, max_tilt)
        if best is None or value < best[0]:
            best = value, counts, slants, place(slants)
    if best is None:
        raise OptionError(given=f"{lights} lights.", needed=f"A {shape} needs more.", remedy="Choose another shape.")
    value, counts, slants, directions = best
    rig = Rig.distant(directions, source=f"{shape} of {lights} lights")
    squares, _ = noise_gain(directions, np.ones(lights), _seen(max_tilt))
    return RigProposal(
        rig=rig,
        shape=shape,
        slants=np.concatenate([np.zeros(len(counts) - len(slants)), slants]),
        counts=counts,
        told=max(0.0, 1.0 - value[0]),
        error_per_noise=float(np.sqrt(squares[np.isfinite(squares)].mean())),
        rating=assess_rig(rig),
    )


def _check(lights: int, max_tilt: float, cone: float, shape: str) -> None:
    if shape not in SHAPES:
        raise OptionError(
            given=f"The shape is {shape!r}.", needed=f"It is one of {', '.join(SHAPES)}.", remedy="Choose one of them."
        )
    if not 3 <= lights <= _MOST:
        raise OptionError(
            given=f"{lights} lights are asked for.",
            needed=f"3 to {_MOST}; normals need three.",
            remedy="Take five or more, so that shadows and highlights can be told.",
        )
    for what, angle, least, most in (("tilt", max_tilt, 0.0, 85.0), ("cone", cone, 5.0, 90.0)):
        if not np.radians(least) <= angle <= np.radians(most) + 1e-12:
            raise OptionError(
                given=f"The {what} is {np.degrees(angle):g}°.",
                needed=f"{least:g} to {most:g} degrees.",
                remedy="90 degrees would be a surface, or a light, seen from the side.",
            )


def _seen(max_tilt: float) -> FloatArray:
    """Return normals of a ball that cover equal areas of its picture, up to a tilt and with some at it, (n, 3)."""
    tilts = np.arcsin(np.sqrt(np.arange(_LEVELS + 1) / _LEVELS) * np.sin(max_tilt))
    azimuths = np.arange(_AROUND) * (2 * np.pi / _AROUND)
    return normals_at(tilts[:, None], azimuths[None]).reshape(-1, 3)


def _value(directions: FloatArray, normals: FloatArray, max_tilt: float) -> _Value:
    """Return how bad a placement is; beside the normals, those that face away from each light must be told."""
    away = normals_at(np.full(len(directions), max_tilt), np.arctan2(-directions[:, 1], -directions[:, 0]))
    told, squares = _pseudo_normals(directions, np.concatenate([normals, away]))
    count = len(normals)
    if not told[:count].any():
        return 1.0, float("inf")
    lost = (~told).sum() / count
    return float(lost), float(squares[:count][told[:count]].mean())


def _pseudo_normals(directions: FloatArray, normals: FloatArray) -> tuple[BoolArray, FloatArray]:
    """Return whether normals can be told, and mean squares of their pseudo-normals' errors, ``tr (LᵀL)⁻¹``."""
    reaches = (normals @ directions.T > 1e-9).astype(np.float64)
    x, y, z = directions.T
    xx, yy, zz, xy, xz, yz = (reaches @ np.stack([x * x, y * y, z * z, x * y, x * z, y * z], axis=1)).T
    minors = (yy * zz - yz * yz) + (xx * zz - xz * xz) + (xx * yy - xy * xy)
    determinant = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    told = determinant > _SINGULAR * (xx + yy + zz) ** 3
    return told, minors / np.where(told, determinant, np.nan)


def _search(place: _Placement, rings: int, cone: float, max_tilt: float) -> tuple[FloatArray, _Value]:
    """Return the best slants, in growing order: a grid, then steps to either side that shrink."""
    normals = _seen(max_tilt)
    lights = len(place(np.linspace(0.1, 0.2, rings)))
    coarse = _COARSE if lights <= _MANY else 2 * _COARSE
    grid = np.linspace(min(_LOWEST, cone / 2), cone, max(int(cone / coarse), 3))
    starts = np.stack(np.meshgrid(*[grid] * rings, indexing="ij"), axis=-1).reshape(-1, rings)
    starts = starts[(np.diff(starts, axis=1) > 0).all(axis=1)]
    values = [_value(place(start), normals, max_tilt) for start in starts]
    at = min(range(len(values)), key=values.__getitem__)
    slants, value, step = starts[at], values[at], coarse / 2
    while step > _FINEST:
        moved = False
        for way in (*np.eye(rings), *-np.eye(rings)):
            tried = np.clip(slants + step * way, grid[0], cone)
            if (np.diff(tried) > 0).all() and (found := _value(place(tried), normals, max_tilt)) < value:
                slants, value, moved = tried, found, True
        step = step if moved else step / 2
    return slants, value


def _ring(count: int, slant: float, turn: float) -> FloatArray:
    return normals_at(np.full(count, slant), 2 * np.pi * np.arange(count) / max(count, 1) + turn)


def _one_ring(lights: int) -> Iterator[tuple[tuple[int, ...], int, _Placement]]:
    yield (lights,), 1, lambda slants: _ring(lights, float(slants[0]), 0.0)


def _two_rings(lights: int) -> Iterator[tuple[tuple[int, ...], int, _Placement]]:
    """Yield one ring, and two, each with or without a light at the camera; the inner has half the lights at most."""
    yield from _one_ring(lights)
    for pole in (0, 1):
        rest = lights - pole
        if pole and rest >= 3:
            yield (1, rest), 1, _rings(1, 0, rest)
        inner = sorted({max(3, round(rest * share)) for share in (0.2, 0.3, 0.4, 0.5)})
        for count in inner:
            if rest - count >= 3:
                counts = (1, count, rest - count) if pole else (count, rest - count)
                yield counts, 2, _rings(pole, count, rest - count)


def _rings(pole: int, inner: int, outer: int) -> _Placement:
    def place(slants: FloatArray) -> FloatArray:
        parts = [_ring(outer, float(slants[-1]), 0.0)]
        if inner:
            parts.insert(0, _ring(inner, float(slants[0]), np.pi / outer))
        return np.concatenate([np.array([[0.0, 0.0, 1.0]] * pole).reshape(-1, 3), *parts])

    return place


def _dome(lights: int) -> Iterator[tuple[tuple[int, ...], int, _Placement]]:
    """Yield lights that cover equal areas of a cap, each a golden angle on from the last."""
    places = np.arange(lights)

    def place(slants: FloatArray) -> FloatArray:
        drop = 2 * np.sin(slants[0] / 2) ** 2 * (places + 0.5) / lights  # 1 − cos of the slant
        return normals_at(2 * np.arcsin(np.sqrt(drop / 2)), _GOLDEN * places)

    yield (lights,), 1, place


SHAPES: dict[str, Callable[[int], Iterator[tuple[tuple[int, ...], int, _Placement]]]] = {
    "ring": _one_ring,
    "rings": _two_rings,
    "dome": _dome,
}
"""Shapes of placements: one ring; one or two, with or without a light at the camera; an even dome."""
