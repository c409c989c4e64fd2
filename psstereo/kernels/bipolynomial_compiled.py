"""Bi-polynomial fits, compiled: one pixel at a time, only the observations that were chosen."""

import math
from typing import Any

import numba
import numpy as np

from psstereo.kernels.bipolynomial import (
    CLOSE,
    DEVIATION,
    FAILED,
    FIRST_DAMPING,
    FLOOR,
    JITTER,
    LEAST_SLOPE,
    LONGEST,
    NOTHING,
    SETTLED,
    SHORT,
    TUKEY,
    UNSETTLED,
    Fit,
)

__all__ = ["choose", "factor", "fit_pixels", "relative", "select", "solve_factored", "tangents"]

# NaN must be seen, so the flags that deny it stay off; sums over lights may be taken in any order.
_compile = numba.njit(nogil=True, cache=True, fastmath={"reassoc", "contract", "nsz"}, error_model="numpy")


@_compile
def select(a: Any, n: int, k: int) -> float:
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
def factor(a: Any, n: int) -> bool:
    """Put Cholesky's factor into the lower half of the first n rows of a; False if a pivot is not positive."""
    for j in range(n):
        d = a[j, j]
        for k in range(j):
            d -= a[j, k] * a[j, k]
        if not d > 0:
            return False
        d = math.sqrt(d)
        a[j, j] = d
        for i in range(j + 1, n):
            s = a[i, j]
            for k in range(j):
                s -= a[i, k] * a[j, k]
            a[i, j] = s / d
    return True


@_compile
def solve_factored(a: Any, b: Any, n: int) -> None:
    """Solve A x = b in place, a holding the factor."""
    for i in range(n):
        s = b[i]
        for k in range(i):
            s -= a[i, k] * b[k]
        b[i] = s / a[i, i]
    for i in range(n - 1, -1, -1):
        s = b[i]
        for k in range(i + 1, n):
            s -= a[k, i] * b[k]
        b[i] = s / a[i, i]


@_compile
def tangents(n: Any, t: Any) -> None:
    """Put two unit vectors across n into t."""
    small = 0
    if abs(n[1]) < abs(n[small]):
        small = 1
    if abs(n[2]) < abs(n[small]):
        small = 2
    for k in range(3):
        t[0, k] = (1.0 if k == small else 0.0) - n[small] * n[k]
    size = math.sqrt(t[0, 0] ** 2 + t[0, 1] ** 2 + t[0, 2] ** 2)
    for k in range(3):
        t[0, k] /= size
    t[1, 0] = n[1] * t[0, 2] - n[2] * t[0, 1]
    t[1, 1] = n[2] * t[0, 0] - n[0] * t[0, 2]
    t[1, 2] = n[0] * t[0, 1] - n[1] * t[0, 0]


@_compile
def _rows(n: Any, c: Any, t: Any, at: Any, count: int, geo: Any, powers: Any, j: Any, y: Any, r: Any) -> None:
    """Put derivatives and residuals of the chosen observations into j and r."""
    degree = powers.shape[1] - 1
    for i in range(count):
        o = at[i]
        s = n[0] * geo[o, 0] + n[1] * geo[o, 1] + n[2] * geo[o, 2]
        x = n[0] * geo[o, 3] + n[1] * geo[o, 4] + n[2] * geo[o, 5] - geo[o, 6]
        value = slope = 0.0
        k = 0
        xp, xq = 1.0, 0.0
        for a in range(degree + 1):
            for b in range(degree + 1):
                term = xp * powers[o, b]
                value += c[k] * term
                slope += c[k] * a * xq * powers[o, b]
                j[i, 2 + k] = s * term
                k += 1
            xq = xp
            xp *= x
        for e in range(2):
            d = t[e, 0] * geo[o, 0] + t[e, 1] * geo[o, 1] + t[e, 2] * geo[o, 2]
            h = t[e, 0] * geo[o, 3] + t[e, 1] * geo[o, 4] + t[e, 2] * geo[o, 5]
            j[i, e] = d * value + s * slope * h
        r[i] = y[o] - s * value


