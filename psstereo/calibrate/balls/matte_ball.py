"""Lights from matte balls: direction, strength of each channel, ambient light, and the level that was never light."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from psstereo.calibrate.balls.adjustment import tangents
from psstereo.calibrate.balls.ball import inside
from psstereo.calibrate.balls.matte_fit import SECTORS, MatteFit, fit_matte
from psstereo.calibrate.balls.mirror_ball import reflected_rays
from psstereo.calibrate.balls.pictures import BallPictures, require_still
from psstereo.camera import Camera
from psstereo.errors import InputError, OptionError
from psstereo.io.rig_file import RigQuality
from psstereo.lights import Rig
from psstereo.types import FloatArray, IntArray, Progress, no_progress

__all__ = ["MatteCalibration", "calibrate_matte_balls"]

_WITHIN = 0.95
"""Share of the radius that is fitted: the rim is blurred, and a small error of the outline turns its normals most."""
_CLIPPED = 0.98
"""Share of full scale from which a value counts as clipped."""
_MOST_CLIPPED = 0.5
"""Share of the ball that may be clipped."""
_ODD = 0.3
"""Residual from which the ball does not follow Lambert's law."""
_PIXELS = 30000
"""Pixels of a ball that are used; more would only repeat the same errors of the model."""
_LIT = 10.0
"""Strength over its error below which a ball counts as not lit."""
_DIFFERENT = 3.0
"""Errors by which levels of single pictures differ from the common one when something else is added too."""
_ROUGH = 0.1
"""Residual from which the ball is said not to be quite matte."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MatteCalibration:
    """Lights that matte balls have shown.

    Attributes
    ----------
    rig : Rig
        Directional lights. Strengths are pixel values of a facing ball over its albedo and full scale.
    quality : RigQuality
        How far to trust them.
    camera : Camera
        That the balls were seen by.
    ambient : float64 array (m, c)
        Level that is added everywhere, a share of full scale [1].
    ambient_error : float64 array (m, c)
        Its standard error [1].
    pedestal : float64 array (c,) or None
        The level of all pictures together, if one was taken for all [1].
    background : float64 array (m, c)
        Median beside the balls, for comparison [1].
    residual : float64 array (m,)
        Root-mean-square residual of each picture over its brightness [1].
    notes : tuple of str
        What was done, a sentence each.
    """

    rig: Rig
    quality: RigQuality
    camera: Camera
    ambient: FloatArray
    ambient_error: FloatArray
    pedestal: FloatArray | None
    background: FloatArray
    residual: FloatArray
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Fits:
    """Fits of gray and of each channel, one row a picture; the gray one is the last of a row."""

    rows: tuple[tuple[MatteFit, ...], ...]
    background: FloatArray


def calibrate_matte_balls(
    pictures: Sequence[BallPictures],
    *,
    albedo: float = 1.0,
    pedestal: str | float = "common",
    source: str = "matte balls",
    progress: Progress = no_progress,
) -> MatteCalibration:
    """Find direction and strength of each light from pictures of matte balls.

    Not for glossy or translucent balls, whose brightness is no cosine: the residual tells. Balls that stand apart under
    near lamps see different directions; their mean is taken, and how much they differ goes into the errors.

    Parameters
    ----------
    pictures : sequence of BallPictures
        One entry a ball, with the same lights in the same order.
    albedo : float
        πρ of the balls, only a factor of all strengths [1].
    pedestal : str or float
        What is added to the light everywhere. ``"common"``: one level for all pictures, as a camera's black level or a
        room's light, is found; ``"each"``: one for each picture is found; or the level as a share of full scale.
    source : str
        Where the balls came from, for the record.
    progress : callable
        Told how many pictures have been looked at.

    Returns
    -------
    MatteCalibration
        Lights, levels, errors.

    Raises
    ------
    InputError
        If a ball is not in the picture, moved, not lit, clipped over half of it, or nowhere near matte.
    OptionError
        If albedo or pedestal is out of range.
    """
    level = _check(pictures, albedo, pedestal)
    notes = [f"Ball {k + 1}: {require_still(one, progress)}" for k, one in enumerate(pictures)]
    fits = [_fits(one, level, progress) for one in pictures]
    ambient, ambient_error = _levels(fits)
    common, differ = None, 0.0
    if pedestal == "common":
        common = _common(ambient, ambient_error)
        fits = [_fits(one, common, progress) for one in pictures]
        beside = float(np.median([one.background for one in fits]))
        notes.append(_level_note(common, ambient, beside))
        differ = _disagreement(ambient, ambient_error, common)
        ambient = np.broadcast_to(common, ambient.shape)
    directions, error = _directions(fits)
    strengths, strength_error = _strengths(fits, pictures, albedo)
    residual = np.sqrt(np.mean([[row[-1].residual ** 2 for row in one.rows] for one in fits], axis=0))
    _require_lambertian(residual, pictures[0].stack.names)
    rms, turned = float(np.sqrt((residual * residual).mean())), float(np.degrees(np.sqrt((error * error).mean())))
    quality = RigQuality(
        direction_error=error,
        strength_error=strength_error,
        residual_brightness=rms,
        verdict=f"{len(directions)} lights, directions within ±{turned:.2g}°, strengths within"
        f" ±{100 * np.sqrt((strength_error**2).mean()):.2g} % (root mean square); the balls follow Lambert's law"
        f" to {100 * rms:.2g} %.",
        advice=_advice(rms, turned, differ),
    )
    return MatteCalibration(
        rig=Rig.distant(directions, strengths, source=source),
        quality=quality,
        camera=pictures[0].ball.camera,
        ambient=ambient,
        ambient_error=ambient_error,
        pedestal=common,
        background=np.asarray(np.mean([one.background for one in fits], axis=0)),
        residual=residual,
        notes=tuple(notes),
    )


def _check(pictures: Sequence[BallPictures], albedo: float, pedestal: str | float) -> FloatArray | None:
    """Return the level that was given, one a channel, or None."""
    counts = {one.stack.shape[0] for one in pictures}
    channels = {one.stack.shape[3] for one in pictures}
    if len(counts) != 1 or len(channels) != 1:
        raise InputError(
            given=f"There are {len(pictures)} balls, whose pictures differ in number or channels.",
            needed="One ball or more, each in one picture for each light, all in gray or all in colour.",
            remedy="Name folders of the same lights in the same order.",
        )
    if not 0 < albedo < np.inf:
        raise OptionError(
            given=f"The albedo of the balls is {albedo}.",
            needed="A positive number, 1 for a ball that reflects all light.",
            remedy="Leave it out; strengths are relative then.",
        )
    if isinstance(pedestal, str):
        if pedestal not in ("common", "each"):
            raise OptionError(
                given=f"The pedestal is {pedestal!r}.",
                needed="common, each, or a share of full scale.",
                remedy="Leave it out to have one level found for all pictures.",
            )
        return None
    if not 0 <= pedestal < 1:
        raise OptionError(
            given=f"The pedestal is {pedestal}.",
            needed="A share of full scale, 0 or more and below 1.",
            remedy="Divide the level by the value at full scale, such as 75/255.",
        )
    return np.full(channels.pop(), float(pedestal))


def _fits(pictures: BallPictures, level: FloatArray | None, progress: Progress) -> _Fits:
    """Fit all pictures of a ball; the levels (c,) are held if they are given."""
    ball, shape = pictures.local, (pictures.stack.shape[1], pictures.stack.shape[2])
    mask, near, far = (inside(ball, shape, share) for share in (_WITHIN, 1.15, 1.6))
    rows, columns = np.nonzero(mask)
    if len(rows) < 200:
        raise InputError(
            given=f"The circle x = {ball.seen[0]:.1f}, y = {ball.seen[1]:.1f}, r = {ball.seen[2]:.1f} covers "
            f"{len(rows)} pixels of the pictures, which are {shape[1]} × {shape[0]}.",
            needed="The ball must be in the pictures and some twenty pixels wide.",
            remedy="Check the circle: x counts columns from the left and y rows from the top, unless another origin is "
            "named.",
        )
    step = max(1, -(-len(rows) // _PIXELS))
    rows, columns = rows[::step], columns[::step]
    centre, radius = ball.sphere
    points = reflected_rays(ball.camera, centre, radius, np.stack([columns, rows], axis=-1).astype(np.float64))[0]
    normals = (points - centre) / radius
    turn = np.arctan2(rows - ball.seen[1], columns - ball.seen[0])
    sector = np.floor((turn / (2 * np.pi) + 0.5) * SECTORS).astype(np.intp) % SECTORS
    beside = far & ~near
    fitted, around = [], []
    for i in range(len(pictures.stack)):
        progress("shading", i, len(pictures.stack))
        image = pictures.linear(i) / pictures.stack.white
        raw = pictures.stack.frame(i)[rows, columns] / pictures.stack.white
        values = image[rows, columns]
        clear = np.isfinite(values).all(axis=1)
        if pictures.stack.saturates:
            clear &= (raw < _CLIPPED).all(axis=1)
        _require_clear(clear, pictures.stack.names[i])
        fitted.append(_picture(normals[clear], values[clear], sector[clear], level, pictures.stack.names[i]))
        around.append(np.median(image[beside], axis=0) if beside.any() else np.full(image.shape[2], np.nan))
    progress("shading", len(fitted), len(fitted))
    return _Fits(tuple(fitted), np.array(around))


def _picture(
    normals: FloatArray, values: FloatArray, sector: IntArray, level: FloatArray | None, name: str
) -> tuple[MatteFit, ...]:
    """Fit each channel of a picture, and the mean of all at last."""
    channels = values.shape[1]
    gray = values.mean(axis=1)
    known = [None] * channels if level is None else list(level)
    mean = None if level is None else float(level.mean())
    fits = [fit_matte(normals, values[:, c], sector, ambient=known[c]) for c in range(channels)] if channels > 1 else []
    fits.append(fit_matte(normals, gray, sector, ambient=mean))
    found = fits[-1]
    light = found.solution[:3]
    strength = float(np.sqrt(light @ light))
    spread = float(np.sqrt(np.trace(found.covariance[:3, :3])))
    if not strength > _LIT * spread / 3 or not strength > 1e-3:
        raise InputError(
            given=f"The ball in {name} has a strength of {strength:.3g} of full scale, ±{spread:.2g}.",
            needed="Each lamp must light the ball, and the ball be matte.",
            remedy="Check circle, exposure and that the lamp was on; a mirror is for `psstereo calibrate balls`.",
        )
    return tuple(fits)


def _require_clear(clear: np.ndarray, name: str) -> None:
    share = 1.0 - float(clear.mean())
    if share > _MOST_CLIPPED or int(clear.sum()) < 100:
        raise InputError(
            given=f"{100 * share:.0f} % of the ball in {name} are clipped at full scale.",
            needed=f"Clipped values tell nothing; {100 * _MOST_CLIPPED:.0f} % may be.",
            remedy="Expose less, or leave that picture out together with its light.",
        )


def _levels(fits: Sequence[_Fits]) -> tuple[FloatArray, FloatArray]:
    """Return levels (m, c) and errors, the mean over balls."""
    each = np.array([[[fit.solution[3] for fit in _colours(row)] for row in one.rows] for one in fits])
    error = np.array([[[np.sqrt(fit.covariance[3, 3]) for fit in _colours(row)] for row in one.rows] for one in fits])
    return each.mean(axis=0), np.sqrt((error * error).mean(axis=0) / len(fits))


def _colours(row: tuple[MatteFit, ...]) -> tuple[MatteFit, ...]:
    return row[:-1] if len(row) > 1 else row


def _common(ambient: FloatArray, error: FloatArray) -> FloatArray:
    weights = 1.0 / np.maximum(error, 1e-9) ** 2
    return np.asarray((weights * ambient).sum(axis=0) / weights.sum(axis=0))


def _level_note(common: FloatArray, each: FloatArray, background: float) -> str:
    return (
        f"A level of {100 * common.mean():.2f} % of full scale is added in all pictures; alone they tell "
        f"{100 * each.mean(axis=1).min():.2f} to {100 * each.mean(axis=1).max():.2f} %, and the background beside the "
        f"ball shows {100 * background:.2f} %."
    )


def _directions(fits: Sequence[_Fits]) -> tuple[FloatArray, FloatArray]:
    """Return directions (m, 3) and root-mean-square errors of the balls' means."""
    lights = np.array([[row[-1].solution[:3] for row in one.rows] for one in fits])
    units = lights / np.sqrt((lights * lights).sum(axis=-1, keepdims=True))
    mean = units.mean(axis=0)
    mean /= np.sqrt((mean * mean).sum(axis=-1, keepdims=True))
    across = np.stack(tangents(mean), axis=1)
    spread = np.array([[row[-1].covariance[:3, :3] for row in one.rows] for one in fits])
    formal = np.einsum("mai,kmij,maj->km", across, spread, across) / (lights * lights).sum(axis=-1)
    variance = formal.mean(axis=0) / len(fits)
    if len(fits) > 1:
        off = np.einsum("mai,kmi->kma", across, units)
        variance = variance + (off * off).sum(axis=(0, 2)) / (len(fits) * (len(fits) - 1))
    return mean, np.sqrt(variance)


