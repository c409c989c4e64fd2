"""Bivariate inverse regression, compiled: one pixel at a time, only the observations that were chosen."""

import math
from typing import Any

import numba
import numpy as np

from psstereo.kernels.bipolynomial import (
    DEVIATION,
    FAILED,
    FLOOR,
    JITTER,
    LEAST_SLOPE,
    NOTHING,
    SETTLED,
    SHORT,
    TUKEY,
    UNSETTLED,
    Fit,
)
from psstereo.kernels.bipolynomial_compiled import choose, factor, relative, select, solve_factored, tangents
from psstereo.kernels.bivariate import CLEARLY, WRONG_SIGN

__all__ = ["fit_pixels", "programme"]

# NaN must be seen, so the flags that deny it stay off; sums over lights may be taken in any order.
_compile = numba.njit(nogil=True, cache=True, fastmath={"reassoc", "contract", "nsz"}, error_model="numpy")


@_compile
def _curves(z: float, order: int, out: Any) -> None:
    """Put the cumulative Bernstein polynomials 1 … order at z into the first entries of out."""
    out[: order + 1] = 0.0
    out[0] = 1.0
    for _ in range(order):
        for k in range(order, 0, -1):
            out[k] = (1 - z) * out[k] + z * out[k - 1]
        out[0] *= 1 - z
    total = 0.0
    for k in range(order, 0, -1):
        total += out[k]
        out[k] = total
    for k in range(order):
        out[k] = out[k + 1]


@_compile
def programme(m: Any, b: Any, c: Any, d: Any, free: Any, a: Any, u: Any, v: Any, index: Any) -> bool:
    """Solve the quadratic programme of one pixel in place; see :func:`psstereo.kernels.bivariate.programme`."""
    size = len(d)
    for _ in range(4 * size):
        n = 0
        for i in range(size):
            if free[i]:
                index[n] = i
                n += 1
        for i in range(n):
            u[i], v[i] = b[index[i]], c[index[i]]
            for k in range(i + 1):
                a[i, k] = m[index[i], index[k]]
        if not factor(a, n):
            return False
        solve_factored(a, u, n)
        solve_factored(a, v, n)
        cu = cv = 0.0
        for i in range(n):
            cu += c[index[i]] * u[i]
            cv += c[index[i]] * v[i]
        multiplier = (1 - cu) / cv
        step, block = 1.0, -1
        for i in range(n):
            target, at = u[i] + multiplier * v[i], d[index[i]]
            if target < 0 and at / (at - target) < step:
                step, block = at / (at - target), index[i]
        for i in range(n):
            d[index[i]] += step * (u[i] + multiplier * v[i] - d[index[i]])
        if block >= 0:
            d[block] = 0.0
            free[block] = False
            continue
        worst, which = WRONG_SIGN, -1
        for i in range(size):
            if not free[i]:
                gradient = -b[i] - multiplier * c[i]
                for k in range(size):
                    gradient += m[i, k] * d[k]
                if gradient / m[i, i] < worst:
                    worst, which = gradient / m[i, i], i
        if which < 0:
            return True
        free[which] = True
    return False


@_compile
def _sums(w: Any, at: Any, count: int, directions: Any, basis: Any, a: Any, g: Any, m: Any) -> None:
    """Put Σ w l lᵀ, Σ w l Bᵀ and Σ w B Bᵀ into a, g and the lower half of m."""
    size = basis.shape[1]
    a[:] = 0.0
    g[:] = 0.0
    m[:] = 0.0
    for i in range(count):
        o = at[i]
        x, y, z = w[i] * directions[o, 0], w[i] * directions[o, 1], w[i] * directions[o, 2]
        a[0, 0] += x * directions[o, 0]
        a[1, 0] += x * directions[o, 1]
        a[1, 1] += y * directions[o, 1]
        a[2, 0] += x * directions[o, 2]
        a[2, 1] += y * directions[o, 2]
        a[2, 2] += z * directions[o, 2]
        for k in range(size):
            e = basis[i, k]
            g[k, 0] += x * e
            g[k, 1] += y * e
            g[k, 2] += z * e
            e *= w[i]
            for h in range(k + 1):
                m[k, h] += e * basis[i, h]


@_compile
def _eliminate(a: Any, g: Any, x: Any, m: Any) -> bool:
    """Take the normal out of m, whose both halves are filled; x becomes A⁻¹ G, a row an increment."""
    tiny = 1e-14 * (a[0, 0] + a[1, 1] + a[2, 2]) + 1e-300
    for e in range(3):
        a[e, e] += tiny
    if not factor(a, 3):
        return False
    size = len(m)
    for k in range(size):
        x[k] = g[k]
        solve_factored(a, x[k], 3)
    for k in range(size):
        for h in range(k + 1):
            m[k, h] -= x[k, 0] * g[h, 0] + x[k, 1] * g[h, 1] + x[k, 2] * g[h, 2]
            m[h, k] = m[k, h]
    return True


