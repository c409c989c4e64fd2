"""The algebra of unknown strengths: the closed form from a Gram matrix, and Gauss–Newton steps with normals removed."""

from dataclasses import dataclass

import numpy as np

from psstereo.normals.gram import weighted_gram
from psstereo.normals.low_rank_fit import LowRankFit
from psstereo.types import FloatArray

__all__ = ["StrengthSystem", "closed_form", "strength_system"]

_ROUNDING = 1e-12
"""Determinacy a light below which rounding has made it."""


def closed_form(values: FloatArray, lights: FloatArray, weights: FloatArray | None = None) -> tuple[FloatArray, float]:
    """Return strengths that make every pixel's values a product with the light matrix, as well as can be.

    With s the reciprocal strengths, ``diag(V_p) s`` lies in the range of L for every pixel p. The sum of squared
    distances from that range is sᵀ Q s with ``Q = (1 − L L⁺) ∘ (V Vᵀ)``; s is the eigenvector of the smallest
    eigenvalue of Q relative to the diagonal of V Vᵀ.

    Parameters
    ----------
    values : float64 array (m, p)
        Brightness; pixels with an observation that is not finite, or of weight zero, are left out.
    lights : float64 array (m, 3)
        Unit directions L.
    weights : float64 array (m, p), optional
        Positive where an observation is lit.

    Returns
    -------
    strengths : float64 array (m,)
        With mean one; negative or infinite ones mean that the form failed.
    ratio : float
        Second smallest eigenvalue over the smallest; below 3 the answer is not to be trusted [1].
    """
    whole = np.isfinite(values).all(axis=0) if weights is None else (weights > 0).all(axis=0)
    gram = weighted_gram(values[:, whole])
    q, _ = np.linalg.qr(lights)
    scale = 1.0 / np.sqrt(np.diag(gram))
    normalised = (np.eye(len(lights)) - q @ q.T) * gram * scale * scale[:, None]
    found, vectors = np.linalg.eigh(normalised)
    reciprocal = scale * vectors[:, 0]
    with np.errstate(divide="ignore"):
        strengths = 1.0 / reciprocal
    smallest = max(float(found[0]), np.finfo(np.float64).eps)
    return strengths / strengths.mean(), float(found[1]) / smallest


@dataclass(frozen=True, eq=False)
class StrengthSystem:
    """Normal equations of the logarithms of the strengths, all normals eliminated.

    Attributes
    ----------
    matrix : float64 array (m, m)
        H; its null vector is 1, the common scale.
    right : float64 array (m,)
        g.
    """

    matrix: FloatArray
    right: FloatArray

    def solve(self, prior: float = 0.0, offset: FloatArray | None = None) -> FloatArray:
        """Return the step of the logarithms, (m,), of mean zero.

        Parameters
        ----------
        prior : float
            Weight of a tie to nominal strengths, as a share of the median diagonal of H [1].
        offset : float64 array (m,), optional
            Logarithms of the strengths over the nominal ones, up to a common factor.
        """
        if prior == 0 or offset is None:
            return self.free_step(self.right)
        tie = prior * float(np.median(np.diag(self.matrix)))
        tied = StrengthSystem(self.matrix + tie * _centring(len(self.matrix)), self.right)
        return tied.free_step(self.right - tie * (offset - offset.mean()))

    def free_step(self, right: FloatArray) -> FloatArray:
        """Return the solution of H x = right with mean zero, (m,)."""
        d = 1.0 / np.sqrt(np.diag(self.matrix))
        ones = (1.0 / d) / np.sqrt((1.0 / d) @ (1.0 / d))
        # the common scale is free: fill its direction so that the matrix can be inverted
        step = d * np.linalg.solve(self.matrix * d * d[:, None] + np.outer(ones, ones), d * right)
        return np.asarray(step - step.mean())

    def determinacy(self) -> float:
        """Return the smallest share of a light's own information that is left when normals are unknown [1].

        Zero or less where it is lost in rounding, or a light has no information at all.
        """
        diagonal = np.diag(self.matrix)
        if not (diagonal > 0).all():
            return 0.0
        d = 1.0 / np.sqrt(diagonal)
        share = float(np.linalg.eigvalsh(self.matrix * d * d[:, None])[1])
        return share if share > _ROUNDING * len(d) else 0.0


def _centring(count: int) -> FloatArray:
    return np.eye(count) - 1.0 / count


def strength_system(values: FloatArray, lights: FloatArray, fit: LowRankFit) -> StrengthSystem:
    """Build the normal equations at a fit.

    With A = diag(e) L and V ≈ A B, the derivative of a value by log e_i is its model; eliminating each pixel's normal
    (variable projection) subtracts ``Σ_p (w f A) (Aᵀ W A)⁻¹ (w f A)ᵀ`` from the diagonal Σ_p w f².

    Parameters
    ----------
    values : float64 array (m, p)
        Brightness, finite.
    lights : float64 array (m, 3)
        A.
    fit : LowRankFit
        Fit of these values with these lights.

    Returns
    -------
    StrengthSystem
        H and g.
    """
    weighted = fit.weights * fit.model
    diagonal = (weighted * fit.model).sum(axis=1)
    right = (weighted * (values - fit.model)).sum(axis=1)
    root = inverse_root(fit.gram)
    factors = np.zeros((3, *values.shape))
    for j in range(3):
        # columns of (w f) A G with G Gᵀ the inverse of each pixel's matrix
        np.matmul(lights, root[:, j], out=factors[j])
        factors[j] *= weighted
    flat = factors.transpose(1, 0, 2).reshape(len(values), -1)
    return StrengthSystem(np.diag(diagonal) - flat @ flat.T, right)


def inverse_root(gram: FloatArray) -> FloatArray:
    """Return G with G Gᵀ the inverse of symmetric 3 × 3 matrices, (3, 3, p); zero where singular."""
    a11, a21, a31 = gram[0, 0], gram[1, 0], gram[2, 0]
    a22, a32, a33 = gram[1, 1], gram[2, 1], gram[2, 2]
    out = np.zeros_like(gram)
    with np.errstate(all="ignore"):
        l11 = np.sqrt(a11)
        l21, l31 = a21 / l11, a31 / l11
        l22 = np.sqrt(a22 - l21 * l21)
        l32 = (a32 - l31 * l21) / l22
        l33 = np.sqrt(a33 - l31 * l31 - l32 * l32)
        out[0, 0], out[1, 1], out[2, 2] = 1 / l11, 1 / l22, 1 / l33
        out[0, 1] = -l21 / (l11 * l22)
        out[1, 2] = -l32 / (l22 * l33)
        out[0, 2] = (l21 * l32 / l22 - l31) / (l11 * l33)
    out[:, :, ~np.isfinite(out).all(axis=(0, 1))] = 0.0
    return out
