"""Fits of Lambert's law under lamps near the surface, each pixel with light vectors of its own: the reference.

A pixel at X shows ``y_i = max(0, a_i(X)·b)`` under lamp i, with b the albedo times the normal and
``a = (axis·(X − s)/|X − s|)₊^mu (s − X)/|s − X|³``. The fit reweights observations by their residual. At the same time
it tells how the photometric energy changes when X slides along the line of sight, with b free: that derivative is what
makes distances metric.
"""

from typing import NamedTuple

import numpy as np

from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = [
    "FEW",
    "FLOOR",
    "GEMAN_MCCLURE",
    "GRAZING",
    "REACH",
    "SINGULAR",
    "TUKEY",
    "NearFit",
    "fit_near",
    "lamp_vectors",
]

GEMAN_MCCLURE = 0
"""Loss t²/(1 + t²)."""
TUKEY = 1
"""Tukey's biweight, which ends at 4.685 scales."""

GRAZING = 0.02
"""Cosine around which an observation fades out as its lamp sinks below the surface, from twice that to zero; and share
of the brightest value that counts as dark. A sharp gate would make the alternation with the depth flicker."""
REACH = 4.685
"""Scales at which Tukey's loss ends."""
SINGULAR = 1e-10
"""Pivot over trace below which a pixel's lamps count as coplanar."""
FLOOR = 1e-3
"""Weight, before its residual counts, of a bright observation whose lamp the fit has behind the surface: enough to turn
a wrong fit round, too little to bend a right one."""
FEW = 4
"""Lit observations up to which residuals cannot tell an outlier from a wrong fit: all weigh the same."""


class NearFit(NamedTuple):
    """What is found at p pixels.

    Attributes
    ----------
    scaled : float64 array (p, 3)
        Albedo times normal; NaN where the lamps that are left do not determine it.
    moments : float64 array (p, 6)
        Weighted sums of a aᵀ, entries xx, xy, yy, xz, yz, zz.
    energy : float64 array (p,)
        Sum of the loss over usable observations, between 0 and their number [1].
    pull, stiffness : float64 arrays (p,)
        Gauss–Newton terms of the energy along the line of sight: half the negative gradient, and half the curvature,
        with b eliminated, in units of the scale squared.
    squares, power : float64 arrays (p,)
        Weighted sums of squared residuals and of squared values.
    deviation : float64 array (p,)
        Median of the residuals' magnitudes over lit observations, NaN if there is none.
    usable, used : int64 arrays (p,)
        Observations that are numbers, and those with a say.
    """

    scaled: FloatArray
    moments: FloatArray
    energy: FloatArray
    pull: FloatArray
    stiffness: FloatArray
    squares: FloatArray
    power: FloatArray
    deviation: FloatArray
    usable: IntArray
    used: IntArray


