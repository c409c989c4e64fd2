"""Whether balls see the lamps in the same direction, in different ones as near lamps are, or cannot tell.

Two adjustments are compared: one direction a lamp, and one position a lamp. Their sums of squares differ by a χ² with
one degree of freedom a lamp if the lamps are far away. Where even positions leave more than the highlights' errors,
errors count as larger by as much, and the difference is held against what is left (an F test).
"""

from dataclasses import dataclass
from enum import Enum

import numpy as np

from psstereo.calibrate.balls.adjustment import Adjustment, adjust, tangents
from psstereo.calibrate.balls.ball import Ball
from psstereo.types import FloatArray

__all__ = ["Reach", "Triangulation", "triangulate_lamps"]

_SIGNIFICANT = 0.01
"""Probability below which balls disagree by more than chance."""
_PARALLEL = 50.0
"""Distance over the spread of the balls from which light is parallel: less than about a degree from ball to ball."""
_BOUND = 1.645
"""Standard errors that 95 of 100 normal errors stay below."""


class Reach(Enum):
    """How far away the lamps are, as far as balls tell."""

    NEAR = "near"
    """The balls disagree as they do about lamps that are near, and every lamp's distance is told."""
    DISTANT = "distant"
    """The balls agree, and would not if the lamps were near."""
    UNTOLD = "untold"
    """One ball, or balls too close to each other for their errors: near lamps would look the same."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Triangulation:
    """Directions of lamps and, if the balls tell them, positions.

    Attributes
    ----------
    reach : Reach
        Which of the two to use.
    directions : float64 array (m, 3)
        Toward the lamps from the middle of the balls [1].
    direction_error : float64 array (m,)
        Root-mean-square angle of their errors [rad].
    positions : float64 array (m, 3) or None
        Where the lamps are, if they are near [length].
    covariance : float64 array (m, 3, 3) or None
        Of their errors [length²].
    weakest : float64 array (m, 3) or None
        Unit vector along which a position is known worst [1].
    weakest_error : float64 array (m,) or None
        Standard error along it [length].
    least_distance : float or None
        Distance from the middle of the balls that lamps exceed with 95 % confidence, the nearest of them; None with
        one ball [length].
    spread : float
        Largest distance of balls from each other, or the radius of the only one [length].
    middle : float64 array (3,)
        Of the balls [length].
    probability : float or None
        That lamps infinitely far away make balls disagree as much; None with one ball [1].
    enlarged : float
        Factor on the errors, above 1 if even positions do not make the balls agree [1].
    residual : float or None
        Root-mean-square angle between the balls' rays and the lamps as they are used; None with one ball [rad].
    seen : float64 array (k, 3)
        Adjusted outlines of the balls [px].
    """

    reach: Reach
    directions: FloatArray
    direction_error: FloatArray
    positions: FloatArray | None
    covariance: FloatArray | None
    weakest: FloatArray | None
    weakest_error: FloatArray | None
    least_distance: float | None
    spread: float
    middle: FloatArray
    probability: float | None
    enlarged: float
    residual: float | None
    seen: FloatArray


def triangulate_lamps(
    balls: tuple[Ball, ...], pixels: FloatArray, covariance: FloatArray, *, reach: Reach | None = None
) -> Triangulation:
    """Find lamps by their highlights on mirror balls.

    Not for lamps closer than a few radii of a ball that is lit by something large: a lamp is taken for a point. A
    parallel projection hides that lamps are near where the camera is as near itself: seen from a pinhole, the balls'
    normals turn along with the rays. Give the camera if it is known.

    Parameters
    ----------
    balls : tuple of Ball
        The k balls, one or more, all seen by one camera.
    pixels : float array (m, k, 2)
        Highlights, NaN where a ball does not show a lamp; each lamp in one ball at least [px].
    covariance : float array (m, k, 2, 2)
        Of their errors [px²].
    reach : Reach, optional
        NEAR or DISTANT to decide it beforehand, which needs two balls for NEAR; the highlights decide if absent.

    Returns
    -------
    Triangulation
        Directions or positions, with their errors.

    Examples
    --------
    >>> left, right = Ball.circle(100, 100, 50), Ball.circle(400, 100, 50)
    >>> places = np.array([[[100.0, 100.0], [400.0, 100.0]]])
    >>> found = triangulate_lamps((left, right), places, np.full((1, 2, 2, 2), 0.01) * np.eye(2))
    >>> found.directions.round(6).tolist(), found.reach.name
    ([[0.0, 0.0, 1.0]], 'UNTOLD')
    """
    spheres = [ball.sphere for ball in balls]
    centres = np.array([centre for centre, _ in spheres])
    gaps = centres[:, None] - centres
    widest = float(np.sqrt((gaps * gaps).sum(axis=-1)).max())
    spread = widest if len(balls) > 1 else spheres[0][1]
    distant = adjust(balls, pixels, covariance, near=False)
    shared = bool((np.isfinite(pixels[..., 0]).sum(axis=1) >= 2).all())
    if not shared:
        # With balls that share no lamp there is nothing to compare; the freedom tells how much is left over.
        return _result(Reach.UNTOLD, distant, None, spread, probability=None, enlarged=1.0)
    near = adjust(balls, pixels, covariance, near=True)
    enlarged = _enlarged(near)
    probability = _probability(distant, near)
    inverse, error = near.lamps.inverse, enlarged * np.sqrt(near.covariance[:, 2, 2])
    told = bool((inverse > error).all())
    largest = float((np.maximum(inverse, 0.0) + _BOUND * error).max())
    if reach is None:
        if probability < _SIGNIFICANT and told:
            reach = Reach.NEAR
        elif probability >= _SIGNIFICANT and largest * spread < 1 / _PARALLEL:
            reach = Reach.DISTANT
        else:
            reach = Reach.UNTOLD
    return _result(
        reach, distant, near, spread, probability=probability, enlarged=enlarged, least_distance=1.0 / largest
    )


def _enlarged(near: Adjustment) -> float:
    """Return the factor on all errors that makes the fit of positions what it should be, 1 at least."""
    return float(np.sqrt(max(1.0, near.chi_square / near.freedom))) if near.freedom > 0 else 1.0


def _probability(distant: Adjustment, near: Adjustment) -> float:
    """Return the probability that chance makes one direction a lamp fit so much worse than one position."""
    from scipy import stats

    more = distant.freedom - near.freedom
    gain = max(distant.chi_square - near.chi_square, 0.0)
    if near.freedom > 0 and near.chi_square > near.freedom:
        return float(stats.f.sf(gain / more / (near.chi_square / near.freedom), more, near.freedom))
    return float(stats.chi2.sf(gain, more))


def _result(
    reach: Reach,
    distant: Adjustment,
    near: Adjustment | None,
    spread: float,
    *,
    probability: float | None,
    enlarged: float,
    least_distance: float | None = None,
) -> Triangulation:
    used = near if reach is Reach.NEAR and near is not None else distant
    # Where the balls disagree more than their errors allow, what is left over is the error of one direction a lamp.
    excess = enlarged if used is near else max(enlarged, _enlarged(distant))
    lamps, covariance = used.lamps, excess * excess * used.covariance
    positions = covariances = weakest = weakest_error = None
    if used is near:
        distance = 1.0 / lamps.inverse[:, None]
        positions = lamps.origin + lamps.direction * distance
        first, second = tangents(lamps.direction)
        slopes = np.stack([first * distance, second * distance, -lamps.direction * distance * distance], axis=-1)
        covariances = slopes @ covariance @ np.swapaxes(slopes, 1, 2)
        values, vectors = np.linalg.eigh(covariances)
        weakest, weakest_error = vectors[..., -1], np.sqrt(values[:, -1])
    seen_twice = near is not None
    return Triangulation(
        reach=reach,
        directions=lamps.direction,
        direction_error=np.sqrt(covariance[:, 0, 0] + covariance[:, 1, 1]),
        positions=positions,
        covariance=covariances,
        weakest=weakest,
        weakest_error=weakest_error,
        least_distance=least_distance,
        spread=spread,
        middle=lamps.origin,
        probability=probability,
        enlarged=enlarged,
        residual=float(np.sqrt(np.nanmean(used.angles**2))) if seen_twice else None,
        seen=used.seen,
    )
