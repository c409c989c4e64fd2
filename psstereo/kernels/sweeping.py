r"""Sweeps over a convex Hamilton–Jacobi equation on the pixel grid: the readable reference in NumPy.

:mod:`psstereo.kernels.sweeping_conic` has the equation and the solution of one pixel from its neighbours. Gauss–Seidel
sweeps in four diagonal orders find that of all [1]_.

The second order replaces a by (4a − a₂) / 3 and h by 2h/3, with a₂ the value one pixel further, where both pixels have
their own values from the same side. From where each pixel has its value stays fixed meanwhile, so that this is a linear
march along known paths; :func:`refine` then chooses anew, by monotone steps over the better values.

Arrays of values have a rim of two pixels on each side, with ``BIG`` in it.

References
----------
.. [1] H. Zhao, "A fast sweeping method for eikonal equations", Math. Comput. 74, 2005.
   doi:10.1090/S0025-5718-04-01678-3
"""

from collections.abc import Iterator

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
    choose,
    conics,
    fine,
)
from psstereo.types import Array, BoolArray, FloatArray, IntArray

__all__ = ["first_order", "normals", "pieces", "refine", "second_order", "widen"]

_SIDES = ((0, -1), (0, 1), (-1, 0), (1, 0))


def _neighbours(u: FloatArray, i: IntArray, j: IntArray) -> FloatArray:
    return np.stack([u[i + 2 + di, j + 2 + dj] for di, dj in _SIDES])


def _diagonals(window: IntArray, down: bool, right: bool) -> Iterator[tuple[IntArray, IntArray]]:
    """Yield the pixels of a window by diagonals, none of which depends on another of its own.

    Going through them has the same result as going through rows one after the other.
    """
    top, bottom, left, last = window
    rows = np.arange(top, bottom) if down else np.arange(bottom - 1, top - 1, -1)
    columns = np.arange(left, last) if right else np.arange(last - 1, left - 1, -1)
    for k in range(rows.size + columns.size - 1):
        along = np.arange(max(0, k - columns.size + 1), min(rows.size, k + 1))
        yield rows[along], columns[k - along]


def _wake(active: Array, i: IntArray, j: IntArray, far: bool) -> None:
    """Mark the pixels whose value rests on one that has changed."""
    for di, dj in _SIDES:
        for reach in (1, 2) if far else (1,):
            active[i + 2 + reach * di, j + 2 + reach * dj] = 1


def _touch(window: IntArray, i: IntArray, j: IntArray) -> int:
    """Return bits: something changed (1), near the first or last two rows (2, 4), columns (8, 16) of the window."""
    if i.size == 0:
        return 0
    top, bottom, left, last = window
    sides = (i.min() - top < 2, bottom - i.max() <= 2, j.min() - left < 2, last - j.max() <= 2)
    return 1 + sum(2 << k for k, near in enumerate(sides) if near)


def first_order(
    u: FloatArray,
    state: Array,
    active: Array,
    code: Array,
    bright: FloatArray,
    frame: FloatArray,
    window: IntArray,
    down: bool,
    right: bool,
    tolerance: float,
) -> int:
    """Sweep once over a window by the monotone scheme.

    Parameters
    ----------
    u : float64 array (h + 4, w + 4)
        Values, changed in place; they only fall. Under a lamp they begin at ½ ln K.
    state : uint8 array (h, w)
        ``OPEN``, ``GIVEN`` or ``OUTSIDE``.
    active : uint8 array (h + 4, w + 4)
        Pixels to look at; those that were are cleared, and neighbours of a change are marked.
    code : uint8 array (h, w)
        From which neighbours each pixel has its value, kept up to date: ``LEFT``, ``RIGHT``, ``UP``, ``DOWN`` or a sum
        of one of the first two and one of the others; 0 where it has none.
    bright : float64 array (h, w)
        Cosine of the angle to the sun, above 0 and at most 1; or K, flux over irradiance [length²].
    frame : float64 array (11,)
        fx, fy, cx, cy, skew of the camera (1, 1, 0, 0, 0 in parallel projection) [px]; the light's direction with y
        down [1]; 1 if u grows away from the camera, −1 if toward it; 1 for central projection; 1 for a lamp.
    window : int64 array (4,)
        First row, row after the last, first column, column after the last.
    down, right : bool
        Order of rows and columns.
    tolerance : float
        Changes up to this are not worth another look.

    Returns
    -------
    int
        Bits: 1 if something changed by more, and 2, 4, 8, 16 if within two pixels of the window's top, bottom, left or
        right.
    """
    forms, touched = conics(bright, frame, window), 0
    for i, j in _diagonals(window, down, right):
        look = active[i + 2, j + 2] != 0
        active[i + 2, j + 2] = 0
        look &= state[i, j] == OPEN
        i, j = i[look], j[look]  # noqa: PLW2901 - the rest of the diagonal is done
        if i.size == 0:
            continue
        old = u[i + 2, j + 2]
        best, piece = choose(forms[:, i - window[0], j - window[2]], frame, bright[i, j], old, _neighbours(u, i, j))
        u[i + 2, j + 2] = np.minimum(best, old)
        code[i, j] = np.where(best < old, piece, code[i, j])
        changed = np.abs(u[i + 2, j + 2] - old) > tolerance
        _wake(active, i[changed], j[changed], False)
        touched |= _touch(window, i[changed], j[changed])
    return touched


