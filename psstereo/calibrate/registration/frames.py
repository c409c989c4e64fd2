"""Frames laid over one another although the light changes between them.

Paint is the same under each light: where frames have details in common, short ones of the logarithm, each frame is
moved until its details are those of the others' mean. Shapes without paint show other details under each light; there
each frame is moved until it is what a mixture of the others makes of it.
"""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from psstereo.calibrate.registration.grid import Grid, Placed
from psstereo.calibrate.registration.paint import place_by_paint
from psstereo.calibrate.registration.shape import place_by_shape
from psstereo.calibrate.registration.start import coarse_shifts
from psstereo.errors import InputError, OptionError
from psstereo.io.rig_file import RigQuality
from psstereo.types import BoolArray, FloatArray

__all__ = ["Registration", "register_frames"]

_MODELS = ("shift", "affine")
_LEAST_FRAMES = 5
_LEAST_PIXELS = 1000
_COMMON = 0.8
"""Correlation of a frame's details with the others' mean from which paint places the frames."""
_BLURS = (3.0, 1.0)
"""Standard deviations of the smoothing for shading, so that moves larger than its detail are still seen [px]."""
_LOST = 0.25
"""Standard error of a frame's place from which it counts as not registered [px]."""
_MARGIN = 8
"""Pixels at the border that are left out [px]."""
_SQUARE = 32
"""Squares of the chequerboard whose halves are placed apart [px]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Registration:
    """Where each frame's pixels are found.

    Attributes
    ----------
    affines : float64 array (m, 2, 3)
        Pixel (x, y, 1), column and row of the reference, is found at ``affine @ (x, y, 1)`` of the frame [px].
    errors : float64 array (m,)
        Standard error of each frame's place: by the misfit, and by how far two halves of the image disagree [px].
    distances : float64 array (m,)
        How far each frame had moved, at that corner of the compared part where it is most [px].
    moved : float
        The largest of them [px].
    by : {"paint", "shape"}
        What placed the frames.
    agreement : float
        By paint, the correlation of a frame's details with the others' mean; by shape, the root-mean-square misfit as a
        share of brightness [1].
    rounds : int
        Rounds that were needed.
    converged : bool
        Whether nothing moved any more.
    quality : RigQuality
        The same in words.
    """

    affines: FloatArray
    errors: FloatArray
    distances: FloatArray
    moved: float
    by: str
    agreement: float
    rounds: int
    converged: bool
    quality: RigQuality


def register_frames(
    frames: npt.ArrayLike,
    *,
    mask: BoolArray | None = None,
    reference: int = 0,
    model: str = "shift",
) -> Registration:
    """Find how frames under different lights have moved against each other.

    Camera or object moved a little between the photographs, by up to a tenth of the image; the object has paint, or is
    matte and curved with lights all around. Not for fewer than five frames, since any three predict a fourth; nor where
    things move against each other; nor for shiny objects without paint, whose highlights are laid over one another.

    Parameters
    ----------
    frames : float array (m, h, w)
        Linear light, gray; NaN where it is not known, as at saturated pixels.
    mask : bool array (h, w), optional
        The object in the reference; every pixel if absent.
    reference : int
        The frame that stays, from 0.
    model : {"shift", "affine"}
        What moves are like.

    Returns
    -------
    Registration
        The moves and their errors.

    Raises
    ------
    InputError
        If there are fewer than five frames, fewer than a thousand pixels to compare, a frame shows nothing there, or
        neither paint nor shading places them.
    OptionError
        If the model or the reference is unknown.
    """
    light, inside = _checked(frames, mask, reference, model)
    filled = np.where(np.isfinite(light), light, np.nanmax(light, axis=(1, 2), keepdims=True))
    still = np.repeat(np.eye(3)[None], len(light), axis=0)
    coarse = still.copy()
    coarse[:, :2, 2] = coarse_shifts(filled, reference)
    grid = Grid.of(inside, model)
    by = "paint"
    found = place_by_paint(light, coarse, grid, reference)
    if found.agreement < _COMMON:
        found = max((found, place_by_paint(light, still, grid, reference)), key=_agreeing)
    if found.agreement < _COMMON:
        by = "shape"
        found = _by_shape(light, filled, (still, coarse), grid, reference)
    else:
        found = replace(found, errors=np.maximum(found.errors, _halves(light, found, grid, reference)))
    errors = np.hypot(found.errors, found.errors[reference])
    errors[reference] = 0.0
    found = replace(found, errors=errors)
    distances = np.array([grid.furthest(one[None]) for one in found.moves - np.eye(3)])
    moved = float(distances.max())
    return Registration(
        affines=found.moves[:, :2],
        errors=found.errors,
        distances=distances,
        moved=moved,
        by=by,
        agreement=found.agreement,
        rounds=found.rounds,
        converged=found.converged,
        quality=_quality(found, moved, by),
    )


def _agreeing(found: Placed) -> float:
    return found.agreement


def _by_shape(
    light: FloatArray, filled: FloatArray, starts: tuple[FloatArray, ...], grid: Grid, reference: int
) -> Placed:
    """Place frames by their shading, from the start that leaves less after a few rounds."""
    shift = Grid.of(grid.inside, "shift")
    wide, narrow = (_blurred(light, filled, blur) for blur in _BLURS)
    nothing = Placed(moves=starts[0], errors=np.zeros(len(light)), agreement=0.0, rounds=0, converged=False)
    tried = [place_by_shape(wide, replace(nothing, moves=one), shift, reference, rounds=4) for one in starts]
    found = place_by_shape(wide, min(tried, key=_agreeing), shift, reference)
    found = place_by_shape(narrow, found, shift, reference)
    found = found if grid.model == "shift" else place_by_shape(narrow, found, grid, reference)
    if not found.converged:
        raise InputError(
            given="The frames have no paint in common, and placing them by their shading does not come to rest.",
            needed="Paint or marks, or a matte surface that is curved, with lights all around.",
            remedy="Stick marks beside the object, fix camera and object, or give a mask without shiny parts.",
        )
    return found


def _halves(light: FloatArray, found: Placed, grid: Grid, reference: int) -> FloatArray:
    """Return half the distance between where the two colours of a chequerboard put each frame, float64 (m,) [px]."""
    rows, columns = np.indices(grid.inside.shape) // _SQUARE
    odd = (rows + columns) % 2 == 1
    places = []
    for half in (grid.inside & odd, grid.inside & ~odd):
        if np.count_nonzero(half) < _LEAST_PIXELS // 2:
            return np.zeros(len(light))
        part = Grid.of(half, grid.model)
        places.append(place_by_paint(light, found.moves, part, reference, fine=True).moves)
    middle = np.append(grid.middle, 1.0)
    return np.asarray(np.linalg.norm(((places[0] - places[1]) @ middle)[:, :2], axis=1) / 2.0)


def _checked(frames: npt.ArrayLike, mask: BoolArray | None, reference: int, model: str) -> tuple[FloatArray, BoolArray]:
    light = np.asarray(frames, np.float32)
    if model not in _MODELS or light.ndim != 3 or not 0 <= reference < len(light):
        raise OptionError(
            given=f"Frames of the shape {light.shape}, the model {model!r}, the reference {reference}.",
            needed="(m, h, w) frames, shift or affine, and the number of a frame.",
            remedy="Correct them.",
        )
    if len(light) < _LEAST_FRAMES:
        raise InputError(
            given=f"There are {len(light)} frames.",
            needed=f"At least {_LEAST_FRAMES}: three under different lights predict a fourth wherever it lies.",
            remedy="Take more photographs, or fix camera and object.",
        )
    inside = np.zeros(light.shape[1:], np.bool_)
    inside[_MARGIN:-_MARGIN, _MARGIN:-_MARGIN] = True
    if mask is not None and np.shape(mask) == inside.shape:
        inside &= np.asarray(mask, np.bool_)
    elif mask is not None:
        raise InputError(
            given=f"The mask has the shape {np.shape(mask)}; the frames, {inside.shape}.",
            needed="A mask of the frames' size.",
            remedy="Use the one that belongs to them.",
        )
    seen = np.where(inside & np.isfinite(light), light, 0.0)
    bright = seen.max(axis=(1, 2))
    if np.count_nonzero(inside) < _LEAST_PIXELS or not (bright > 0).all():
        raise InputError(
            given=f"{np.count_nonzero(inside)} pixels are to be compared, and "
            f"{np.count_nonzero(~(bright > 0))} frames show nothing there.",
            needed=f"At least {_LEAST_PIXELS} pixels that every frame shows.",
            remedy="Use a larger mask, or leave black frames out together with their lights.",
        )
    return light / bright[:, None, None], inside


def _blurred(light: FloatArray, filled: FloatArray, blur: float) -> FloatArray:
    """Return the frames smoothed, and NaN grown by as much."""
    import cv2

    out = np.zeros(light.shape, np.float32)
    for i, (frame, whole) in enumerate(zip(light, filled, strict=True)):
        out[i] = np.asarray(cv2.GaussianBlur(np.asarray(whole, np.float32), (0, 0), blur))
        lost = (~np.isfinite(frame)).astype(np.float32)
        if lost.any():
            out[i][np.asarray(cv2.GaussianBlur(lost, (0, 0), blur)) > 0.01] = np.nan
    return out


def _quality(found: Placed, moved: float, by: str) -> RigQuality:
    lost = np.flatnonzero(~(found.errors < _LOST))
    advice = []
    if len(lost):
        names = ", ".join(str(i + 1) for i in lost[:6])
        advice.append(f"Frames {names} are not placed to {_LOST} px: leave them out, or give a mask of the object.")
    if not found.converged:
        advice.append("The search did not come to rest: is something moving against the rest?")
    if by == "shape":
        advice.append("The frames have no paint in common, so that shading had to place them: stick marks beside it.")
    worst = float(found.errors.max())
    return RigQuality(
        verdict=f"Frames had moved by up to {moved:.2f} px; their {by} lays them over one another to {worst:.3f} px.",
        advice=tuple(advice),
    )