def fit_near(
    values: FloatArray,
    points: FloatArray,
    motion: FloatArray,
    lamps: FloatArray,
    start: FloatArray,
    scale: FloatArray,
    rounds: int,
    loss: int,
) -> NearFit:
    """Fit some pixels.

    Parameters
    ----------
    values : float64 array (m, p)
        Brightness over the lamp's radiant intensity; NaN where not usable.
    points : float64 array (p, 3)
        Where the surface is [length].
    motion : float64 array (p, 3)
        How a point moves along its line of sight, per unit of whatever measures the way [length].
    lamps : float64 array (m, 7)
        Position, axis, exponent.
    start : float64 array (p, 3)
        Albedo times normal to begin with; NaN to begin from the brightness alone.
    scale : float64 array (p,)
        Residual that counts as large, above zero, in the unit of the values.
    rounds : int
        Rounds of reweighting.
    loss : int
        ``GEMAN_MCCLURE`` or ``TUKEY``.

    Returns
    -------
    NearFit
        Fits and their derivatives.
    """
    usable = np.isfinite(values)
    y = np.where(usable, values, 0.0)
    a, da = lamp_vectors(points, motion, lamps)
    length = np.sqrt((a * a).sum(axis=0))
    bright = usable & (y > GRAZING * y.max(axis=0, initial=0.0)) & (length > 0)
    weights = bright.astype(np.float64)
    b = np.where(np.isfinite(start).all(axis=1), start.T, np.nan)
    fresh = np.isnan(b[0])
    b[:, fresh] = _solve(
        _moments(a[..., fresh], weights[:, fresh]), _right_side(a[..., fresh], (weights * y)[:, fresh])
    )
    begun = b
    for _ in range(rounds):
        weights, _ = _weigh(y, usable, bright, a, length, b, scale, weights, loss)
        b = _solve(_moments(a, weights), _right_side(a, weights * y))
    # Reweighting can hop to and fro between two fits; the one that it began from stays unless the other is better.
    worse = ~(_cost(y, usable, a, b, scale, loss) <= _cost(y, usable, a, begun, scale, loss))
    b = np.where(worse, begun, b)
    weights, lit = _weigh(y, usable, bright, a, length, b, scale, weights, loss)
    return _summary(y, usable, a, da, b, scale, weights, lit, loss)


