"""Lights from an object whose shape is known in the image: a sphere, a board, or a coarse mesh put in register.

An even matte surface shows ``I = E max(0, n·l) + a`` under a distant light: four numbers from thousands of pixels, of
which the unlit ones show the ambient part a alone. Weights follow the residuals, so that cast shadows, gloss and places
where the shape is not quite that take little part.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from psstereo.calibrate.shape.fit import ShapeFit, fit_direction, fit_strength
from psstereo.errors import InputError
from psstereo.io.rig_file import RigQuality
from psstereo.lights import Rig
from psstereo.types import FloatArray, IntArray

__all__ = ["ShapeCalibration", "calibrate_known_shape", "sphere_normals"]

_LEAST = 30
"""Pixels that a light must reach."""
_RANK = 0.05
"""Least over largest singular value of what normals tell, from which a direction can be told."""
_BANDS = 5
"""Parts of the image are bands of rows, this many, split into this many pieces each."""
_UNSURE = np.radians(2.0)
_UNEVEN = 0.05
"""Difference of ambient levels over a light's strength that one room does not make [1]."""
_ROUGH = 0.1
"""Residual over the brightness that says the surface is not even and matte, or not in register [1]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ShapeCalibration:
    """Lights that a known shape tells.

    Attributes
    ----------
    rig : Rig
        One distant light an image; strengths are those of a surface of albedo over π equal to one, relative.
    ambient : float64 array (m, c)
        Brightness without the light [that of the images].
    quality : RigQuality
        Errors and verdict. Errors are those that parts of the image disagree about; what is wrong everywhere alike,
        such as a lamp that is near or a surface that is not quite matte, comes on top.
    """

    rig: Rig
    ambient: FloatArray
    quality: RigQuality


def calibrate_known_shape(
    values: FloatArray,
    normals: FloatArray,
    *,
    places: IntArray | None = None,
    ambient: bool = True,
    directions: npt.ArrayLike | None = None,
) -> ShapeCalibration:
    """Find the lights of images of an even matte object of known shape.

    A plane tells one number a light and no direction: the light that falls on it, which is a strength only if the
    direction is known, as for a white card. Not for glossy or painted objects, nor for lamps so near that one side of
    the object is lit from elsewhere than the other.

    Parameters
    ----------
    values : float array (m, p) or (m, p, c)
        Linear brightness of pixels of the object; NaN where not usable, such as clipped.
    normals : float array (p, 3)
        The object's unit normals there, x right, y up, z toward the camera; NaN where unknown [1].
    places : int array (p, 2), optional
        Row and column of each pixel: errors are told from what parts of the image disagree about; from runs of pixels
        in their order if absent [px].
    ambient : bool
        Whether something is added to all of an image; the normals must then tell four numbers. False where a dark
        image was subtracted.
    directions : float array (m, 3), optional
        Directions of the lights, if only strengths and ambient light are wanted [1].

    Returns
    -------
    ShapeCalibration
        Rig, ambient light, errors.

    Raises
    ------
    InputError
        If shapes disagree, normals do not tell the unknowns, as of a plane, or a light reaches too few pixels.

    Examples
    --------
    >>> normals = sphere_normals((41, 41), (20.0, 20.0), 18.0)
    >>> inside = np.isfinite(normals[..., 0])
    >>> images = np.maximum(normals[inside] @ [[0.0, 0.6], [0.6, 0.0], [0.8, 0.8]], 0.0).T + 0.1
    >>> found = calibrate_known_shape(images, normals[inside])
    >>> found.rig.directions.round(6).tolist()
    [[0.0, 0.6, 0.8], [0.6, 0.0, 0.8]]
    """
    v, n, parts = _checked(values, normals, places)
    given = None if directions is None else Rig.distant(directions).directions
    if given is None:
        _require_told(n, ambient)
    elif len(given) != len(v):
        raise InputError(
            given=f"There are {len(given)} directions for {len(v)} images.",
            needed="One an image, in their order.",
            remedy="Check the light file.",
        )
    found = []
    for k, one in enumerate(v):
        gray = one.mean(axis=1)
        usable = np.isfinite(gray)
        if np.count_nonzero(usable & (np.nan_to_num(gray) > 0)) < _LEAST:
            raise InputError(
                given=f"Light {k + 1} reaches {np.count_nonzero(usable & (np.nan_to_num(gray) > 0))} usable pixels.",
                needed=f"At least {_LEAST} pixels of the object that are lit and not clipped.",
                remedy="Widen the mask, expose less if it is clipped, or leave this light out.",
            )
        direction = fit_direction(gray[usable], n[usable], ambient=ambient) if given is None else given[k]
        found.append(
            fit_strength(one[usable], n[usable], direction, parts[usable], ambient=ambient, free=given is None)
        )
        _require_lit(found[-1], k)
    return _calibration(found, free=given is None)


def sphere_normals(shape: tuple[int, int], centre: tuple[float, float], radius: float) -> FloatArray:
    """Return the normals of a sphere under parallel projection.

    Parameters
    ----------
    shape : (int, int)
        Rows and columns of the image [px].
    centre : (float, float)
        Column and row of its middle [px].
    radius : float
        Of its outline [px].

    Returns
    -------
    float64 array (h, w, 3)
        Unit normals, NaN outside [1].

    Raises
    ------
    InputError
        If the radius is not positive, or nothing of it is in the image.
    """
    rows, columns = np.indices(shape, dtype=np.float64)
    fine = np.isfinite([*centre, radius]).all() and radius > 0
    x, y = (columns - centre[0]) / (radius or 1.0), (centre[1] - rows) / (radius or 1.0)
    inside = x * x + y * y < 1.0
    if not fine or not inside.any():
        raise InputError(
            given=f"A sphere of radius {radius} px at column {centre[0]}, row {centre[1]} of an image of {shape} px.",
            needed="A sphere that is seen.",
            remedy="Give its middle as column,row, and its radius, in pixels.",
        )
    z = np.sqrt(np.where(inside, 1.0 - x * x - y * y, 0.0))
    return np.asarray(np.where(inside[..., None], np.stack([x, y, z], axis=-1), np.nan))


def _checked(
    values: FloatArray, normals: FloatArray, places: IntArray | None
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return brightness (m, p, c), normals (p, 3) and parts of the image (p,) where the shape is known."""
    v, n = np.asarray(values, np.float64), np.asarray(normals, np.float64)
    v = v[..., None] if v.ndim == 2 else v
    where = None if places is None else np.asarray(places)
    if (
        v.ndim != 3
        or n.shape != (v.shape[1], 3)
        or (where is not None and where.shape != (v.shape[1], 2))
        or not v.size
    ):
        raise InputError(
            given=f"Brightness has the shape {np.shape(values)}, normals {n.shape}"
            f"{'' if where is None else f', places {where.shape}'}.",
            needed="(m, p) or (m, p, c), (p, 3) and (p, 2) of the same pixels.",
            remedy="Take shape and images of one size under one mask.",
        )
    known = np.isfinite(n).all(axis=1) & (np.abs(np.linalg.norm(np.nan_to_num(n), axis=1) - 1.0) < 1e-3)
    count = int(known.sum())
    order = np.arange(count) if where is None else np.lexsort((where[known, 1], where[known, 0]))
    parts = np.zeros(count, np.intp)
    parts[order] = np.arange(count) * _BANDS**2 // max(count, 1)
    if where is not None:
        band = np.zeros(count, np.intp)
        band[order] = np.arange(count) * _BANDS // max(count, 1)
        again = np.lexsort((where[known, 1], band))
        parts[again] = np.arange(count) * _BANDS**2 // max(count, 1)
    if count < _LEAST:
        raise InputError(
            given=f"The shape is known at {count} pixels.",
            needed=f"Unit normals at {_LEAST} or more.",
            remedy="Check that the shape lies under the mask, and that its normals have unit length.",
        )
    return v[:, known], n[known], parts


