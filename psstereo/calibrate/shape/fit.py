"""One distant light fitted to the brightness of pixels whose normals are known, with weights that follow residuals."""

from dataclasses import dataclass

import numpy as np

from psstereo.errors import InputError
from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["ShapeFit", "fit_direction", "fit_strength", "robust_weights"]

_ROUNDS = 60
_WIDTH = 3.0
"""Residuals over their scale at which a weight is a quarter."""
_FLOOR = 1e-4
"""Least scale of residuals, as a share of the brightness: so well does no picture follow a model."""
_SETTLED = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class ShapeFit:
    """One light.

    Attributes
    ----------
    direction : float64 array (3,)
        Toward it [1].
    strength : float64 array (c,)
        Brightness of a pixel that faces it, less the ambient part.
    ambient : float64 array (c,)
        Brightness without it.
    direction_error : float
        Root-mean-square angle of the direction's error; 0 if it was given [rad].
    strength_error : float64 array (c,)
        Relative standard errors [1].
    residual : float
        Robust residual over the mean brightness of lit pixels [1].
    lit : int
        Pixels that face it.
    """

    direction: FloatArray
    strength: FloatArray
    ambient: FloatArray
    direction_error: float
    strength_error: FloatArray
    residual: float
    lit: int


def robust_weights(residual: FloatArray, size: float) -> FloatArray:
    """Return Geman–McClure weights of residuals (p,), whose scale is 1.48 times their median magnitude.

    Parameters
    ----------
    residual : float64 array (p,)
        Residuals.
    size : float
        What they are small against.

    Returns
    -------
    float64 array (p,)
        Weights from 0 to 1 [1].
    """
    scale = max(1.4826 * float(np.median(np.abs(residual))), _FLOOR * size)
    return np.asarray(1.0 / (1.0 + (residual / (_WIDTH * scale)) ** 2) ** 2)


def fit_direction(values: FloatArray, normals: FloatArray, *, ambient: bool) -> FloatArray:
    """Return the direction of the light that explains some pixels best.

    Several starts: what is lit depends on the direction, and the direction on what is taken for lit.

    Parameters
    ----------
    values : float64 array (p,)
        Brightness, finite.
    normals : float64 array (p, 3)
        Unit normals [1].
    ambient : bool
        Whether a constant is added.

    Returns
    -------
    float64 array (3,)
        Unit vector toward the light [1].

    Raises
    ------
    InputError
        If brightness does not follow any direction.
    """
    size = float(np.quantile(values, 0.95)) or 1.0
    best, loss = None, np.inf
    for share in (0.0, 0.3, 0.6):
        low, high = np.quantile(values, (0.02, 0.98))
        lit = values > low + share * (high - low)
        found = _rounds(values, normals, lit, size, ambient=ambient)
        if found is None:
            continue
        slope, level = found
        residual = values - level - np.maximum(normals @ slope, 0.0)
        cost = float(np.median(np.abs(residual)) + 0.1 * np.mean(np.abs(residual)))
        if cost < loss:
            best, loss = slope, cost
    if best is None or not np.linalg.norm(best) > 0:
        raise InputError(
            given="The brightness of an image does not follow any direction of light.",
            needed="A matte, even surface under one distant light.",
            remedy="Check that shape and images are in register, and that the light was on.",
        )
    return np.asarray(best / np.linalg.norm(best))


def _rounds(
    values: FloatArray, normals: FloatArray, lit: BoolArray, size: float, *, ambient: bool
) -> tuple[FloatArray, float] | None:
    """Return E l and the level, from fits in turn with what is lit and the weights; None if it cannot be told."""
    weights: FloatArray = np.ones(len(values))
    last: FloatArray = np.zeros(3 + ambient)
    for _ in range(_ROUNDS):
        rows = normals * lit[:, None]
        rows = np.concatenate([rows, np.ones((len(rows), 1))], axis=1) if ambient else rows
        root = np.sqrt(weights)[:, None]
        moments = (rows * root).T @ (rows * root)
        if not np.linalg.cond(moments) < 1e12:
            return None
        found = np.linalg.solve(moments, rows.T @ (weights * values))
        level = float(found[3]) if ambient else 0.0
        facing = normals @ found[:3]
        lit = facing > 0
        weights = robust_weights(values - level - np.maximum(facing, 0.0), size)
        if np.abs(found - last).max() < _SETTLED * size:
            break
        last = found
    return found[:3], level


