r"""The solution of one pixel of a convex Hamilton–Jacobi equation from its neighbours: the readable reference.

The unknown u grows along the paths on which it is known. Its slopes a pixel, p along columns and q along rows, lie on a
conic that each pixel has of its own:

* A sun. The normal is ``N = n0 + p n1 + q n2``, with vectors that depend on the pixel, and the brightness J its cosine
  with the light l, so that ``J² |N|² − (l·N)² = 0`` on the side where ``l·N > 0``. In parallel projection u is minus
  the height, in central projection the logarithm of the distance.
* A lamp at the optical centre. With r the distance, u = ln r, g the slopes over rays (y, 1), and
  ``Q² = 1 / (1 + |y|²)``: ``|g|² + (g·y)² = Q² (K² exp(−4u) − 1)`` with K the flux over the irradiance. u is at most
  ½ ln K.

A pixel takes the smallest value that a straight path from one of its four neighbours, or from between two of them,
allows (Hopf and Lax): with the slopes ``p = (u − a) / h`` and ``q = (u − b) / h`` the conic is a quadratic equation
in u, and what is known has to flow across the edge. That is monotone and of first order in h, for any conic that is
convex where it counts. Gauss–Seidel sweeps in four diagonal orders find the solution [1]_ [2]_.

References
----------
.. [1] J. Qian, Y.-T. Zhang, H.-K. Zhao, "Fast sweeping methods for eikonal equations on triangular meshes", SIAM J.
   Numer. Anal. 45, 2007. doi:10.1137/050627083
"""

import numpy as np

from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["BIG", "DOWN", "GIVEN", "LEAN", "LEFT", "NEWTON", "OPEN", "OUTSIDE", "PATIENCE", "RESTLESS", "RIGHT"]
__all__ += ["SLACK", "UP", "WIDE_X", "WIDE_Y", "choose", "conics", "fine"]

BIG = 1e30
"""A value that is not known."""
LEAN = 1e29
"""What is below this is known."""
OPEN, GIVEN, OUTSIDE = 0, 1, 2
"""States of a pixel."""
LEFT, RIGHT, UP, DOWN, WIDE_X, WIDE_Y = 1, 2, 4, 8, 16, 32
"""Bits that say from which neighbours a pixel has its value, and along which axes by a wide difference."""
SLACK = 0.3
"""How far a path may miss the edge that was chosen for it at first order, as a share of the flow along the edge."""
PATIENCE = 120
"""Changes of a pixel after which it is not expected to settle."""
RESTLESS = 32
"""Bit that says so."""
NEWTON = 8
"""Further steps of Newton's iteration for a lamp's fall-off, at most."""


def conics(bright: FloatArray, frame: FloatArray, window: IntArray) -> FloatArray:
    """Return the coefficients c0, c1, c2, c11, c12, c22 of each pixel's conic, and l·n1, l·n2, float64 (8, h, w)."""
    top, bottom, left, last = window
    fx, fy, cx, cy, skew, lx, ly, lz, sign, central, lamp = frame
    row, column = np.mgrid[top:bottom, left:last].astype(np.float64)
    right, below = column - cx, row - cy
    zero = np.zeros(right.shape)
    if lamp:
        y = below / fy
        x = (right - skew * y) / fx
        q2 = 1.0 / (1.0 + x * x + y * y)
        forms = [fx * fx + skew * skew + right**2, skew * fy + right * below, fy * fy + below**2]
        return np.stack([q2, zero, zero, *forms, zero, zero])
    n1 = [sign * fx + zero, sign * skew + zero, sign * central * right]
    n2 = [zero, sign * fy + zero, sign * central * below]
    s1, s2 = (lx * n[0] + ly * n[1] + lz * n[2] for n in (n1, n2))
    j2 = np.square(bright[top:bottom, left:last])
    dots = [sum(a * b for a, b in zip(*pair, strict=True)) for pair in ((n1, n1), (n1, n2), (n2, n2))]
    return np.stack(
        [
            j2 - lz * lz,
            j2 * n1[2] - lz * s1,
            j2 * n2[2] - lz * s2,
            j2 * dots[0] - s1 * s1,
            j2 * dots[1] - s1 * s2,
            j2 * dots[2] - s2 * s2,
            s1,
            s2,
        ]
    )


def _turned(conic: FloatArray) -> FloatArray:
    """Return the conics with rows for columns."""
    return conic[[0, 2, 1, 5, 4, 3]]


