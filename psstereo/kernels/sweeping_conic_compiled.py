"""The solution of one pixel, compiled: the twin of :mod:`psstereo.kernels.sweeping_conic`."""

import math
from typing import Any

import numba

from psstereo.kernels.sweeping_conic import BIG, DOWN, LEAN, LEFT, NEWTON, RIGHT, SLACK, UP, WIDE_X, WIDE_Y

__all__ = ["fine", "lamp_node", "node", "prepare"]

_compile: Any = numba.njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "nsz", "arcp"})


@_compile
def _sun_row(bright: Any, frame: Any, i: int, left: int, conic: Any) -> None:
    """Put the conic of each pixel of row i from column `left` on, for a sun."""
    fx, fy, cx, cy, skew = frame[0], frame[1], frame[2], frame[3], frame[4]
    lx, ly, lz, sign, central = frame[5], frame[6], frame[7], frame[8], frame[9]
    n2y, n2z = sign * fy, sign * central * (i - cy)
    s2 = ly * n2y + lz * n2z
    n1x, n1y = sign * fx, sign * skew
    c0, c1, c2, c11, c12, c22 = conic[0], conic[1], conic[2], conic[3], conic[4], conic[5]
    lit1, lit2 = conic[6], conic[7]
    for k in range(bright.shape[0]):
        n1z = sign * central * (left + k - cx)
        s1 = lx * n1x + ly * n1y + lz * n1z
        j2 = bright[k] * bright[k]
        c0[k] = j2 - lz * lz
        c1[k] = j2 * n1z - lz * s1
        c2[k] = j2 * n2z - lz * s2
        c11[k] = j2 * (n1x * n1x + n1y * n1y + n1z * n1z) - s1 * s1
        c12[k] = j2 * (n1y * n2y + n1z * n2z) - s1 * s2
        c22[k] = j2 * (n2y * n2y + n2z * n2z) - s2 * s2
        lit1[k], lit2[k] = s1, s2


@_compile
def _lamp_row(bright: Any, frame: Any, i: int, left: int, conic: Any) -> None:
    """Put the quadratic form of each pixel of row i from column `left` on, for a lamp at the optical centre."""
    fx, fy, cx, cy, skew = frame[0], frame[1], frame[2], frame[3], frame[4]
    y = (i - cy) / fy
    for k in range(bright.shape[0]):
        x = (left + k - cx - skew * y) / fx
        conic[0, k], conic[1, k], conic[2, k] = 1.0 / (1.0 + x * x + y * y), 0.0, 0.0
        conic[3, k] = fx * fx + skew * skew + (left + k - cx) * (left + k - cx)
        conic[4, k] = skew * fy + (left + k - cx) * (i - cy)
        conic[5, k] = fy * fy + (i - cy) * (i - cy)
        conic[6, k], conic[7, k] = 0.0, 0.0


@_compile
def _axis_row(c0: Any, c1: Any, c2: Any, c11: Any, c12: Any, c22: Any, ahead: Any, back: Any, lean: Any) -> None:
    """Put the greatest rise along one axis, forward and backward, and the slope across for each."""
    for k in range(c0.shape[0]):
        usable = c22[k] > 0.0
        inverse = 1.0 / (c22[k] if usable else 1.0)
        share = c12[k] * inverse
        e2 = c11[k] - share * c12[k]
        e1 = c1[k] - share * c2[k]
        e0 = c0[k] - c2[k] * inverse * c2[k]
        size = abs(e1) + math.sqrt(max(e1 * e1 - e2 * e0, 0.0))
        small = e0 / (-size if size > 0.0 else -1.0)
        large = size / (e2 if e2 > 0.0 else 1.0)
        large = large if e2 > 0.0 else BIG
        up = small if e1 > 0.0 else large
        down = large if e1 > 0.0 else small
        up = up if usable else BIG
        down = down if usable else BIG
        ahead[k] = up
        back[k] = down
        lean[0, k] = -(c2[k] * inverse + share * up) if up < LEAN else 0.0
        lean[1, k] = -(c2[k] * inverse - share * down) if down < LEAN else 0.0


@_compile
def prepare(bright: Any, frame: Any, i: int, left: int, conic: Any, rise: Any, lean: Any) -> None:
    """Put all that a row's pixels need and that does not depend on the solution."""
    if frame[10] > 0.0:
        _lamp_row(bright, frame, i, left, conic)
        return
    _sun_row(bright, frame, i, left, conic)
    c0, c1, c2, c11, c12, c22 = conic[0], conic[1], conic[2], conic[3], conic[4], conic[5]
    if rise.size > 0:
        _axis_row(c0, c1, c2, c11, c12, c22, rise[0], rise[1], lean[:2])
        _axis_row(c0, c2, c1, c22, c12, c11, rise[2], rise[3], lean[2:])


