"""How much of the light a surface reflects in all: ρ integrated over the hemisphere of directions.

Highlights are narrow in the half vector h, whichever way the light comes from, so the integral is taken over h:

    R(θ) = ∫ ρ n·v dΩ_v = ∫∫ ρ n·v 4 (l·h) sin a da db

with the angle a of h to the normal and its azimuth b from the light's. The eye is above the surface for b below

    b₁(a) = atan2(√(−cos(θ + 2a) cos(θ − 2a)), −cos θ cos 2a),

that is everywhere for a < (π/2 − θ)/2 and nowhere for a > (π/2 + θ)/2. On the pieces between these limits, and of b on
either side of π/2, where lobes around the mirror direction are narrow at grazing incidence, the double exponential rule
is used [1]_. Its points gather at the ends of the pieces: it takes the square roots there, and resolves a highlight of
radius 1e-6 with the points that it has for a wide one.

References
----------
.. [1] H. Takahasi, M. Mori, "Double exponential formulas for numerical integration", Publ. RIMS Kyoto Univ. 9, 1974.
       doi:10.2977/prims/1195192451
"""

import numpy as np
import numpy.typing as npt

from psstereo.brdf.brdf import Brdf
from psstereo.errors import InputError
from psstereo.types import FloatArray

__all__ = ["directional_reflectance", "reciprocity_gap"]

_NORMAL = np.array([0.0, 0.0, 1.0])
_REACH = 3.4
"""Where the double exponential rule is cut off: its weights are below 1e-17 from there [1]."""


def directional_reflectance(brdf: Brdf, incidence: npt.ArrayLike, *, count: int = 96) -> FloatArray:
    """Return the share of light from one direction that a surface reflects, ∫ ρ n·v dΩ.

    Parameters
    ----------
    brdf : Brdf
        An isotropic reflectance without maps.
    incidence : float or float array (...)
        Angle of the light to the normal, 0 … less than π/2 [rad].
    count : int
        Points along each of the two pieces of the azimuth, and half of those of the half vector's angle. With 96,
        smooth models are integrated to 1e-9, models with kinks (`OrenNayar`) to 1e-4, lobes of a radius of 1e-4 to
        2e-6 and of 1e-6 to 2e-4, of which 128 points leave 1e-5.

    Returns
    -------
    float64 array (..., c)
        Directional-hemispherical reflectance; at most 1 if the model conserves energy; NaN where ρ is not known for
        a part of the directions [1].

    Raises
    ------
    InputError
        If an incidence is not on the upper side of the surface, the reflectance is a map, or there are too few points.
    """
    angles = np.asarray(incidence, np.float64)
    if not ((angles >= 0.0) & (angles < np.pi / 2)).all() or count < 2:
        raise InputError(
            given=f"Incidences are {angles.tolist() if angles.size < 5 else angles.shape}, with {count} points.",
            needed="Angles from 0 to less than π/2, in radians, and 2 points or more.",
            remedy="Take 1.57 for grazing incidence.",
        )
    _refuse_map(brdf)
    shares = [_reflected(brdf, float(angle), count) for angle in angles.ravel()]
    return np.reshape(shares, (*angles.shape, brdf.channels))


def _refuse_map(brdf: Brdf) -> None:
    if brdf.evaluate(_NORMAL, _NORMAL, _NORMAL).ndim > 1:
        raise InputError(
            given="The reflectance varies over the surface.",
            needed="Light reflected by one point.",
            remedy="Take a point of it: brdf.at(index).",
        )


def _rule(count: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return points x and 1 − x of the unit interval, each to full relative accuracy, and weights."""
    t = np.linspace(-_REACH, _REACH, count)
    rise = 0.5 * np.pi * np.sinh(t)
    low, high = 1.0 / (1.0 + np.exp(-2.0 * rise)), 1.0 / (1.0 + np.exp(2.0 * rise))
    return low, high, np.pi * np.cosh(t) * low * high * (t[1] - t[0])


def _reflected(brdf: Brdf, angle: float, count: int) -> FloatArray:
    """Return the reflectance (c,) at one incidence."""
    steep, rest, a_rule = _rule(2 * count)
    low, high, weights = _rule(count)
    inner, outer = (np.pi / 2 - angle) / 2, (np.pi / 2 + angle) / 2
    light = np.array([np.sin(angle), 0.0, np.cos(angle)])
    a = np.concatenate([inner * steep, inner * rest + outer * steep])
    a_weights = np.concatenate([inner * a_rule, angle * a_rule])
    inside = np.maximum(-np.cos(angle + 2 * a) * np.cos(angle - 2 * a), 0.0)
    end = np.arctan2(np.sqrt(inside), -np.cos(angle) * np.cos(2 * a))
    end[: len(steep)] = np.pi
    first = np.minimum(end, np.pi / 2)[:, None]
    second = (end[:, None] - first) * weights
    b = np.concatenate([first * low, first * high + end[:, None] * low], axis=1)
    area = np.concatenate([first * weights, second], axis=1) * (a_weights * np.sin(a))[:, None]
    sine = np.sin(a)[:, None]
    half = np.stack([sine * np.cos(b), sine * np.sin(b), np.broadcast_to(np.cos(a)[:, None], b.shape)], axis=-1)
    along = half @ light
    eye = 2.0 * along[..., None] * half - light
    eye /= np.linalg.norm(eye, axis=-1, keepdims=True)
    rho = brdf.evaluate(_NORMAL, light, eye)
    share = 2.0 * area * 4.0 * np.maximum(along, 0.0) * np.maximum(eye[..., 2], 0.0)  # 2: both signs of b
    return np.asarray(np.einsum("ab,abc->c", share, np.where(share[..., None] > 0.0, rho, 0.0)))


def reciprocity_gap(brdf: Brdf, *, count: int = 4000, seed: int = 0) -> float:
    """Return the largest relative change of ρ when light and eye change places.

    Parameters
    ----------
    brdf : Brdf
        An isotropic reflectance without maps.
    count : int
        Pairs of directions, a third of them near the mirror direction and a third near grazing incidence [1].
    seed : int
        Of the directions.

    Returns
    -------
    float
        |ρ(l, v) − ρ(v, l)| over the larger of the two, the largest of all pairs [1].

    Raises
    ------
    InputError
        If there are fewer than 3 pairs, or the reflectance is a map.
    """
    if count < 3:
        raise InputError(
            given=f"{count} pairs of directions are asked for.",
            needed="3 or more: oblique ones, mirrored ones and grazing ones.",
            remedy="Take some thousands.",
        )
    _refuse_map(brdf)
    rng = np.random.default_rng(seed)
    height = rng.uniform(0.0, 1.0, (2, count))
    height[:, : count // 3] = 10.0 ** rng.uniform(-6, 0, (2, count // 3))
    turn = rng.uniform(0.0, 2.0 * np.pi, (2, count))
    mirror = slice(count // 3, 2 * count // 3)
    near = 10.0 ** rng.uniform(-8, 0, (2, mirror.stop - mirror.start))
    height[1, mirror] = np.clip(height[0, mirror] + 0.1 * near[0], 0.0, 1.0)
    turn[1, mirror] = turn[0, mirror] + np.pi + near[1]
    flat = np.sqrt(1.0 - height**2)
    light, eye = np.stack([flat * np.cos(turn), flat * np.sin(turn), height], axis=-1)
    there, back = brdf.evaluate(_NORMAL, light, eye), brdf.evaluate(_NORMAL, eye, light)
    larger = np.maximum(there, back)
    known = larger > 0.0
    return float(np.max(np.abs(there - back)[known] / larger[known], initial=0.0))
