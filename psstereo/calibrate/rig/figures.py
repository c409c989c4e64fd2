"""What a rig of lights can do, in figures: how noise becomes angles, and how many lights reach which normals."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from psstereo.errors import InputError, RigError
from psstereo.lights import Led, Light, Rig
from psstereo.types import FloatArray, IntArray

__all__ = ["RigFigures", "noise_gain", "normals_at", "rig_figures"]

_AZIMUTHS = 72
"""Normals of each tilt that are looked at: one every 5 degrees."""
_STEP = 5.0
"""Between tilts [deg]."""
_STEEPEST = 85.0
"""Largest tilt looked at [deg]; at 90 a surface is a line in the picture."""
_SINGULAR = 1e-12
"""Smallest ratio of eigenvalues of a normal matrix, and square of that of directions, that still tells a normal."""
_PARALLEL = 1e-3
"""Mean squared sine of the angles between lamps' axes and their middle below which they count as parallel."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RigFigures:
    """What a rig can do with a matte surface.

    Attributes
    ----------
    directions : float64 array (m, 3)
        Toward the lights from the object, unit rows [1].
    shares : float64 array (m,)
        Strength of each light over that of the strongest, at the object [1].
    condition : float
        Of the matrix of directions; 1 is best, infinite if they span no space [1].
    tilts : float64 array (k,)
        Angles between normal and view at which the rig is looked at [rad].
    error_per_noise : float64 array (k,)
        Root-mean-square angle of a normal's error, over all azimuths at which it can be told, for noise as large as
        the brightness of a surface that faces the strongest light; NaN if there are none [rad].
    told : float64 array (k,)
        Share of azimuths at which a normal can be told by the lights that do not leave it in its own shadow [1].
    fewest_lit : int array (k,)
        How many lights reach the normal of that tilt which the fewest reach.
    darkest : float64 array (k,)
        Azimuth of that normal, from x toward y [rad].
    best : float
        Error per noise of as many lights of these strengths at their best places [rad].
    direction_error : float64 array (m,) or None
        Root-mean-square angle of each direction's error, NaN where it is not known [rad].
    from_directions : float
        Root-mean-square angle that independent errors of the directions put into a normal toward the camera; NaN if
        none is known or the normal cannot be told [rad].
    """

    directions: FloatArray
    shares: FloatArray
    condition: float
    tilts: FloatArray
    error_per_noise: FloatArray
    told: FloatArray
    fewest_lit: IntArray
    darkest: FloatArray
    best: float
    direction_error: FloatArray | None
    from_directions: float


def rig_figures(
    rig: Rig, *, direction_error: npt.ArrayLike | None = None, point: npt.ArrayLike | None = None
) -> RigFigures:
    """Rate a rig for a matte surface, by the covariance of least squares with attached shadows left out.

    White noise σ of the brightness gives the pseudo-normal ``b = ρ n`` the covariance ``σ² (LᵀWL)⁻¹`` with W the
    squared strengths of the lights that reach the normal, and n the angle ``(σ / ρ) √tr(P (LᵀWL)⁻¹ P)`` with
    ``P = I − n nᵀ``: the Cramér-Rao bound for unknown albedo [1]_.

    Do not take it for the error on a real object: gloss, cast shadows and light between surfaces are usually more.
    What other parts of the object shade is not known here; concave objects want more lights, and higher ones.

    Parameters
    ----------
    rig : Rig
        Distant lights, or lamps.
    direction_error : array (m,), optional
        Root-mean-square angle of each direction's error; NaN where it is not known [rad].
    point : array (3,), optional
        Where the object is, for lamps; where their axes meet if absent [length].

    Returns
    -------
    RigFigures
        The figures.

    Raises
    ------
    RigError
        If there is no light; or lamps' axes are parallel or do not meet in front of them, and no point is given.
    InputError
        If there are not as many errors as lights, one is negative or infinite, or the point is not three numbers.
    UnsupportedError
        If a light is neither distant nor a lamp.

    References
    ----------
    .. [1] O. Drbohlav, M. Chantler, "On optimal light configurations in photometric stereo", ICCV 2005.
    """
    directions, strengths = _seen_from(rig, point)
    errors = _checked_errors(direction_error, len(directions))
    shares = strengths / strengths.max()
    tilts = np.radians(np.arange(0.0, _STEEPEST + _STEP / 2, _STEP))
    azimuths = np.arange(_AZIMUTHS) * (2 * np.pi / _AZIMUTHS)
    squares, lit = noise_gain(directions, shares, normals_at(tilts[:, None], azimuths[None]))
    told = np.isfinite(squares)
    sums, counts = np.where(told, squares, 0.0).sum(axis=1), told.sum(axis=1)
    values = np.linalg.svd(directions, compute_uv=False)
    spans = len(values) == 3 and values[-1] > np.sqrt(_SINGULAR) * values[0]
    return RigFigures(
        directions=directions,
        shares=shares,
        condition=float(values[0] / values[-1]) if spans else float("inf"),
        tilts=tilts,
        error_per_noise=np.sqrt(np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)),
        told=told.mean(axis=1),
        fewest_lit=lit.min(axis=1),
        darkest=azimuths[lit.argmin(axis=1)],
        best=float(np.sqrt(6.0 / (shares * shares).sum())),
        direction_error=errors,
        from_directions=_from_directions(directions, shares, errors),
    )