@_compile
def _energy(n: Any, c: Any, at: Any, count: int, geo: Any, powers: Any, y: Any, w: Any, tie: Any) -> float:
    degree = powers.shape[1] - 1
    total = 0.0
    for i in range(count):
        o = at[i]
        s = n[0] * geo[o, 0] + n[1] * geo[o, 1] + n[2] * geo[o, 2]
        x = n[0] * geo[o, 3] + n[1] * geo[o, 4] + n[2] * geo[o, 5] - geo[o, 6]
        value = 0.0
        k = 0
        xp = 1.0
        for _ in range(degree + 1):
            for b in range(degree + 1):
                value += c[k] * xp * powers[o, b]
                k += 1
            xp *= x
        d = y[o] - s * value
        total += w[i] * d * d
    for k in range(len(c)):
        total += tie[k] * c[k] * c[k]
    return total


@_compile
def _normal_matrix(j: Any, r: Any, w: Any, count: int, c: Any, tie: Any, a: Any, b: Any) -> None:
    n = j.shape[1]
    a[:] = 0.0
    b[:] = 0.0
    for i in range(count):
        for k in range(n):
            wk = w[i] * j[i, k]
            b[k] += wk * r[i]
            for e in range(k + 1):
                a[k, e] += wk * j[i, e]
    for k in range(2, n):
        a[k, k] += tie[k - 2]
        b[k] -= tie[k - 2] * c[k - 2]


@_compile
def choose(y: Any, s: Any, base: Any, sorting: Any, share: float, least: int, dark: float, at: Any, told: Any) -> int:
    """Put the darkest lit observations into `at` and return how many; too few to fit gives 0."""
    n = 0
    for i in range(len(y)):
        if base[i] > 0:
            told[i] = 3.0
            if s[i] > dark and y[i] > dark:
                told[i] = 2.0
                sorting[n] = y[i]
                n += 1
    if n < least:
        return 0
    rank = max(math.ceil(share * (n - 1)), least - 1)
    top = select(sorting, n, int(rank))
    count = 0
    for i in range(len(y)):
        if told[i] == 2.0 and y[i] <= top:
            at[count] = i
            count += 1
    return count


@_compile
def _scale(r: Any, u: Any, count: int, sorting: Any, unknowns: int) -> float:
    for i in range(count):
        sorting[i] = abs(r[i]) * math.sqrt(u[i])
    # The fit makes as many residuals small as it has unknowns.
    rank = min((count + unknowns) / 2, count - 1.0)
    return max(FLOOR, select(sorting, count, int(rank)) * DEVIATION)


@_compile
def relative(u: Any, base: Any, at: Any, count: int) -> float:
    """Put the weights of the chosen observations, the greatest 1, into u and return their sum."""
    top = total = 0.0
    for i in range(count):
        top = max(top, base[at[i]])
    for i in range(count):
        u[i] = base[at[i]] / top
        total += u[i]
    return total


@_compile
def _turned(n: Any, b: Any, t: Any, cut: float, n2: Any) -> None:
    norm = 0.0
    for e in range(3):
        n2[e] = n[e] + cut * (b[0] * t[0, e] + b[1] * t[1, e])
        norm += n2[e] * n2[e]
    n2 /= math.sqrt(norm)


@_compile
def _spread(
    j: Any, r: Any, u: Any, count: int, c: Any, tie: Any, scale: float, total: float, at: Any, told: Any,
    save: Any, b: Any, out: Any,
) -> None:  # fmt: skip
    """Put the covariance along the tangents into `out` and the signed weights into `told`; see the reference."""
    size = j.shape[1]
    inner = slope = 0.0
    for i in range(count):
        z2 = r[i] * r[i] * u[i] / (TUKEY * scale) ** 2
        g = (1 - z2) ** 2 if z2 < 1 else 0.0
        inner += g * g * r[i] * r[i] * u[i]
        slope += (1 - z2) * (1 - 5 * z2) if z2 < 1 else 0.0
        told[at[i]] = -g if r[i] < 0 else g
    _normal_matrix(j, r, u, count, c, tie, save, b)
    for k in range(size):
        save[k, k] += JITTER * total
    if not factor(save, size):
        return
    freedom = float(count - size)
    for e in range(size):
        b[:] = 0.0
        b[e] = 1.0
        solve_factored(save, b, size)
        if e == 0:
            out[0], out[1] = b[0], b[1]
        elif e == 1:
            out[2] = b[1]
        else:
            freedom += tie[e - 2] * b[e]
    keeping = slope / count
    if freedom > 0 and keeping > LEAST_SLOPE:
        out *= inner / freedom / (keeping * keeping)
    else:
        out[:] = math.nan


