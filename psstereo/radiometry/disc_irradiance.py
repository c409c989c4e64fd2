"""Irradiance from a flat Lambertian disc, for a receiver anywhere and of any orientation.

The irradiance from a uniform source is an integral along its outline r(φ), seen from the receiver (Lambert; Stokes'
theorem), n being the receiver's normal:

    E = (L/2) ∮ n · (r × dr) / |r|²

With height h over the disc's plane, distance p from its axis and radius R, and axes x toward the disc's axis and z
toward its plane, the outline is r = (p + R cosφ, R sinφ, h). Let

    U = p² + h² + R²,  V = 2pR,  T = p² + h² − R²,  S² = U² − V² = T² + 4h²R²

Whole disc above the receiver's tangent plane:

    E = π L [ n_z (S − T) / 2S + n_x 2pR²h / ((U + S) S) ]

in which S − T = 4h²R² / (S + T) where T > 0, so that nothing cancels. When the tangent plane cuts the disc, the part
above it is bounded by the arc |φ − φ₀| < β and by its chord. The arc's integrals are elementary, the chord adds the
angle under which it is seen, since it lies in the tangent plane. That form subtracts terms of size R/d to get one of
size (R/d)²: far away, a Gauss rule over the part above takes its place, which has positive terms only.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from psstereo.radiometry.checks import directions, in_range, vectors
from psstereo.types import FloatArray

__all__ = ["disc_irradiance"]

_FAR = 50.0
"""Distance from which a cut disc is integrated by the Gauss rule [radii]."""
_ALONG, _ACROSS = 14, 4
"""Points of that rule, along and across the direction in which the tangent plane rises [1]."""


class _View(NamedTuple):
    """A disc as the receiver sees it; the module's text has the letters; all arrays have the same shape."""

    p: FloatArray
    h: FloatArray
    radius: FloatArray
    normal: tuple[FloatArray, FloatArray, FloatArray]

    @property
    def rise(self) -> FloatArray:
        """Height of the disc's centre over the tangent plane, n · r [length]."""
        return self.normal[0] * self.p + self.normal[2] * self.h

    @property
    def swing(self) -> FloatArray:
        """How much higher than the centre the rim rises over the tangent plane [length]."""
        return self.radius * np.hypot(self.normal[0], self.normal[1])

    def at(self, where: npt.NDArray[np.bool_]) -> "_View":
        """Return the view from some of the points."""
        n = self.normal
        return _View(self.p[where], self.h[where], self.radius[where], (n[0][where], n[1][where], n[2][where]))


def disc_irradiance(  # noqa: PLR0917 - the order of its siblings
    radiance: npt.ArrayLike,
    points: npt.ArrayLike,
    normals: npt.ArrayLike,
    centre: npt.ArrayLike,
    axis: npt.ArrayLike,
    radius: npt.ArrayLike,
) -> FloatArray:
    """Irradiance from a uniform disc that shines to one side, also where the surface's horizon cuts it.

    Closed form, accurate to 1e-13 of the irradiance that a surface facing the disc would get, near and far; on the
    disc's axis π L sin²θ. Not for sources whose radiance varies over the disc or with the angle, as behind a grid or
    a lens. All leading axes are broadcast with each other.

    Parameters
    ----------
    radiance : float or float array (...)
        Radiance L of the disc, ≥ 0 [W m⁻² sr⁻¹].
    points : float array (..., 3)
        Surface points [m].
    normals : float array (..., 3)
        Unit normals of the surface; NaN where not known [1].
    centre : float array (..., 3)
        Centre of the disc [m].
    axis : float array (..., 3)
        Unit normal of the disc on the side to which it shines [1].
    radius : float or float array (...)
        Radius of the disc, ≥ 0 [m].

    Returns
    -------
    float64 array (...)
        Irradiance of the broadcast shape; 0 behind the disc and in its plane beside it, NaN on the disc itself, where
        it jumps, and wherever something is not known [W m⁻²].

    Raises
    ------
    InputError
        If radiance or radius is negative, a vector's length is not 1, or a last axis has not 3 components.

    Examples
    --------
    >>> print(f"{disc_irradiance(1.0, [0, 0, 0], [0, 0, 1], [0, 0, 2], [0, 0, -1], 2.0) / np.pi:.15f}")
    0.500000000000000
    """
    level = in_range("radiance", radiance, unit="W m⁻² sr⁻¹")
    size = in_range("radius", radius, unit="m")
    n, w = directions("normals", normals), directions("disc's axis", axis)
    arm = vectors("points", points) - vectors("centre", centre)
    with np.errstate(all="ignore"):
        view = _seen(arm, n, w, size)
        beside = np.where(view.p > view.radius, 0.0, np.nan)
        known = ~np.isnan(view.rise + view.swing + view.radius)
        front = known & (view.h > 0.0)
        factor = np.select([known & (view.h < 0.0), known & (view.h == 0.0)], [0.0, beside], np.nan)
        rise, swing = view.rise, view.swing
        whole, cut = front & (rise >= swing), front & (np.abs(rise) < swing)
        factor[front & (rise <= -swing) & ~whole] = 0.0
        far = cut & (np.hypot(view.p, view.h) > _FAR * view.radius)
        near = cut & ~far
        for where, part in [(whole, _whole), (near, _cut_near), (far, _cut_far)]:
            if where.any():
                factor[where] = part(view.at(where))
        return np.asarray(level * factor)