@_compile
def _residuals(n: Any, d: Any, at: Any, count: int, directions: Any, basis: Any, r: Any) -> None:
    for i in range(count):
        o = at[i]
        value = n[0] * directions[o, 0] + n[1] * directions[o, 1] + n[2] * directions[o, 2]
        for k in range(len(d)):
            value -= basis[i, k] * d[k]
        r[i] = value


@_compile
def _scale(r: Any, u: Any, count: int, sorting: Any, order: int) -> float:
    for i in range(count):
        sorting[i] = abs(r[i]) * math.sqrt(u[i])
    # The fit makes residuals small; about half of the increments are bound.
    rank = min((count + order + 3) / 2, count - 1.0)
    return max(FLOOR, select(sorting, count, int(rank)) * DEVIATION)


@_compile
def _weigh(r: Any, u: Any, count: int, scale: float, w: Any) -> None:
    for i in range(count):
        z2 = r[i] * r[i] * u[i] / (TUKEY * scale) ** 2
        w[i] = u[i] * (1 - z2) ** 2 if z2 < 1 else 0.0


@_compile
def _length(n: Any) -> float:
    return math.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])


@_compile
def _change(n: Any, n2: Any) -> float:
    """Return how far a direction moves."""
    one, two, total = _length(n), _length(n2), 0.0
    for e in range(3):
        total += (n2[e] / two - n[e] / one) ** 2
    return math.sqrt(total)


@_compile
def _score(n: Any, at: Any, count: int, directions: Any, y: Any, w: Any) -> float:
    """Return how far n·l is from a multiple of brightness, as the squared sine of an angle."""
    product = first = second = 0.0
    for i in range(count):
        o = at[i]
        s = n[0] * directions[o, 0] + n[1] * directions[o, 1] + n[2] * directions[o, 2]
        product += w[i] * s * y[o]
        first += w[i] * y[o] * y[o]
        second += w[i] * s * s
    score = 1 - product * product / (first * second)
    return score if math.isfinite(score) else math.inf


@_compile
def _loss(r: Any, u: Any, count: int, scale: float) -> float:
    """Return the sum of Tukey's loss."""
    total = 0.0
    for i in range(count):
        z2 = r[i] * r[i] * u[i] / (TUKEY * scale) ** 2
        total += 1 - (1 - z2) ** 3 if z2 < 1 else 1.0
    return total * scale * scale


@_compile
def _spread(
    n: Any, r: Any, u: Any, at: Any, count: int, directions: Any, basis: Any, c: Any, free: Any, tie: float,
    total: float, scale: float, t: Any, work: Any, out: Any, told: Any,
) -> None:  # fmt: skip
    """Put the covariance along the tangents into `out` and the signed weights into `told`; see the reference."""
    size = basis.shape[1] + 3
    p, inverse, along, row = work
    inner = slope = 0.0
    p[:] = 0.0
    for i in range(count):
        o = at[i]
        z2 = r[i] * r[i] * u[i] / (TUKEY * scale) ** 2
        g = (1 - z2) ** 2 if z2 < 1 else 0.0
        inner += g * g * r[i] * r[i] * u[i]
        slope += (1 - z2) * (1 - 5 * z2) if z2 < 1 else 0.0
        told[o] = -g if r[i] > 0 else g
        for k in range(3):
            row[k] = directions[o, k]
        for k in range(3, size):
            row[k] = -basis[i, k - 3] if free[k - 3] else 0.0
        for k in range(size):
            for h in range(k + 1):
                p[k, h] += u[i] * row[k] * row[h]
    freedom = count - 2.0
    for k in range(3):
        p[k, k] += JITTER * total
        along[k] = 0.0
    for k in range(3, size):
        p[k, k] += tie
        along[k] = 0.0
        if free[k - 3]:
            freedom -= 1
            along[k] = c[k - 3]
        else:
            p[k, k] += 1.0
    if not factor(p, size):
        return
    for k in range(size):
        row[k] = along[k]
    solve_factored(p, along, size)
    across = 0.0
    for k in range(size):
        across += along[k] * row[k]
    for k in range(size):
        inverse[k] = 0.0
        inverse[k, k] = 1.0
        solve_factored(p, inverse[k], size)
        for h in range(size):
            inverse[k, h] -= along[k] * along[h] / across
    for k in range(3, size):
        if free[k - 3]:
            freedom += tie * inverse[k, k]
    size_of_n = _length(n)
    keeping = slope / count
    good = freedom > 0 and keeping > LEAST_SLOPE
    for e in range(3):
        f, g2 = (0, 0) if e == 0 else ((0, 1) if e == 1 else (1, 1))
        value = 0.0
        for k in range(3):
            for h in range(3):
                value += t[f, k] * inverse[k, h] * t[g2, h]
        out[e] = value / (size_of_n * size_of_n) * (inner / freedom / (keeping * keeping)) if good else math.nan


