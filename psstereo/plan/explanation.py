"""Which of several normals explains a pixel best, whatever it is made of.

With the normal given, what a pixel shows is close to linear in its reflectance: a sum of Lambert's law, of a rough
matte surface, of one that is evenly bright, and of highlights from sharp to broad, none of them negative, and of a
level of either sign. That is richer than any solver's model, too rich to find normals by it alone, since it follows
most mistakes part of the way. But of two normals the one nearer to the truth nearly always leaves less unexplained.
"""

import numpy as np

from psstereo.kernels.exemplar_nnls import nnls
from psstereo.types import BoolArray, FloatArray

__all__ = ["best_explained", "unexplained"]

_LOBES = (0.1, 0.2, 0.35, 0.55, 0.8)
"""Roughness of the highlights, from sharp to broad, and every other one for few lights [1]."""
_MANY = 20
"""Lights from which all of them are looked for."""
_RISE = 3.0
"""Steepness of the reflectance that is bright from small cosines on [1]."""
_MATTE_SLOPE = 0.36
"""Variance of the facets' slopes of the rough matte surface [rad²]."""
_FRESNEL = 0.05
"""Share of light that a facet throws back straight on, for the shape of the highlights only [1]."""
_LIT = 0.05
"""Cosine to the light from which an observation is looked at [1]."""
_SMALLEST = 0.05
"""Cosine to the camera below which a surface is taken to be seen at this one [1]."""
_ROUNDS = 4
_SCALES = 2.5
"""Residual over its scale at which an observation has a quarter of its weight [1]."""
_ROUNDING = 1e-4
"""Residual that is always forgiven, of a pixel's bright values [1]."""
_BRIGHT = 0.8
"""Rank of the value that counts as bright, 1 for the brightest [1]."""
_RANK = 0.85
"""Rank of the residual that is told: beyond it there are cast shadows [1]."""
_RIDGE = 1e-6
_LEAST = 4
"""Observations that must be left for a figure."""


def best_explained(normals: FloatArray, directions: FloatArray, values: FloatArray) -> FloatArray:
    """Return, for each pixel, that one of several normals which leaves least unexplained.

    Parameters
    ----------
    normals : float64 array (k, n, 3)
        Unit normals of each of the candidates; NaN where it has none [1].
    directions : float64 array (m, 3)
        Unit vectors to the lights [1].
    values : float64 array (m, n)
        Brightness over light strength; NaN where not usable [any unit].

    Returns
    -------
    float64 array (n, 3)
        The chosen ones; NaN where no candidate has a normal [1].
    """
    candidates, pixels = normals.shape[:2]
    left = np.full((candidates, pixels), np.inf)
    known = np.isfinite(normals).all(axis=2)
    which, pixel = np.nonzero(known)
    left[which, pixel] = unexplained(normals[which, pixel], directions, values[:, pixel])
    return np.asarray(normals[np.argmin(left, axis=0), np.arange(pixels)])


def unexplained(normals: FloatArray, directions: FloatArray, values: FloatArray) -> FloatArray:
    """Return how much of what pixels show no mixture of reflectances explains, with their normals given.

    The camera looks along z. Not a test of a normal by itself: noise, a wrong calibration and light between surfaces
    leave something at the true normal, too.

    Parameters
    ----------
    normals : float64 array (n, 3)
        Unit normals [1].
    directions : float64 array (m, 3)
        Unit vectors to the lights [1].
    values : float64 array (m, n)
        Brightness over light strength; NaN where not usable [any unit].

    Returns
    -------
    float64 array (n,)
        A high quantile of the residuals' sizes over the pixel's bright values; infinite where too few observations are
        lit [1].
    """
    mixture, lit = _mixture(normals, directions)
    usable = np.isfinite(values.T)
    part = usable & lit
    count = part.sum(axis=1)
    ranked = np.sort(np.where(usable, values.T, np.inf), axis=1)
    bright = _at(ranked, usable.sum(axis=1), _BRIGHT)
    with np.errstate(invalid="ignore", divide="ignore"):
        shown = np.where(part, values.T / bright[:, None], 0.0)
    good = np.flatnonzero((count >= _LEAST) & np.isfinite(bright) & (bright > 0))
    left = np.full(len(normals), np.inf)
    if len(good):
        left[good] = _residual(mixture[good], shown[good], part[good], count[good])
    return left


