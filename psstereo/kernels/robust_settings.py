"""Numbers of a robust fit, and what it tells; shared by the reference and its compiled twin."""

from typing import NamedTuple

from psstereo.types import Array, FloatArray, IntArray

__all__ = [
    "ADAPTIVE",
    "CONSISTENCY",
    "FEW",
    "LOG_CHANCE",
    "LOSSES",
    "LOSS_OF_FEW",
    "MAD",
    "MORE",
    "QUARTILE",
    "Kind",
    "RobustFit",
    "Settings",
]

LOSSES: dict[str, float] = {
    "l1": 1.0,
    "huber": 1.345,
    "cauchy": 2.385,
    "geman-mcclure": 1.0,
    "tukey": 4.685,
    "welsch": 2.985,
}
"""Losses with their tuning constants, in scales; the order gives their numbers. Those of 95 % efficiency under Gaussian
noise, but for Geman–McClure's, which is kept narrow to find the mode."""

ADAPTIVE = len(LOSSES)
"""Number of the loss that is chosen by the residuals."""


MAD = 1.4826022185056018
"""Standard deviation over the median of the absolute value, of Gaussian noise [1]."""
QUARTILE = 3.138344200661294
"""Standard deviation over the quartile of the absolute value, of Gaussian noise [1]."""
MORE = 60
"""Rounds at most, in multiples of the setting; after the first multiple the lit set and the scale are held [1]."""
FEW = 48
"""Lit observations below which an agreement may be chance [1]."""
LOG_CHANCE = -4.605170185988091
"""Logarithm of the chance, one in a hundred, above which an agreement is not trusted [1]."""
LOSS_OF_FEW = 15.0
"""Observations that picking a narrow agreement costs: the variance grows by one plus this over their number [1]."""
CONSISTENCY = (
    0.1255378914539751,
    0.8556923434719558,
    0.7948426858499678,
    0.3113590848375961,
    0.8280730033893932,
    0.8166857237133057,
    1.0,
)
"""``E[w r²] / E[w]`` of Gaussian noise of unit scale, by loss, the last for least squares; a test integrates them."""


class Kind:
    """What the residuals of a pixel are like."""

    WHITE = 0
    PILED_UP = 1
    STRUCTURED = 2
    PLAIN = 3
    """Too few lit observations for a robust step; left to least squares."""
    UNSOLVED = 4
    """The observations that agree do not tell a normal, or the rounds do not settle; left to least squares."""


class Settings(NamedTuple):
    """Numbers of a robust fit; a plain tuple, so that compiled code takes it as it is."""

    loss: int
    tuning: float
    scale: float  # standard deviation of the noise, 0 to estimate it
    low: float
    high: float
    dark: float  # share of the albedo below which a prediction counts as shadow
    floor: float  # of the scale, as a share of the 'high' quantile of brightness
    structure: float  # Moran's statistic for 96 observations from which residuals are structured
    piled: float  # ratio of the scales by quartile and by median below which residuals pile up at zero
    small: float  # scale, as a share of brightness, below which nothing needs explaining
    middle: float
    width: float
    keep: float  # observations that the middle ranks hold at least
    rounds: int
    tolerance: float
    least: int  # lit observations from which a robust step is taken


class RobustFit(NamedTuple):
    """What was found at some pixels.

    Attributes
    ----------
    x : float64 array (p, 3)
        Scaled normals in the basis of Q; NaN where `kind` is PLAIN or UNSOLVED.
    matrix : float64 array (p, 6)
        ``Σ g q qᵀ`` of the observations looked at, entries 11, 12, 22, 13, 23, 33.
    variance : float64 array (p,)
        Factor that makes the inverse of `matrix` the covariance of x; NaN where it cannot be told.
    scale : float64 array (p,)
        Standard deviation of the residuals that are not outliers.
    used : int64 array (p,)
        Observations with at least a quarter of their full weight.
    looked_at : int64 array (p,)
        Lit observations within the ranks that were fitted.
    usable : int64 array (p,)
        Observations that could take part.
    kind : int64 array (p,)
        One of :class:`Kind`.
    verdicts : uint8 array (m, p), or (0, 0) if not asked for
        See :class:`psstereo.verdict.Verdict`.
    """

    x: FloatArray
    matrix: FloatArray
    variance: FloatArray
    scale: FloatArray
    used: IntArray
    looked_at: IntArray
    usable: IntArray
    kind: IntArray
    verdicts: Array