def lamp_vectors(points: FloatArray, motion: FloatArray, lamps: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the light vectors a, (3, m, p), and their derivatives along the motion."""
    position, axis, exponent = lamps[:, 0:3].T[:, :, None], lamps[:, 3:6].T[:, :, None], lamps[:, 6][:, None]
    to_lamp = position - points.T[:, None, :]
    v = motion.T[:, None, :]
    square = (to_lamp * to_lamp).sum(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.sqrt(square)
        cosine = -(axis * to_lamp).sum(axis=0) / distance
        front = cosine > 0
        lobe = np.where(front, np.where(front, cosine, 1.0) ** exponent, 0.0)
        along = (to_lamp * v).sum(axis=0) / square
        turn = (axis * v).sum(axis=0) / distance + cosine * along
        slope = np.where(front, exponent * lobe * turn / np.where(front, cosine, 1.0), 0.0)
        a = lobe * to_lamp / (square * distance)
        da = (slope * to_lamp + lobe * (3.0 * along * to_lamp - v)) / (square * distance)
    return np.nan_to_num(a, posinf=0.0, neginf=0.0), np.nan_to_num(da, posinf=0.0, neginf=0.0)


def _moments(a: FloatArray, weights: FloatArray) -> FloatArray:
    x, y, z = a
    pairs = (x * x, x * y, y * y, x * z, y * z, z * z)
    return np.stack([(weights * pair).sum(axis=0) for pair in pairs])


def _right_side(a: FloatArray, weighted: FloatArray) -> FloatArray:
    return np.asarray((a * weighted).sum(axis=1))


def _solve(moments: FloatArray, rhs: FloatArray) -> FloatArray:
    """Solve symmetric 3 × 3 systems by Cholesky's method; NaN where a pivot is negligible."""
    xx, xy, yy, xz, yz, zz = moments
    tiny = SINGULAR * (xx + yy + zz)
    with np.errstate(invalid="ignore", divide="ignore"):
        l11 = np.sqrt(np.where(xx > tiny, xx, np.nan))
        l21, l31 = xy / l11, xz / l11
        d2 = yy - l21 * l21
        l22 = np.sqrt(np.where(d2 > tiny, d2, np.nan))
        l32 = (yz - l31 * l21) / l22
        d3 = zz - l31 * l31 - l32 * l32
        l33 = np.sqrt(np.where(d3 > tiny, d3, np.nan))
        u1 = rhs[0] / l11
        u2 = (rhs[1] - l21 * u1) / l22
        u3 = (rhs[2] - l31 * u1 - l32 * u2) / l33
        b3 = u3 / l33
        b2 = (u2 - l32 * b3) / l22
        b1 = (u1 - l21 * b2 - l31 * b3) / l11
    return np.stack([b1, b2, b3])


def _weigh(
    y: FloatArray,
    usable: BoolArray,
    bright: BoolArray,
    a: FloatArray,
    length: FloatArray,
    b: FloatArray,
    scale: FloatArray,
    before: FloatArray,
    loss: int,
) -> tuple[FloatArray, BoolArray]:
    """Return weights for the next fit and which observations are lit; former weights where fewer than three are."""
    albedo = np.sqrt((b * b).sum(axis=0))
    with np.errstate(invalid="ignore", divide="ignore"):
        predicted = (a * b[:, None]).sum(axis=0)
        limit = 2.0 * GRAZING * length * albedo
        lit = usable & (predicted > 0)
        if loss == TUKEY:
            lit &= y > 0.5 * limit
        front = np.where(lit, np.minimum(predicted / limit, 1.0), 0.0)
        t = (y - predicted) / scale
        share = 1.0 / (1.0 + t * t) if loss == GEMAN_MCCLURE else np.maximum(0.0, 1.0 - (t / REACH) ** 2)
        trust = np.clip(front.sum(axis=0) - FEW, 0.0, 1.0)
        if loss == GEMAN_MCCLURE:
            front = np.maximum(front, FLOOR * bright)
        weights = np.where(front > 0, front * (share * share) ** trust, 0.0)
    few = (weights > 0).sum(axis=0) < 3
    weights[:, few] = before[:, few]
    return weights, lit


def _summary(
    y: FloatArray,
    usable: BoolArray,
    a: FloatArray,
    da: FloatArray,
    b: FloatArray,
    scale: FloatArray,
    weights: FloatArray,
    lit: BoolArray,
    loss: int,
) -> NearFit:
    moments = _moments(a, weights)
    predicted = (a * b[:, None]).sum(axis=0)
    residual = y - predicted
    with np.errstate(invalid="ignore", divide="ignore"):
        change = (da * b[:, None]).sum(axis=0)
        across = _right_side(a, weights * change)
        response = _solve(moments, across)
        stiffness = (weights * change * change).sum(axis=0) - (across * response).sum(axis=0)
        pull = (weights * change * residual).sum(axis=0) - (response * _right_side(a, weights * residual)).sum(axis=0)
        squares = np.where(weights > 0, weights * residual * residual, 0.0).sum(axis=0)
    return NearFit(
        scaled=b.T,
        moments=moments.T,
        energy=_cost(y, usable, a, b, scale, loss),
        pull=pull / scale**2,
        stiffness=np.maximum(stiffness, 0.0) / scale**2,
        squares=squares,
        power=(weights * y * y).sum(axis=0),
        deviation=_median_magnitude(residual, lit),
        usable=usable.sum(axis=0),
        used=((weights > 0) & (lit | (loss == TUKEY))).sum(axis=0),
    )


def _cost(y: FloatArray, usable: BoolArray, a: FloatArray, b: FloatArray, scale: FloatArray, loss: int) -> FloatArray:
    """Return the sum of the loss over usable observations; a fit that is no number predicts darkness."""
    predicted = (a * b[:, None]).sum(axis=0)
    with np.errstate(over="ignore"):
        square = (np.where(usable, y - np.where(predicted > 0, predicted, 0.0), 0.0) / scale) ** 2
    if loss == GEMAN_MCCLURE:
        return np.asarray((1.0 - 1.0 / (1.0 + square)).sum(axis=0))
    return np.asarray((1.0 - np.maximum(0.0, 1.0 - square / REACH**2) ** 3).sum(axis=0))


def _median_magnitude(residual: FloatArray, lit: BoolArray) -> FloatArray:
    """Return the (lower) median of the lit residuals' magnitudes."""
    count = lit.sum(axis=0)
    ordered = np.sort(np.where(lit, np.abs(residual), np.inf), axis=0)
    middle = ordered[np.maximum(count - 1, 0) // 2, np.arange(residual.shape[1])]
    return np.where(count > 0, middle, np.nan)
