"""Numbers of photons, or of electrons that they set free."""

import numpy as np

from psstereo.types import FloatArray

__all__ = ["MANY", "poisson"]

MANY = 256.0
"""Mean from which a rounded, skewed normal number stands for a Poisson one: it is drawn several times as fast."""


def poisson(mean: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Draw numbers of independent events.

    Below `MANY` they are Poisson's exactly. From there on a normal number z is bent by the Cornish–Fisher expansion
    [1]_, ``μ + z √(μ − 1/12) + (z² − 1)/6 + (z − z³) / (72 √μ)``, and rounded to whole numbers; 1/12 is the variance
    that rounding adds. Mean, variance and skewness are Poisson's, and no probability of a set of outcomes is off by
    more than 10⁻⁵.

    Parameters
    ----------
    mean : float array of any shape
        Expected numbers, finite and not negative [1].
    rng : numpy Generator
        Source of the numbers.

    Returns
    -------
    float64 array of the same shape
        Whole numbers of zero or more.

    References
    ----------
    .. [1] E. A. Cornish, R. A. Fisher, "Moments and cumulants in the specification of distributions", Revue de
       l'Institut International de Statistique 5, 1938.
    """
    mean = np.asarray(mean, np.float64)
    many = mean >= MANY
    if not many.any():
        return np.asarray(rng.poisson(mean), np.float64)
    if many.all():
        return _bent_normal(mean, rng)
    numbers = np.zeros(mean.shape)
    numbers[~many] = rng.poisson(mean[~many])
    numbers[many] = _bent_normal(mean[many], rng)
    return numbers


def _bent_normal(mean: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return whole numbers for means of `MANY` or more."""
    z = rng.standard_normal(mean.shape)
    root = np.sqrt(mean)
    square = z * z
    # √(μ − 1/12) = √μ − 1 / (24 √μ), to within 4e-8
    bent = z * (root + (-square - 2.0) / (72.0 * root))
    square -= 1.0
    square /= 6.0
    bent += square
    bent += mean
    return np.asarray(np.rint(bent, out=bent))