def _facing(frame: FloatArray, i: IntArray, j: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return the slopes along columns and rows of a surface that faces the light."""
    fx, fy, cx, cy, skew, lx, ly, lz, sign, central, lamp = frame
    if lamp:
        return np.zeros(i.shape), np.zeros(i.shape)
    y = central * (i - cy) / fy
    x = central * (j - cx - skew * y) / fx
    share = sign / (lz - x * lx - y * ly)
    p = share * lx / fx
    return p, (share * ly - skew * p) / fy


def _below(
    u: FloatArray, facing: tuple[FloatArray, FloatArray], i: IntArray, j: IntArray, side: tuple[int, int]
) -> BoolArray:
    """Say whether the neighbours on one side lie below some pixels, as the light sees it."""
    di, dj = side
    return np.asarray(u[i + 2 + di, j + 2 + dj] - (dj * facing[0] + di * facing[1]) < u[i + 2, j + 2])


def _rises(u: FloatArray, frame: FloatArray, i: IntArray, j: IntArray, piece: IntArray) -> BoolArray:
    """Say whether at least one of the neighbours that a pixel has its value from lies below it, see :func:`_below`."""
    found, facing = np.zeros(i.shape, np.bool_), _facing(frame, i, j)
    for bit, side in zip((LEFT, RIGHT, UP, DOWN), _SIDES, strict=True):
        found |= (piece & bit != 0) & _below(u, facing, i, j, side)
    return found


def pieces(u: FloatArray, state: Array, bright: FloatArray, frame: FloatArray, window: IntArray, code: Array) -> None:
    """Put from which neighbours each pixel of a window would have its value by the monotone scheme.

    Parameters
    ----------
    u, state, bright, frame, window
        See :func:`first_order`.
    code : uint8 array (h, w)
        Filled, see :func:`first_order`; 0 where the value is given or unknown, where it is the fall-off's limit, and
        where it does not rise above any of the neighbours that it would come from: such a value stays as it is, or
        paths could run in circles.
    """
    i, j = (part.ravel() for part in np.mgrid[window[0] : window[1], window[2] : window[3]])
    old = u[i + 2, j + 2]
    forms = conics(bright, frame, window).reshape(8, -1)
    best, piece = choose(forms, frame, bright[i, j], old, _neighbours(u, i, j))
    known = (state[i, j] == OPEN) & (old < LEAN) & (best < LEAN) & _rises(u, frame, i, j, piece)
    code[i, j] = np.where(known, piece, 0)


def _widened(
    code: Array,
    state: Array,
    u: FloatArray,
    frame: FloatArray,
    i: IntArray,
    j: IntArray,
    piece: IntArray,
) -> IntArray:
    """Return the pieces with bits for the axes along which the difference may be wide."""
    height, width = code.shape
    bits, facing = piece.copy(), _facing(frame, i, j)
    for bit, other, side in zip((LEFT, RIGHT, UP, DOWN), (RIGHT, LEFT, DOWN, UP), _SIDES, strict=True):
        di, dj = side
        far = i + 2 * di, j + 2 * dj
        within = (far[0] >= 0) & (far[0] < height) & (far[1] >= 0) & (far[1] < width)
        far = np.where(within, far[0], i), np.where(within, far[1], j)
        near = np.where(within, i + di, i), np.where(within, j + dj, j)
        leads = (code[near] != 0) & (code[near] & other == 0)
        leads &= _below(u, facing, i, j, side) & _below(u, facing, *near, side)
        usable = np.where(state[near] == GIVEN, state[far] == GIVEN, leads)
        use = within & (u[far[0] + 2, far[1] + 2] < LEAN) & usable & (piece & bit != 0)
        bits |= np.where(use, WIDE_X if dj else WIDE_Y, 0)
    return bits


def widen(u: FloatArray, state: Array, frame: FloatArray, window: IntArray, code: Array) -> None:
    """Mark the pixels of a window and the axes along which the difference may be wide.

    Parameters
    ----------
    u, state, frame, window
        See :func:`first_order`.
    code : uint8 array (h, w)
        What the other functions have put, of the whole image; ``WIDE_X`` and ``WIDE_Y`` are added where the two pixels
        on that side both lead here: they lie lower and lower, as the light sees it, and nothing flows against them in
        between; or both are given. So wide differences do not rest on each other in a circle.
    """
    i, j = (part.ravel() for part in np.mgrid[window[0] : window[1], window[2] : window[3]])
    piece = (code[i, j] & (LEFT | RIGHT | UP | DOWN)).astype(np.int64)
    code[i, j] = _widened(code, state, u, frame, i, j, piece)


def second_order(
    u: FloatArray,
    active: Array,
    code: Array,
    tired: Array,
    bright: FloatArray,
    frame: FloatArray,
    window: IntArray,
    down: bool,
    right: bool,
    tolerance: float,
) -> int:
    """Sweep once over a window with wide differences along the paths that are known.

    Parameters
    ----------
    u, active, bright, frame, window, down, right, tolerance
        See :func:`first_order`; values may rise as well.
    code : uint8 array (h, w)
        From where each pixel has its value, with the bits of :func:`widen`; 0 leaves it as it is.
    tired : uint8 array (h, w)
        How often each pixel has changed; wide differences that rest on each other in a circle need not settle.

    Returns
    -------
    int
        Bits, see :func:`first_order`; and ``RESTLESS`` if a pixel has changed ``PATIENCE`` times.
    """
    forms, touched = conics(bright, frame, window), 0
    for i, j in _diagonals(window, down, right):
        look = (active[i + 2, j + 2] != 0) & (code[i, j] != 0)
        active[i + 2, j + 2] = 0
        i, j = i[look], j[look]  # noqa: PLW2901 - the rest of the diagonal is done
        if i.size == 0:
            continue
        old, bits = u[i + 2, j + 2], code[i, j].astype(np.int64)
        found = fine(forms[:, i - window[0], j - window[2]], frame, bright[i, j], bits, u, i, j)
        u[i + 2, j + 2] = np.where(found < LEAN, found, old)
        changed = np.abs(u[i + 2, j + 2] - old) > tolerance
        _wake(active, i[changed], j[changed], True)
        i, j = i[changed], j[changed]  # noqa: PLW2901
        tired[i, j] += tired[i, j] < PATIENCE
        touched |= RESTLESS * int((tired[i, j] == PATIENCE).any())
        if frame[10] > 0:
            active[i + 2, j + 2] = 1  # the fall-off was taken at the old distance
        touched |= _touch(window, i, j)
    return touched


def refine(
    u: FloatArray,
    state: Array,
    active: Array,
    code: Array,
    bright: FloatArray,
    frame: FloatArray,
    window: IntArray,
    down: bool,
    right: bool,
    tolerance: float,
) -> int:
    """Sweep once over a window, choosing afresh from where each pixel has its value.

    The choice is that of the monotone scheme over the values as they are, the value itself that of wide differences. A
    value that is given too low for the first order, around which pixels took theirs from it, thereby loses them.

    Parameters
    ----------
    u, state, active, bright, frame, window, down, right, tolerance
        See :func:`first_order`.
    code : uint8 array (h, w)
        Changed in place; see :func:`second_order`.

    Returns
    -------
    int
        Bits, see :func:`first_order`.
    """
    forms, touched = conics(bright, frame, window), 0
    for i, j in _diagonals(window, down, right):
        look = active[i + 2, j + 2] != 0
        active[i + 2, j + 2] = 0
        look &= (state[i, j] == OPEN) & (u[i + 2, j + 2] < LEAN)
        i, j = i[look], j[look]  # noqa: PLW2901 - the rest of the diagonal is done
        if i.size == 0:
            continue
        old, conic = u[i + 2, j + 2], forms[:, i - window[0], j - window[2]]
        best, piece = choose(conic, frame, bright[i, j], old, _neighbours(u, i, j))
        bits = _widened(code, state, u, frame, i, j, piece)
        found = fine(conic, frame, bright[i, j], bits, u, i, j)
        found = np.where((bits != 0) & (found < LEAN), found, best)
        known = best < LEAN
        u[i + 2, j + 2] = np.where(known, found, old)
        code[i, j] = np.where(known, bits, code[i, j])
        changed = np.abs(u[i + 2, j + 2] - old) > tolerance
        _wake(active, i[changed], j[changed], True)
        touched |= _touch(window, i[changed], j[changed])
    return touched


def _slopes(u: FloatArray, code: Array, i: IntArray, j: IntArray, axis: int) -> FloatArray:
    """Return slopes along rows (0) or columns (1); 0 if no neighbour is known."""
    di, dj = (1, 0) if axis == 0 else (0, 1)
    less, more = (UP, DOWN) if axis == 0 else (LEFT, RIGHT)
    rim = np.pad(code, 1)
    here, before, behind = u[i + 2, j + 2], u[i + 2 - di, j + 2 - dj], u[i + 2 + di, j + 2 + dj]
    own, ahead, back = rim[i + 1, j + 1], rim[i + 1 + di, j + 1 + dj], rim[i + 1 - di, j + 1 - dj]
    both = (before < LEAN) & (behind < LEAN)
    # Where flows meet, the surface has a crease: the difference then stays on its own side.
    meets = ((own & less != 0) & (ahead & more != 0)) | ((own & more != 0) & (back & less != 0))
    sign = np.where(np.where(both, own & less != 0, before < LEAN), -1, 1)
    near = u[i + 2 + sign * di, j + 2 + sign * dj]
    far = u[i + 2 + 2 * sign * di, j + 2 + 2 * sign * dj]
    one = sign * np.where(far < LEAN, 2 * near - 1.5 * here - 0.5 * far, near - here)
    one = np.where(near < LEAN, one, 0.0)
    return np.where(both & ~meets, 0.5 * (behind - before), one)


def normals(u: FloatArray, code: Array, frame: FloatArray, window: IntArray, out: FloatArray) -> None:
    """Put the unit normals of a window: central differences, and one-sided ones at creases and borders.

    Parameters
    ----------
    u, frame, window
        See :func:`first_order`.
    code : uint8 array (h, w)
        From where each pixel has its value, see :func:`pieces`.
    out : float64 array (h, w, 3)
        Filled with x right, y up, z toward the camera; NaN where the value is not known [1].
    """
    i, j = (part.ravel() for part in np.mgrid[window[0] : window[1], window[2] : window[3]])
    fx, fy, cx, cy, skew = frame[:5]
    known = u[i + 2, j + 2] < LEAN
    q, p = (np.where(known, frame[8] * _slopes(u, code, i, j, axis), np.nan) for axis in (0, 1))
    n = np.stack([fx * p, skew * p + fy * q, 1.0 + frame[9] * ((j - cx) * p + (i - cy) * q)], axis=-1)
    if frame[10] > 0:  # the slopes are those of the distance along the ray
        down = (i - cy) / fy
        ray = np.stack([(j - cx - skew * down) / fx, down, np.ones(i.shape)], axis=-1)
        squares = np.sum(ray * ray, axis=-1, keepdims=True)
        n -= ray / squares
        n[:, 2] += 2.0 / squares[:, 0] - 1.0
    n[:, 1] *= -1.0
    out[i, j] = n / np.sqrt(np.sum(n * n, axis=-1, keepdims=True))
