"""What a pixel of each exemplar material shows under the lights of a rig: the readable reference.

A lobe is a reflectance of one parameter times the cosine c = n·l to the light; it is zero where c is not positive. With
v the view along z, h half way between light and view, and e = n·v, cut off at 0.02:

* `LAMBERT`, c;
* `GLAZE`, c (1 − (1 − c)⁵), a matte body below a smooth surface, which lets less light in at grazing incidence [1]_;
* `POWER`, c to a power: below one for rough surfaces, which stay bright toward the shadow line;
* `ROUGH`, c (1 + F (1 − c)⁵) (1 + F (1 − e)⁵) with F = 2 s (l·h)² − 1/2, a rough matte surface, brighter where it
  throws light back [2]_;
* `FACETED`, c (1 + s max(0, l·v − c e) / max(c, e)), small matte facets with s the ratio B / A of [4]_;
* `GGX`, c times D V of microfacets with roughness² = α, as a multiple of its value with light and eye on the
  normal [3]_;
* `BELL`, the same with facets whose slopes are Gaussian, after Beckmann [3]_, so that the highlight ends sooner; the
  shadowing is that of `GGX`, from which its own differs little;
* `CONSTANT`, 1 whatever the normal: light that comes by way of the surroundings.

References
----------
.. [1] P. Shirley, B. Smits, H. Hu, E. Lafortune, "A practitioners' assessment of light reflection models", Pacific
   Graphics, 1997
.. [2] B. Burley, "Physically-based shading at Disney", SIGGRAPH course notes, 2012
.. [3] B. Walter, S. R. Marschner, H. Li, K. E. Torrance, "Microfacet models for refraction through rough surfaces",
   Eurographics Symposium on Rendering, 2007
.. [4] M. Oren, S. K. Nayar, "Generalization of Lambert's reflectance model", SIGGRAPH 1994. doi:10.1145/192161.192213
"""

import numpy as np

from psstereo.types import FloatArray, IntArray

__all__ = [
    "BELL",
    "CONSTANT",
    "FACETED",
    "GGX",
    "GLAZE",
    "GRAZING",
    "LAMBERT",
    "LEAST_HALF",
    "POWER",
    "ROUGH",
    "along",
    "lights_table",
    "lobes",
    "slopes",
    "tangents",
]

LAMBERT, GLAZE, POWER, ROUGH, FACETED, GGX, CONSTANT, BELL = range(8)
"""Kinds of lobes."""

GRAZING = 0.02
"""Least cosine between normal and view that lobes are computed with [1]."""

LEAST_HALF = 0.05
"""Least cosine between normal and half vector that Gaussian facets are computed with; they show nothing there [1]."""

_LEAST_SHADOWING = 1e-9
"""Denominator of microfacet shadowing below which no light is left [1]."""


def lights_table(directions: FloatArray) -> FloatArray:
    """Return what lobes need of the lights: direction, half vector, and the squared cosine between the two.

    Parameters
    ----------
    directions : float64 array (m, 3) or (p, m, 3)
        Unit vectors from the surface to the lights, the same at every pixel or a set a pixel, in whose frame z points
        at the camera. A vector of zeros stands for no light: that observation must not take part, so be NaN [1].

    Returns
    -------
    float64 array (7, m) or (p, 7, m)
        ``l``, ``h`` and ``(l·h)²``; the half vector of a light behind the object is zero [1].
    """
    half = directions + np.array([0.0, 0.0, 1.0])
    length = np.sqrt((half * half).sum(axis=-1, keepdims=True))
    half = np.where(length > 1e-9, half / np.maximum(length, 1e-9), 0.0)
    across = (directions * half).sum(axis=-1)
    rows = np.concatenate([directions, half, across[..., None] ** 2], axis=-1)
    return np.ascontiguousarray(np.swapaxes(rows, -1, -2))


def along(vectors: FloatArray, axes: FloatArray) -> FloatArray:
    """Return the products of each pixel's vector with the lights' axes.

    Parameters
    ----------
    vectors : float64 array (p, 3)
        A vector a pixel [1].
    axes : float64 array (3, m) or (p, 3, m)
        Three rows of the lights' table, shared by all pixels or one set a pixel [1].

    Returns
    -------
    float64 array (p, m)
        The products [1].
    """
    if axes.ndim == 2:
        return np.asarray(vectors @ axes)
    return np.asarray((vectors[:, None] @ axes)[:, 0])


