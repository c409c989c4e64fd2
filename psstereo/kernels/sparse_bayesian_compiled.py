"""Sparse Bayesian regression, compiled: one pixel at a time, all its rounds in registers and the nearest cache."""

import math
from typing import Any

import numba
import numpy as np

from psstereo.kernels.sparse_bayesian import (
    BARE,
    DARK,
    DEVIATION,
    ENOUGH,
    FAILED,
    HOLD,
    IGNORED,
    LEAST_SLOPE,
    QUANTILE,
    SETTLED,
    SINGULAR,
    TRIM,
    UNSETTLED,
)

__all__ = ["iterate"]

# NaN must be seen, so the flags that deny it stay off; sums over lights may be taken in any order.
_compile = numba.njit(nogil=True, cache=True, fastmath={"reassoc", "contract", "nsz"}, error_model="numpy")


@_compile
def _select(a: Any, n: int, k: int) -> float:
    """Return the k-th smallest of the first n entries; reorders them."""
    low, high = 0, n - 1
    while low < high:
        pivot = a[(low + high) >> 1]
        i, j = low, high
        while i <= j:
            while a[i] < pivot:
                i += 1
            while a[j] > pivot:
                j -= 1
            if i <= j:
                a[i], a[j] = a[j], a[i]
                i += 1
                j -= 1
        if k <= j:
            high = j
        elif k >= i:
            low = i
        else:
            break
    return a[k]


@_compile
def _solve(w: Any, r: Any, q: Any, mo: Any, step: Any, s: Any) -> bool:
    """Put the step Σ w r q → A⁻¹ and A⁻¹ where they belong; leave both alone and return False if A is singular."""
    a11 = a12 = a22 = a13 = a23 = a33 = b1 = b2 = b3 = 0.0
    for i in range(len(w)):
        c = w[i]
        d = c * r[i]
        a11 += c * mo[0, i]
        a12 += c * mo[1, i]
        a22 += c * mo[2, i]
        a13 += c * mo[3, i]
        a23 += c * mo[4, i]
        a33 += c * mo[5, i]
        b1 += d * q[0, i]
        b2 += d * q[1, i]
        b3 += d * q[2, i]
    tiny = SINGULAR * (a11 + a22 + a33)
    if not a11 > tiny:
        return False
    l11 = math.sqrt(a11)
    l21, l31 = a12 / l11, a13 / l11
    d2 = a22 - l21 * l21
    if not d2 > tiny:
        return False
    l22 = math.sqrt(d2)
    l32 = (a23 - l31 * l21) / l22
    d3 = a33 - l31 * l31 - l32 * l32
    if not d3 > tiny:
        return False
    l33 = math.sqrt(d3)
    g11, g22, g33 = 1 / l11, 1 / l22, 1 / l33
    g21, g32, g31 = -l21 * g11 * g22, -l32 * g22 * g33, (l21 * l32 * g22 - l31) * g11 * g33
    s[0] = g11 * g11 + g21 * g21 + g31 * g31
    s[1] = g21 * g22 + g31 * g32
    s[2] = g22 * g22 + g32 * g32
    s[3] = g31 * g33
    s[4] = g32 * g33
    s[5] = g33 * g33
    step[0] = s[0] * b1 + s[1] * b2 + s[3] * b3
    step[1] = s[1] * b1 + s[2] * b2 + s[4] * b3
    step[2] = s[3] * b1 + s[4] * b2 + s[5] * b3
    return True


@_compile
def _length(t: Any, x: Any) -> float:
    """Return |R⁻¹ x|."""
    a = t[0, 0] * x[0] + t[0, 1] * x[1] + t[0, 2] * x[2]
    b = t[1, 0] * x[0] + t[1, 1] * x[1] + t[1, 2] * x[2]
    c = t[2, 0] * x[0] + t[2, 1] * x[1] + t[2, 2] * x[2]
    return math.sqrt(a * a + b * b + c * c)