def _seen(arm: FloatArray, n: FloatArray, w: FloatArray, radius: FloatArray) -> _View:
    """Return the disc in the axes of the module's text, in a unit in which the largest length is about 1."""
    shape = np.broadcast_shapes(arm.shape, n.shape, w.shape, (*radius.shape, 3))
    arm, n, w, radius = (*(np.broadcast_to(x, shape) for x in (arm, n, w)), np.broadcast_to(radius, shape[:-1]))
    # By a power of two, which is exact: rounding would move a point that is close to the rim.
    shift = -np.frexp(np.maximum(np.abs(arm).max(axis=-1), radius))[1]
    arm, radius = np.ldexp(arm, shift[..., None]), np.ldexp(radius, shift)
    lateral = np.cross(np.cross(w, arm), w)
    p = np.sqrt(np.einsum("...i,...i->...", lateral, lateral))
    # On the axis every direction across will do.
    across = np.cross(w, np.eye(3)[np.argmin(np.abs(w), axis=-1)])
    inward = np.where((p > 0.0)[..., None], -lateral, across)
    inward = inward / np.sqrt(np.einsum("...i,...i->...", inward, inward))[..., None]
    normal = (
        np.einsum("...i,...i->...", n, inward),
        np.einsum("...i,...i->...", n, np.cross(inward, w)),
        -np.einsum("...i,...i->...", n, w),
    )
    return _View(p, np.einsum("...i,...i->...", arm, w), radius, normal)


def _squares(view: _View) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return U, S, (S − T) / S and 2hRV / ((U + S) S)."""
    p, h, r, _ = view
    u = p * p + h * h + r * r
    t = h * h + (p - r) * (p + r)
    s = np.hypot(p - r, h) * np.hypot(p + r, h)
    along = np.where(t > 0.0, 4.0 * (h * r) * (h * r) / ((s + t) * s), (s - t) / s)
    return u, s, along, 4.0 * p * h * r * r / ((u + s) * s)


def _whole(view: _View) -> FloatArray:
    """Return E / L of a disc that is wholly above the tangent plane."""
    _, _, along, across = _squares(view)
    return np.asarray(0.5 * np.pi * (view.normal[2] * along + view.normal[0] * across))


def _half_arc(view: _View) -> tuple[FloatArray, FloatArray]:
    """Return φ₀ and β of the arc above the tangent plane."""
    rise, swing = view.rise, view.swing
    middle = np.arctan2(view.normal[1], view.normal[0])
    return middle, np.arctan2(np.sqrt((swing - rise) * (swing + rise)), -rise)


def _cut_near(view: _View) -> FloatArray:
    """Return E / L of a disc that the tangent plane cuts: the outline's integral over arc and chord."""
    p, h, r, (n_x, n_y, n_z) = view
    u, s, along, across = _squares(view)
    middle, half = _half_arc(view)
    last, first = middle + half, middle - half
    lag_last, rate_last = _lag(view, last)
    lag_first, rate_first = _lag(view, first)
    arc = n_z * (half * along + (1.0 - along) * (lag_last - lag_first))
    arc = arc + n_x * (half * across - 2.0 * h * r * u / s * (rate_last - rate_first))
    # ∫ sinφ / |r|² dφ = −ln(|r|² at the last point over that at the first) / V, which holds for V = 0, too, as follows.
    square_last, square_first = _rim_square(view, last), _rim_square(view, first)
    step = -2.0 * np.sin(middle) * np.sin(half) / square_first
    growth = 2.0 * p * r * step
    logarithm = np.where(np.abs(growth) < 0.5, np.log1p(growth), np.log(square_last / square_first))
    arc = arc + n_y * h * r * step * np.where(growth == 0.0, 1.0, logarithm / growth)
    return np.maximum(0.5 * (arc + _chord(view, last, first)), 0.0)


