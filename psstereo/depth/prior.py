"""Depth that is known beforehand, coarsely or in a few places, to be fused with normals."""

from dataclasses import dataclass

import numpy as np

from psstereo.camera import Camera
from psstereo.depth.domain import Domain
from psstereo.errors import InputError
from psstereo.results import DepthKind
from psstereo.types import FloatArray

__all__ = ["Prior", "prior_values"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Prior:
    """Known depth with its standard error, and the normals' standard error to weigh them against each other.

    Normals say what the surface looks like nearby, a depth map from stereo, structured light or a few measured points
    where it is; their least-squares fusion follows the normals over short distances and the prior over long ones. Each
    deviation counts in units of its own standard error; the errors are taken for independent from pixel to pixel.

    Do not use it for depth with gross errors (wrong matches): every pixel pulls with the square of its deviation.
    Remove them first, or give them a large `sigma`.

    Attributes
    ----------
    depth : float array (h, w)
        Known depth of the camera's kind, height or distance along the optical axis; NaN where unknown [`unit`].
    sigma : float or float array (h, w)
        Its standard error [`unit`].
    unit : str
        Unit of both; for heights it must be the camera's, distances take it over.
    angle : float
        Standard error of the normals that count most (weight 1), each of the two angles [rad].
    """

    depth: FloatArray
    sigma: float | FloatArray
    unit: str
    angle: float = 0.02


def prior_values(prior: Prior, domain: Domain, camera: Camera) -> tuple[FloatArray, FloatArray]:
    """Return a prior as the values that are solved for, and its weights beside an edge of weight 1.

    Parameters
    ----------
    prior : Prior
        Known depth.
    domain : Domain
        Where normals are.
    camera : Camera
        The camera.

    Returns
    -------
    values : float64 array (h, w)
        Heights or logarithms of distances on the domain's rectangle; 0 where unknown.
    weights : float64 array (h, w)
        Variance of an edge's step over that of the prior; 0 where unknown [1].

    Raises
    ------
    InputError
        If shape, unit, standard errors or distances do not fit, or no known pixel has a normal.
    """
    depth, sigma = np.asarray(prior.depth), np.asarray(prior.sigma)
    if depth.shape != domain.shape or depth.dtype.kind != "f" or sigma.shape not in {(), domain.shape}:
        raise InputError(
            given=f"The prior depth has shape {depth.shape} and type {depth.dtype}, its error shape {sigma.shape}.",
            needed=f"Depth must be floating-point numbers for the {domain.shape} pixels, its error that or one number.",
            remedy="Bring the prior to the pixels of the normal map, with NaN where it is unknown.",
        )
    central = domain.kind is DepthKind.DISTANCE
    if not central and prior.unit != camera.unit:
        raise InputError(
            given=f"The prior is in {prior.unit}, the camera in {camera.unit}.",
            needed="Heights and prior must be in one unit.",
            remedy="Give the orthographic camera the size of its pixels in the unit of the prior.",
        )
    depth = depth[domain.window].astype(np.float64)
    sigma = np.broadcast_to(sigma, domain.shape)[domain.window].astype(np.float64)
    known = domain.inside & ~np.isnan(depth)
    fine = np.isfinite(depth) & np.isfinite(sigma) & (sigma > 0) & ((depth > 0) | (not central))
    if not (fine | ~known).all() or not known.any() or not 0 < prior.angle < np.inf:
        raise InputError(
            given=(
                f"{np.count_nonzero(known)} pixels with a normal have a prior depth, {np.count_nonzero(known & ~fine)} "
                f"of them no valid depth or standard error; the error of the normals is {prior.angle} rad."
            ),
            needed="At least one is needed; standard errors must be positive, and so must distances.",
            remedy="Use NaN where the depth is unknown, and check unit and mask.",
        )
    step = prior.angle * _spacing(domain)
    relative = sigma / depth if central else sigma
    weights = np.zeros(depth.shape)
    weights[known] = (step / relative[known]) ** 2
    values = np.zeros(depth.shape)
    values[known] = np.log(depth[known]) if central else depth[known]
    return values, weights


def _spacing(domain: Domain) -> float:
    """Return the mean distance between neighbouring points of the plane z = 0, or between tips of rays."""
    if domain.array.size == 0:
        return float(np.linalg.norm(domain.matrix[:, :2]) / np.sqrt(2.0))
    steps = [np.linalg.norm(np.diff(domain.array, axis=axis), axis=-1).ravel() for axis in (0, 1)]
    return float(np.median(np.concatenate(steps))) if sum(part.size for part in steps) else 1.0