@_compile
def _solve(
    c0: float, c1: float, c2: float, c11: float, c12: float, c22: float,
    e: float, a: float, b: float, sx: float, sy: float,
) -> float:  # fmt: skip
    """Return u with the conic of the slopes sx (u − a) and sy (u − b), plus e times (u − smaller of both), zero."""
    base = min(a, b)
    a -= base
    b -= base
    xx, xy, yy = c11 * sx * sx, c12 * sx * sy, c22 * sy * sy
    x1, y1 = c1 * sx, c2 * sy
    second = xx + 2.0 * xy + yy
    first = x1 + y1 - (xx + xy) * a - (xy + yy) * b + 0.5 * e
    constant = c0 - 2.0 * (x1 * a + y1 * b) + xx * a * a + 2.0 * xy * a * b + yy * b * b
    square = first * first - second * constant
    if square < 0.0:
        return BIG
    root = math.sqrt(square)
    if first <= 0.0:
        return base + (root - first) / second if second > 0.0 else BIG
    return base - constant / (first + root)


@_compile
def _flows(conic: Any, k: int, facing: float, p: float, q: float, sx: float, sy: float, slack: float) -> bool:
    """Say whether what is known at both ends of an edge flows across it, and the slopes face the light."""
    x = sx * (conic[1, k] + conic[3, k] * p + conic[4, k] * q)
    y = sy * (conic[2, k] + conic[4, k] * p + conic[5, k] * q)
    lit = facing + conic[6, k] * p + conic[7, k] * q
    return bool(x >= -slack * y and y >= -slack * x and x + y > 0.0 and lit > 0.0)


@_compile
def node(conic: Any, rise: Any, lean: Any, facing: float, k: int, a0: float, a1: float, b0: float, b1: float) -> Any:
    """Return the smallest value that four neighbours allow, and by which of them, for a sun."""
    c0, c1, c2, c11, c12, c22 = conic[0, k], conic[1, k], conic[2, k], conic[3, k], conic[4, k], conic[5, k]
    f0, f1, g0, g1 = a0 + rise[0, k], a1 + rise[1, k], b0 + rise[2, k], b1 + rise[3, k]
    best, piece = f0, LEFT
    if f1 < best:
        best, piece = f1, RIGHT
    if g0 < best:
        best, piece = g0, UP
    if g1 < best:
        best, piece = g1, DOWN
    for e in range(4):
        a, sx, f, across = (a0, 1.0, f0, lean[0, k]) if e < 2 else (a1, -1.0, f1, lean[1, k])
        b, sy, g, along = (b0, 1.0, g0, lean[2, k]) if e % 2 == 0 else (b1, -1.0, g1, lean[3, k])
        if b < f - sy * across and a < g - sx * along:
            found = _solve(c0, c1, c2, c11, c12, c22, 0.0, a, b, sx, sy)
            if found < best and _flows(conic, k, facing, sx * (found - a), sy * (found - b), sx, sy, 0.0):
                best, piece = found, (LEFT if e < 2 else RIGHT) + (UP if e % 2 == 0 else DOWN)
    return best, piece


@_compile
def _lamp_axis(form: float, c0: float, e: float, gap: float, spacing: float) -> float:
    """Return the rise d with form (d / spacing)² + e (d + gap) + c0 = 0, or BIG if it would fall."""
    constant = c0 + e * gap
    if not constant < 0.0:
        return BIG
    second = form / (spacing * spacing)
    return -2.0 * constant / (e + math.sqrt(e * e - 4.0 * second * constant))


@_compile
def _lamp_terms(conic: Any, k: int, range2: float, old: float) -> Any:
    """Return the fall-off at a distance and its derivative."""
    share = conic[0, k] * range2 * math.exp(-4.0 * old)
    return conic[0, k] - share, 4.0 * share


@_compile
def _lamp_step(conic: Any, k: int, strength: float, old: float, a0: float, a1: float, b0: float, b1: float) -> Any:
    """Take one step of Newton's iteration for a lamp."""
    c11, c12, c22 = conic[3, k], conic[4, k], conic[5, k]
    c0, e = _lamp_terms(conic, k, strength * strength, old)
    form_x, form_y = c11 - c12 / c22 * c12, c22 - c12 / c11 * c12
    f0, f1 = a0 + _lamp_axis(form_x, c0, e, a0 - old, 1.0), a1 + _lamp_axis(form_x, c0, e, a1 - old, 1.0)
    g0, g1 = b0 + _lamp_axis(form_y, c0, e, b0 - old, 1.0), b1 + _lamp_axis(form_y, c0, e, b1 - old, 1.0)
    best, piece = 0.5 * math.log(strength), 0
    if f0 < best:
        best, piece = f0, LEFT
    if f1 < best:
        best, piece = f1, RIGHT
    if g0 < best:
        best, piece = g0, UP
    if g1 < best:
        best, piece = g1, DOWN
    for n in range(4):
        a, sx, f = (a0, 1.0, f0) if n < 2 else (a1, -1.0, f1)
        b, sy, g = (b0, 1.0, g0) if n % 2 == 0 else (b1, -1.0, g1)
        if f < LEAN and g < LEAN and b < f + sx * sy * c12 / c22 * (f - a) and a < g + sx * sy * c12 / c11 * (g - b):
            found = _solve(c0 + e * (min(a, b) - old), 0.0, 0.0, c11, c12, c22, e, a, b, sx, sy)
            if found < best and _flows(conic, k, 1.0, sx * (found - a), sy * (found - b), sx, sy, 0.0):
                best, piece = found, (LEFT if n < 2 else RIGHT) + (UP if n % 2 == 0 else DOWN)
    return best, piece


