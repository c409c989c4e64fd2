"""Sweeps over a convex Hamilton–Jacobi equation, compiled: the twin of :mod:`psstereo.kernels.sweeping`."""

import math
from typing import Any

import numba
import numpy as np

from psstereo.kernels.sweeping_conic import (
    DOWN,
    GIVEN,
    LEAN,
    LEFT,
    OPEN,
    PATIENCE,
    RESTLESS,
    RIGHT,
    UP,
    WIDE_X,
    WIDE_Y,
)
from psstereo.kernels.sweeping_conic_compiled import fine, lamp_node, node, prepare

__all__ = ["first_order", "normals", "pieces", "refine", "second_order", "widen"]

_compile: Any = numba.njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "nsz", "arcp"})


@_compile
def _touch(above: int, below: int, before: int, behind: int) -> int:
    """Return bits: something changed, and near which sides of the window."""
    return 1 + 2 * (above < 2) + 4 * (below <= 2) + 8 * (before < 2) + 16 * (behind <= 2)


@_compile
def _wake(active: Any, i: int, j: int, far: bool) -> None:
    """Mark the pixels whose value rests on one that has changed."""
    active[i + 1, j + 2] = active[i + 3, j + 2] = active[i + 2, j + 1] = active[i + 2, j + 3] = 1
    if far:
        active[i, j + 2] = active[i + 4, j + 2] = active[i + 2, j] = active[i + 2, j + 4] = 1


@_compile
def first_order(
    u: Any,
    state: Any,
    active: Any,
    code: Any,
    bright: Any,
    frame: Any,
    window: Any,
    down: bool,
    right: bool,
    tolerance: float,
) -> int:
    """Sweep once over a window; see :func:`psstereo.kernels.sweeping.first_order`."""
    top, bottom, left, last = window[0], window[1], window[2], window[3]
    width, lamp = last - left, frame[10] > 0.0
    conic, rise, lean = np.zeros((8, width)), np.zeros((4, width)), np.zeros((4, width))
    touched = 0
    for step in range(bottom - top):
        i = top + step if down else bottom - 1 - step
        prepare(bright[i, left:last], frame, i, left, conic, rise, lean)
        here, above, below, kind, awake = u[i + 2], u[i + 1], u[i + 3], state[i], active[i + 2]
        for count in range(width):
            k = count if right else width - 1 - count
            j = left + k
            if not awake[j + 2]:
                continue
            awake[j + 2] = 0
            if kind[j] != OPEN:
                continue
            old = here[j + 2]
            a0, a1, b0, b1 = here[j + 1], here[j + 3], above[j + 2], below[j + 2]
            if lamp:
                best, piece = lamp_node(conic, k, bright[i, j], old, a0, a1, b0, b1)
            else:
                best, piece = node(conic, rise, lean, frame[7], k, a0, a1, b0, b1)
            if best < old:
                here[j + 2] = best
                code[i, j] = piece
                if old - best > tolerance:
                    _wake(active, i, j, False)
                    touched |= _touch(i - top, bottom - i, k, width - k)
    return touched


@_compile
def _facing(frame: Any, i: int, j: int) -> Any:
    """Return the slopes of a surface that faces the light."""
    if frame[10] > 0.0:
        return 0.0, 0.0
    y = frame[9] * (i - frame[3]) / frame[1]
    x = frame[9] * (j - frame[2] - frame[4] * y) / frame[0]
    share = frame[8] / (frame[7] - x * frame[5] - y * frame[6])
    p = share * frame[5] / frame[0]
    return p, (share * frame[6] - frame[4] * p) / frame[1]


@_compile
def _below(u: Any, p: float, q: float, i: int, j: int, di: int, dj: int) -> bool:
    """Say whether the neighbour on one side lies below a pixel, as the light sees it."""
    return bool(u[i + 2 + di, j + 2 + dj] - (dj * p + di * q) < u[i + 2, j + 2])


@_compile
def _rises(u: Any, p: float, q: float, i: int, j: int, piece: int) -> bool:
    """Say whether at least one of the neighbours that a pixel has its value from lies below it, see :func:`_below`."""
    dj, di = ((piece & RIGHT) != 0) - ((piece & LEFT) != 0), ((piece & DOWN) != 0) - ((piece & UP) != 0)
    return bool((dj != 0 and _below(u, p, q, i, j, 0, dj)) or (di != 0 and _below(u, p, q, i, j, di, 0)))