def _require_told(normals: FloatArray, ambient: bool) -> None:
    """Refuse shapes whose normals do not tell a direction."""
    alone = np.linalg.svd(normals, compute_uv=False) / np.sqrt(len(normals))
    if alone[2] <= _RANK * alone[0]:
        flat = alone[1] <= _RANK * alone[0]
        raise InputError(
            given="The shape is a plane: all its normals are alike." if flat else "The normals all lie in one plane.",
            needed="Normals of three directions at least. "
            + ("A plane tells one number a light, what falls on it, and no direction." if flat else ""),
            remedy="Use a ball or another rounded thing; where directions are known, a plane gives strengths.",
        )
    rows = np.concatenate([normals, np.ones((len(normals), 1))], axis=1)
    both = np.linalg.svd(rows, compute_uv=False)
    if ambient and both[3] <= _RANK * both[0]:
        raise InputError(
            given="The normals all stand at one angle to some axis.",
            needed="With ambient light unknown, normals must tell it from a direction.",
            remedy="Subtract a dark image and say that there is no ambient light, or use a ball.",
        )


def _require_lit(fit: ShapeFit, index: int) -> None:
    if not (fit.strength > 0).all() or fit.lit < _LEAST:
        raise InputError(
            given=f"Light {index + 1} lights {fit.lit} pixels of the shape, with a strength of"
            f" {np.array2string(fit.strength, precision=3)}.",
            needed=f"A light that reaches {_LEAST} pixels, and brightness that grows toward it.",
            remedy="Check that shape and images are in register and not mirrored, and the order of the directions.",
        )


def _calibration(found: list[ShapeFit], *, free: bool) -> ShapeCalibration:
    spread = np.array([one.direction_error for one in found]) if free else None
    errors = np.array([float(one.strength_error.max()) for one in found])
    residual = float(np.sqrt(np.mean([one.residual**2 for one in found])))
    advice = []
    if spread is not None and spread.max() > _UNSURE:
        worst = int(spread.argmax())
        advice.append(
            f"Light {worst + 1} is known to {np.degrees(spread[worst]):.1f}° only: it grazes the shape, or the shape is"
            " too flat; take a ball, or move the light to the front."
        )
    if residual > _ROUGH:
        advice.append(
            f"{100 * residual:.0f} % of the brightness is unexplained: look for gloss, paint, cast shadows, or a shape"
            " out of register."
        )
    levels = np.array([one.ambient for one in found])
    uneven = float((np.ptp(levels, axis=0) / np.median([one.strength for one in found], axis=0)).max())
    if uneven > _UNEVEN:
        advice.append(
            f"Ambient light differs by {100 * uneven:.0f} % of a light's strength between images, as room light does"
            " not: subtract a dark image and say that there is none, or directions lean by what the level takes up."
        )
    told = f"directions to {np.degrees(spread.max()):.2g}°, " if spread is not None else "directions as given, "
    return ShapeCalibration(
        rig=Rig.distant(
            np.array([one.direction for one in found]),
            np.array([one.strength for one in found]),
            source="a known shape",
        ),
        ambient=levels,
        quality=RigQuality(
            direction_error=spread,
            strength_error=errors,
            residual_brightness=residual,
            verdict=f"{len(found)} lights from a known shape: {told}strengths to {100 * errors.max():.2g} % (standard"
            f" errors of the worst); the images are explained to {100 * residual:.2g} %.",
            advice=tuple(advice),
        ),
    )
