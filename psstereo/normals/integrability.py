"""Which basis makes factored normals belong to a surface.

Normals from a factorisation are s with b = A s for an unknown matrix A with rows a₁, a₂, a₃. The slopes b₁/b₃ and b₂/b₃
of a surface have ∂(b₁/b₃)/∂y = ∂(b₂/b₃)/∂x. Written out, with s_x and s_y the derivatives of s, that is

    (a₁ × a₃) · (s_y × s) = (a₂ × a₃) · (s_x × s),

linear in the six numbers of c₁ = a₁ × a₃ and c₂ = a₂ × a₃, and blind to albedo, since s may be divided by any function.
It gives A up to the bas-relief transformations, which keep a surface a surface.
"""

from dataclasses import dataclass

import numpy as np

from psstereo.errors import InputError
from psstereo.types import BoolArray, FloatArray

__all__ = ["IntegrabilityForm", "IntegrableBasis", "integrable_basis"]

_JUMP = 0.2
"""Change of a direction from pixel to pixel beyond which it counts as a jump of depth [rad]."""
_ROUNDS = 20
_EXACT = 1e-5
"""Least singular value beside the largest; finite differences are no better than that."""
_LEAST = 50
"""Least number of pixels with neighbours; the equations have six unknowns."""


@dataclass(frozen=True, eq=False)
class IntegrableBasis:
    """A basis in which the normals belong to a surface.

    Attributes
    ----------
    matrix : float64 array (3, 3)
        A, with b = A s; b₃ is positive for most pixels.
    ratio : float
        Fifth over sixth singular value of the equations: how far it stands out, 1 for normals of no surface [1].
    equations : int
        Pixels that gave an equation.
    form : IntegrabilityForm
        How badly any other basis does.
    """

    matrix: FloatArray
    ratio: float
    equations: int
    form: "IntegrabilityForm"


@dataclass(frozen=True, eq=False)
class IntegrabilityForm:
    """The equations of integrability, as far as they tell bases apart.

    Attributes
    ----------
    whitener : float64 array (3, 3)
        Matrix that makes the factored normals' directions evenly spread.
    singular : float64 array (6,)
        Singular values of the equations for (c₁, c₂), from the smallest.
    vectors : float64 array (6, 6)
        Their vectors, as columns.
    """

    whitener: FloatArray
    singular: FloatArray
    vectors: FloatArray

    def violations(self, matrix: FloatArray) -> FloatArray:
        """Return how far a basis A (3, 3) is from integrable, (5,), 1 where residuals in unison would explain it."""
        a1, a2, a3 = matrix @ np.linalg.inv(self.whitener)
        c = np.concatenate([np.cross(a1, a3), np.cross(a2, a3)])
        least = max(float(self.singular[0]), _EXACT * float(self.singular[-1]))
        return np.asarray((self.vectors[:, 1:].T @ c) / np.sqrt(c @ c) * self.singular[1:] / least)


def integrable_basis(normals: FloatArray, spread: FloatArray, mask: BoolArray) -> IntegrableBasis:
    """Find the basis in which factored normals belong to a surface.

    Parameters
    ----------
    normals : float64 array (3, p)
        Factored normals s of the pixels of the mask, in row-major order.
    spread : float64 array (p,)
        Relative residual of each pixel, infinite where it has no normal [1].
    mask : bool array (h, w)
        Where the pixels lie.

    Returns
    -------
    IntegrableBasis
        The basis.

    Raises
    ------
    InputError
        If too few pixels have neighbours.
    """
    whitener = _whitener(normals[:, np.isfinite(spread)])
    equations, trust = _equations(whitener @ normals, spread, mask)
    if len(equations) < _LEAST:
        raise InputError(
            given=f"{len(equations)} pixels have a normal and four neighbours without a jump between them.",
            needed=f"At least {_LEAST} are needed to tell which normals belong to a surface.",
            remedy="Use larger images, or a mask without gaps.",
        )
    singular, vectors = _spectrum(equations, trust)
    found = vectors[:, 0]
    c1, c2 = found[:3], found[3:]
    a3 = np.cross(c1, c2)
    length = float(a3 @ a3)
    ratio = float(singular[1] / max(singular[0], np.finfo(np.float64).eps * singular[-1], np.finfo(np.float64).tiny))
    if not length > 0 or not singular[1] > _EXACT * singular[-1]:
        raise InputError(
            given="More than one basis makes the normals those of a surface.",
            needed="The surface must bend in both directions, and be no paraboloid or saddle of second degree.",
            remedy="Give the directions of the lights; from this object they cannot be told.",
        )
    matrix = np.stack([np.cross(a3, c1) / length, np.cross(a3, c2) / length, a3]) @ whitener
    toward = (matrix[2] @ normals)[np.isfinite(spread)]
    if np.median(np.sign(toward)) < 0:
        matrix = -matrix
    return IntegrableBasis(matrix, ratio, len(equations), IntegrabilityForm(whitener, singular, vectors))


def _whitener(normals: FloatArray) -> FloatArray:
    """Return the matrix that makes the directions' second moment the identity, (3, 3)."""
    unit = normals / np.sqrt((normals * normals).sum(axis=0))
    values, vectors = np.linalg.eigh(unit @ unit.T / unit.shape[1])
    return np.asarray((vectors / np.sqrt(np.maximum(values, np.finfo(np.float64).tiny))).T)


def _equations(normals: FloatArray, spread: FloatArray, mask: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Return rows (s_y × s, −s_x × s), (n, 6), and how far to trust each, (n,)."""
    field = np.full((*mask.shape, 3), np.nan)
    length = np.sqrt((normals * normals).sum(axis=0))
    unit = normals / np.where(np.isfinite(spread) & (length > 0), length, np.nan)
    field[mask] = unit.T
    residual = np.full(mask.shape, np.nan)
    residual[mask] = spread
    middle = field[1:-1, 1:-1]
    along_x = (field[1:-1, 2:] - field[1:-1, :-2]) / 2
    along_y = (field[:-2, 1:-1] - field[2:, 1:-1]) / 2  # rows run down, y runs up
    change = np.sqrt((along_x * along_x + along_y * along_y).sum(axis=-1))
    kept = (change < _JUMP) & np.isfinite(residual[1:-1, 1:-1])  # false where a neighbour or the pixel is missing
    s, s_x, s_y = middle[kept], along_x[kept], along_y[kept]
    own = residual[1:-1, 1:-1][kept]
    typical = max(float(np.median(own)), np.finfo(np.float64).tiny) if len(own) else 1.0
    return np.concatenate([np.cross(s_y, s), -np.cross(s_x, s)], axis=1), 1.0 / (1.0 + (own / typical) ** 2)


def _spectrum(equations: FloatArray, trust: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return singular values of the robustly weighted equations from the smallest, and their vectors as columns."""
    weights = trust
    for _ in range(_ROUNDS):
        values, vectors = np.linalg.eigh((equations * weights[:, None]).T @ equations)
        residual = equations @ vectors[:, 0]
        scale = max(2 * 1.4826 * float(np.median(np.abs(residual))), np.finfo(np.float64).eps)
        weights = trust / (1.0 + (residual / scale) ** 2)
    return np.sqrt(np.maximum(values, 0.0)), vectors