def tangents(normals: FloatArray) -> FloatArray:
    """Return two unit vectors across each normal, (p, 2, 3): one across the view too, and one down the slope.

    They turn with the picture, so that it does not matter to an answer which way up that is.
    """
    level = normals[:, 0] ** 2 + normals[:, 1] ** 2
    flat = ~(level > 0)
    length = np.sqrt(np.where(flat, 1.0, level))
    first = np.stack([-normals[:, 1] / length, normals[:, 0] / length, np.zeros(len(normals))], axis=1)
    first[flat] = [1.0, 0.0, 0.0]
    return np.stack([first, np.cross(normals, first)], axis=1)


def lobes(normals: FloatArray, table: FloatArray, kinds: IntArray, shapes: FloatArray) -> FloatArray:
    """Return the brightness of each lobe.

    Parameters
    ----------
    normals : float64 array (p, 3)
        Unit normals.
    table : float64 array (7, m) or (p, 7, m)
        The lights, of all pixels or of each; see :func:`lights_table` [1].
    kinds : int array (k,)
        Kinds of the lobes.
    shapes : float64 array (k,)
        Their parameters: the exponent, s, or α; 0 for those that have none [1].

    Returns
    -------
    float64 array (p, k, m)
        Brightness.
    """
    cosine, eye, half = _angles(normals, table)
    result = np.zeros((len(normals), len(kinds), table.shape[-1]))
    for k, (kind, shape) in enumerate(zip(kinds, shapes, strict=True)):
        result[:, k] = _lobe(int(kind), float(shape), cosine, eye, half, table)
    return result


