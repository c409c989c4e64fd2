"""Bas-relief ambiguity and diffuse maxima: where a matte surface is brightest, its normal points at the light.

At a local maximum of l · b under one light, with albedo that does not change there, n is parallel to l [1]_. With the
matrix K of :mod:`psstereo.normals.bas_relief` that is ``K Kᵀ b ∥ l``, linear in μ, ν and τ = μ² + ν² + λ²: two maxima
give a transformation, and all others vote on it. Maxima of the albedo itself vote for nothing in common.

The maxima are those of the fitted model, not of the photographs, so that highlights are none.

References
----------
.. [1] T. Papadhimitri, P. Favaro, "A closed-form, consistent and robust solution to uncalibrated photometric stereo
   via local diffuse reflectance maxima", Int. J. Comput. Vis. 107(2), 139-154, 2014. doi:10.1007/s11263-013-0665-5
"""

from dataclasses import dataclass

import numpy as np

from psstereo.normals.bas_relief import transformed
from psstereo.normals.low_rank_fit import outer_entries, solve_symmetric
from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["Maxima", "find_maxima"]

_RADIUS = 3
"""A maximum is the brightest of a square of 2 · 3 + 1 pixels of the grid, all of which have a normal."""
_BADLY_FITTED = 4.0
"""A pixel's residual over the median at which it is no candidate."""
_NEAR = np.radians(5.0)
"""Angle between light and normal at which a vote falls to a quarter."""
_PAIRS = 1500
_VOTERS = 2000
_CHUNK = 32


@dataclass(frozen=True, eq=False)
class Maxima:
    """Local maxima of brightness.

    Attributes
    ----------
    normals : float64 array (3, n)
        Unit normals at the maxima.
    lights : float64 array (3, n)
        Unit lights under which they are maxima.
    """

    normals: FloatArray
    lights: FloatArray

    def __len__(self) -> int:
        return int(self.normals.shape[1])

    def candidates(self) -> FloatArray:
        """Return transformations (k, 3), as μ, ν, log λ, each from two maxima; pairs are drawn with a fixed seed."""
        rng = np.random.default_rng(0)
        pairs = rng.integers(0, len(self), (2, _PAIRS))
        pairs = pairs[:, pairs[0] != pairs[1]]
        table, right = self._equations()
        found, singular = solve_symmetric(table[:, pairs].sum(axis=1), right[:, pairs].sum(axis=1))
        mu, nu, tau = found
        square = tau - mu * mu - nu * nu
        good = ~singular & (square > 0)
        return np.stack([mu[good], nu[good], 0.5 * np.log(square[good])], axis=1)

    def votes(self, parameters: FloatArray) -> FloatArray:
        """Return how large a share of the maxima agrees with each of several transformations (k, 3), (k,) [1]."""
        some = np.linspace(0, len(self) - 1, min(_VOTERS, len(self))).astype(np.intp)
        shares = [
            (1.0 / (1.0 + (angle / _NEAR) ** 2) ** 2).mean(axis=1)
            for angle in (self._angles(parameters[k : k + _CHUNK], some) for k in range(0, len(parameters), _CHUNK))
        ]
        return np.concatenate(shares) if shares else np.zeros(0)

    def angles(self, parameters: FloatArray) -> FloatArray:
        """Return the angle between light and normal at each maximum under one transformation (3,), (n,) [rad]."""
        return np.asarray(self._angles(parameters[None], np.arange(len(self)))[0])

    def _angles(self, parameters: FloatArray, some: IntArray) -> FloatArray:
        b = transformed(self.normals[:, some], parameters)
        mu, nu, log_depth = (parameters[:, i : i + 1] for i in range(3))
        l1, l2, l3 = self.lights[:, some]
        z = (l3 - mu * l1 - nu * l2) * np.exp(-log_depth)
        x = b[:, 1] * z - b[:, 2] * l2
        y = b[:, 2] * l1 - b[:, 0] * z
        w = b[:, 0] * l2 - b[:, 1] * l1
        return np.asarray(np.arctan2(np.sqrt(x * x + y * y + w * w), b[:, 0] * l1 + b[:, 1] * l2 + b[:, 2] * z))

    def _equations(self) -> tuple[FloatArray, FloatArray]:
        """Return the normal equations of (K Kᵀ b) × l = 0 for μ, ν, τ at each maximum, (6, n) and (3, n)."""
        b1, b2, b3 = self.normals
        l1, l2, l3 = self.lights
        zero = np.zeros_like(b1)
        rows = (
            (np.stack([b1 * l2, b2 * l2 - b3 * l3, b3 * l2]), b2 * l3),
            (np.stack([b1 * l1 - b3 * l3, b2 * l1, b3 * l1]), b1 * l3),
            (np.stack([b3 * l2, -b3 * l1, zero]), b2 * l1 - b1 * l2),
        )
        table = sum((outer_entries(left) for left, _ in rows), np.zeros((6, len(self))))
        right = sum((left * value for left, value in rows), np.zeros((3, len(self))))
        return table, right


