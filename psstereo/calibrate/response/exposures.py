"""The camera's response from several exposures of one scene that does not change.

What is exposed twice as long gets twice the light, whatever its value says. A gamma curve is found by least squares on
the values themselves, where the noise of rounding is the same everywhere, each pixel's light eliminated in closed form;
a free curve by least squares on log exposure, a gamma curve times the exponential of a spline.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from psstereo.calibrate.response.curve import fit_curve
from psstereo.calibrate.response.fit import ResponseFit, gamma_or_linear
from psstereo.errors import InputError, OptionError
from psstereo.io.rig_file import RigQuality
from psstereo.stack import Response
from psstereo.stack.brackets import checked_times
from psstereo.stack.stack import full_scale
from psstereo.types import Array, BoolArray, FloatArray, Progress, no_progress

__all__ = ["Exposures", "response_from_exposures", "usable_exposures"]

_LOW, _HIGH = 0.02, 0.97
"""Shares of full scale between which values are trusted: below rounding rules, above sensors bend and clip."""
_PIXELS = 4000
_DIFFERENT = 3
"""Exposure times from which a free curve is looked for."""
_LEAST = 50
"""Pixels seen in two exposures or more, without which nothing is said."""
_BEND = 0.01
"""Difference of curve and gamma curve in light, as a share of full scale, from which the curve is taken."""
_BETTER = 0.98
"""Residual of the curve over that of the gamma curve, below which it is taken."""
_UNSURE = 0.02
"""Standard error of the exponent, as a share of it, from which advice is given."""


@dataclass(frozen=True, eq=False)
class Exposures:
    """Values of some pixels under each exposure.

    Attributes
    ----------
    values : float64 array (k, p)
        Shares of full scale [1].
    usable : bool array (k, p)
        Whether they are neither clipped nor too dark; at least two a pixel.
    times : float64 array (k,)
        Exposure times over their geometric mean [1].
    """

    values: FloatArray
    usable: BoolArray
    times: FloatArray


def response_from_exposures(
    frames: Sequence[Array],
    times: npt.ArrayLike,
    *,
    white: float | None = None,
    model: str = "auto",
    progress: Progress = no_progress,
) -> ResponseFit:
    """Find the tone curve that makes light proportional to exposure time.

    Camera and scene stand still, the light is constant, aperture, gain and white balance are fixed; nothing is told of
    the scene. Not from frames that a camera has tone-mapped one by one, whose curves differ, nor where the dark level
    is a noticeable share of the values: take it off first.

    Parameters
    ----------
    frames : sequence of array (h, w) or (h, w, c)
        Two photographs or more, in their own numbers; channels count alike.
    times : float array (k,)
        Exposure times; only ratios matter [s].
    white : float, optional
        Value of full scale; from the type if absent.
    model : {"auto", "gamma", "curve"}
        A gamma curve, a free one, or the free one where it differs and fits better.
    progress : callable
        Told how many fits are done.

    Returns
    -------
    ResponseFit
        The response and its error.

    Raises
    ------
    InputError
        If frames or times do not fit, all times are the same, too few pixels are neither clipped nor dark in two of
        them, or brightness does not rise with time.
    OptionError
        If the model is unknown.

    References
    ----------
    .. [1] P. E. Debevec, J. Malik, "Recovering High Dynamic Range Radiance Maps from Photographs", SIGGRAPH 1997.
       doi:10.1145/258734.258884
    .. [2] T. Mitsunaga, S. K. Nayar, "Radiometric Self Calibration", IEEE CVPR 1999. doi:10.1109/CVPR.1999.786966
    """
    if model not in ("auto", "gamma", "curve"):
        raise OptionError(
            given=f"The model of the response is {model!r}.",
            needed="auto, gamma or curve.",
            remedy="Choose one of them.",
        )
    seen = usable_exposures(frames, times, white)
    exponent, residual, formal = fit_gamma(seen)
    error = max(formal, _jackknife(seen, progress))
    response = gamma_or_linear(exponent, error)
    several = len(np.unique(seen.times)) >= _DIFFERENT
    if model == "curve" and not several:
        raise InputError(
            given=f"A free curve is asked for, from {len(np.unique(seen.times))} exposure times.",
            needed=f"At least {_DIFFERENT}: with one ratio, curves that wave in its rhythm fit as well.",
            remedy="Take more exposures, or use the model gamma.",
        )
    if model == "curve" or (model == "auto" and several):
        curve, other = fit_curve(seen.values, seen.usable, seen.times, exponent)
        grid = np.linspace(0.0, 1.0, 101)
        bend = float(np.abs(curve.curve(grid) - grid**exponent).max())
        if model == "curve" or (bend > _BEND and other < _BETTER * residual):
            response, residual = curve, other
    return ResponseFit(
        response=response,
        exponent=exponent,
        exponent_error=error,
        residual=residual,
        observations=int(np.count_nonzero(seen.usable)),
        quality=_quality(response, exponent, error, residual, len(seen.times)),
    )


def usable_exposures(frames: Sequence[Array], times: npt.ArrayLike, white: float | None = None) -> Exposures:
    """Choose pixels of all brightnesses that are neither clipped nor dark in two exposures or more.

    Parameters
    ----------
    frames : sequence of array
        The photographs.
    times : float array (k,)
        Exposure times [s].
    white : float, optional
        Value of full scale.

    Returns
    -------
    Exposures
        Some thousand pixels.

    Raises
    ------
    InputError
        As :func:`response_from_exposures`.
    """
    if len(frames) < 2 or len({(one.shape, one.dtype) for one in frames}) > 1:
        raise InputError(
            given=f"There are {len(frames)} photographs of the shapes {sorted({one.shape for one in frames})}.",
            needed="Two or more of one size and type.",
            remedy="Photograph one scene with several exposure times and convert all alike.",
        )
    seconds = checked_times(times, len(frames))
    if not seconds.max() > 1.05 * seconds.min():
        raise InputError(
            given=f"The exposure times run from {seconds.min():.4g} to {seconds.max():.4g} s.",
            needed="Times that differ, best by a factor of two from one to the next.",
            remedy="Vary the exposure time, not aperture or gain.",
        )
    top = full_scale(frames[0].dtype) if white is None else white
    values = np.stack([np.asarray(frame, np.float64).ravel() / top for frame in frames])
    usable = (values > _LOW) & (values < _HIGH)
    chosen = np.flatnonzero(usable.sum(axis=0) >= 2)
    if len(chosen) < _LEAST:
        raise InputError(
            given=f"{len(chosen)} pixels are neither clipped nor nearly black in two exposures or more.",
            needed=f"At least {_LEAST}, of many brightnesses.",
            remedy="Take exposures that lie closer together, of a scene with bright and dark parts.",
        )
    bright = np.nanmean(np.where(usable[:, chosen], np.log(np.maximum(values[:, chosen], _LOW)), np.nan), axis=0)
    order = chosen[np.argsort(bright, kind="stable")]
    picked = order[np.unique(np.linspace(0, len(order) - 1, min(len(order), _PIXELS)).astype(int))]
    return Exposures(values[:, picked], usable[:, picked], seconds / np.exp(np.log(seconds).mean()))


def fit_gamma(seen: Exposures) -> tuple[float, float, float]:
    """Fit ``value = (light · time)^(1 / γ)``.

    Parameters
    ----------
    seen : Exposures
        The values.

    Returns
    -------
    exponent : float
        γ [1].
    residual : float
        Root-mean-square misfit of the values [1].
    error : float
        Standard error of γ, taking the misfits for independent [1].

    Raises
    ------
    InputError
        If values do not rise with the exposure time.
    """
    from scipy.optimize import least_squares

    usable = seen.usable

    def misfit(x: FloatArray) -> FloatArray:
        bright = seen.times[:, None] ** float(x[0])
        share = (np.where(usable, seen.values * bright, 0.0)).sum(axis=0) / (usable * bright**2).sum(axis=0)
        return np.asarray((seen.values - share * bright)[usable])

    first = least_squares(misfit, [0.6], bounds=(0.05, 10.0))
    spread = 1.4826 * float(np.median(np.abs(first.fun))) + 1e-12
    found = least_squares(misfit, first.x, bounds=(0.05, 10.0), loss="soft_l1", f_scale=3 * spread)
    inverse = float(found.x[0])
    if not 0.1 < inverse < 9.9:
        raise InputError(
            given=f"Values go with the exposure time to the power of {inverse:.2g}.",
            needed="Values that rise with the time, by a power of 0.1 to 10.",
            remedy="Check the order of times and photographs, and that nothing else changed between them.",
        )
    left = misfit(found.x)
    step = 1e-4
    slope = (misfit(found.x + step) - misfit(found.x - step)) / (2 * step)
    freedom = max(left.size - usable.shape[1] - 1, 1)
    deviation = float(np.sqrt((left @ left) / freedom / max(float(slope @ slope), 1e-300)))
    return 1.0 / inverse, float(np.sqrt(np.mean(left * left))), deviation / inverse**2


def _jackknife(seen: Exposures, progress: Progress) -> float:
    """Return the standard error of the exponent that leaving out one exposure after the other tells; 0 of two."""
    count = len(seen.times)
    if count < 3:
        return 0.0
    found = []
    for left_out in range(count):
        progress("exposures left out in turn", left_out, count)
        keep = np.arange(count) != left_out
        enough = seen.usable[keep].sum(axis=0) >= 2
        if np.count_nonzero(enough) >= _LEAST:
            found.append(
                fit_gamma(Exposures(seen.values[keep][:, enough], seen.usable[keep][:, enough], seen.times[keep]))[0]
            )
    progress("exposures left out in turn", count, count)
    if len(found) < 3:
        return 0.0
    n = len(found)
    return float(np.sqrt((n - 1) * np.var(found)))


def _quality(response: Response, exponent: float, error: float, residual: float, count: int) -> RigQuality:
    names = {"linear": "The images are linear", "gamma": f"The response is a gamma curve of {exponent:.3f}"}
    what = names.get(response.name, f"The response is a curve of its own, near a gamma of {exponent:.2f}")
    advice = []
    if error > _UNSURE * exponent:
        advice.append("Check the exposure times: those of a camera's dial are rounded; EXIF often has better ones.")
    if count < 4:
        advice.append("Take four exposures or more, each twice as long as the one before.")
    if residual > 0.02:
        advice.append("The values disagree with any curve by more than 2 %: did light, camera or scene change?")
    return RigQuality(
        residual_brightness=residual,
        verdict=f"{what} (± {error:.3f} of the exponent); values are met to {residual:.2%} of full scale.",
        advice=tuple(advice),
    )
