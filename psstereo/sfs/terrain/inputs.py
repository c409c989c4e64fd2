"""What terrain from the sun is given, checked: elevation, images, suns, cells and options."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from numbers import Integral

import numpy as np
import numpy.typing as npt

from psstereo.errors import InputError, OptionError
from psstereo.sfs.terrain.stencils import LEAST
from psstereo.types import FloatArray

__all__ = ["Inputs", "TerrainOptions", "check_inputs"]

_REFLECTANCES = ("lambert", "lunar-lambert")
_SAME = math.cos(math.radians(2.0))
"""Cosine of the angle below which two suns count as one."""
_STEEP = math.cos(math.radians(5.0))
"""Cosine of the distance from the zenith below which a sun tells next to nothing of slopes."""


@dataclass(frozen=True, kw_only=True)
class TerrainOptions:
    """How the elevation is refined.

    Attributes
    ----------
    lunar_weight : float or None
        L of the Lunar-Lambert law, 0 … 1; None: that of the Moon at the angle between sun and eye. Has no meaning for
        the Lambert law, where it is refused [1].
    noise : float
        Standard deviation of brightness that the model does not explain, in shares of the exposure [1].
    elevation_error : float or None
        Standard deviation of the given elevation, of each of its values. None: half a percent of what the roughness
        comes to over a cell of the elevation, which trusts it nearly fully; where the elevation is known pixel by
        pixel, as much as a typical slope rises over one. Of means, a tenth of that is the least that is worked with; a
        note tells if more was asked for [length of the cells].
    roughness : float or None
        Standard deviation of the change of slope from cell to cell that is expected; None: the root-mean-square
        slope of the given elevation, at least 0.05. Small values flatten details, which the exposures then make up for
        by being too high; large ones let noise through where a single sun does not see [1].
    support : int or None
        Side of the square over which an elevation on the images' grid was averaged, or of the coarser grid's cell from
        which it was interpolated: only means over such squares are trusted. None: 1. Refused for a coarse elevation,
        whose cells say it [px].
    albedo_step : float or None
        Standard deviation of the change of the albedo from cell to cell; None: the albedo is the same everywhere [1].
    rounds : int
        Rounds of Gauss–Newton at most, on the finest grid.
    tolerance : float
        The rounds end when the root-mean-square step falls below this share of the whole change [1].
    tile : int or None
        Side of the windows in which large grids are solved; None solves all at once [px].
    overlap : int
        How far windows reach beyond that [px].
    threads : int
        Threads at most.

    Raises
    ------
    OptionError
        If a value has no meaning.
    """

    lunar_weight: float | None = None
    noise: float = 0.005
    elevation_error: float | None = None
    roughness: float | None = None
    support: int | None = None
    albedo_step: float | None = None
    rounds: int = 10
    tolerance: float = 0.01
    tile: int | None = None
    overlap: int = 48
    threads: int = 1

    def __post_init__(self) -> None:
        for one in fields(self):
            value = getattr(self, one.name)
            if value is None:
                continue
            low, high = {"lunar_weight": (0.0, 1.0), "tolerance": (1e-12, 1.0), "tile": (64, math.inf)}.get(
                one.name, (1 if isinstance(value, Integral) else 5e-324, math.inf)
            )
            low = 0 if one.name == "overlap" else low
            whole = one.name in ("support", "rounds", "tile", "overlap", "threads")
            if not (low <= value <= high and math.isfinite(value)) or (whole and not isinstance(value, Integral)):
                kind = "a whole number" if whole else "a number"
                above = "above 0" if low == 5e-324 else f"of {low:g} or more"
                raise OptionError(
                    given=f"The option {one.name} of terrain is {value}.",
                    needed=f"It is {kind} {above}{'' if math.isinf(high) else f', {high:g} at most'}.",
                    remedy="Correct it, or leave it out.",
                )


@dataclass(frozen=True, kw_only=True, eq=False)
class Inputs:
    """What was given, in order.

    Attributes
    ----------
    elevation : float64 array (hb, wb)
        Heights, NaN where unknown [length].
    block : (int, int)
        Rows and columns of pixels to each value of the elevation; (1, 1) on the images' grid [px].
    images : list of float64 arrays (h, w)
        Brightness.
    suns, views : float64 arrays (k, 3)
        Unit vectors toward sun and camera [1].
    cell : (float, float)
        Distances of the images' columns and rows [length].
    notes : tuple of str
        What weakens the result.
    """

    elevation: FloatArray
    block: tuple[int, int]
    images: list[FloatArray]
    suns: FloatArray
    views: FloatArray
    cell: tuple[float, float]
    notes: tuple[str, ...]


def check_inputs(
    elevation: npt.ArrayLike,
    images: Sequence[npt.ArrayLike] | npt.NDArray[np.generic],
    suns: npt.ArrayLike,
    *,
    cell: tuple[float, float],
    reflectance: str,
    view: npt.ArrayLike,
    options: TerrainOptions,
) -> Inputs:
    """Refuse what cannot be used, and return the rest in double precision."""
    _check_options(reflectance, options)
    dx, dy = _cell(cell)
    frames = _frames(images)
    heights = _numbers(elevation, "elevation")
    if not np.isfinite(heights).any():
        raise InputError(
            given=f"The elevation of {heights.shape[1]} × {heights.shape[0]} values holds no number.",
            needed="Heights, NaN only where they are unknown.",
            remedy="Check the file and the value that stands for missing heights.",
        )
    block = _block(heights.shape, frames[0].shape, options)
    toward = _directions(suns, len(frames), "sun")
    eyes = np.asarray(view, np.float64)
    eyes = np.broadcast_to(eyes, (len(frames), 3)) if eyes.shape == (3,) else eyes
    views = _directions(eyes, len(frames), "camera")
    return Inputs(
        elevation=heights, block=block, images=frames, suns=toward, views=views, cell=(dx, dy), notes=_notes(toward)
    )


def _check_options(reflectance: str, options: TerrainOptions) -> None:
    if reflectance not in _REFLECTANCES:
        raise OptionError(
            given=f"The reflectance of the terrain is {reflectance!r}.",
            needed=f"Known are {' and '.join(_REFLECTANCES)}.",
            remedy="Take lunar-lambert for the Moon and other airless bodies, lambert for most ground under air.",
        )
    if reflectance == "lambert" and options.lunar_weight is not None:
        raise OptionError(
            given=f"A lunar weight of {options.lunar_weight:g} is given for Lambert's law.",
            needed="It belongs to the Lunar-Lambert law.",
            remedy="Take reflectance lunar-lambert, or leave the weight out.",
        )


def _cell(cell: tuple[float, float]) -> tuple[float, float]:
    values = np.asarray(cell, np.float64)
    if values.shape != (2,) or not (np.isfinite(values) & (values > 0)).all():
        raise InputError(
            given=f"The cells of the images are {cell} in size.",
            needed="Two lengths above zero: the distance of columns and that of rows, in the unit of the heights.",
            remedy="Give both, in metres if heights are in metres; degrees must be turned into lengths.",
        )
    return float(values[0]), float(values[1])


def _numbers(array: npt.ArrayLike, name: str) -> FloatArray:
    found = np.asarray(array)
    if found.ndim != 2 or found.size == 0 or found.dtype.kind not in "fiu":
        raise InputError(
            given=f"The {name} is an array of shape {found.shape} and type {found.dtype}.",
            needed="One real number a cell, in an array (rows, columns).",
            remedy="Turn colours into one channel, or take one band.",
        )
    values = found.astype(np.float64)
    if np.isinf(values).any():
        raise InputError(
            given=f"The {name} holds {np.count_nonzero(np.isinf(values))} infinite values.",
            needed="Finite numbers, or NaN where nothing is known.",
            remedy="Put NaN in their place.",
        )
    return values


def _frames(images: Sequence[npt.ArrayLike] | npt.NDArray[np.generic]) -> list[FloatArray]:
    frames = [_numbers(image, f"image {number}") for number, image in enumerate(images, start=1)]
    shapes = sorted({frame.shape for frame in frames})
    if len(shapes) != 1 or min(shapes[0]) < LEAST:
        raise InputError(
            given="No image is given."
            if not shapes
            else f"The images have the shapes {', '.join(f'{w} × {h}' for h, w in shapes)}.",
            needed=f"One image or more, all of the same size, {LEAST} × {LEAST} pixels at least.",
            remedy="Bring all images to the same map grid.",
        )
    return frames


def _block(elevation: tuple[int, ...], image: tuple[int, ...], options: TerrainOptions) -> tuple[int, int]:
    block = image[0] // elevation[0], image[1] // elevation[1]
    fits = (elevation[0] * block[0], elevation[1] * block[1]) == image
    if not fits:
        raise InputError(
            given=f"The elevation has {elevation[1]} × {elevation[0]} cells; images, {image[1]} × {image[0]} pixels.",
            needed="The same grid, or a coarser one whose every cell covers a whole number of pixels.",
            remedy="Crop the images to whole cells; or bring the elevation to their grid, and say with `support` over "
            "how many pixels one of its heights was a mean.",
        )
    if block == (1, 1):
        return block
    if options.support is not None:
        raise OptionError(
            given=f"A support of {options.support} is given for an elevation whose cells cover {block[1]} × {block[0]} "
            "pixels.",
            needed="It is for elevations on the images' own grid; a coarse one says it by its cells.",
            remedy="Leave the support out.",
        )
    return block


def _directions(vectors: npt.ArrayLike, count: int, what: str) -> FloatArray:
    """Return unit vectors toward suns or cameras, all above the horizon."""
    v = np.asarray(vectors, np.float64)
    if v.shape != (count, 3) or not np.isfinite(v).all() or not (np.abs(v).max(axis=1, initial=0.0) > 0).all():
        raise InputError(
            given=f"Directions to the {what} have the shape {v.shape}; there are {count} images.",
            needed=f"One direction x east, y north, z up for each image, ({count}, 3), finite and not zero.",
            remedy="Give azimuth and elevation of each, through psstereo.lights.solar.from_azimuth.",
        )
    v = v / np.abs(v).max(axis=1, keepdims=True)
    v = np.asarray(v / np.linalg.norm(v, axis=1, keepdims=True))
    for number, up in enumerate(v[:, 2], start=1):
        if not up > 1e-3:
            raise InputError(
                given=f"The {what} of image {number} stands {math.degrees(math.asin(up)):.2f}° above the horizon.",
                needed=f"A {what} above the horizon, or the image cannot show the ground.",
                remedy="Check its elevation, which counts from the horizon up.",
            )
    return v


def _notes(suns: FloatArray) -> tuple[str, ...]:
    notes = []
    for i, one in enumerate(suns):
        same = [j + 1 for j in range(i) if float(suns[j] @ one) > _SAME]
        if same:
            notes.append(
                f"Image {i + 1} has the sun of image {same[0]} within 2°: together they tell little more than one."
            )
        if one[2] > _STEEP:
            notes.append(
                f"The sun of image {i + 1} stands within 5° of the zenith, where brightness hardly tells slopes."
            )
    return tuple(notes)