def find_maxima(normals: FloatArray, lights: FloatArray, spread: FloatArray, mask: BoolArray) -> Maxima:
    """Find the local maxima of the model's brightness under each light.

    Parameters
    ----------
    normals : float64 array (3, p)
        Scaled normals of the pixels of the mask, in row-major order, zero where there is none.
    lights : float64 array (m, 3)
        Lights in the same basis.
    spread : float64 array (p,)
        Relative residual of each pixel, infinite where it has no normal [1].
    mask : bool array (h, w)
        Where the pixels lie.

    Returns
    -------
    Maxima
        With places between pixels, from a parabola through the neighbours.
    """
    from scipy.ndimage import maximum_filter, minimum_filter

    fitted = np.isfinite(spread)
    typical = float(np.median(spread[fitted])) if fitted.any() else 0.0
    known, good = np.zeros((2, *mask.shape), np.bool_)
    known[mask] = fitted
    good[mask] = spread <= max(_BADLY_FITTED * typical, np.finfo(np.float64).eps)
    field = np.zeros((*mask.shape, 3))
    field[mask] = normals.T
    size = 2 * _RADIUS + 1
    inner = good & minimum_filter(known, size=size, mode="constant", cval=0)
    places, whose = [], []
    for light in lights:
        image = np.where(known, field @ light, -np.inf)
        top = maximum_filter(image, size=size, mode="constant", cval=-np.inf)
        rows, columns = np.nonzero((image == top) & inner & (image > 0))
        peaks = _between(image, field, rows, columns)
        places.append(peaks)
        whose.append(np.broadcast_to(light, peaks.shape))
    facing, lamps = np.concatenate(places).T, np.concatenate(whose).T
    return Maxima(
        facing / np.sqrt((facing * facing).sum(axis=0)),
        lamps / np.sqrt((lamps * lamps).sum(axis=0)),
    )


def _between(image: FloatArray, field: FloatArray, rows: IntArray, columns: IntArray) -> FloatArray:
    """Return the normals (n, 3) where parabolas through the neighbours of the brightest pixels have their tops."""
    w = {(i, j): image[rows + i, columns + j] for i in (-1, 0, 1) for j in (-1, 0, 1)}
    dx, dy = (w[0, 1] - w[0, -1]) / 2, (w[1, 0] - w[-1, 0]) / 2
    dxx, dyy = w[0, 1] - 2 * w[0, 0] + w[0, -1], w[1, 0] - 2 * w[0, 0] + w[-1, 0]
    dxy = (w[1, 1] - w[1, -1] - w[-1, 1] + w[-1, -1]) / 4
    determinant = dxx * dyy - dxy * dxy
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = (dxy * dy - dyy * dx) / determinant, (dxy * dx - dxx * dy) / determinant
        kept = (determinant > 0) & (np.abs(x) <= 1) & (np.abs(y) <= 1)  # not on a ridge or a plateau
    r, c, x, y = rows[kept], columns[kept], x[kept, None], y[kept, None]
    along_x, along_y = (field[r, c + 1] - field[r, c - 1]) / 2, (field[r + 1, c] - field[r - 1, c]) / 2
    return np.asarray(field[r, c] + x * along_x + y * along_y)