@_compile
def lamp_node(conic: Any, k: int, strength: float, old: float, a0: float, a1: float, b0: float, b1: float) -> Any:
    """Return the smallest value that four neighbours and the fall-off allow, and by which of them, for a lamp."""
    # The tangent of the fall-off lies below it: after the first step the values rise to the solution.
    best, piece = _lamp_step(conic, k, strength, old, a0, a1, b0, b1)
    for _ in range(NEWTON):
        if abs(best - old) <= 1e-13:
            break
        old = best
        best, piece = _lamp_step(conic, k, strength, old, a0, a1, b0, b1)
    return best, piece


@_compile
def _axis_slope(c0: float, c1: float, c2: float, c11: float, c12: float, c22: float, sign: float) -> float:
    """Return the greatest slope along the first axis, times the sign; BIG if nothing flows along it."""
    if not c22 > 0.0:
        return BIG
    share = c12 / c22
    e2, e1, e0 = c11 - share * c12, sign * (c1 - share * c2), c0 - c2 / c22 * c2
    root = math.sqrt(max(e1 * e1 - e2 * e0, 0.0))
    if e1 > 0.0:
        return -e0 / (e1 + root)
    return (root - e1) / e2 if e2 > 0.0 else BIG


@_compile
def _along(
    c0: float, c1: float, c2: float, c11: float, c12: float, c22: float,
    e: float, gap: float, sign: float, spacing: float, lamp: bool,
) -> float:  # fmt: skip
    """Return the greatest rise along the first axis over a spacing."""
    if lamp:
        return _lamp_axis(c11 - c12 / c22 * c12, c0, e, gap, spacing)
    return _axis_slope(c0, c1, c2, c11, c12, c22, sign) * spacing


@_compile
def fine(conic: Any, frame: Any, strength: float, k: int, bits: int, u: Any, row: int, column: int) -> float:
    """Return the value of a pixel by differences that reach as far as its bits allow, or BIG."""
    c0, c1, c2, c11, c12, c22, e = conic[0, k], conic[1, k], conic[2, k], conic[3, k], conic[4, k], conic[5, k], 0.0
    old, lamp = u[row, column], frame[10] > 0.0
    if lamp:
        c0, e = _lamp_terms(conic, k, strength * strength, old)
    dj, di = ((bits & RIGHT) != 0) - ((bits & LEFT) != 0), ((bits & DOWN) != 0) - ((bits & UP) != 0)
    near_a, near_b, sx, sy = u[row, column + dj], u[row + di, column], -float(dj), -float(di)
    a, b, long_a, long_b = near_a, near_b, 1.0, 1.0
    if bits & WIDE_X:
        a, long_a = (4.0 * near_a - u[row, column + 2 * dj]) / 3.0, 1.5
    if bits & WIDE_Y:
        b, long_b = (4.0 * near_b - u[row + 2 * di, column]) / 3.0, 1.5
    if di == 0:
        return a + _along(c0, c1, c2, c11, c12, c22, e, a - old, sx, 1.0 / long_a, lamp)
    if dj == 0:
        return b + _along(c0, c2, c1, c22, c12, c11, e, b - old, sy, 1.0 / long_b, lamp)
    for _ in range(2):
        gap = e * (min(a, b) - old)
        found = _solve(c0 + gap, c1, c2, c11, c12, c22, e, a, b, sx * long_a, sy * long_b)
        p, q = sx * long_a * (found - a), sy * long_b * (found - b)
        if found < LEAN and _flows(conic, k, frame[7], p, q, sx, sy, SLACK):
            return found
        a, b, long_a, long_b = near_a, near_b, 1.0, 1.0
    along = near_a + _along(c0, c1, c2, c11, c12, c22, e, near_a - old, sx, 1.0, lamp)
    return min(along, near_b + _along(c0, c2, c1, c22, c12, c11, e, near_b - old, sy, 1.0, lamp))
