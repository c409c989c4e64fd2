"""Three ways to resolve the bas-relief ambiguity: maxima of brightness, entropy of albedo, strengths of lights.

Transformations are written as μ, ν, log λ; see :mod:`psstereo.normals.bas_relief`.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from psstereo.errors import InputError
from psstereo.normals.albedo_criteria import Albedo
from psstereo.normals.bas_relief import BasRelief, is_plausible
from psstereo.normals.diffuse_maxima import Maxima
from psstereo.types import FloatArray

__all__ = ["Resolved", "by_entropy", "by_maxima", "by_strengths"]

_LEAST_MAXIMA = 6
_PLAINNESS = 20.0
"""Power to which the plainness of the albedo is taken against the share of votes."""
_STILL = 1e-4
"""Change of log albedo from pixel to pixel that no photograph gets below."""
_STARTS = 4
_ROUNDS = 400
_GRID = (np.linspace(-1.0, 1.0, 9), np.linspace(-1.0, 1.0, 9), np.linspace(-1.2, 1.2, 9))
_FEW = 7
"""One pixel in so many is enough to tell how steep a surface is."""
_LOOSE = 0.2
"""Expected error of log λ beyond which strengths do not resolve the ambiguity."""

Cost = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, kw_only=True)
class Resolved:
    """A transformation and what spoke for it.

    Attributes
    ----------
    relief : BasRelief
        The transformation, with positive depth.
    support : float
        Share of the maxima that agree within about 5°, entropy of the albedo, or robust relative residual of the
        strengths, as the method has it [1].
    chance : float
        Median of the same figure over the transformations that were tried; NaN if none were [1].
    evidence : int
        Maxima, pixels or lights that were asked.
    """

    relief: BasRelief
    support: float
    chance: float
    evidence: int


def by_maxima(maxima: Maxima, albedo: Albedo) -> Resolved:
    """Resolve by the maxima of brightness, weighed by how plain the albedo then is.

    The share of maxima that agree is multiplied by a power of the inverse change of albedo: a bundle of normals seen
    edge-on or a bundle of lights may collect votes by chance, but makes the albedo restless.

    Parameters
    ----------
    maxima : Maxima
        Local maxima of brightness.
    albedo : Albedo
        Scaled normals in the same basis.

    Raises
    ------
    InputError
        If there are hardly any maxima, or no two of them make a plausible surface.
    """
    tried = maxima.candidates() if len(maxima) >= _LEAST_MAXIMA else np.zeros((0, 3))
    tried = tried[is_plausible(albedo.normals[:, ::_FEW], tried)] if len(tried) else tried
    if not len(tried):
        raise InputError(
            given=f"There are {len(maxima)} local maxima of brightness, and no two of them make a plausible surface.",
            needed=f"Some {_LEAST_MAXIMA} places must be brightest under a light because they face it.",
            remedy="Resolve by the entropy of the albedo or by the strengths of the lights, or give directions.",
        )
    votes = maxima.votes(tried)

    def cost(parameters: FloatArray) -> FloatArray:
        restless = np.log(albedo.variation(parameters) + _STILL)
        return np.asarray(_PLAINNESS * restless - np.log(maxima.votes(parameters)))

    best = _descend(_within(cost, albedo), tried, cost(tried))
    support = float(maxima.votes(best[None])[0])
    return Resolved(relief=_relief(best), support=support, chance=float(np.median(votes)), evidence=len(maxima))


def by_entropy(albedo: Albedo) -> Resolved:
    """Resolve by the entropy of the albedo: a surface of few colours should show few.

    Parameters
    ----------
    albedo : Albedo
        Scaled normals, in a basis in which the surface faces the camera on the whole.

    Raises
    ------
    InputError
        If no transformation makes a plausible surface.
    """
    grid = np.stack(np.meshgrid(*_GRID, indexing="ij"), axis=-1).reshape(-1, 3)
    grid = grid[is_plausible(albedo.normals[:, ::_FEW], grid)]
    if not len(grid):
        raise InputError(
            given="No bas-relief transformation makes a surface that is neither flat nor seen edge-on.",
            needed="The object must show normals in all directions.",
            remedy="Give the directions of the lights.",
        )
    entropies = albedo.entropy(grid)
    best = _descend(_within(albedo.entropy, albedo), grid, entropies)
    return Resolved(
        relief=_relief(best),
        support=float(albedo.entropy(best[None])[0]),
        chance=float(np.median(entropies)),
        evidence=albedo.normals.shape[1],
    )


def by_strengths(lights: FloatArray) -> Resolved:
    """Resolve by lights that all have strength one.

    Parameters
    ----------
    lights : float64 array (m, 3)
        Lights over their strengths, in a basis in which the surface faces the camera on the whole.

    Raises
    ------
    InputError
        If the strengths are as well explained by other transformations, as those of a ring of lights are.
    """
    from scipy.optimize import least_squares

    def excess(parameters: FloatArray) -> FloatArray:
        # λ⁻¹ as exp(−log λ): l' = (l₁, l₂, (l₃ − μ l₁ − ν l₂)/λ)
        z = (lights[:, 2] - parameters[0] * lights[:, 0] - parameters[1] * lights[:, 1]) * np.exp(-parameters[2])
        log_length = 0.5 * np.log(lights[:, 0] ** 2 + lights[:, 1] ** 2 + z * z)
        return np.asarray(log_length - log_length.mean())

    starts = [np.array([0.0, 0.0, log_depth]) for log_depth in np.linspace(-2.0, 2.0, 5)]
    fits = [least_squares(excess, start, loss="soft_l1", f_scale=0.05, xtol=1e-12, ftol=1e-12) for start in starts]
    best = min(fits, key=lambda fit: fit.cost)
    residual = excess(best.x)
    spread = float(1.4826 * np.median(np.abs(residual)))
    least = float(np.linalg.svd(np.asarray(best.jac), compute_uv=False)[-1]) / np.sqrt(len(lights))
    expected = spread / least if least > 1e-6 else np.inf
    if not expected < _LOOSE:
        raise InputError(
            given="The lights' strengths leave the depth of the relief uncertain by a factor of "
            f"{np.exp(min(expected, 50.0)):.3g}.",
            needed="Lights at several heights above the object, whose strengths are as given.",
            remedy="Resolve by maxima of brightness or by the entropy of the albedo instead.",
        )
    return Resolved(relief=_relief(best.x), support=spread, chance=float("nan"), evidence=len(lights))


def _within(cost: Cost, albedo: Albedo) -> Cost:
    """Return a cost that is infinite where the surface would be flat or seen edge-on."""
    few = albedo.normals[:, ::_FEW]
    return lambda parameters: np.asarray(np.where(is_plausible(few, parameters), cost(parameters), np.inf))


def _descend(cost: Cost, tried: FloatArray, costs: FloatArray) -> FloatArray:
    """Return the lowest point reached from the best few of the transformations tried."""
    from scipy.optimize import minimize

    def one(parameters: FloatArray) -> float:
        return float(cost(parameters[None])[0])

    found = []
    for k in np.argsort(costs, kind="stable")[:_STARTS]:
        start = np.array(tried[k], np.float64)
        fit = minimize(one, start, method="Nelder-Mead", options={"xatol": 1e-5, "fatol": 1e-6, "maxiter": _ROUNDS})
        found.append((float(fit.fun), np.asarray(fit.x)))
    return min(found, key=lambda pair: pair[0])[1]


def _relief(parameters: FloatArray) -> BasRelief:
    mu, nu, log_depth = (float(one) for one in parameters)
    return BasRelief(mu=mu, nu=nu, depth=float(np.exp(log_depth)))