def _residual(mixture: FloatArray, shown: FloatArray, part: BoolArray, count: FloatArray) -> FloatArray:
    """Fit the mixtures robustly, and return the quantile of the residuals."""
    size = np.sqrt((mixture * mixture).mean(axis=1, keepdims=True))
    columns = mixture / np.maximum(size, np.finfo(np.float64).tiny)
    weight, solution = part.astype(np.float64), np.zeros((len(columns), columns.shape[2]))
    ridge = _RIDGE * np.eye(columns.shape[2])
    ranked = np.zeros(shown.shape)
    for _ in range(_ROUNDS):
        weighted = (columns * (weight / count[:, None])[..., None]).transpose(0, 2, 1)
        moments = np.matmul(weighted, shown[..., None])[..., 0]
        mass = weight.sum(axis=1) / count
        solution = nnls(np.matmul(weighted, columns) + ridge, moments, 1, solution, mass)
        residual = np.abs(shown - np.matmul(columns, solution[..., None])[..., 0])
        ranked = np.sort(np.where(part, residual, np.inf), axis=1)
        scale = _SCALES * (1.4826 * _at(ranked, count, 0.5) + _ROUNDING)
        weight = part / (1.0 + (residual / scale[:, None]) ** 2) ** 2
    return _at(ranked, count, _RANK)


def _at(ranked: FloatArray, count: FloatArray, rank: float) -> FloatArray:
    """Return a quantile of the first values of each row, which are in order."""
    place = np.maximum(np.ceil(rank * count).astype(np.intp) - 1, 0)
    return np.asarray(ranked[np.arange(len(ranked)), place])


def _mixture(normals: FloatArray, directions: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return what each kind of surface shows, (n, m, k), a level of one kind last; and which observations are lit."""
    half = directions + np.array([0.0, 0.0, 1.0])
    half /= np.maximum(np.linalg.norm(half, axis=1), np.finfo(np.float64).tiny)[:, None]
    light = np.maximum(normals @ directions.T, 0.0)
    eye = np.maximum(normals[:, 2:], _SMALLEST)
    middle = np.clip(normals @ half.T, 0.0, 1.0)
    lobes = _LOBES if len(directions) >= _MANY else _LOBES[1::2]
    fresnel = _FRESNEL + (1.0 - _FRESNEL) * (1.0 - np.clip(half[:, 2], 0.0, 1.0)) ** 5
    kinds = [light, light / (light + eye), np.minimum(_RISE * light, 1.0), _rough(light, eye, directions[:, 2])]
    kinds += [_highlight(light, eye, middle, fresnel, lobe) for lobe in lobes]
    return np.stack([*kinds, (light > 0).astype(np.float64)], axis=-1), light > _LIT


def _rough(light: FloatArray, eye: FloatArray, between: FloatArray) -> FloatArray:
    """Return what a rough matte surface shows, after Oren and Nayar; `between` is the cosine of light and eye."""
    flat = 1.0 - 0.5 * _MATTE_SLOPE / (_MATTE_SLOPE + 0.33)
    back = 0.45 * _MATTE_SLOPE / (_MATTE_SLOPE + 0.09)
    return np.asarray(light * (flat + back * np.maximum(between - light * eye, 0.0) / np.maximum(light, eye)))


def _highlight(light: FloatArray, eye: FloatArray, middle: FloatArray, fresnel: FloatArray, lobe: float) -> FloatArray:
    """Return what a surface of small mirrors shows, after Trowbridge and Reitz."""
    square = lobe * lobe
    spread = square / (middle * middle * (square - 1.0) + 1.0) ** 2
    return np.asarray(spread * _unhidden(light, square) * _unhidden(eye, square) * fresnel / (4.0 * eye))


def _unhidden(cosine: FloatArray, square: float) -> FloatArray:
    """Return the share of mirrors that no other one hides."""
    return np.asarray(2.0 * cosine / (cosine + np.sqrt(square + (1.0 - square) * cosine * cosine)))