def normals_at(tilts: FloatArray, azimuths: FloatArray) -> FloatArray:
    """Return unit normals (..., 3) at angles from the view and azimuths from x toward y, broadcast [rad]."""
    x, y, z = np.broadcast_arrays(
        np.sin(tilts) * np.cos(azimuths), np.sin(tilts) * np.sin(azimuths), np.cos(tilts) + 0.0 * azimuths
    )
    return np.stack([x, y, z], axis=-1)


def noise_gain(directions: FloatArray, shares: FloatArray, normals: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return what unit noise does to normals, and how many lights reach them.

    Parameters
    ----------
    directions : float array (m, 3)
        Toward the lights, unit rows [1].
    shares : float array (m,)
        Their strengths; noise is counted in the same unit [1].
    normals : float array (..., 3)
        Unit normals of a surface of albedo 1 [1].

    Returns
    -------
    squares : float64 array (...)
        Mean square of the angle of a normal's error, infinite where the lights that reach it do not tell it [rad²].
    lit : int array (...)
        How many lights reach it.
    """
    reaches = normals @ directions.T > 0
    moments = (directions[:, :, None] * directions[:, None, :]).reshape(-1, 9) * (shares * shares)[:, None]
    values, vectors = np.linalg.eigh((reaches @ moments).reshape(*normals.shape[:-1], 3, 3))
    fine = values[..., 0] > _SINGULAR * values[..., 2]
    along = (vectors * normals[..., :, None]).sum(axis=-2)  # the normal's parts along the three axes
    with np.errstate(divide="ignore", invalid="ignore"):
        squares = ((1.0 - along * along) / values).sum(axis=-1)
    return np.where(fine, squares, np.inf), reaches.sum(axis=-1)


def _from_directions(directions: FloatArray, shares: FloatArray, errors: FloatArray | None) -> float:
    """Return the angle that errors of directions put into a normal toward the camera; unknown ones count as none.

    With l + d for l the pseudo-normal moves by ``−A⁻¹ Σ w l (d·b)``. A direction errs across itself only, as much one
    way as the other, so that d·n has the variance ``½ e² |n × l|²``.
    """
    if errors is None or not np.isfinite(errors).any():
        return float("nan")
    lit = directions[:, 2] > 0
    towards, w = directions[lit], shares[lit] ** 2
    normal_matrix = (towards * w[:, None]).T @ towards
    if lit.sum() < 3 or np.linalg.cond(normal_matrix) > 1 / _SINGULAR:
        return float("nan")
    variance = 0.5 * np.nan_to_num(errors[lit]) ** 2 * (towards[:, 0] ** 2 + towards[:, 1] ** 2)
    moved = np.linalg.solve(normal_matrix, (towards * w[:, None]).T)[:2]  # the part across the normal is x and y
    return float(np.sqrt((moved * moved * variance).sum()))


def _checked_errors(errors: npt.ArrayLike | None, count: int) -> FloatArray | None:
    if errors is None:
        return None
    array = np.asarray(errors, np.float64)
    if array.shape != (count,) or (array < 0).any() or np.isinf(array).any():
        raise InputError(
            given=f"Errors of directions have the shape {array.shape}"
            + (", and some are negative or infinite." if array.shape == (count,) else f"; there are {count} lights."),
            needed="Each light has one finite angle of zero or more, or NaN where it is not known.",
            remedy="Give one number a light, or none at all.",
        )
    return array


def _seen_from(rig: Rig, point: npt.ArrayLike | None) -> tuple[FloatArray, FloatArray]:
    """Return directions (m, 3) and strengths (m,), the mean of the channels, at a point."""
    if len(rig) == 0:
        raise RigError(given="There is no light.", needed="Three or more.", remedy="Add lights.")
    ideal = [light.idealised() for light in rig.lights]
    lamps = [light for light in ideal if isinstance(light, Led)]
    place = np.zeros(3) if not lamps else _middle(lamps) if point is None else np.asarray(point, np.float64)
    if place.shape != (3,) or not np.isfinite(place).all():
        raise InputError(
            given=f"The object is at {place.tolist()}.", needed="Three finite numbers x y z.", remedy="Correct them."
        )
    seen = [_at(light, place, i) for i, light in enumerate(ideal)]
    return np.array([direction for direction, _ in seen]), np.array([strength for _, strength in seen])


def _at(light: Light, place: FloatArray, index: int) -> tuple[FloatArray, float]:
    beam = next(light.beams(place, 1))
    strength = float(np.mean(beam.irradiance))
    if not strength > 0:
        raise RigError(
            given=f"Light {index + 1} does not shine on the point ({', '.join(f'{x:.4g}' for x in place)}).",
            needed="A lamp's axis points toward the object, within a right angle.",
            remedy="Give the point where the object is, or correct that lamp's axis.",
        )
    return np.asarray(beam.directions), strength


def _middle(lamps: list[Led]) -> FloatArray:
    """Return the point that is nearest to all axes."""
    across = np.array([np.eye(3) - np.outer(lamp.axis, lamp.axis) for lamp in lamps])
    whole = across.mean(axis=0)
    if np.linalg.eigvalsh(whole)[0] > _PARALLEL:
        place = np.linalg.solve(
            whole, np.mean([a @ lamp.position for a, lamp in zip(across, lamps, strict=True)], axis=0)
        )
        if all((place - lamp.position) @ lamp.axis > 0 for lamp in lamps):
            return np.asarray(place)
    raise RigError(
        given="The lamps' axes are parallel, or do not meet in front of the lamps.",
        needed="From which directions lamps light an object depends on where it stands.",
        remedy="Give the point x y z where the object is.",
    )