def _steepest(conic: FloatArray, sign: FloatArray | float) -> tuple[FloatArray, FloatArray]:
    """Return the greatest slope along the first axis, times the sign, and the slope across that goes with it."""
    c0, c1, c2, c11, c12, c22 = conic[:6]
    usable = c22 > 0
    inverse = 1.0 / np.where(usable, c22, 1.0)
    share = c12 * inverse
    e2, e1, e0 = c11 - share * c12, sign * (c1 - share * c2), c0 - c2 * inverse * c2
    root = np.sqrt(np.maximum(e1 * e1 - e2 * e0, 0.0))
    ahead = e1 > 0  # the root without cancellation
    small = -e0 / np.where(ahead, e1 + root, 1.0)
    large = np.where(e2 > 0, (root - e1) / np.where(e2 > 0, e2, 1.0), BIG)
    slope = np.where(usable, np.where(ahead, small, large), BIG)
    return slope, np.where(slope < LEAN, -(c2 * inverse + share * sign * slope), 0.0)


def _solve(
    conic: FloatArray, e: FloatArray, a: FloatArray, b: FloatArray, sx: FloatArray | float, sy: FloatArray | float
) -> FloatArray:
    """Return u with the conic of the slopes sx (u − a) and sy (u − b), plus e times (u − smaller of both), zero."""
    c0, c1, c2, c11, c12, c22 = conic[:6]
    base = np.minimum(a, b)
    a, b = a - base, b - base
    xx, xy, yy = c11 * sx * sx, c12 * sx * sy, c22 * sy * sy
    second = xx + 2 * xy + yy
    first = c1 * sx + c2 * sy - (xx + xy) * a - (xy + yy) * b + 0.5 * e
    constant = c0 - 2 * (c1 * sx * a + c2 * sy * b) + xx * a * a + 2 * xy * a * b + yy * b * b
    square = first * first - second * constant
    root = np.sqrt(np.maximum(square, 0.0))
    ahead = first > 0
    large = np.where(second > 0, base + (root - first) / np.where(second > 0, second, 1.0), BIG)
    found = np.where(ahead, base - constant / np.where(ahead, first + root, 1.0), large)
    return np.where(square < 0, BIG, found)


def _flows(
    conic: FloatArray,
    facing: float,
    p: FloatArray,
    q: FloatArray,
    sx: FloatArray | float,
    sy: FloatArray | float,
    slack: float,
) -> BoolArray:
    """Say whether what is known at both ends of an edge flows across it, and the slopes face the light."""
    x = sx * (conic[1] + conic[3] * p + conic[4] * q)
    y = sy * (conic[2] + conic[4] * p + conic[5] * q)
    lit = facing + conic[6] * p + conic[7] * q
    return np.asarray((x >= -slack * y) & (y >= -slack * x) & (x + y > 0) & (lit > 0))


