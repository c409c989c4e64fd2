"""What a model that does not hold does to a fit, told from what it leaves over: the readable reference.

Error bars from the size of the residuals take these for noise that is independent from light to light. What a wrong
reflectance, light from neighbouring surfaces or a shadow leaves over is not: it goes smoothly with the direction of the
light, so that a hundred lights count as far fewer. Two things are told of it at each pixel and added to the covariance.

1. **What goes with the direction** [1]_. Residuals are taken for white noise of variance σ² plus a random function of
   the direction, of variance τ² and of correlation exp(−angle / `LENGTH`), which is positive definite on the
   sphere [2]_. With R what a fit leaves of an error, ``E[rᵀr] = σ² tr R + τ² tr RK`` and
   ``E[rᵀKr] = σ² tr RK + τ² tr RKRK``: two equations for two variances, unbiased whatever the distribution [3]_. The
   estimator ``A⁻¹ X r`` then varies by ``τ² A⁻¹ X K Xᵀ A⁻¹`` beyond noise. The sum over pairs of residuals themselves,
   as in covariances that are robust to correlation [4]_, does not do here: the fit has made it zero for all that is as
   smooth as its columns. What R took away is what the traces give back. Chance makes τ² differ from zero too, and bars
   may not grow by that: ``rᵀKr / rᵀr`` of noise alone has a mean and a variance that the traces tell, and τ² counts
   from `CHANCE` to `CERTAIN` such deviations above the mean.
2. **What outliers would have done.** A robust fit gives little weight to what contradicts it, and is right if that is
   no part of the model; but where the model is wrong it may be the other way round. The step d that the normal would
   make with the full weight of all observations tells the two apart [5]_: independent outliers pull here and there, and
   the variance of d follows from them; d dᵀ counts as far as it is more than that. Residuals far beyond `FAR`
   scales count less and less in either, since sharp highlights and cast shadows are rightly left out.

It tells nothing of a misfit that the unknowns can follow, since that leaves no residual, nor of errors of the lights
that all pixels share. It says too much where a cast shadow or a highlight fills one side of the sky and the rest of
the lights are right. With fewer than `LEAST` observations more than unknowns it says nothing. The numbers below were
chosen on path-traced scenes of many materials.

References
----------
.. [1] M. C. Kennedy, A. O'Hagan, "Bayesian calibration of computer models", J. R. Stat. Soc. B 63(3), 2001.
   doi:10.1111/1467-9868.00294
.. [2] T. Gneiting, "Strictly and non-strictly positive definite functions on spheres", Bernoulli 19(4), 2013.
   doi:10.3150/12-BEJSP06
.. [3] C. R. Rao, "Estimation of variance and covariance components - MINQUE theory", J. Multivariate Anal. 1, 1971.
   doi:10.1016/0047-259X(71)90001-7
.. [4] T. G. Conley, "GMM estimation with cross sectional dependence", J. Econometrics 92, 1999.
   doi:10.1016/S0304-4076(98)00084-0
.. [5] J. A. Hausman, "Specification tests in econometrics", Econometrica 46, 1978. doi:10.2307/1913827
"""

from typing import NamedTuple

import numpy as np

from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["CERTAIN", "CHANCE", "FAR", "LEAST", "LENGTH", "NEGLIGIBLE", "Sky", "misfit_spread", "sky_of"]

LENGTH = 0.5
"""Angle between lights over which the correlation of a misfit falls by e [rad]."""
FAR = 20.0
"""Scales at which a residual counts half [1]."""
CHANCE, CERTAIN = 1.0, 3.0
"""Deviations above what noise alone would give, from which a misfit counts, and from which all of it [1]."""
LEAST = 8
"""Observations more than unknowns from which anything can be told."""
NEGLIGIBLE = 1e-6
"""Determinant of the two equations, over the product on its diagonal, below which they are one and the same [1]."""
_CELLS = 128
"""Lights from which neighbours are put together, since the work goes with the square."""


class Sky(NamedTuple):
    """How the misfits at lights hang together; a plain tuple, so that compiled code takes it as it is.

    Attributes
    ----------
    cell : int64 array (m,)
        Which of the k cells each light is in; each has one of its own in rigs of up to 128.
    correlation : float64 array (k, k)
        Correlation of the misfit between cells [1].
    """

    cell: IntArray
    correlation: FloatArray


def sky_of(directions: FloatArray) -> Sky:
    """Return how the misfits at the lights of a rig hang together.

    Lights of large rigs are put into cells around lights that are far from each other, and those of one cell count as
    one direction. Not for lamps so near that their order in the sky changes over the object.

    Parameters
    ----------
    directions : float64 array (m, 3)
        Unit vectors from the surface to the lights [1].

    Returns
    -------
    Sky
        Cells, and how these are correlated.
    """
    count = len(directions)
    if count <= _CELLS:
        return Sky(np.arange(count), np.exp(-_angles(directions, directions) / LENGTH))
    centres = [int(np.argmax(directions @ directions.mean(axis=0)))]
    nearest = _angles(directions, directions[centres])[:, 0]
    while len(centres) < _CELLS:
        centres.append(int(np.argmax(nearest)))
        nearest = np.minimum(nearest, _angles(directions, directions[centres[-1:]])[:, 0])
    chosen = directions[centres]
    cell = np.argmin(_angles(directions, chosen), axis=1)
    return Sky(cell.astype(np.int64), np.exp(-_angles(chosen, chosen) / LENGTH))


