"""Other orders of the lights that would explain the images better, found from sums of products of images.

With P the order and L the lights, what is left unexplained is tr((1 − Q Qᵀ) S) for S = Σ v vᵀ over pixels and Q an
orthonormal basis of the rows of L in that order. All exchanges of two rows are weighed at once by two products of
m × m matrices; turns, the reversed order and the order of names sorted as text are weighed one by one; and exchanges
are made as long as they help.
"""

from itertools import permutations

import numpy as np

from psstereo.types import FloatArray, IntArray

__all__ = ["best_orders"]

_FEW = 4
"""Lights up to which every order is tried."""
_KEPT = 5
"""Orders of each kind that are handed on."""
_HELPS = 0.98
"""Share to which an exchange must bring the misfit down to be made."""


def best_orders(values: FloatArray, lights: FloatArray, names: tuple[str, ...]) -> list[IntArray]:
    """Return orders worth a closer look, the given one first.

    Parameters
    ----------
    values : float64 array (m, n)
        Brightness over albedo, finite.
    lights : float64 array (m, 3)
        Unit directions as given.
    names : tuple of str
        Names of the images.

    Returns
    -------
    list of int array (m,)
        Row i says which of the given lights belongs to image i.
    """
    count = len(lights)
    given = np.arange(count)
    if count <= _FEW:
        return [np.array(order) for order in permutations(range(count))]
    gram = values @ values.T
    basis, _ = np.linalg.qr(lights)
    rest = np.eye(count) - basis @ basis.T
    gain = _exchanges(rest, gram)
    upper = np.argsort(gain, axis=None, kind="stable")[: 2 * _KEPT]
    swaps = [_swapped(given, *divmod(int(k), count)) for k in upper if k // count < k % count]
    others = [np.roll(given, k) for k in range(1, count)] + [given[::-1].copy()]
    text = np.array(sorted(given, key=lambda i: names[i]))
    others += [text, np.argsort(text)]
    others.sort(key=lambda order: _misfit(rest, gram, order))
    found = [given, *swaps, *others[:_KEPT], _descent(rest, gram)]
    unique = {tuple(int(i) for i in order): order for order in found}
    return list(unique.values())


def _swapped(order: IntArray, a: int, b: int) -> IntArray:
    """Return an order with two entries exchanged."""
    found = order.copy()
    found[[a, b]] = found[[b, a]]
    return found


def _misfit(rest: FloatArray, gram: FloatArray, order: IntArray) -> float:
    """Return what is left when image i is explained by light order[i]."""
    return float((rest[np.ix_(order, order)] * gram).sum())


def _exchanges(rest: FloatArray, gram: FloatArray) -> FloatArray:
    """Return by how much each exchange of two images changes the misfit, (m, m)."""
    product = rest @ gram
    mixed = product + product.T
    a, b = np.diag(rest), np.diag(gram)
    own = np.diag(product)
    # Σ_k (R_ak − R_bk)(S_bk − S_ak), less the terms k = a and k = b, whose cross entries stay where they are
    whole = mixed - own[:, None] - own[None, :]
    cut = (a[:, None] - rest) * (gram - b[:, None]) + (rest - a[None, :]) * (b[None, :] - gram)
    return np.asarray(2 * (whole - cut) - (a[:, None] - a[None, :]) * (b[:, None] - b[None, :]))


def _descent(rest: FloatArray, gram: FloatArray) -> IntArray:
    """Return the order that is reached by making the best exchange again and again."""
    order: IntArray = np.arange(len(gram))
    left = _misfit(rest, gram, order)
    for _ in range(2 * len(gram)):
        gain = _exchanges(rest[np.ix_(order, order)], gram)
        a, b = divmod(int(gain.argmin()), len(gram))
        if not left + gain[a, b] < _HELPS * left:
            break
        order = _swapped(order, a, b)
        left += float(gain[a, b])
    return order
