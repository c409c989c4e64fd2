"""A response of any rising form: log light is a gamma curve plus a spline of the value."""

import numpy as np

from psstereo.errors import InputError
from psstereo.stack import Response
from psstereo.types import BoolArray, FloatArray

__all__ = ["fit_curve"]

_PIECES = 8
"""Pieces of the spline."""
_LOOSE = 0.5
"""Standard deviation of the second difference of its coefficients before the data speak, in log light [1]."""
_WIDE = 2.0
"""The same of the coefficients themselves, which holds what the data leave free beside γ [1]."""
_ROUNDS = 6
_KNOTS = 33
_STEP = 1.0 / 255.0 / np.sqrt(12.0)
"""Noise of the values to begin with [1]."""


def fit_curve(values: FloatArray, usable: BoolArray, times: FloatArray, exponent: float) -> tuple[Response, float]:
    """Fit ``ln light(value) = γ ln value + s(value)``, with s(1) = 0 and s a cubic spline.

    Weights are those that constant noise of the values gives their logarithms; each pixel's light is eliminated by
    taking differences from its weighted mean. Below the darkest value the curve goes on as a gamma curve.

    Parameters
    ----------
    values : float64 array (k, p)
        Shares of full scale [1].
    usable : bool array (k, p)
        Which take part.
    times : float64 array (k,)
        Exposure times, in any unit.
    exponent : float
        γ of the gamma curve that fits best, to begin with [1].

    Returns
    -------
    response : Response
        The curve.
    residual : float
        Root-mean-square misfit of the values [1].

    Raises
    ------
    InputError
        If the curve that fits best falls anywhere.
    """
    low = float(values[usable].min())
    v = np.where(usable, values, 1.0)
    columns, slopes = _columns(v, low)
    target = np.broadcast_to(np.log(times)[:, None], v.shape)
    coefficients = np.concatenate([[exponent], np.zeros(columns.shape[-1] - 1)])
    noise = _STEP
    robust = np.ones(v.shape)
    for _ in range(_ROUNDS):
        steep = np.maximum(slopes @ coefficients, 0.05)  # d ln light / d value; bounded where a first guess falls
        weight = np.where(usable, robust / (steep * noise) ** 2, 0.0)
        coefficients = _solve(columns, target, weight)
        left = _centred((columns @ coefficients - target)[..., None], weight)[..., 0] / steep
        noise = 1.4826 * float(np.median(np.abs(left[usable]))) + 1e-9
        robust = 1.0 / (1.0 + (left / (4 * noise)) ** 2)
    residual = float(np.sqrt(np.mean(left[usable] ** 2)))
    return _response(coefficients, low), residual


def _columns(v: FloatArray, low: float) -> tuple[FloatArray, FloatArray]:
    """Return what multiplies γ and the spline's coefficients, and the derivatives of that by the value."""
    from scipy.interpolate import BSpline

    inner = np.linspace(low, 1.0, _PIECES + 1)
    knots = np.concatenate([[low] * 3, inner, [1.0] * 3])
    count = len(knots) - 4
    spline = BSpline(knots, np.eye(count), 3)
    inside = np.clip(v, low, 1.0)
    basis, slope = spline(inside), spline.derivative()(inside)
    # The last coefficient is the spline's value at 1, which is zero; light 1 is at value 1.
    return (
        np.concatenate([np.log(v)[..., None], basis[..., :-1]], axis=-1),
        np.concatenate([(1.0 / v)[..., None], slope[..., :-1]], axis=-1),
    )


def _centred(values: FloatArray, weight: FloatArray) -> FloatArray:
    """Return columns (k, p, n) less their weighted mean over the exposures."""
    total = np.maximum(weight.sum(axis=0), 1e-300)
    return np.asarray(values - (values * weight[..., None]).sum(axis=0) / total[:, None])


def _solve(columns: FloatArray, target: FloatArray, weight: FloatArray) -> FloatArray:
    a = _centred(columns, weight)
    b = _centred(target[..., None], weight)[..., 0]
    count = columns.shape[-1]
    matrix = np.einsum("kpi,kp,kpj->ij", a, weight, a, optimize=True)
    right = np.einsum("kpi,kp,kp->i", a, weight, b, optimize=True)
    bends = np.diff(np.vstack([np.eye(count - 1), np.zeros(count - 1)]), 2, axis=0) / _LOOSE
    matrix[1:, 1:] += bends.T @ bends
    # γ ln v and a straight spline share a direction; the spline is the smaller of the two.
    matrix[1:, 1:] += np.eye(count - 1) / _WIDE**2
    return np.asarray(np.linalg.solve(matrix, right))


def _response(coefficients: FloatArray, low: float) -> Response:
    values = np.linspace(0.0, 1.0, _KNOTS) ** 2  # close together where a gamma curve is bent most
    inside = np.maximum(values[1:], low)
    columns, slopes = _columns(inside, low)
    below = coefficients[0] * np.log(values[1:] / inside)
    light = np.exp(columns @ coefficients + below)
    if not ((slopes @ coefficients > 0).all() and (np.diff(light) > 0).all()):
        raise InputError(
            given="The response that fits best falls somewhere, so that one value would stand for two lights.",
            needed="Photographs whose values rise with the light everywhere.",
            remedy="Check exposure times and order; use the model gamma if few brightnesses occur.",
        )
    return Response.from_knots(values, np.concatenate([[0.0], light[:-1] / light[-1], [1.0]]))