def _angles(a: FloatArray, b: FloatArray) -> FloatArray:
    across = np.cross(a[:, None], b[None])
    return np.asarray(np.arctan2(np.sqrt((across * across).sum(axis=2)), a @ b.T))


def misfit_spread(
    columns: FloatArray,
    matrix: FloatArray,
    free: BoolArray,
    gate: FloatArray,
    residuals: FloatArray,
    influence: FloatArray,
    scale: FloatArray,
    sky: Sky,
) -> FloatArray:
    """Return what a fit's covariance lacks because its model does not hold.

    Not for fits whose last two unknowns are not turns of the normal, and no substitute for the covariance by noise, to
    which it is added.

    Parameters
    ----------
    columns : float64 array (p, c, m)
        Derivatives of what each observation should be by the c unknowns, the last two of which turn the normal along
        two tangents [unit of the residuals over that of the unknown, which is rad for the last two].
    matrix : float64 array (p, c, c)
        ``Σ g x xᵀ`` of the columns x and the gate g, with the ties of the unknowns on its diagonal.
    free : bool array (p, c)
        Unknowns that are not held.
    gate : float64 array (p, m)
        Inverse variances of the observations up to a factor, near 1; zero for those that take no part [1].
    residuals : float64 array (p, m)
        Observations less the fit.
    influence : float64 array (p, m)
        Residuals as far as they move the fit: times their weight, over the mean slope of that product; the residuals
        themselves in least squares.
    scale : float64 array (p,)
        Standard deviation of the residuals that are not outliers [unit of the residuals].
    sky : Sky
        See :func:`sky_of`.

    Returns
    -------
    float64 array (p, 3)
        Covariance of the two turns beyond that by noise, entries 11, 12, 22; zero where there is nothing to tell it
        from [rad²].
    """
    root, size = np.sqrt(gate), columns.shape[1]
    x = np.where(free[:, :, None], columns, 0.0) * root[:, None]
    both = free[:, :, None] & free[:, None]
    spare = (gate > 0).sum(axis=1) - free.sum(axis=1)
    sound = (spare >= LEAST) & np.isfinite(matrix).all(axis=(1, 2)) & np.isfinite(influence).all(axis=1)
    inverse = np.linalg.inv(np.where(both & sound[:, None, None], matrix, np.eye(size)))
    r = np.where(gate > 0, residuals, 0.0) * root
    r = r / (1.0 + (r / (FAR * scale[:, None])) ** 2)
    step = (inverse @ (x @ r[:, :, None]))[:, :, 0]
    left = r - (step[:, None] @ x)[:, 0]
    through = inverse[:, -2:]
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        variance, product = _variance(x, inverse, root, left, spare, sky)
        spread = variance[:, None, None] * (through @ product @ through.transpose(0, 2, 1))
        unlike = np.where(gate > 0, r - influence * root, 0.0)
        chance = (unlike * unlike).sum(axis=1) / spare * (inverse[:, -2, -2] + inverse[:, -1, -1])
        square = step[:, -2] ** 2 + step[:, -1] ** 2
        share = np.where(square > chance, 1.0 - chance / square, 0.0)
    turn = step[:, -2:]
    spread = spread + share[:, None, None] * turn[:, :, None] * turn[:, None]
    told = np.stack([spread[:, 0, 0], spread[:, 0, 1], spread[:, 1, 1]], axis=1)
    return np.where(sound[:, None], told, 0.0)


def _variance(
    x: FloatArray, inverse: FloatArray, root: FloatArray, left: FloatArray, spare: IntArray, sky: Sky
) -> tuple[FloatArray, FloatArray]:
    """Return τ², between zero and what explains all that is left over, and ``X K Xᵀ``; see the module's description."""
    within = np.eye(len(sky.correlation))[sky.cell]  # (m, k)
    gathered = (x * root[:, None]) @ within
    mass = (root * root) @ within
    rest = (left * root) @ within
    related = gathered @ sky.correlation
    product = related @ gathered.transpose(0, 2, 1)
    once = inverse @ product
    trace = mass.sum(axis=1) - np.einsum("pii->p", once)
    twice = np.einsum("pi,ij,pj->p", mass, sky.correlation**2, mass)
    twice -= 2.0 * np.einsum("pij,pji->p", inverse, (related * mass[:, None]) @ related.transpose(0, 2, 1))
    twice += np.einsum("pij,pji->p", once, once)
    plain, alike = (left * left).sum(axis=1), np.einsum("pi,ij,pj->p", rest, sky.correlation, rest)
    determinant = spare * twice - trace * trace
    found = (spare * alike - trace * plain) / determinant
    by_chance = np.sqrt(2.0 * determinant / (spare + 2.0)) / spare
    rise = np.clip(((alike / plain - trace / spare) / by_chance - CHANCE) / (CERTAIN - CHANCE), 0.0, 1.0)
    usable = (plain > 0) & (trace > 0) & (determinant > NEGLIGIBLE * spare * twice)
    found = np.clip(found, 0.0, plain / trace) * rise * rise * (3.0 - 2.0 * rise)
    return np.where(usable, found, 0.0), product
