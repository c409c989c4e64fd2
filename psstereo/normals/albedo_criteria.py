"""How plain an albedo is: its entropy over the image, and its change from pixel to pixel.

A wrong bas-relief transformation multiplies the albedo by a factor that depends on the normal, so that a surface of few
colours seems to have many: the entropy of the albedo's histogram rises [1]_, and so does its change between neighbours.

References
----------
.. [1] N. G. Alldrin, S. P. Mallick, D. J. Kriegman, "Resolving the generalized bas-relief ambiguity by entropy
   minimization", Proc. IEEE CVPR, 2007. doi:10.1109/CVPR.2007.383208
"""

from dataclasses import dataclass

import numpy as np

from psstereo.normals.bas_relief import transformed
from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["Albedo", "albedo_of"]

_PAIRS = 4000
_PIXELS = 5000
_BIN = 0.02
"""Width of a bin of log albedo [1]."""
_KERNEL = np.exp(-0.5 * (np.arange(-5, 6) / 1.5) ** 2)
_SPAN = 2.5
"""Log albedo this far from the median falls into the last bin."""
_LEAST = 1e-300
_CHUNK = 16


@dataclass(frozen=True, eq=False)
class Albedo:
    """Scaled normals and what it takes to judge their lengths.

    Attributes
    ----------
    normals : float64 array (3, n)
        Scaled normals of some pixels.
    trust : float64 array (n,)
        Weight of each [1].
    first, second : float64 array (3, k)
        Scaled normals of pairs of neighbours.
    pair_trust : float64 array (k,)
        Weight of each pair [1].
    """

    normals: FloatArray
    trust: FloatArray
    first: FloatArray
    second: FloatArray
    pair_trust: FloatArray

    def variation(self, parameters: FloatArray) -> FloatArray:
        """Return the mean change of log albedo from a pixel to the next under transformations (k, 3), (k,) [1]."""
        return np.concatenate(
            [
                np.abs(_log_length(self.first, part) - _log_length(self.second, part)) @ self.pair_trust
                for part in _parts(parameters)
            ]
        )

    def entropy(self, parameters: FloatArray) -> FloatArray:
        """Return the entropy of the histogram of log albedo under transformations (k, 3), (k,) [1]."""
        return np.concatenate([self._entropies(part) for part in _parts(parameters)])

    def _entropies(self, parameters: FloatArray) -> FloatArray:
        level = _log_length(self.normals, parameters)
        level -= np.median(level, axis=1, keepdims=True)
        bins = int(2 * _SPAN / _BIN)
        index = np.clip((level + _SPAN) / _BIN, 0, bins - 1).astype(np.intp)
        found = []
        for row in index:
            share = np.convolve(np.bincount(row, self.trust, bins), _KERNEL, mode="same")
            share = share[share > 0] / share.sum()
            found.append(-(share * np.log(share)).sum())
        return np.array(found)


def albedo_of(normals: FloatArray, trust: FloatArray, mask: BoolArray) -> Albedo:
    """Choose the pixels and the pairs of neighbours on which an albedo is judged.

    Parameters
    ----------
    normals : float64 array (3, p)
        Scaled normals of the pixels of the mask, in row-major order.
    trust : float64 array (p,)
        Weight of each, zero where it has none [1].
    mask : bool array (h, w)
        Where the pixels lie.

    Returns
    -------
    Albedo
        On a few thousand pixels and pairs, evenly chosen.
    """
    number = np.full(mask.shape, -1, np.intp)
    number[mask] = np.where(trust > 0, np.arange(len(trust)), -1)
    sides = [(number[:, :-1], number[:, 1:]), (number[:-1], number[1:])]
    first = np.concatenate([one.ravel() for one, _ in sides])
    second = np.concatenate([other.ravel() for _, other in sides])
    both = (first >= 0) & (second >= 0)
    pairs = _some(np.flatnonzero(both), _PAIRS)
    first, second = first[pairs], second[pairs]
    pixels = _some(np.flatnonzero(trust > 0), _PIXELS)
    pair_trust = trust[first] * trust[second]
    return Albedo(
        normals[:, pixels], trust[pixels], normals[:, first], normals[:, second], pair_trust / pair_trust.sum()
    )


def _some(indices: IntArray, limit: int) -> IntArray:
    return indices[np.linspace(0, len(indices) - 1, min(limit, len(indices))).astype(np.intp)]


def _parts(parameters: FloatArray) -> list[FloatArray]:
    return [parameters[k : k + _CHUNK] for k in range(0, len(parameters), _CHUNK)]


def _log_length(normals: FloatArray, parameters: FloatArray) -> FloatArray:
    b = transformed(normals, parameters)
    return np.asarray(0.5 * np.log(np.maximum((b * b).sum(axis=1), _LEAST)))
