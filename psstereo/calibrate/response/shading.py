"""The camera's response from the shading itself: the exponent with which Lambert's law fits the photographs best.

With the right exponent the residuals of Lambert's law have nothing to do with ``y ln v``, what a change of the exponent
does to the light y of a value v. The exponent is moved until that is so. A search for the smallest residual of light
would be drawn to large exponents, which make everything dark, and with it the residual; residuals of values are not,
but shadows and gloss weigh much in them. They say where to begin, and whether to believe what comes out.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from psstereo.calibrate.response.fit import ResponseFit, gamma_or_linear
from psstereo.errors import InputError, UnsupportedError
from psstereo.io.rig_file import RigQuality
from psstereo.types import BoolArray, FloatArray, Progress, no_progress

__all__ = ["response_from_shading"]

_LOW, _HIGH = 0.02, 0.97
"""Shares of full scale between which values are trusted."""
_GRAZING = 0.1
"""Cosine below which a light is left out: there shadows and rough paint bend the law."""
_LEAST_LIT = 5
_LEAST_PIXELS = 200
_MOST_PIXELS = 6000
_MODEL = 0.01
"""Error of Lambert's law itself, as a share of what a facing surface would show, beside the rounding of values [1]."""
_CUT = 4.685
"""Residual over its scale from which an observation is left out, Tukey's number."""
_SHARPEST = 0.3
"""Least scale of the residuals, over what rounding and model make expected: exact data leave nothing out [1]."""
_ROUNDS, _INNER = 15, 3
_STARTS = tuple(float(one) for one in np.geomspace(0.4, 4.0, 12))
_PART = 0.7
"""Share of the values by whose residuals starts are compared; the others may be in shadow or gloss."""
_FEW = 1200
"""Pixels that starts are tried on."""
_AGREE = 1.25
"""Factor between the two exponents, from which the surface does not tell one."""
_SETTLED = 1e-5
_SMALLEST, _LARGEST = 0.2, 6.0
_GROUPS = 5
"""Groups of lights, and of pixels, that are left out in turn."""
_SEARCHES = 1 + 2 * _GROUPS
"""Searches for the exponent: one with everything, and one for each group that is left out."""
_MATTE = 0.03
"""Misfit as a share of brightness from which the surface is not matte enough to trust the exponent."""
_USELESS = 0.25
"""Standard error of the exponent, as a share of it, from which there is no answer."""
_UNSURE = 0.05
"""Standard error of the exponent, as a share of it, from which a verdict warns."""


@dataclass(frozen=True, eq=False)
class _Shading:
    """Values (q, m) of pixels and channels, their dark values (q,), and the light matrix of each channel (c, m, 3)."""

    values: FloatArray
    dark: FloatArray
    lights: FloatArray
    channel: npt.NDArray[np.intp]
    step: float

    def of(self, pixels: BoolArray | slice, lights: BoolArray | slice) -> "_Shading":
        return _Shading(
            self.values[pixels][:, lights],
            self.dark[pixels],
            self.lights[:, lights],
            self.channel[pixels],
            self.step,
        )


def response_from_shading(
    values: npt.ArrayLike,
    directions: npt.ArrayLike,
    strengths: npt.ArrayLike | None = None,
    *,
    dark: npt.ArrayLike | None = None,
    step: float = 1.0 / 255.0,
    progress: Progress = no_progress,
) -> ResponseFit:
    """Find the gamma curve under which Lambert's law fits pixels that five lights or more reach.

    One exposure a light is enough. Not for glossy, translucent or very rough surfaces, whose own bend is taken for the
    camera's: exposures of one scene tell better. Room light that is not given as `dark` bends the law too.

    Parameters
    ----------
    values : float array (m, p) or (c, m, p)
        Shares of full scale as the camera gave them, at pixels of the object; NaN where unusable [1].
    directions : float array (m, 3)
        Toward the lights [1].
    strengths : float array (m,) or (m, c), optional
        Of the lights; all alike if absent.
    dark : float array (p,) or (c, p), optional
        Values without any of the lights, through the same response [1].
    step : float
        Rounding of the values, 1/255 for 8 bits [1].
    progress : callable
        Told how many searches for the exponent are done.

    Returns
    -------
    ResponseFit
        The exponent and its error, that of left-out lights and pixels included.

    Raises
    ------
    InputError
        If shapes do not fit, or fewer than 200 pixels are reached by five lights, or nothing depends on the exponent.
    UnsupportedError
        If residuals of light and of values do not want the same exponent, between 0.2 and 6.
    """
    shading = _shading(values, directions, strengths, dark, step)
    start = _start(shading)
    progress("exponent", 0, _SEARCHES)
    exponent, misfit, formal, used = _search(shading, start)
    if not 1 / _AGREE < exponent / start < _AGREE:
        raise _no_exponent(f"residuals of values are least at {start:.2f}, those of light want {exponent:.2f}")
    by_light = _left_out(shading, exponent, progress, 1, lights=True)
    by_pixel = _left_out(shading, exponent, progress, 1 + _GROUPS, lights=False)
    progress("exponent", _SEARCHES, _SEARCHES)
    error = max(formal, by_light, by_pixel)
    if not error < _USELESS * exponent:
        raise _no_exponent(f"{exponent:.2f} fits best, and parts of the photographs contradict each other")
    return ResponseFit(
        response=gamma_or_linear(exponent, error),
        exponent=exponent,
        exponent_error=error,
        residual=misfit,
        observations=used,
        quality=_quality(exponent, error, misfit),
    )