def _fall_off(conic: FloatArray, strength: FloatArray, old: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the conics with a lamp's fall-off at a distance in c0, and its derivative."""
    share = conic[0] * strength * strength * np.exp(-4.0 * old)
    changed = conic.copy()
    changed[0] -= share
    return changed, 4.0 * share


def _lamp_rise(conic: FloatArray, e: FloatArray, gap: FloatArray, spacing: FloatArray | float) -> FloatArray:
    """Return the rise along the first axis from a value that is `gap` above the old one, or BIG if it would fall."""
    form = (conic[3] - conic[4] / conic[5] * conic[4]) / (spacing * spacing)
    constant = conic[0] + e * gap
    usable = constant < 0
    return np.where(usable, -2 * constant / (e + np.sqrt(np.maximum(e * e - 4 * form * constant, 0.0)) + ~usable), BIG)


def choose(
    conic: FloatArray, frame: FloatArray, strength: FloatArray, old: FloatArray, near: FloatArray
) -> tuple[FloatArray, IntArray]:
    """Return the smallest value that the four neighbours allow, and by which of them."""
    best, piece = _choose_once(conic, frame, strength, old, near)
    # The tangent of a lamp's fall-off lies below it: after the first step the values rise to the solution.
    for _ in range(NEWTON if frame[10] > 0 else 0):
        moving = np.abs(best - old) > 1e-13
        if not moving.any():
            break
        old = np.where(moving, best, old)
        best[moving], piece[moving] = _choose_once(
            conic[:, moving], frame, strength[moving], old[moving], near[:, moving]
        )
    return best, piece


def _choose_once(
    conic: FloatArray, frame: FloatArray, strength: FloatArray, old: FloatArray, near: FloatArray
) -> tuple[FloatArray, IntArray]:
    """Return that with a lamp's fall-off replaced by its tangent at the old value."""
    zero: FloatArray = np.zeros(old.shape)
    e, turned, lamp = zero, _turned(conic), bool(frame[10] > 0)
    if lamp:
        conic, e = _fall_off(conic, strength, old)
        turned = _turned(conic)
        rise = [_lamp_rise(c, e, a - old, 1.0) for c, a in zip((conic, conic, turned, turned), near, strict=True)]
        lean = [-c[4] / c[5] * s * d for c, s, d in zip((conic, conic, turned, turned), (1, -1) * 2, rise, strict=True)]
        reach = [np.where(d < LEAN, 0.0, -np.inf) for d in rise]
    else:
        both = [_steepest(c, s) for c in (conic, turned) for s in (1.0, -1.0)]
        rise, lean, reach = [one[0] for one in both], [one[1] for one in both], [zero] * 4
    ends = [a + d for a, d in zip(near, rise, strict=True)]
    best, piece = (0.5 * np.log(strength), zero.astype(np.int64)) if lamp else (ends[0], zero.astype(np.int64) + LEFT)
    for end, bit in zip(ends, (LEFT, RIGHT, UP, DOWN), strict=True):
        piece = np.where(end < best, bit, piece)
        best = np.minimum(end, best)
    for n, m in ((0, 2), (0, 3), (1, 2), (1, 3)):
        a, b, sx, sy = near[n], near[m], 1.0 - 2.0 * n, 1.0 - 2.0 * (m - 2)
        hit = (b < ends[n] - sy * lean[n] + reach[n]) & (a < ends[m] - sx * lean[m] + reach[m])
        shifted = conic.copy()
        if lamp:
            shifted[0] += e * (np.minimum(a, b) - old)
        found = _solve(shifted, e, a, b, sx, sy)
        hit &= (found < best) & _flows(
            conic, 1.0 if lamp else frame[7], sx * (found - a), sy * (found - b), sx, sy, 0.0
        )
        best, piece = np.where(hit, found, best), np.where(hit, (1 << n) + (1 << m), piece)
    return best, piece


def fine(
    conic: FloatArray, frame: FloatArray, strength: FloatArray, bits: IntArray, u: FloatArray, i: IntArray, j: IntArray
) -> FloatArray:
    """Return values by differences that reach as far as the bits allow, or BIG."""
    old, lamp = u[i + 2, j + 2], bool(frame[10] > 0)
    e: FloatArray = np.zeros(i.shape)
    if lamp:
        conic, e = _fall_off(conic, strength, old)
    dj, di = (((bits & more) != 0).astype(int) - ((bits & less) != 0) for more, less in ((RIGHT, LEFT), (DOWN, UP)))
    sx, sy = -1.0 * dj, -1.0 * di
    near = [u[i + 2, j + 2 + dj], u[i + 2 + di, j + 2]]
    beyond = [u[i + 2, j + 2 + 2 * dj], u[i + 2 + 2 * di, j + 2]]
    wide = [(bits & bit) != 0 for bit in (WIDE_X, WIDE_Y)]
    reach = [np.where(one, (4 * a - a2) / 3, a) for one, a, a2 in zip(wide, near, beyond, strict=True)]
    spacing = [np.where(one, 2 / 3, 1.0) for one in wide]

    def along(axis: int, base: FloatArray, distance: FloatArray | float) -> FloatArray:
        turned = _turned(conic) if axis else conic
        if lamp:
            return base + _lamp_rise(turned, e, base - old, distance)
        return base + _steepest(turned, sy if axis else sx)[0] * distance

    def across(a: FloatArray, b: FloatArray, px: FloatArray, py: FloatArray) -> FloatArray:
        shifted = conic.copy()
        shifted[0] += e * (np.minimum(a, b) - old)
        found = _solve(shifted, e, a, b, px, py)
        good = (found < LEAN) & _flows(conic, frame[7], px * (found - a), py * (found - b), sx, sy, SLACK)
        return np.where(good, found, BIG)

    found = across(reach[0], reach[1], sx / spacing[0], sy / spacing[1])
    found = np.where(found < LEAN, found, across(near[0], near[1], sx, sy))
    found = np.where(found < LEAN, found, np.minimum(along(0, near[0], 1.0), along(1, near[1], 1.0)))
    found = np.where(di == 0, along(0, reach[0], spacing[0]), found)
    return np.where((dj == 0) & (di != 0), along(1, reach[1], spacing[1]), found)
