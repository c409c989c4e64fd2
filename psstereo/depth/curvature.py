"""Curvature of a surface straight from its normals, without a depth map."""

import math
from dataclasses import dataclass

import numpy as np

from psstereo.camera import Camera
from psstereo.depth.differences import Differences
from psstereo.depth.domain import Domain, make_domain
from psstereo.depth.footprint import distance_of, image_steps, labels_of
from psstereo.depth.local_planes import local_planes
from psstereo.errors import OptionError
from psstereo.results import DepthKind
from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["Curvature", "curvature_from_normals"]

_LEAST_SMOOTHING = 0.5
"""Below it the weights of the next pixels vanish beside that of the pixel itself [px]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Curvature:
    """Curvatures of a surface: positive where it bulges toward the camera.

    Attributes
    ----------
    mean : float64 array (h, w)
        Mean of the two principal curvatures, H; 1 / R on a sphere of radius R that bulges toward the camera, −1 / R in
        a hollow one [`unit`].
    gaussian : float64 array (h, w)
        Their product, K; 1 / R² on bulges and in hollows, negative on saddles, 0 on cylinders and cones [`unit`²].
    largest, smallest : float64 arrays (h, w)
        The principal curvatures, ``largest ≥ smallest`` by sign, not by size: ridges stand out in the first, grooves,
        negative, in the second [`unit`].
    unit : str
        ``"1/mm"`` or another length; ``"1/distance"`` where the distance from the camera is unknown: the numbers are
        then curvature times each pixel's own distance along the optical axis [1].
    """

    mean: FloatArray
    gaussian: FloatArray
    largest: FloatArray
    smallest: FloatArray
    unit: str


def curvature_from_normals(
    normals: FloatArray,
    camera: Camera,
    *,
    mask: BoolArray | None = None,
    components: IntArray | None = None,
    distance: float | FloatArray | None = None,
    unit: str | None = None,
    smoothing: float = 0.0,
) -> Curvature:
    r"""Return the curvatures of the surface that has these normals.

    How much the normal turns along the surface is its shape operator, dn = S dX; mean and Gaussian curvature are half
    its trace and its determinant [1]_. Along one step in the image the surface moves by the tangent
    t = q − e (n·q) / (n·e), where e is the pixel's ray and q what the step does to the point of the plane across the
    optical axis: with the normal known, nothing has to be integrated, and errors do not travel. Under central
    projection t comes out in units of the distance along the optical axis, and so does 1 / S. The part of S that is not
    symmetric, which only noise and jumps have, is left out.

    Derivatives are central differences, of second order; with a neighbour on one side only, they are of first order.
    Exact on planes, and under parallel projection on spheres and cylinders. An error of the normals by ε [rad] at each
    pixel becomes one of H by about ε / (2 · pixel size); with `smoothing` s [px], by 0.14 ε / (s² · pixel size), while
    waves of wavelength Λ [px] keep the share exp(−2 π² s² / Λ²) of their curvature.

    Do not read it across creases and jumps of the depth: the turn of the normal there is divided by one pixel,
    whatever the surface does. `components` that are cut there keep them apart.

    Parameters
    ----------
    normals : float array (h, w, 3)
        Normals, x right, y up, z toward the camera; NaN where unknown [1].
    camera : Camera
        The camera of the normal map.
    mask : bool array (h, w), optional
        Pixels wanted; all if left out.
    components : int array (h, w), optional
        Connected components; pixels of different ones are no neighbours, and 0 is left out.
    distance : float or float array (h, w), optional
        Distance along the optical axis, under central projection only; NaN where unknown [`unit`].
    unit : str, optional
        Unit of `distance`, beside it only.
    smoothing : float
        Standard deviation of the Gaussian weights with which planes are fitted to the normals around each pixel, in
        the image; 0 for differences between neighbours, else 0.5 or more [px].

    Returns
    -------
    Curvature
        Float64 maps (h, w); NaN outside, where a pixel has no neighbour left and right or none above and below, and
        where the distance is wanted and unknown.

    Raises
    ------
    InputError
        If shapes or types do not fit, no pixel can be used, distances are not positive, are given to a camera without
        them, or come without unit.
    OptionError
        If the smoothing is not one of those said.

    References
    ----------
    .. [1] M. P. do Carmo, "Differential Geometry of Curves and Surfaces", Prentice-Hall, 1976, section 3.3.

    Examples
    --------
    >>> import numpy as np
    >>> from psstereo.camera import Orthographic
    >>> y, x = np.mgrid[2:-3:-1, -2:3]
    >>> ball = np.stack([x, y, np.sqrt(100 - x**2 - y**2)], axis=-1) / 10.0
    >>> found = curvature_from_normals(ball, Orthographic(pixel_size=1.0, length_unit="mm"))
    >>> round(float(found.mean[2, 2]), 6), round(float(found.gaussian[2, 2]), 6), found.unit
    (0.1, 0.01, '1/mm')
    """
    if not (smoothing == 0 or _LEAST_SMOOTHING <= smoothing < math.inf):
        raise OptionError(
            given=f"The smoothing is {smoothing}.",
            needed=f"It must be 0 for none, or a finite number of pixels of {_LEAST_SMOOTHING} or more.",
            remedy="Begin with 1, or leave it out.",
        )
    domain = make_domain(normals, camera, mask, None)
    scale = distance_of(domain, camera, distance, unit)
    named = unit or ("distance" if domain.kind is DepthKind.DISTANCE else camera.unit)
    labels = domain.inside.astype(np.int32)
    if components is not None:
        labels = np.where(domain.inside, labels_of(np.ones(domain.shape, np.bool_), components)[domain.window], 0)
    upright, right, down = _derivatives(domain.normals, labels, smoothing)
    mean, half = _mean_and_half_difference(upright, right, down, domain)
    with np.errstate(over="ignore", invalid="ignore"):
        largest, smallest = (mean + half) / scale, (mean - half) / scale
        parts = mean / scale, largest * smallest, largest, smallest
    maps = [np.full(domain.shape, np.nan) for _ in parts]
    for whole, part in zip(maps, parts, strict=True):
        whole[domain.window] = np.where(labels > 0, part, np.nan)
    return Curvature(mean=maps[0], gaussian=maps[1], largest=maps[2], smallest=maps[3], unit=f"1/{named}")


_Parts = tuple[FloatArray, FloatArray, FloatArray]
"""Components x, y, z (h, w) of a vector field."""


def _derivatives(normals: FloatArray, labels: IntArray, smoothing: float) -> tuple[_Parts, _Parts, _Parts]:
    """Return the normals and their derivatives for a step to the right and one down, by components."""
    if smoothing > 0:
        value, right, down = local_planes(normals, labels, smoothing)
        value /= np.sqrt(np.sum(value * value, axis=-1, keepdims=True))
        return _split(value), _split(right), _split(down)
    parts = _split(np.ascontiguousarray(np.moveaxis(normals, -1, 0)).transpose(1, 2, 0))
    across, along = Differences(labels, axis=1), Differences(labels, axis=0)
    return parts, _mapped(across, parts), _mapped(along, parts)


def _split(field: FloatArray) -> _Parts:
    return field[..., 0], field[..., 1], field[..., 2]


def _mapped(derivative: Differences, parts: _Parts) -> _Parts:
    return derivative(parts[0]), derivative(parts[1]), derivative(parts[2])


def _mean_and_half_difference(
    normal: _Parts, right: _Parts, down: _Parts, domain: Domain
) -> tuple[FloatArray, FloatArray]:
    """Return mean and half the difference of the principal curvatures.

    In the basis of the tangents t_u, t_v, the columns of S are the coordinates of n_u and n_v; they are read off after
    a projection along the ray onto the image plane, which takes t_u, t_v to q_u, q_v. An orthonormal basis that begins
    with t_u / l then gives the symmetric part: t_u = (l, 0), t_v = (a, b).
    """
    (ux, uy), (vx, vy), (ex, ey) = _steps_and_ray(domain)
    determinant = ux * vy - uy * vx
    # e = (ex, ey, −1), so that the projection adds e times the z component.
    rx, ry = right[0] + ex * right[2], right[1] + ey * right[2]
    dx, dy = down[0] + ex * down[2], down[1] + ey * down[2]
    s11, s21 = (vy * rx - vx * ry) / determinant, (ux * ry - uy * rx) / determinant
    s12, s22 = (vy * dx - vx * dy) / determinant, (ux * dy - uy * dx) / determinant
    toward = ex * normal[0] + ey * normal[1] - normal[2]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        gu, gv = (ux * normal[0] + uy * normal[1]) / toward, (vx * normal[0] + vy * normal[1]) / toward
        ray = ex * ex + ey * ey + 1.0
        ue, ve = ux * ex + uy * ey, vx * ex + vy * ey
        length = np.sqrt(ux * ux + uy * uy - 2.0 * gu * ue + gu * gu * ray)
        skew = (ux * vx + uy * vy - gu * ve - gv * ue + gu * gv * ray) / length
        across = -determinant / toward / length
        tilt = skew / length * s21
        first, second = s11 + tilt, s22 - tilt
        turned = (length * s12 + skew * (s22 - first)) / across + across / length * s21
    return 0.5 * (s11 + s22), np.hypot(0.5 * (first - second), 0.5 * turned)


def _steps_and_ray(domain: Domain) -> tuple[tuple[FloatArray, FloatArray], ...]:
    """Return x and y of q_u, of q_v and of the ray with z component −1."""
    central = domain.kind is DepthKind.DISTANCE
    ray = (domain.places[..., 0], domain.places[..., 1]) if central else (np.zeros(()), np.zeros(()))
    right, down = image_steps(domain)
    return right, down, ray