def _shading(
    values: npt.ArrayLike,
    directions: npt.ArrayLike,
    strengths: npt.ArrayLike | None,
    dark: npt.ArrayLike | None,
    step: float,
) -> _Shading:
    v = np.asarray(values, np.float64)
    v = v[None] if v.ndim == 2 else v
    d = np.asarray(directions, np.float64)
    if v.ndim != 3 or d.shape != (v.shape[1], 3) or not np.isfinite(d).all() or not 0 < step < 0.1:
        raise InputError(
            given=f"Values of the shape {v.shape}, directions of {d.shape}, rounded to {step}.",
            needed="(c, m, p) values, m directions of three numbers, and a step between 0 and 0.1.",
            remedy="Give one row of values a light.",
        )
    channels, count, pixels = v.shape
    s = np.ones((count, 1)) if strengths is None else np.asarray(strengths, np.float64)
    s = s[:, None] if s.ndim == 1 else s
    level = np.zeros((channels, pixels)) if dark is None else np.asarray(dark, np.float64)
    level = np.broadcast_to(level, (channels, pixels)) if level.ndim < 2 or len(level) == 1 else level
    if s.shape not in ((count, 1), (count, channels)) or not (s > 0).all() or level.shape != (channels, pixels):
        raise InputError(
            given=f"Strengths of the shape {s.shape} and dark values of {level.shape} for {count} lights.",
            needed="Positive strengths, one a light or one a channel besides, and one dark value a pixel and channel.",
            remedy="Correct them, or leave them out.",
        )
    lights = d / np.linalg.norm(d, axis=1, keepdims=True)
    matrix = (np.broadcast_to(s, (count, channels)).T / s.mean())[..., None] * lights
    flat = v.transpose(0, 2, 1).reshape(-1, count)
    usable = (flat > _LOW) & (flat < _HIGH)
    enough = np.flatnonzero(usable.sum(axis=1) >= _LEAST_LIT)
    if len(enough) < _LEAST_PIXELS:
        raise InputError(
            given=f"{len(enough)} pixels are lit by {_LEAST_LIT} lights or more without being clipped.",
            needed=f"At least {_LEAST_PIXELS}.",
            remedy="Use more lights, or find the response from several exposures of one scene.",
        )
    some = enough[np.unique(np.linspace(0, len(enough) - 1, min(len(enough), _MOST_PIXELS)).astype(int))]
    return _Shading(flat[some], np.maximum(level.reshape(-1)[some], 0.0), matrix, some // pixels, step)


def _start(shading: _Shading) -> float:
    """Return the exponent for which values, rather than light, are met best by the greater part of some pixels."""
    some = shading.of(slice(None, None, max(len(shading.values) // _FEW, 1)), slice(None))
    v = some.values
    usable = (v > _LOW) & (v < _HIGH)
    spreads = []
    for exponent in _STARTS:
        left, _, _ = _fit(some, exponent)
        slope = exponent * np.where(usable, v, 1.0) ** (exponent - 1.0)  # light a step of the value
        spreads.append(np.quantile(np.abs(left / slope)[usable], _PART))
    best = int(np.argmin(spreads))
    if not 0 < best < len(_STARTS) - 1:
        return _STARTS[best]
    a, b, c = np.log(spreads[best - 1 : best + 2])
    step = np.log(_STARTS[1] / _STARTS[0])
    return float(_STARTS[best] * np.exp(0.5 * step * (a - c) / (a - 2.0 * b + c)))


def _search(shading: _Shading, start: float) -> tuple[float, float, float, int]:
    """Return the exponent, the misfit as a share of full scale, the formal error, and how many values are used."""
    exponent = start
    change = error = 0.0
    for _ in range(_ROUNDS):
        residual, pattern, weight = _fit(shading, exponent)
        strength = float((weight * pattern * pattern).sum())
        if not strength > 0:
            break
        change = -float((weight * residual * pattern).sum()) / strength
        used = weight > 0
        freedom = max(np.count_nonzero(used) - 3 * np.count_nonzero(used.any(axis=1)), 1)
        error = float(np.sqrt((weight * residual**2).sum() / freedom / strength))
        exponent = float(np.clip(exponent + np.clip(change, -0.5, 0.5), _SMALLEST, _LARGEST))
        if abs(change) < _SETTLED:
            break
    else:
        if abs(change) > max(error, 0.01):
            raise _no_exponent(f"the search does not come to rest at {exponent:.2f}")
    if not _SMALLEST < exponent < _LARGEST or not error > 0:
        raise _no_exponent(f"the search ended at {exponent:.2f}")
    values = shading.values
    slope = exponent * np.where(used, values, 1.0) ** (exponent - 1.0)  # light a step of the value
    misfit = float(np.sqrt(np.mean((residual / slope)[used] ** 2)))
    return exponent, misfit, error, int(np.count_nonzero(used))


def _fit(shading: _Shading, exponent: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fit Lambert's law with one exponent.

    Returns what is left of light, and of light's derivative by the exponent, after the law has taken its share, and the
    weights; each is (q, m).
    """
    v = np.where(np.isfinite(shading.values), shading.values, 0.0)
    usable = (v > _LOW) & (v < _HIGH)
    safe = np.where(usable, v, 0.5)
    dark = shading.dark[:, None]
    light = safe**exponent - dark**exponent
    slope = safe**exponent * np.log(safe) - dark**exponent * np.log(np.maximum(dark, 1e-12))
    design = shading.lights[shading.channel]
    top = np.where(usable, light, 0.0).max(axis=1, keepdims=True)
    rounding = exponent * safe ** (exponent - 1.0) * shading.step / np.sqrt(12.0)
    base = usable / (rounding**2 + (_MODEL * top) ** 2)
    weight = base
    size = np.linalg.norm(design, axis=2)
    for _ in range(_INNER):
        normal, _ = _normals(design, weight, light)
        shown = np.einsum("qmi,qi->qm", design, normal)
        lit = usable & (shown > _GRAZING * size * np.linalg.norm(normal, axis=1)[:, None])
        ratio = (light - shown) * np.sqrt(base)
        scale = 1.4826 * float(np.median(np.abs(ratio[lit]))) if lit.any() else 1.0
        limit = _CUT * max(scale, _SHARPEST)
        weight = base * lit * np.maximum(1.0 - (ratio / limit) ** 2, 0.0) ** 2
        weight = weight * ((weight > 0).sum(axis=1, keepdims=True) >= _LEAST_LIT)
    normal, inverse = _normals(design, weight, light)
    left = light - np.einsum("qmi,qi->qm", design, normal)
    taken = np.einsum("qij,qmj,qm,qm->qi", inverse, design, weight, slope, optimize=True)
    pattern = slope - np.einsum("qmi,qi->qm", design, taken)
    return left, pattern, weight


def _normals(design: FloatArray, weight: FloatArray, light: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return weighted least squares of light on the lights, (q, 3), and the inverse normal matrices (q, 3, 3)."""
    weighted = design * weight[..., None]
    matrix = np.einsum("qmi,qmj->qij", weighted, design, optimize=True)
    size = np.einsum("qii->q", matrix)
    matrix += np.eye(3) * (1e-9 * size + 1e-30)[:, None, None]
    inverse = np.linalg.inv(matrix)
    return np.einsum("qij,qmj,qm->qi", inverse, weighted, light, optimize=True), inverse


def _left_out(shading: _Shading, start: float, progress: Progress, done: int, *, lights: bool) -> float:
    """Return the standard error that leaving out groups of lights, or of neighbouring pixels, tells (jackknife)."""
    pixels, count = shading.values.shape
    number = count if lights else pixels
    group = np.arange(number) % _GROUPS if lights else np.arange(number) * _GROUPS // number
    found = []
    for one in range(_GROUPS):
        progress("exponent", done + one, _SEARCHES)
        keep = group != one
        part = shading.of(slice(None), keep) if lights else shading.of(keep, slice(None))
        if lights and np.count_nonzero(keep) < _LEAST_LIT:
            return 0.0
        try:
            found.append(_search(part, start)[0])
        except UnsupportedError:
            return float("inf")
    return float(np.sqrt((_GROUPS - 1) * np.var(found)))


def _no_exponent(why: str) -> UnsupportedError:
    return UnsupportedError(
        given=f"The shading does not tell an exponent: {why}.",
        needed="A matte surface under known lights, without room light and with little light from its own parts.",
        remedy="Check the order of the lights; find the response from several exposures of one scene instead.",
    )


def _quality(exponent: float, error: float, misfit: float) -> RigQuality:
    advice = []
    known = f"The shading wants a gamma curve of {exponent:.3f} ± {error:.3f}; values are met to {misfit:.2%}."
    if misfit > _MATTE:
        advice.append("The surface is not matte enough for this: find the response from exposures of one scene.")
    if not error < _UNSURE * exponent:
        advice.append("The exponent is uncertain: use more lights and pixels, or several exposures of one scene.")
    return RigQuality(residual_brightness=misfit, verdict=known, advice=tuple(advice))