@_compile
def pieces(u: Any, state: Any, bright: Any, frame: Any, window: Any, code: Any) -> None:
    """Put from where each pixel has its value; see :func:`psstereo.kernels.sweeping.pieces`."""
    top, bottom, left, last = window[0], window[1], window[2], window[3]
    width, lamp = last - left, frame[10] > 0.0
    conic, rise, lean = np.zeros((8, width)), np.zeros((4, width)), np.zeros((4, width))
    p, q = _facing(frame, top, left)
    for i in range(top, bottom):
        prepare(bright[i, left:last], frame, i, left, conic, rise, lean)
        here, above, below, kind = u[i + 2], u[i + 1], u[i + 3], state[i]
        for k in range(width):
            j = left + k
            code[i, j] = 0
            if kind[j] != OPEN or not here[j + 2] < LEAN:
                continue
            if frame[9] > 0.0:
                p, q = _facing(frame, i, j)
            a0, a1, b0, b1 = here[j + 1], here[j + 3], above[j + 2], below[j + 2]
            if lamp:
                best, piece = lamp_node(conic, k, bright[i, j], here[j + 2], a0, a1, b0, b1)
            else:
                best, piece = node(conic, rise, lean, frame[7], k, a0, a1, b0, b1)
            if best < LEAN and _rises(u, p, q, i, j, piece):
                code[i, j] = piece


@_compile
def _wide(code: Any, state: Any, u: Any, p: float, q: float, i: int, j: int, di: int, dj: int, other: int) -> bool:
    """Say whether two pixels in a row lead here, so that the difference may reach over both."""
    height, width = code.shape
    a, b = i + di, j + dj
    if not (0 <= a + di < height and 0 <= b + dj < width) or not u[a + di + 2, b + dj + 2] < LEAN:
        return False
    if state[a, b] == GIVEN:
        return bool(state[a + di, b + dj] == GIVEN)
    if code[a, b] == 0 or code[a, b] & other != 0:
        return False
    return bool(_below(u, p, q, i, j, di, dj) and _below(u, p, q, a, b, di, dj))


@_compile
def _widened(code: Any, state: Any, u: Any, p: float, q: float, i: int, j: int, piece: int) -> int:
    """Return the piece with bits for the axes along which the difference may be wide."""
    bits = piece
    if piece & (LEFT | RIGHT):
        forward = (piece & RIGHT) != 0
        if _wide(code, state, u, p, q, i, j, 0, 1 if forward else -1, LEFT if forward else RIGHT):
            bits |= WIDE_X
    if piece & (UP | DOWN):
        forward = (piece & DOWN) != 0
        if _wide(code, state, u, p, q, i, j, 1 if forward else -1, 0, UP if forward else DOWN):
            bits |= WIDE_Y
    return bits


@_compile
def widen(u: Any, state: Any, frame: Any, window: Any, code: Any) -> None:
    """Mark where differences may be wide; see :func:`psstereo.kernels.sweeping.widen`."""
    p, q = _facing(frame, window[0], window[2])
    for i in range(window[0], window[1]):
        for j in range(window[2], window[3]):
            if code[i, j] != 0:
                if frame[9] > 0.0:
                    p, q = _facing(frame, i, j)
                code[i, j] = _widened(code, state, u, p, q, i, j, code[i, j] & (LEFT | RIGHT | UP | DOWN))


@_compile
def second_order(
    u: Any,
    active: Any,
    code: Any,
    tired: Any,
    bright: Any,
    frame: Any,
    window: Any,
    down: bool,
    right: bool,
    tolerance: float,
) -> int:
    """Sweep once over a window with wide differences; see :func:`psstereo.kernels.sweeping.second_order`."""
    top, bottom, left, last = window[0], window[1], window[2], window[3]
    width = last - left
    conic, nothing = np.zeros((8, width)), np.zeros((0, 0))
    touched = 0
    for step in range(bottom - top):
        i = top + step if down else bottom - 1 - step
        prepare(bright[i, left:last], frame, i, left, conic, nothing, nothing)
        for count in range(width):
            k = count if right else width - 1 - count
            if not active[i + 2, left + k + 2]:
                continue
            active[i + 2, left + k + 2] = 0
            bits = code[i, left + k]
            if bits == 0:
                continue
            found = fine(conic, frame, bright[i, left + k], k, bits, u, i + 2, left + k + 2)
            if found < LEAN:
                change = abs(found - u[i + 2, left + k + 2])
                u[i + 2, left + k + 2] = found
                if change > tolerance:
                    _wake(active, i, left + k, True)
                    tired[i, left + k] += tired[i, left + k] < PATIENCE
                    touched |= RESTLESS * (tired[i, left + k] == PATIENCE)
                    active[i + 2, left + k + 2] = frame[10] > 0.0
                    touched |= _touch(i - top, bottom - i, k, width - k)
    return touched