def _angles(normals: FloatArray, table: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the cosines to the lights, to the view (p, 1), and to the half vectors."""
    cosine = np.maximum(along(normals, table[..., :3, :]), 0.0)
    return cosine, np.maximum(normals[:, 2:], GRAZING), along(normals, table[..., 3:6, :])


def _lobe(kind: int, s: float, c: FloatArray, eye: FloatArray, half: FloatArray, table: FloatArray) -> FloatArray:
    if kind == CONSTANT:
        return np.ones_like(c)
    if kind == GGX:
        return _gloss(s * s, c, eye, half)
    if kind == BELL:
        return _bell(s * s, c, eye, half)
    shape = np.ones_like(c)
    if kind == POWER:
        shape = np.where(c > 0.0, c, 1.0) ** (s - 1.0)
    elif kind == GLAZE:
        shape = 1.0 - (1.0 - c) ** 5
    elif kind == ROUGH:
        retro = 2.0 * s * table[..., 6, :] - 0.5
        shape = (1.0 + retro * (1.0 - c) ** 5) * (1.0 + retro * (1.0 - eye) ** 5)
    elif kind == FACETED:
        shape = 1.0 + s * np.maximum(table[..., 2, :] - c * eye, 0.0) / np.maximum(c, eye)
    return np.asarray(c * shape)


def _gloss(square: float, c: FloatArray, eye: FloatArray, half: FloatArray) -> FloatArray:
    facets = square / ((square - 1.0) * half * half + 1.0)
    light, seen = np.sqrt(c * c + square * (1.0 - c * c)), np.sqrt(eye * eye + square * (1.0 - eye * eye))
    shadowing = 2.0 / np.maximum(c * seen + eye * light, _LEAST_SHADOWING)
    return np.where(half > 0.0, c * facets * facets * shadowing, 0.0)


def _bell(square: float, c: FloatArray, eye: FloatArray, half: FloatArray) -> FloatArray:
    inverse = 1.0 / np.maximum(half, LEAST_HALF) ** 2
    facets = np.exp((1.0 - inverse) / square) * inverse * inverse
    light, seen = np.sqrt(c * c + square * (1.0 - c * c)), np.sqrt(eye * eye + square * (1.0 - eye * eye))
    return np.asarray(c * facets * 2.0 / np.maximum(c * seen + eye * light, _LEAST_SHADOWING))


def slopes(
    normals: FloatArray, table: FloatArray, kinds: IntArray, shapes: FloatArray, amounts: FloatArray
) -> FloatArray:
    """Return how a sum of lobes changes with c = n·l, with n·h, and with the z of the normal.

    Parameters
    ----------
    normals, table, kinds, shapes
        As of :func:`lobes`.
    amounts : float64 array (p, k)
        Of each lobe in the sum.

    Returns
    -------
    float64 array (p, 3, m)
        The three derivatives.
    """
    cosine, eye, half = _angles(normals, table)
    result = np.zeros((len(normals), 3, table.shape[-1]))
    for k, (kind, shape) in enumerate(zip(kinds, shapes, strict=True)):
        result += amounts[:, k, None, None] * _slope(int(kind), float(shape), cosine, eye, half, table)
    result[:, :2] *= (cosine > 0.0)[:, None]
    result[:, 2] *= normals[:, 2:] > GRAZING
    return result


def _slope(kind: int, s: float, c: FloatArray, eye: FloatArray, half: FloatArray, table: FloatArray) -> FloatArray:
    flat, x = np.zeros_like(c), 1.0 - c
    if kind == FACETED:
        return _faceted_slope(s, c, eye, table[..., 2, :])
    if kind == GGX:
        return _gloss_slope(s * s, c, eye, half)
    if kind == BELL:
        return _bell_slope(s * s, c, eye, half)
    by_light, by_eye = flat + 1.0, flat
    if kind == CONSTANT:
        by_light = flat
    elif kind == POWER:
        by_light = s * np.where(c > 0.0, c, 1.0) ** (s - 1.0)
    elif kind == GLAZE:
        by_light = 1.0 - x**5 + 5.0 * c * x**4
    elif kind == ROUGH:
        retro = 2.0 * s * table[..., 6, :] - 0.5
        lit = 1.0 + retro * x**5
        by_light = (1.0 + retro * (1.0 - eye) ** 5) * (lit - 5.0 * c * retro * x**4)
        by_eye = -5.0 * c * lit * retro * (1.0 - eye) ** 4
    return np.stack([by_light, flat, by_eye], axis=1)


def _faceted_slope(s: float, c: FloatArray, eye: FloatArray, height: FloatArray) -> FloatArray:
    toward, larger = np.maximum(height - c * eye, 0.0), np.maximum(c, eye)
    some, rest = toward > 0.0, toward / (larger * larger)
    by_light = 1.0 + s * toward / larger - s * c * (some * eye / larger + rest * (c > eye))
    by_eye = -s * c * (some * c / larger + rest * (c <= eye))
    return np.stack([by_light, np.zeros_like(c), by_eye], axis=1)


def _gloss_slope(square: float, c: FloatArray, eye: FloatArray, half: FloatArray) -> FloatArray:
    rest = 1.0 - square
    facets = square / (1.0 - rest * half * half)
    light, seen = np.sqrt(c * c + square * (1.0 - c * c)), np.sqrt(eye * eye + square * (1.0 - eye * eye))
    below = np.maximum(c * seen + eye * light, _LEAST_SHADOWING)
    bare = np.where(half > 0.0, 2.0 * facets * facets / below, 0.0)
    by_light = bare * (1.0 - c * (seen + eye * rest * c / light) / below)
    by_half = bare * c * 4.0 * rest * half * facets / square
    by_eye = -bare * c * (c * rest * eye / seen + light) / below
    return np.stack([by_light, by_half, by_eye], axis=1)


def _bell_slope(square: float, c: FloatArray, eye: FloatArray, half: FloatArray) -> FloatArray:
    rest, h = 1.0 - square, np.maximum(half, LEAST_HALF)
    inverse = 1.0 / (h * h)
    light, seen = np.sqrt(c * c + square * (1.0 - c * c)), np.sqrt(eye * eye + square * (1.0 - eye * eye))
    below = np.maximum(c * seen + eye * light, _LEAST_SHADOWING)
    bare = 2.0 * np.exp((1.0 - inverse) / square) * inverse * inverse / below
    by_light = bare * (1.0 - c * (seen + eye * rest * c / light) / below)
    by_half = np.where(half > LEAST_HALF, bare * c * (2.0 * inverse / square - 4.0) / h, 0.0)
    by_eye = -bare * c * (c * rest * eye / seen + light) / below
    return np.stack([by_light, by_half, by_eye], axis=1)