def _lag(view: _View, angle: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return D = φ/2 − atan(q tan(φ/2)) without its jumps, and D / V; q² = (U − V) / (U + V).

    With it ∫ dφ / |r|² = (φ − 2 D) / S.
    """
    near, far = np.hypot(view.p - view.radius, view.h), np.hypot(view.p + view.radius, view.h)
    sine, cosine = np.sin(0.5 * angle), np.cos(0.5 * angle)
    per_v = 2.0 * sine * cosine / ((far + near) * (far * cosine * cosine + near * sine * sine))
    tangent = 2.0 * view.p * view.radius * per_v
    lag = np.arctan(tangent)
    return lag, per_v * np.where(tangent == 0.0, 1.0, lag / tangent)


def _rim_square(view: _View, angle: FloatArray) -> FloatArray:
    """Return |r|² at a point of the rim."""
    cosine = np.cos(0.5 * angle)
    return np.asarray((view.p - view.radius) ** 2 + view.h**2 + 4.0 * view.p * view.radius * cosine * cosine)


def _chord(view: _View, last: FloatArray, first: FloatArray) -> FloatArray:
    """Return the angle under which the chord is seen, from the arc's last point to its first, about the normal."""
    p, h, r, n = view
    a_x, a_y = p + r * np.cos(last), r * np.sin(last)
    d_x, d_y = r * (np.cos(first) - np.cos(last)), r * (np.sin(first) - np.sin(last))
    turn = n[2] * (a_x * d_y - a_y * d_x) + h * (n[1] * d_x - n[0] * d_y)
    return np.asarray(np.arctan2(turn, a_x * (a_x + d_x) + a_y * (a_y + d_y) + h * h))


def _cut_far(view: _View) -> FloatArray:
    """Return E / L of a disc that the tangent plane cuts: ∬ (n·r) h / |r|⁴ dA over the part above it, by a Gauss rule.

    Along the direction φ₀ in which n·r grows, a point is at R cosψ from the centre, and across it at R sinψ t.
    """
    middle, half = _half_arc(view)
    total = np.zeros_like(half)
    across, across_weights = np.polynomial.legendre.leggauss(_ACROSS)
    for node, weight in zip(*np.polynomial.legendre.leggauss(_ALONG), strict=True):
        psi = 0.5 * (1.0 + node) * half
        sine = np.sin(psi)
        # n·r = swing (cosψ − cosβ), written as a product
        height = 2.0 * view.swing * np.sin(0.5 * (half + psi)) * np.sin(0.5 * (half - psi))
        strip = np.zeros_like(half)
        for t, share in zip(across, across_weights, strict=True):
            x = view.p + view.radius * (np.cos(psi) * np.cos(middle) - sine * t * np.sin(middle))
            y = view.radius * (np.cos(psi) * np.sin(middle) + sine * t * np.cos(middle))
            strip += share / (x * x + y * y + view.h**2) ** 2
        total += 0.5 * half * weight * height * sine * sine * strip
    return np.asarray(total * view.h * view.radius**2)