@_compile
def refine(
    u: Any, state: Any, active: Any, code: Any, bright: Any, frame: Any, window: Any, down: bool, right: bool,
    tolerance: float,
) -> int:  # fmt: skip
    """Choose afresh from where each pixel has its value; see :func:`psstereo.kernels.sweeping.refine`."""
    top, bottom, left, last = window[0], window[1], window[2], window[3]
    width, lamp = last - left, frame[10] > 0.0
    conic, rise, lean = np.zeros((8, width)), np.zeros((4, width)), np.zeros((4, width))
    touched = 0
    for step in range(bottom - top):
        i = top + step if down else bottom - 1 - step
        prepare(bright[i, left:last], frame, i, left, conic, rise, lean)
        here, above, below = u[i + 2], u[i + 1], u[i + 3]
        for count in range(width):
            k = count if right else width - 1 - count
            j = left + k
            if not active[i + 2, j + 2]:
                continue
            active[i + 2, j + 2] = 0
            old = here[j + 2]
            if state[i, j] != OPEN or not old < LEAN:
                continue
            a0, a1, b0, b1 = here[j + 1], here[j + 3], above[j + 2], below[j + 2]
            if lamp:
                best, piece = lamp_node(conic, k, bright[i, j], old, a0, a1, b0, b1)
            else:
                best, piece = node(conic, rise, lean, frame[7], k, a0, a1, b0, b1)
            if best < LEAN:
                p, q = _facing(frame, i, j)
                bits = _widened(code, state, u, p, q, i, j, piece)
                found = fine(conic, frame, bright[i, j], k, bits, u, i + 2, j + 2) if bits != 0 else best
                here[j + 2] = found if found < LEAN else best
                code[i, j] = bits
                if abs(here[j + 2] - old) > tolerance:
                    _wake(active, i, j, True)
                    touched |= _touch(i - top, bottom - i, k, width - k)
    return touched


@_compile
def _slope(u: Any, code: Any, i: int, j: int, di: int, dj: int, less: int, more: int) -> float:
    """Return the slope along an axis; NaN if no neighbour is known."""
    row, column = i + 2, j + 2
    here, before, behind = u[row, column], u[row - di, column - dj], u[row + di, column + dj]
    has_before, has_behind = before < LEAN, behind < LEAN
    own = code[i, j]
    if has_before and has_behind:
        # Where flows meet, the surface has a crease: the difference then stays on its own side.
        meets = (own & less != 0 and code[i + di, j + dj] & more != 0) or (
            own & more != 0 and code[i - di, j - dj] & less != 0
        )
        if not meets:
            return 0.5 * (behind - before)
        has_before = own & less != 0
    elif not has_before and not has_behind:
        return math.nan
    sign = -1 if has_before else 1
    near, far = u[row + sign * di, column + sign * dj], u[row + 2 * sign * di, column + 2 * sign * dj]
    if far < LEAN:
        return sign * (2.0 * near - 1.5 * here - 0.5 * far)
    return sign * (near - here)


@_compile
def normals(u: Any, code: Any, frame: Any, window: Any, out: Any) -> None:
    """Put the unit normals of a window; see :func:`psstereo.kernels.sweeping.normals`."""
    fx, fy, cx, cy, skew, sign, central = frame[0], frame[1], frame[2], frame[3], frame[4], frame[8], frame[9]
    for i in range(window[0], window[1]):
        for j in range(window[2], window[3]):
            out[i, j, 0] = out[i, j, 1] = out[i, j, 2] = math.nan
            if not u[i + 2, j + 2] < LEAN:
                continue
            p = sign * _slope(u, code, i, j, 0, 1, LEFT, RIGHT)
            q = sign * _slope(u, code, i, j, 1, 0, UP, DOWN)
            p = 0.0 if math.isnan(p) else p
            q = 0.0 if math.isnan(q) else q
            x, y, z = fx * p, skew * p + fy * q, 1.0 + central * ((j - cx) * p + (i - cy) * q)
            if frame[10] > 0.0:  # the slopes are those of the distance along the ray
                down = (i - cy) / fy
                right = (j - cx - skew * down) / fx
                share = 1.0 / (1.0 + right * right + down * down)
                x, y, z = x - share * right, y - share * down, z - 1.0 + share
            y = -y
            scale = 1.0 / math.sqrt(x * x + y * y + z * z)
            out[i, j, 0], out[i, j, 1], out[i, j, 2] = x * scale, y * scale, z * scale