@_compile
def _weigh(w: Any, r: Any, lit: Any, base: Any, mo: Any, s: Any, lam: float, plain: bool) -> None:
    """Put the weights 1 / v into w."""
    s0, s1, s2, s3, s4, s5 = s[0], 2 * s[1], s[2], 2 * s[3], 2 * s[4], s[5]
    if plain:
        for i in range(len(w)):
            w[i] = lit[i] * base[i] / lam
        return
    for i in range(len(w)):
        leverage = s0 * mo[0, i] + s1 * mo[1, i] + s2 * mo[2, i] + s3 * mo[3, i] + s4 * mo[4, i] + s5 * mo[5, i]
        w[i] = lit[i] * base[i] / max(lam, base[i] * (r[i] * r[i] + leverage))


@_compile
def _residuals(r: Any, y: Any, q: Any, x: Any) -> None:
    x0, x1, x2 = x[0], x[1], x[2]
    for i in range(len(r)):
        r[i] = y[i] - (q[0, i] * x0 + q[1, i] * x1 + q[2, i] * x2)


@_compile
def _start(
    y: Any, base: Any, first: Any, w: Any, q: Any, mo: Any, step: Any, s: Any, sorting: Any, shadow: bool
) -> bool:
    """Fit the middle ranks; all lit values where these do not span space; all above zero where those do not."""
    m = len(y)
    n = 0
    for i in range(m):
        if first[i] > 0:
            sorting[n] = y[i]
            n += 1
    low = high = math.inf
    if n > 0:
        low = _select(sorting, n, int(math.floor(TRIM[0] * (n - 1))))
        high = _select(sorting, n, int(math.ceil(TRIM[1] * (n - 1))))
    for i in range(m):
        w[i] = base[i] if first[i] > 0 and low <= y[i] <= high else 0.0
    if _solve(w, y, q, mo, step, s):
        return True
    for i in range(m):
        w[i] = base[i] * first[i]
    if _solve(w, y, q, mo, step, s):
        return True
    for i in range(m):
        first[i] = 1.0 if base[i] > 0 and (y[i] > 0 or not shadow) else 0.0
        w[i] = base[i] * first[i]
    return bool(_solve(w, y, q, mo, step, s))


@_compile
def _gate(y: Any, r: Any, base: Any, lit: Any, first: Any, threshold: float) -> bool:
    """Put what the model says is lit into `lit`; return False, and take the first choice, where that is too little."""
    n = 0.0
    for i in range(len(y)):
        g = 1.0 if base[i] > 0 and y[i] - r[i] > threshold else 0.0
        lit[i] = g
        n += g
    if n >= 3:
        return True
    lit[:] = first
    return False


@_compile
def _estimate(r: Any, base: Any, lit: Any, sorting: Any, floor: float) -> float:
    """Return the variance of which the residuals' lower quantile speaks."""
    n = 0
    for i in range(len(r)):
        if lit[i] > 0:
            sorting[n] = abs(r[i]) * math.sqrt(base[i])
            n += 1
    if n < ENOUGH:
        return floor
    at = _select(sorting, n, int(QUANTILE * (n - 3)) + 2) / DEVIATION
    return max(floor, at * at)


@_compile
def _differ(a: Any, b: Any) -> bool:
    for i in range(len(a)):
        if a[i] != b[i]:
            return True
    return False


@_compile
def _spread(
    r: Any, w: Any, base: Any, lit: Any, mo: Any, s: Any, lam: float, plain: bool, shares: Any
) -> tuple[float, int]:
    """Return the variance of the noise as it reaches x and how many observations count, and put down their shares."""
    total = inner = slope = 0.0
    counted = 0
    s0, s1, s2, s3, s4, s5 = s[0], 2 * s[1], s[2], 2 * s[3], 2 * s[4], s[5]
    for i in range(len(r)):
        if base[i] <= 0:
            shares[i] = math.nan
            continue
        if lit[i] <= 0:
            shares[i] = -2.0 if r[i] < 0 else 2.0
            continue
        per = base[i] / lam
        share = w[i] / per
        t2 = r[i] * r[i] * per
        if share < 1 and not plain:
            leverage = s0 * mo[0, i] + s1 * mo[1, i] + s2 * mo[2, i] + s3 * mo[3, i] + s4 * mo[4, i] + s5 * mo[5, i]
            slope += share * share * (leverage * per - t2)
        else:
            slope += share
        total += share
        inner += share * share * t2
        if share >= IGNORED:
            counted += 1
        shares[i] = -share if r[i] < 0 else share
    keeping = max(slope / total, LEAST_SLOPE) if total > 0 else LEAST_SLOPE
    spread = lam * inner / (keeping * keeping * (total - 3)) if total > 3 else math.nan
    return spread, counted