@_compile
def fit_pixels(values: Any, weights: Any, start: Any, geometry: Any, powers: Any, settings: Any) -> Any:
    """Fit pixels; see :func:`psstereo.kernels.bipolynomial.fit_pixels`."""
    share, least, dark, ridge, noise_ridge, hold, rounds, tolerance = settings
    p, m = values.shape
    terms = powers.shape[1] ** 2
    size = terms + 2
    normal, brightness, spread = np.full((p, 3), np.nan), np.full(p, np.nan), np.full((p, 3), np.nan)
    outcome, told = np.full(p, SHORT), np.full((p, m), np.nan)
    y, base, s, sorting = np.zeros(m), np.zeros(m), np.zeros(m), np.zeros(m)
    at, w, u, r = np.zeros(m, np.int64), np.zeros(m), np.zeros(m), np.zeros(m)
    j, a, save, b = np.zeros((m, size)), np.zeros((size, size)), np.zeros((size, size)), np.zeros(size)
    n, c, t, n2, c2, tie = np.zeros(3), np.zeros(terms), np.zeros((2, 3)), np.zeros(3), np.zeros(terms), np.zeros(terms)
    for q in range(p):
        rho = math.sqrt(start[q, 0] ** 2 + start[q, 1] ** 2 + start[q, 2] ** 2)
        if not (rho > 0 and rho < math.inf):
            continue
        n[:] = start[q] / rho
        for i in range(m):
            v = values[q, i] / rho
            g = weights[q, i] if weights.size else 1.0
            good = math.isfinite(v) and g > 0
            y[i] = v if good else 0.0
            base[i] = g if good else 0.0
            s[i] = n[0] * geometry[i, 0] + n[1] * geometry[i, 1] + n[2] * geometry[i, 2]
        count = choose(y, s, base, sorting, share, least, dark, at, told[q])
        if count == 0:
            continue
        total = relative(u, base, at, count)
        c[:] = 0.0
        c[0] = 1.0
        tie[:] = 0.0
        tangents(n, t)
        _rows(n, c, t, at, count, geometry, powers, j, y, r)
        damping, scale, state = FIRST_DAMPING, FLOOR, UNSETTLED
        for k in range(rounds):
            if k < hold:
                scale = _scale(r, u, count, sorting, size)
                tie[1:] = (ridge + noise_ridge * scale * scale) * total
            for i in range(count):
                z2 = r[i] * r[i] * u[i] / (TUKEY * scale) ** 2
                w[i] = u[i] * (1 - z2) ** 2 if z2 < 1 else 0.0
            energy = _energy(n, c, at, count, geometry, powers, y, w, tie)
            _normal_matrix(j, r, w, count, c, tie, a, b)
            for e in range(size):
                a[e, e] += damping * a[e, e] + JITTER * total
            better = factor(a, size)
            if better:
                solve_factored(a, b, size)
            length = math.sqrt(b[0] * b[0] + b[1] * b[1])
            if better:
                _turned(n, b, t, min(1.0, LONGEST / max(length, 1e-300)), n2)
                c2[:] = c + b[2:]
                better = _energy(n2, c2, at, count, geometry, powers, y, w, tie) <= energy * CLOSE + NOTHING * total
            if not better:
                damping = 10 * damping + FIRST_DAMPING
                continue
            damping *= 0.1
            n[:] = n2
            c[:] = c2
            tangents(n, t)
            _rows(n, c, t, at, count, geometry, powers, j, y, r)
            if k + 1 >= hold and length <= tolerance:
                state = SETTLED
                break
        _spread(j, r, u, count, c, tie, scale, total, at, told[q], save, b, spread[q])
        normal[q], brightness[q] = n, c[0] * rho
        outcome[q] = state if c[0] > 0 else FAILED
    return Fit(normal, brightness, spread, outcome, told)