@_compile
def fit_pixels(values: Any, weights: Any, start: Any, directions: Any, heights: Any, settings: Any) -> Any:
    """Fit pixels; see :func:`psstereo.kernels.bivariate.fit_pixels`."""
    order, share, least, dark, ridge, noise_ridge, hold, rounds, tolerance = settings
    p, m = values.shape
    size = 2 * order
    normal, brightness, spread = np.full((p, 3), np.nan), np.full(p, np.nan), np.full((p, 3), np.nan)
    outcome, told = np.full(p, SHORT), np.full((p, m), np.nan)
    y, base, s, sorting = np.zeros(m), np.zeros(m), np.zeros(m), np.zeros(m)
    at, w, u, r = np.zeros(m, np.int64), np.zeros(m), np.zeros(m), np.zeros(m)
    basis, curve = np.zeros((m, size)), np.zeros(order + 1)
    h, g, a, x = np.zeros((size, size)), np.zeros((size, 3)), np.zeros((3, 3)), np.zeros((size, 3))
    c, d, lambert, b = np.zeros(size), np.zeros(size), np.zeros(size), np.zeros(size)
    free, index = np.zeros(size, np.bool_), np.zeros(size, np.int64)
    ha, hu, hv = np.zeros((size, size)), np.zeros(size), np.zeros(size)
    n, n2, unit, t = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros((2, 3))
    work = (np.zeros((size + 3, size + 3)), np.zeros((size + 3, size + 3)), np.zeros(size + 3), np.zeros(size + 3))
    for q in range(p):
        rho = _length(start[q])
        if not (rho > 0 and rho < math.inf):
            continue
        unit[:] = start[q] / rho
        for i in range(m):
            v = values[q, i] / rho
            k = weights[q, i] if weights.size else 1.0
            good = math.isfinite(v) and k > 0
            y[i] = v if good else 0.0
            base[i] = k if good else 0.0
            s[i] = unit[0] * directions[i, 0] + unit[1] * directions[i, 1] + unit[2] * directions[i, 2]
        count = choose(y, s, base, sorting, share, least, dark, at, told[q])
        if count == 0:
            continue
        total = relative(u, base, at, count)
        top = 0.0
        for i in range(count):
            top = max(top, y[at[i]])
        lambert[:order] = top / order
        lambert[order:] = 0.0
        c[:order] = 1 / top
        c[order:] = 0.5 / top
        best = first = math.inf
        for turn in range(2):
            for i in range(count):
                o = at[i]
                _curves(y[o] / top, order, curve)
                height = heights[o] if turn == 0 else 1 - heights[o]
                for k in range(order):
                    basis[i, k] = curve[k]
                    basis[i, order + k] = curve[k] * height
            d[:] = lambert
            free[:] = True
            n[:] = unit
            scale, tie, state = FLOOR, 0.0, UNSETTLED
            for k in range(rounds):
                _residuals(n, d, at, count, directions, basis, r)
                if k < hold:
                    scale = _scale(r, u, count, sorting, order)
                    tie = (ridge + noise_ridge * scale * scale + JITTER) * total
                _weigh(r, u, count, scale, w)
                _sums(w, at, count, directions, basis, a, g, h)
                state = FAILED
                if not _eliminate(a, g, x, h):
                    break
                for e in range(size):
                    h[e, e] += tie
                    b[e] = tie * lambert[e]
                if not programme(h, b, c, d, free, ha, hu, hv, index):
                    break
                n2[:] = 0.0
                for e in range(size):
                    n2 += x[e] * d[e]
                change = _change(n, n2)
                if not math.isfinite(change):
                    break
                n[:] = n2
                state = UNSETTLED
                if k + 1 >= hold and change <= tolerance:
                    state = SETTLED
                    break
            _residuals(n, d, at, count, directions, basis, r)
            _weigh(r, u, count, scale, w)
            score, loss = math.inf, math.inf
            if state != FAILED:
                score = _score(n, at, count, directions, y, w)
                loss = _loss(r, u, count, scale) + NOTHING * total
            if turn == 0:
                first = loss
            elif loss < CLEARLY * first:
                score = -1.0
            elif first < CLEARLY * loss:
                score = math.inf
            if not (score < best or turn == 0):
                continue
            best = score
            size_of_n = _length(n)
            for e in range(3):
                n2[e] = n[e] / size_of_n
            tangents(n2, t)
            _spread(
                n, r, u, at, count, directions, basis, c, free, tie, total, scale, t, work, spread[q], told[q]
            )  # fmt: skip
            normal[q], brightness[q], outcome[q] = n2, rho * size_of_n, state
    return Fit(normal, brightness, spread, outcome, told)
