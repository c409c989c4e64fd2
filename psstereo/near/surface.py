"""From fits at one surface to the next surface: integrate the normals, then settle what they leave free."""

from dataclasses import dataclass

import numpy as np

from psstereo.depth import Integrator
from psstereo.kernels.near import NearFit
from psstereo.near.view import View
from psstereo.types import FloatArray, IntArray

__all__ = ["Moved", "distance_pull", "move"]

_PRIOR = 0.1
"""Standard deviation of a separate piece's logarithmic distance from the largest piece, before the images speak."""

_OUTVOTE = 10.0
"""Stiffness of a pixel, over the median, beyond which it gets no more say."""

_LONGEST_STEP = 0.25
"""Bound for one step of the logarithmic distance; the quadratic model says little beyond."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Moved:
    """The next surface.

    Attributes
    ----------
    q : float64 array (p,)
        Where it is; pixels without normal take their neighbours' value.
    components : int array (h, w)
        Pieces that normals hold together, 0 where there is no depth.
    spread : float
        Standard deviation of the common part of q that the residuals predict: of the logarithm of the distance [1], or
        of the height [length].
    residual, iterations
        Of the integration.
    """

    q: FloatArray
    components: IntArray
    spread: float
    residual: float
    iterations: int


def distance_pull(fit: NearFit) -> tuple[FloatArray, FloatArray, float]:
    """Return each pixel's pull and stiffness along its line of sight, and the variance of the residuals in scales.

    Parameters
    ----------
    fit : NearFit
        Fits of all pixels.

    Returns
    -------
    pull, stiffness : float64 arrays (p,)
        Gauss–Newton terms, zero where a pixel says nothing.
    variance : float
        Of residuals over their scale, from the energy of Geman and McClure [1].
    """
    known = np.isfinite(fit.pull) & np.isfinite(fit.stiffness)
    pull, stiffness = np.where(known, fit.pull, 0.0), np.where(known, fit.stiffness, 0.0)
    # A fit of noise can have any albedo, and would outvote the others by its square.
    bound = _OUTVOTE * float(np.median(stiffness[known])) if known.any() else 0.0
    share = bound / np.maximum(stiffness, max(bound, np.finfo(np.float64).tiny))
    pull, stiffness = pull * share, stiffness * share
    freedom = max(float(np.maximum(fit.usable - 3, 0)[known].sum()), 1.0)
    return pull, stiffness, float(fit.energy[known].sum()) / freedom


def move(
    view: View,
    fit: NearFit,
    q: FloatArray,
    *,
    integrator: Integrator,
    length: float,
    hold: float | None,
) -> Moved:
    """Return the surface that has the fitted normals, at the distance where the photometric energy pulls it.

    The integral has one free constant for each connected piece. It moves from its present mean by a Gauss–Newton step
    of the photometric energy; small pieces, which say little about their distance, are drawn toward the largest.

    Parameters
    ----------
    view : View
        Lines of sight.
    fit : NearFit
        Fits at `q`.
    q : float64 array (p,)
        Present surface.
    integrator : Integrator
        Method for the depth.
    length : float
        Unit of a step: 1 for logarithms, the distance to the lamps for heights [length].
    hold : float or None
        Median of q to hold, if the distance is known.

    Returns
    -------
    Moved
        The next surface.

    Raises
    ------
    InputError
        If no pixel can be integrated.
    """
    normals = view.image(fit.scaled)
    weights = view.image(_confidence(fit))
    depth = integrator.integrate(normals, view.camera, mask=view.mask, weights=np.nan_to_num(weights))
    values = view.coordinate(depth.depth)[view.mask]
    labels = depth.components[view.mask]
    found = labels > 0
    pull, stiffness, variance = distance_pull(fit)
    count = int(labels.max(initial=0)) + 1
    sizes = np.bincount(labels[found], minlength=count)
    total = np.maximum(sizes, 1)

    def mean(x: FloatArray) -> FloatArray:
        return np.asarray(np.bincount(labels[found], x[found], count) / total)

    values = values + _offsets(labels, np.where(found, q - values, 0.0), count)[labels]
    pulls, information = mean(pull) * total, mean(stiffness) * total
    largest = int(np.argmax(sizes))
    where = mean(q)
    variance = max(variance, 1e-12)
    tie = variance / (_PRIOR * length) ** 2
    step = _bounded(pulls[largest] / max(information[largest], np.finfo(np.float64).tiny), length)
    target = where[largest] + step
    steps = (pulls + tie * (target - where)) / (information + tie)
    steps[largest] = step
    values = values + np.clip(steps, -_LONGEST_STEP * length, _LONGEST_STEP * length)[labels]
    values = _filled(view, np.where(found, values, np.nan))
    if hold is not None:
        values = values + (hold - float(np.median(values[found])))
    spread = np.sqrt(variance / max(float(information[largest]), np.finfo(np.float64).tiny))
    return Moved(
        q=values,
        components=depth.components,
        spread=float(spread),
        residual=depth.residual,
        iterations=depth.iterations,
    )


def _offsets(labels: IntArray, difference: FloatArray, count: int) -> FloatArray:
    """Return the median of each piece's difference: a few pixels that a piece gains or loses do not move it."""
    order = np.lexsort((difference, labels))
    ends = np.searchsorted(labels[order], np.arange(count + 1))
    ordered = difference[order]
    size = np.maximum(np.diff(ends), 1)
    low, high = (
        np.minimum(ends[:-1] + (size - 1) // 2, len(order) - 1),
        np.minimum(ends[:-1] + size // 2, len(order) - 1),
    )
    return np.asarray(0.5 * (ordered[low] + ordered[high]))


def _bounded(step: float, length: float) -> float:
    return float(np.clip(step, -_LONGEST_STEP * length, _LONGEST_STEP * length))


def _confidence(fit: NearFit) -> FloatArray:
    """Return weights of the normals: the share of the observations that the fit believes, zero without a normal."""
    known = np.isfinite(fit.scaled).all(axis=1)
    believed = fit.usable - np.minimum(fit.energy, fit.usable)
    share = believed / np.maximum(fit.usable, 1)
    return np.where(known, np.maximum(share, 1e-3), 0.0)


def _filled(view: View, values: FloatArray) -> FloatArray:
    """Give pixels without a value that of the nearest pixel that has one."""
    if np.isfinite(values).all():
        return values
    from scipy.ndimage import distance_transform_edt

    image = view.image(values)
    nearest = distance_transform_edt(~np.isfinite(image), return_distances=False, return_indices=True)
    return np.asarray(image[tuple(nearest)][view.mask])
