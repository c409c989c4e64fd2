"""What an exemplar fit is asked with and what it answers: numbers, dictionary, fit; for the reference and its twin."""

from typing import NamedTuple

import numpy as np

from psstereo.types import FloatArray, IntArray

__all__ = [
    "CUBED",
    "DAMPING",
    "DARK_SHARE",
    "FAILED",
    "LEAST_HEIGHT",
    "LEAST_SLOPE",
    "MAD",
    "SETTLED",
    "SHORT",
    "UNSETTLED",
    "WEAK",
    "Dictionary",
    "Fit",
    "Settings",
    "no_fit",
]

SETTLED, UNSETTLED, FAILED, SHORT = 0, 1, 2, 3
"""Outcomes: converged; not; nothing fits; too few lit observations or no start."""
MAD = 1.4826022185056018
"""Standard deviation over the median of the absolute value, of Gaussian noise [1]."""
DAMPING = 1e-3
"""Share by which the normal's diagonal entries are raised."""
WEAK = 1e-8
"""Tie of every unknown, so that amounts of exemplars that look alike are determined."""
LEAST_HEIGHT = 0.02
"""Least z of a normal before it is made a unit vector again."""
CUBED = 3.0
"""Brightness over the top up to which it counts for the mean half vector."""
LEAST_SLOPE = 0.05
"""Mean slope of the residuals' influence from which their variance can be told."""
DARK_SHARE = 3.0
"""What stands for the weight of an observation in shadow."""


class Settings(NamedTuple):
    """Numbers of a fit; a plain tuple, so that compiled code takes it as it is."""

    level: float = 0.02  # brightness, as a share of the pixel's top, up to which it counts as shadow
    top: float = 0.95
    low: float = 0.2  # rank of brightness from which observations take part in the start
    dark: float = 0.02  # cosine up to which a light counts as grazing
    tuning: float = 1.0  # where the loss turns, in standard deviations of the residuals
    floor: float = 2e-3  # of the scale, as a share of the top
    poor: float = 0.02  # scale from which a second start is tried
    better: float = 0.6  # loss of the second start, over that of the first, from which on it is taken
    yard: float = 0.02  # scale of the residuals by which two starts are compared
    longest: float = 0.15  # longest step of the normal in a round [rad]
    tolerance: float = 1e-5  # step of the normal at which rounds stop [rad]
    told: float = 0.02  # way left to go at which rounds stop, in standard deviations of the residuals
    near: float = 0.01  # step of the normal below which steps are prolonged [rad]
    reach: float = 1.0  # longest prolongation, in steps; up to one, what shrinks by any share still shrinks
    settled: float = 2e-3  # last step up to which a fit counts as converged [rad]
    rounds: int = 48
    freeze: int = 4
    least: int = 12  # lit observations that a fit needs


class Dictionary(NamedTuple):
    """Exemplar materials as sums of lobes; a plain tuple, so that compiled code takes it as it is.

    Attributes
    ----------
    kinds, shapes : int64, float64 arrays (k,)
        The lobes; see :func:`psstereo.kernels.exemplar_lobes.lobes`.
    mix : float64 array (q, k)
        Amount of each lobe in each exemplar; (0, 0) where every lobe is an exemplar of its own.
    ties : float64 array (q,)
        Weight of each squared amount, against a squared residual with the top for one [1].
    noise_ties : float64 array (q,)
        The same in units of the squared scale of the residuals: what the data tell badly is held the more [1].
    """

    kinds: IntArray
    shapes: FloatArray
    mix: FloatArray
    ties: FloatArray
    noise_ties: FloatArray


class Fit(NamedTuple):
    """What was found at some pixels.

    Attributes
    ----------
    normal : float64 array (p, 3)
        Unit normals; NaN where there is no fit.
    amounts : float64 array (p, q)
        Of each exemplar, in the unit of the values.
    spread : float64 array (p, 3)
        Covariance of the normal along :func:`psstereo.kernels.exemplar_lobes.tangents`, entries 11, 12, 22; NaN where
        it cannot be told [rad²].
    outcome : int64 array (p,)
        `SETTLED`, `UNSETTLED`, `FAILED` or `SHORT`.
    share : float64 array (p, m)
        Weight of each observation, 0 … 1, negative for values below the fit; 3 where it is dark, NaN where it is not
        usable.
    scale : float64 array (p,)
        Where the loss turns: `tuning` standard deviations of the residuals that are not outliers, over the top [1].
    evidence : float64 array (p,)
        How much less there is in doubt than by Lambert's law with the start: the sum of the squared residuals over the
        scale, none of which counts more than one, so that a highlight which a robust fit left out is little [1].
    loss : float64 array (p,)
        By which answers from several starts are compared: the sum of the logarithms of one plus the squared residuals
        over the square of `Settings.yard` [1].
    """

    normal: FloatArray
    amounts: FloatArray
    spread: FloatArray
    outcome: IntArray
    share: FloatArray
    scale: FloatArray
    evidence: FloatArray
    loss: FloatArray

    def part(self, pixels: slice | IntArray) -> "Fit":
        """Return some pixels' arrays: views for a slice."""
        normal, amounts, spread = self.normal[pixels], self.amounts[pixels], self.spread[pixels]
        outcome, share, scale = self.outcome[pixels], self.share[pixels], self.scale[pixels]
        return Fit(normal, amounts, spread, outcome, share, scale, self.evidence[pixels], self.loss[pixels])


def no_fit(pixels: int, lights: int, exemplars: int) -> Fit:
    """Return the answer of a fit in which no pixel has one yet.

    Parameters
    ----------
    pixels, lights, exemplars : int
        The sizes p, m and q.

    Returns
    -------
    Fit
        NaN all over, every outcome `SHORT`.
    """
    return Fit(
        np.full((pixels, 3), np.nan),
        np.full((pixels, exemplars), np.nan),
        np.full((pixels, 3), np.nan),
        np.full(pixels, SHORT),
        np.full((pixels, lights), np.nan),
        np.full(pixels, np.nan),
        np.zeros(pixels),
        np.full(pixels, np.nan),
    )