def _strengths(fits: Sequence[_Fits], pictures: Sequence[BallPictures], albedo: float) -> tuple[FloatArray, FloatArray]:
    """Return strengths (m, c) and relative errors (m,)."""
    channels = pictures[0].stack.shape[3]
    lights = np.array([[[fit.solution[:3] for fit in _colours(row)] for row in one.rows] for one in fits])
    spread = np.array([[[fit.covariance[:3, :3] for fit in _colours(row)] for row in one.rows] for one in fits])
    size = np.sqrt((lights * lights).sum(axis=-1))
    unit = lights / size[..., None]
    variance = np.einsum("kmci,kmcij,kmcj->kmc", unit, spread, unit) / (size * size)
    error = np.sqrt(variance.mean(axis=(0, 2)) / len(fits))
    return size.mean(axis=0).reshape(-1, channels) / albedo, error


def _require_lambertian(residual: FloatArray, names: tuple[str, ...]) -> None:
    worst = int(np.argmax(residual))
    if not residual[worst] < _ODD:
        raise InputError(
            given=f"The ball in {names[worst]} departs from Lambert's law by {100 * residual[worst]:.0f} %.",
            needed=f"A matte ball under one lamp stays below {100 * _ODD:.0f} %.",
            remedy="Check circle, shadows on the ball and tone curve; a mirror is for `psstereo calibrate balls`.",
        )


def _disagreement(ambient: FloatArray, error: FloatArray, common: FloatArray) -> float:
    """Return how far levels that pictures tell alone are from the common one, root mean square over their errors."""
    if len(ambient) < 2:
        return 0.0
    pull = (ambient - common) / np.maximum(error, 1e-3)
    return float(np.sqrt((pull * pull).sum() / (ambient.size - common.size)))


def _advice(residual: float, turned: float, differ: float) -> tuple[str, ...]:
    advice = []
    if differ > _DIFFERENT:
        advice.append(
            f"The pictures alone tell levels that differ by {differ:.1f} times their errors: lamps near the ball, a"
            " room that is lit by them, or a tone curve look like that."
        )
    if residual > _ROUGH:
        advice.append(
            f"The balls follow Lambert's law to {100 * residual:.0f} % only: check outline, tone curve and gloss."
        )
    if turned > 1.0:
        advice.append("Use a larger ball, or several, to bring the directions' errors below a degree.")
    return tuple(advice)
