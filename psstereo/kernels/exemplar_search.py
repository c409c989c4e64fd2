"""Where to start a fit of exemplars from, out of candidate normals all over the hemisphere: the readable reference.

Under each candidate the amounts of the exemplars are a small problem of non-negative least squares, with weights
``1 / (soft² + y²)``, so that neither the highlight nor the dark decides alone. What they leave is summed with a loss
that grows slowly, because shadows are still among the observations. A candidate whose amounts are unlike those usual
on the object is held back, for a metal that catches no highlight is not a faint one. The best candidates that lie
apart are the starts.
"""

from typing import NamedTuple

import numpy as np

from psstereo.kernels.exemplar_nnls import nnls
from psstereo.types import FloatArray

__all__ = ["LEAST_AMOUNT", "LEAST_LOSS", "WEAK", "Candidates", "SearchSettings", "search"]

WEAK = 1e-6
"""Tie of every unknown, over the sum of weights."""
LEAST_LOSS = 1e-3
"""What is added to a loss before its logarithm is taken [1]."""
LEAST_AMOUNT = 1e-9
"""Least sum of amounts whose logarithm is taken, in units of the pixel's brightness [1]."""


class Candidates(NamedTuple):
    """Candidate normals and what exemplars show under them; a plain tuple, so that compiled code takes it as it is.

    Attributes
    ----------
    normals : float64 array (c, 3)
        Unit normals.
    columns : float64 array (c, q, m)
        What each exemplar shows; the last is light from the surroundings.
    reached : float64 array (c, m)
        1 where the light is neither below the surface nor grazing, 0 elsewhere.
    ties : float64 array (q,)
        Weight of each squared amount, over the sum of weights [1].
    """

    normals: FloatArray
    columns: FloatArray
    reached: FloatArray
    ties: FloatArray


class SearchSettings(NamedTuple):
    """Numbers of a search; a plain tuple, so that compiled code takes it as it is."""

    soft: float = 0.3  # brightness, over the top, below which observations weigh the same
    yard: float = 0.05  # residual, over the top, from which the loss grows slowly
    pull: float = 0.2  # of unusual amounts, against the logarithm of the loss
    apart: float = 0.95  # cosine of the angle that starts lie apart
    starts: int = 3


def search(
    y: FloatArray, g: FloatArray, usual: FloatArray, width: float, candidates: Candidates, s: SearchSettings
) -> FloatArray:
    """Return the normals to start from.

    Parameters
    ----------
    y : float64 array (p, m)
        Brightness over the pixel's top; finite [1].
    g : float64 array (p, m)
        Weights, 0 for what takes no part [1].
    usual : float64 array (p,)
        Logarithm of the usual sum of amounts in units of the pixel's top [1].
    width : float
        How far the logarithm varies over the object; infinite if nothing is known [1].
    candidates : Candidates
        The normals.
    s : SearchSettings
        Numbers of the search.

    Returns
    -------
    float64 array (p, s.starts, 3)
        Unit normals, the best first; a pixel with fewer that lie apart has the best again.
    """
    loss = np.zeros((len(y), len(candidates.normals)))
    base, size = g / (s.soft * s.soft + y * y), len(candidates.ties)
    for j, columns in enumerate(candidates.columns):
        w = base * candidates.reached[j]
        mass = w.sum(axis=1)
        a = (columns * w[:, None]) @ columns.T + np.eye(size) * ((WEAK + candidates.ties) * mass[:, None])[:, None]
        a += np.eye(size) * (mass == 0)[:, None, None]
        x = nnls(a, (w * y) @ columns.T, 0, np.zeros((len(y), size)), mass)
        r = y - x @ columns
        left = np.log(LEAST_LOSS + np.log1p(r * r * g / (s.yard * s.yard)).sum(axis=1))
        away = (np.log(np.maximum(x[:, :-1].sum(axis=1), LEAST_AMOUNT)) - usual) / width
        loss[:, j] = left + s.pull * np.log1p(away * away)
    return _apart(loss, candidates.normals, s)


def _apart(loss: FloatArray, normals: FloatArray, s: SearchSettings) -> FloatArray:
    """Return the candidates of least loss that lie apart."""
    found = np.zeros((len(loss), s.starts, 3))
    found[:] = normals[loss.argmin(axis=1)][:, None]
    left = loss.copy()
    for k in range(s.starts):
        best = left.argmin(axis=1)
        some = np.isfinite(left[np.arange(len(left)), best])
        found[some, k] = normals[best[some]]
        left[normals[best] @ normals.T > s.apart] = np.inf
    return found