def fit_strength(
    values: FloatArray, normals: FloatArray, direction: FloatArray, parts: IntArray, *, ambient: bool, free: bool
) -> ShapeFit:
    """Fit strength and level of each channel for a direction, and tell errors.

    Parameters
    ----------
    values : float64 array (p, c)
        Brightness, finite.
    normals : float64 array (p, 3)
        Unit normals [1].
    direction : float64 array (3,)
        Toward the light [1].
    parts : int array (p,)
        Parts of the image that may be wrong together.
    ambient : bool
        Whether a constant is added.
    free : bool
        Whether the direction was found from these pixels, so that its error counts.

    Returns
    -------
    ShapeFit
        The light.
    """
    facing = normals @ direction
    lit = facing > 0
    shade = np.maximum(facing, 0.0)
    rows = np.stack([shade, np.ones(len(shade))], axis=1) if ambient else shade[:, None]
    weights: FloatArray = np.ones(len(shade))
    strength, level, relative = [], [], []
    side = np.eye(3)[:, :2] if not free else _across(direction)
    for one in values.T:
        found, weights = _channel(one, rows)
        residual = one - rows @ found
        # With the direction free, what it could take up counts among the unknowns.
        wide = np.concatenate([rows, lit[:, None] * (normals @ side) * found[0]], axis=1) if free else rows
        covariance = _sandwich(wide, residual, weights, parts)
        strength.append(found[0])
        level.append(found[1] if ambient else 0.0)
        relative.append((np.sqrt(covariance[0, 0]) / abs(found[0]), covariance[-2:, -2:]))
    errors = np.array([one[0] for one in relative])
    brightest = int(np.argmax(strength))
    turn = float(np.sqrt(np.trace(relative[brightest][1]))) if free else 0.0
    one = values[:, brightest]
    left = one - rows @ ([strength[brightest], level[brightest]] if ambient else [strength[brightest]])
    return ShapeFit(
        direction=direction,
        strength=np.array(strength),
        ambient=np.array(level),
        direction_error=turn,
        strength_error=errors,
        residual=float(1.4826 * np.median(np.abs(left)) / max(float(one[lit].mean()) if lit.any() else 1.0, 1e-300)),
        lit=int(np.count_nonzero(lit & (weights > 0.1))),
    )


def _channel(values: FloatArray, rows: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the robust solution of one channel and its weights."""
    size = float(np.quantile(values, 0.95)) or 1.0
    weights: FloatArray = np.ones(len(values))
    found: FloatArray = np.zeros(rows.shape[1])
    for _ in range(_ROUNDS):
        last = found
        root = np.sqrt(weights)
        found = np.asarray(np.linalg.lstsq(rows * root[:, None], root * values, rcond=None)[0], np.float64)
        weights = robust_weights(values - rows @ found, size)
        if np.abs(found - last).max() < _SETTLED * size:
            break
    return found, weights


def _across(direction: FloatArray) -> FloatArray:
    """Return two unit vectors across a direction, (3, 2)."""
    first = np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(direction, first)], axis=1)


def _sandwich(rows: FloatArray, residual: FloatArray, weights: FloatArray, parts: IntArray) -> FloatArray:
    """Return the covariance of a robust fit from how far parts of the image pull it apart."""
    bread = np.linalg.pinv((rows * weights[:, None]).T @ rows, hermitian=True)
    pulls = np.zeros((int(parts.max()) + 1, rows.shape[1]))
    np.add.at(pulls, parts, rows * (weights * residual)[:, None])
    count = max(len(pulls), 2)
    return np.asarray(bread @ (pulls.T @ pulls) @ bread * (count / (count - 1.0)))