@_compile
def iterate(
    values: Any,
    weights: Any,
    q: Any,
    moments: Any,
    r_inverse: Any,
    shadow: bool,
    noise: float,
    floor: float,
    rounds: int,
    tolerance: float,
) -> Any:
    """Fit pixels; see :func:`psstereo.kernels.sparse_bayesian.iterate`."""
    p, m = values.shape
    out_x, out_a, out_spread = np.full((p, 3), np.nan), np.zeros((p, 6)), np.full(p, np.nan)
    counts, shares = np.zeros((p, 5), np.int64), np.full((p, m), np.nan)
    y, base, lit, first = np.zeros(m), np.zeros(m), np.zeros(m), np.zeros(m)
    w, r, sorting = np.zeros(m), np.zeros(m), np.zeros(m)
    step, s, x = np.zeros(3), np.zeros(6), np.zeros(3)
    for j in range(p):
        peak = top = 0.0
        available = 0
        for i in range(m):
            b = weights[j, i] if weights.size else 1.0
            v = values[j, i]
            good = math.isfinite(v) and b > 0
            base[i] = b if good else 0.0
            y[i] = v if good else 0.0
            available += good
            peak = max(peak, y[i])
            top = max(top, base[i])
        counts[j, 2] = available
        scale, heaviest = (peak if peak > 0 else 1.0), (top if top > 0 else 1.0)
        for i in range(m):
            y[i] /= scale
            base[i] /= heaviest
            first[i] = 1.0 if base[i] > 0 and (y[i] > DARK or not shadow) else 0.0
        lit[:] = first
        lam = noise * noise if noise >= 0 else floor * floor
        s[:] = 0.0
        x[:] = 0.0
        outcome, taken = UNSETTLED, 0
        if peak <= 0:
            outcome = BARE
        elif not _start(y, base, first, w, q, moments, step, s, sorting, shadow):
            outcome = FAILED
        else:
            x[:] = step
        s[:] = 0.0
        if outcome == UNSETTLED:
            lit[:] = first
        held = False
        w[:] = 0.0
        _residuals(r, y, q, x)
        while outcome == UNSETTLED and taken < rounds:
            taken += 1
            if taken <= HOLD:
                if shadow and not held:
                    held = not _gate(y, r, base, lit, first, DARK * _length(r_inverse, x))
                elif shadow:
                    lit[:] = first
                if noise < 0:
                    lam = _estimate(r, base, lit, sorting, floor * floor)
            _weigh(w, r, lit, base, moments, s, lam, lit.sum() < ENOUGH)
            if not _solve(w, r, q, moments, step, s):
                if not _differ(lit, first):
                    continue
                lit[:] = first
                held = True
                for i in range(m):
                    w[i] = lit[i] * base[i]
                if not _solve(w, r, q, moments, step, s):
                    continue
                s[:] = 0.0
            x += step
            _residuals(r, y, q, x)
            if _length(r_inverse, step) <= tolerance * _length(r_inverse, x):
                outcome = SETTLED
        few = lit.sum() < ENOUGH
        _weigh(w, r, lit, base, moments, s, lam, few)
        for k in range(6):
            a = 0.0
            for i in range(m):
                a += w[i] * moments[k, i]
            out_a[j, k] = lam * a
        spread, counted = _spread(r, w, base, lit, moments, s, lam, few, shares[j])
        counts[j, 0], counts[j, 1] = outcome, taken
        counts[j, 3], counts[j, 4] = int(lit.sum()), counted
        if outcome < FAILED:
            out_x[j] = x * peak
            out_spread[j] = spread * peak * peak
    return out_x, out_a, out_spread, counts, shares
