"""Brightness split into lights and scaled normals, known up to a 3 × 3 matrix.

Images of a matte surface have rank three: V = T S with lights T (m, 3) and scaled normals S (3, p), and T M with
M⁻¹ S is as good for every invertible M. A plain singular value decomposition takes shadows and highlights for data;
here it only starts an alternation that fits normals to lights and lights to normals with weights that leave those out.
"""

from dataclasses import dataclass

import numpy as np

from psstereo.errors import InputError
from psstereo.normals.gram import weighted_gram
from psstereo.normals.low_rank_fit import (
    LowRankFit,
    first_weights,
    fit_normals,
    outer_entries,
    reweighted,
    solve_symmetric,
)
from psstereo.types import BoolArray, FloatArray

__all__ = ["Factorisation", "factorise"]

_PIXELS = 4096
"""Pixels on which the lights are found; the normals of all others follow from them."""
_ROUNDS = 150
_LAST_ROUNDS = 6
_SETTLED = 2e-2
"""Turn of the space of the lights, as a share of the residual's spread, at which it counts as found."""
_EXACT = 1e-10


@dataclass(frozen=True, eq=False)
class Factorisation:
    """Lights and normals in a basis of their own.

    Attributes
    ----------
    lights : float64 array (m, 3)
        T.
    fit : LowRankFit
        Fit of all pixels, with their scaled normals S; its model and residuals are those of images made equally bright.
    relief_ratio : float
        Third singular value of the normals over the spread of the residuals: how far three dimensions stand out, near
        1 for a plane or a cylinder [1].
    settled : bool
        Whether the lights settled.
    """

    lights: FloatArray
    fit: LowRankFit
    relief_ratio: float
    settled: bool

    @property
    def spread(self) -> float:
        """Median over pixels of the robust residual over the pixel's brightest value [1]."""
        fitted = np.isfinite(self.fit.spread)
        return float(np.median(self.fit.spread[fitted])) if fitted.any() else float("inf")


def factorise(values: FloatArray, usable: BoolArray, start: FloatArray | None = None) -> Factorisation:
    """Split samples into lights and normals, leaving shadows and highlights out.

    Parameters
    ----------
    values : float64 array (m, p)
        Brightness, zero where not usable.
    usable : bool array (m, p)
        Which observations may be used.
    start : float64 array (m, 3), optional
        Lights to start from; from a Gram matrix of the images if absent.

    Returns
    -------
    Factorisation
        Lights and normals.

    Raises
    ------
    InputError
        If no pixel has enough observations.
    """
    level = _levels(values, usable)
    values = values / level[:, None]  # so that a dim image is not taken for one in shadow
    some = np.linspace(0, values.shape[1] - 1, min(_PIXELS, values.shape[1])).astype(np.intp)
    part, good = values[:, some], usable[:, some]
    weights = first_weights(np.where(good, part, np.nan))
    lights = np.linalg.qr(_start(part, weights) if start is None else start / level[:, None])[0]
    settled = False
    for _ in range(_ROUNDS):
        fit = fit_normals(part, lights, weights)
        fit = fit_normals(part, lights, reweighted(part, good, fit))
        weights = fit.weights
        moved = np.linalg.qr(_fit_lights(part, fit))[0]
        turn = float(np.linalg.norm(moved - lights @ (lights.T @ moved)))
        lights = moved
        if turn < max(_EXACT, _SETTLED * _typical(fit)):
            settled = True
            break
    fit = fit_normals(values, lights, first_weights(np.where(usable, values, np.nan)))
    for _ in range(_LAST_ROUNDS):
        fit = fit_normals(values, lights, reweighted(values, usable, fit))
    if not np.isfinite(fit.spread).any():
        raise InputError(
            given="No pixel follows a matte surface under these lights.",
            needed="Some pixels must be lit in five images or more.",
            remedy="Check the mask, the exposure and that all images show the same object from the same place.",
        )
    return Factorisation(lights * level[:, None], fit, _relief_ratio(fit), settled)


def _levels(values: FloatArray, usable: BoolArray) -> FloatArray:
    """Return how bright each image is, (m,)."""
    level = np.array(
        [np.quantile(row[good], 0.9) if good.any() else 0.0 for row, good in zip(values, usable, strict=True)]
    )
    if not (level > 0).all():
        raise InputError(
            given=f"Image {np.flatnonzero(~(level > 0))[0] + 1} is black nearly everywhere under the mask.",
            needed="Each light must reach a good part of the object.",
            remedy="Leave that image out.",
        )
    return level


def _start(values: FloatArray, weights: FloatArray) -> FloatArray:
    """Return the leading three-dimensional space of pixels that every light reaches, (m, 3)."""
    whole = (weights > 0).all(axis=0)
    even = values[:, whole if np.count_nonzero(whole) > 4 * len(values) else slice(None)]
    _, vectors = np.linalg.eigh(weighted_gram(even))
    return np.asarray(vectors[:, :-4:-1])


def _fit_lights(values: FloatArray, fit: LowRankFit) -> FloatArray:
    """Fit every light to the normals by weighted least squares, (m, 3)."""
    table = outer_entries(fit.normals) @ fit.weights.T
    lights, singular = solve_symmetric(table, fit.normals @ (fit.weights * values).T)
    if singular.all():
        raise InputError(
            given="The images have less than three dimensions: all normals lie in a plane, or are one.",
            needed="To tell lights apart, an object must show normals in all directions.",
            remedy="Give the directions of the lights; from a flat object, or one bent in one direction only, they "
            "cannot be told.",
        )
    if singular.any():
        raise InputError(
            given=f"Image {np.flatnonzero(singular)[0] + 1} shows too little of the object's shape.",
            needed="Each image must light normals of different directions.",
            remedy="Leave that image out together with its light.",
        )
    return lights.T


def _typical(fit: LowRankFit) -> float:
    fitted = np.isfinite(fit.spread)
    return float(np.median(fit.spread[fitted])) if fitted.any() else 0.0


def _relief_ratio(fit: LowRankFit) -> float:
    """Return the third singular value of the model's values, each pixel's brightest at one, over the spread."""
    fitted = np.isfinite(fit.spread)
    unit = fit.normals[:, fitted] / fit.model[:, fitted].max(axis=0)
    singular = np.linalg.svd(unit @ unit.T / np.count_nonzero(fitted), compute_uv=False)
    # lights are orthonormal, so that a light's share of a singular value is one over the root of their number
    third = np.sqrt(singular[2] / len(fit.model))
    return float(third / max(_typical(fit), np.finfo(np.float64).eps))
