"""Lamps and balls adjusted together, so that the highlights fall where they were seen.

Unknown are a direction of each lamp, the inverse of its distance if it is not taken for infinitely far away, and the
three numbers of each ball's outline, which are held by what is known of them. What is minimised are squared distances
in the image, over their variances: errors of highlights have the same size everywhere there, and errors of rays have
not [1]_. An outline's error is one and the same for all lamps; leaving it out would make the lamps' errors look
independent and small.

References
----------
.. [1] J. Ackermann, S. Fuhrmann, M. Goesele, "Geometric Point Light Source Calibration", Vision, Modeling and
   Visualization, 2013.
"""

from dataclasses import dataclass

import numpy as np

from psstereo.calibrate.balls.ball import Ball, sphere_of
from psstereo.calibrate.balls.mirror_ball import mirrored_pixels, reflected_rays
from psstereo.calibrate.viewing import Homogeneous
from psstereo.types import FloatArray

__all__ = ["Adjustment", "adjust", "tangents"]

_STEP = 1e-5
"""Step of the numeric derivative, in standard errors of an outline, radians, or inverse spans of the balls."""
_INSIDE = 1e6
"""Distance of a highlight that a lamp inside of the ball would have: far from any that was seen [px]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Adjustment:
    """What an adjustment has found.

    Attributes
    ----------
    lamps : Homogeneous
        The lamps, from the middle of the balls.
    covariance : float64 array (m, 3, 3)
        Of errors along the two tangents of the direction [rad] and of the inverse distance [1/length], the last 0 if
        lamps were taken to be infinitely far away.
    seen : float64 array (k, 3)
        Adjusted outlines [px].
    chi_square : float
        Sum of squared residuals over variances, the outlines' part included [1].
    freedom : int
        Observations minus unknowns.
    angles : float64 array (m, k)
        Between the ray from the ball's highlight and the lamp; NaN where there is no highlight [rad].
    """

    lamps: Homogeneous
    covariance: FloatArray
    seen: FloatArray
    chi_square: float
    freedom: int
    angles: FloatArray


@dataclass(frozen=True, eq=False)
class _Problem:
    balls: tuple[Ball, ...]
    pixels: FloatArray
    whitening: FloatArray
    spread: FloatArray
    origin: FloatArray
    span: float
    start: FloatArray
    near: bool

    @property
    def each(self) -> int:
        """Unknowns of a lamp."""
        return 3 if self.near else 2

    def lamps(self, unknowns: FloatArray) -> Homogeneous:
        """Return lamps of unknowns (..., m, 2 or 3)."""
        first, second = tangents(self.start)
        turned = self.start + unknowns[..., :1] * first + unknowns[..., 1:2] * second
        direction = turned / np.sqrt((turned * turned).sum(axis=-1, keepdims=True))
        inverse = unknowns[..., 2] / self.span if self.near else np.zeros(unknowns.shape[:-1])
        return Homogeneous(self.origin, direction, inverse)

    def seen(self, k: int, outlines: FloatArray) -> FloatArray:
        """Return outlines (..., 3) of ball k for unknowns in standard errors (..., 3)."""
        return np.asarray(self.balls[k].seen + outlines @ self.spread[k].T)

    def split(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the unknowns of lamps (m, 2 or 3) and of outlines (k, 3)."""
        count = len(self.start) * self.each
        return x[:count].reshape(-1, self.each), x[count:].reshape(-1, 3)

    def shown(self, k: int, lamps: FloatArray, outlines: FloatArray) -> FloatArray:
        """Return how far ball k shows lamps (v, m, 2 or 3) from their highlights, in standard errors, (v, m, 2)."""
        ball = self.balls[k]
        centre, radius = sphere_of(ball, self.seen(k, outlines)[:, None])
        pixels = mirrored_pixels(ball.camera, centre, radius, self.lamps(lamps))
        gap = pixels - np.nan_to_num(self.pixels[:, k])
        return np.asarray(np.einsum("mij,vmj->vmi", self.whitening[:, k], np.nan_to_num(gap, nan=_INSIDE)))

    def residuals(self, x: FloatArray) -> FloatArray:
        """Return all residuals over their standard errors; those of highlights that are not there are 0."""
        lamps, outlines = self.split(x)
        gaps = [self.shown(k, lamps[None], outlines[k : k + 1])[0] for k in range(len(self.balls))]
        return np.concatenate([np.stack(gaps, axis=1).ravel(), outlines.ravel()])

    def jacobian(self, x: FloatArray) -> FloatArray:
        """Return the derivative of `residuals`; a lamp and a ball move their own highlights only."""
        lamps, outlines = self.split(x)
        m, k, each = *self.pixels.shape[:2], self.each
        steps = np.concatenate([np.eye(each + 3), -np.eye(each + 3)]) * _STEP
        matrix = np.zeros((m, k, 2, len(x)))
        rows = np.arange(m)
        for j in range(k):
            moved = self.shown(j, lamps + steps[:, None, :each], outlines[j] + steps[:, each:])
            slopes = (moved[: each + 3] - moved[each + 3 :]) / (2 * _STEP)
            for i in range(each):
                matrix[rows, j, :, rows * each + i] = slopes[i]
            matrix[:, j, :, m * each + 3 * j : m * each + 3 * j + 3] = np.moveaxis(slopes[each:], 0, -1)
        own = np.eye(outlines.size, len(x), m * each)
        return np.concatenate([matrix.reshape(-1, len(x)), own])


def adjust(balls: tuple[Ball, ...], pixels: FloatArray, covariance: FloatArray, *, near: bool) -> Adjustment:
    """Adjust lamps and balls to highlights.

    Parameters
    ----------
    balls : tuple of Ball
        The k balls.
    pixels : float array (m, k, 2)
        Where each ball shows each lamp; NaN where it does not [px].
    covariance : float array (m, k, 2, 2)
        Of the errors of these places [px²].
    near : bool
        Whether lamps have a distance; each must be seen in two balls then.

    Returns
    -------
    Adjustment
        Lamps, outlines, and how well they fit.
    """
    from scipy.optimize import least_squares

    problem, start = _problem(balls, pixels, covariance, near)
    found = least_squares(
        problem.residuals, start, jac=problem.jacobian, method="lm", xtol=1e-11, ftol=1e-13, gtol=1e-10, max_nfev=100
    )
    lamps, outlines = problem.split(found.x)
    jacobian = problem.jacobian(found.x)
    scale = 1.0 / np.sqrt((jacobian * jacobian).sum(axis=0))
    inverse = np.linalg.inv((jacobian * scale).T @ (jacobian * scale)) * scale[:, None] * scale
    fitted = problem.lamps(lamps)
    seen = np.array([problem.seen(k, outlines[k]) for k in range(len(balls))])
    observed = np.isfinite(pixels[..., 0])
    return Adjustment(
        lamps=fitted,
        covariance=_blocks(problem, inverse, fitted.direction, lamps),
        seen=seen,
        chi_square=float(2 * found.cost),
        freedom=2 * int(observed.sum()) - problem.each * len(pixels),
        angles=_angles(problem, seen, fitted),
    )


def tangents(directions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return two unit vectors (m, 3) across each direction and across each other.

    Parameters
    ----------
    directions : float array (m, 3)
        Unit vectors [1].

    Returns
    -------
    first, second : float64 array (m, 3)
        The tangents [1].
    """
    # The axis least along the direction; the cross product with it is never short.
    axis = np.eye(3)[np.abs(directions).argmin(axis=1)]
    first = np.cross(directions, axis)
    first /= np.sqrt((first * first).sum(axis=1, keepdims=True))
    return first, np.cross(directions, first)


def _problem(
    balls: tuple[Ball, ...], pixels: FloatArray, covariance: FloatArray, near: bool
) -> tuple[_Problem, FloatArray]:
    """Return the problem and where to start."""
    spheres = [ball.sphere for ball in balls]
    centres, radii = np.array([c for c, _ in spheres]), np.array([r for _, r in spheres])
    origin = centres.mean(axis=0)
    span = float(max(np.sqrt(((centres - origin) ** 2).sum(axis=1)).max(), radii.max()))
    rays = [
        reflected_rays(ball.camera, c, float(r), pixels[:, k])
        for k, (ball, c, r) in enumerate(zip(balls, centres, radii, strict=True))
    ]
    points, directions = (np.stack(part, axis=1) for part in zip(*rays, strict=True))
    middle = np.nansum(directions, axis=1)
    start = middle / np.sqrt((middle * middle).sum(axis=1, keepdims=True))
    inverse: FloatArray = np.zeros(len(start))
    if near:
        start, inverse = _nearest(points - origin, directions, start)
    observed = np.isfinite(pixels[..., 0])
    whitening = np.zeros((*observed.shape, 2, 2))
    whitening[observed] = np.linalg.inv(np.linalg.cholesky(covariance[observed]))
    problem = _Problem(
        balls=balls,
        pixels=pixels,
        whitening=whitening,
        spread=np.linalg.cholesky(np.array([ball.covariance for ball in balls])),
        origin=origin,
        span=span,
        start=start,
        near=near,
    )
    x = np.zeros((len(start), problem.each))
    if near:
        x[:, 2] = inverse * span
    return problem, np.concatenate([x.ravel(), np.zeros(3 * len(balls))])


def _nearest(points: FloatArray, directions: FloatArray, middle: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return directions and inverse distances of the points nearest to all rays of a lamp, infinity if behind."""
    known = np.isfinite(directions[..., :1])
    d, p = np.where(known, directions, 0.0), np.where(known, points, 0.0)
    across = known[..., None] * np.eye(3) - d[..., :, None] * d[..., None, :]
    matrix, side = across.sum(axis=1), np.einsum("mkij,mkj->mi", across, p)
    place = np.einsum("mij,mj->mi", np.linalg.pinv(matrix, rcond=1e-12, hermitian=True), side)
    distance = np.sqrt((place * place).sum(axis=1))
    ahead = (place * middle).sum(axis=1) > 0.5 * distance
    inverse = np.where(ahead, 1.0 / np.where(ahead, distance, 1.0), 0.0)
    return np.where(ahead[:, None], place * inverse[:, None], middle), inverse


def _blocks(problem: _Problem, inverse: FloatArray, directions: FloatArray, lamps: FloatArray) -> FloatArray:
    """Return covariances (m, 3, 3) of the adjusted directions' own tangents and inverse distances."""
    m, each = lamps.shape
    rows = np.arange(m)
    blocks = inverse[: m * each, : m * each].reshape(m, each, m, each)[rows, :, rows]
    first, second = tangents(problem.start)
    # The start's tangents, shortened and turned as the direction was, in the tangents of the result.
    length = np.sqrt(1.0 + (lamps[:, :2] ** 2).sum(axis=1))[:, None, None]
    own = np.stack(tangents(directions), axis=1)
    turn = np.einsum("mai,mbi->mab", own, np.stack([first, second], axis=1)) / length
    whole = np.zeros((m, 3, 3))
    full = np.zeros((m, 3, each))
    full[:, :2, :2] = turn
    if each == 3:
        full[:, 2, 2] = 1.0 / problem.span
    whole[:] = full @ blocks @ np.swapaxes(full, 1, 2)
    return whole


def _angles(problem: _Problem, seen: FloatArray, lamps: Homogeneous) -> FloatArray:
    """Return angles between observed rays and the lamps, (m, k)."""
    columns = []
    for k, ball in enumerate(problem.balls):
        centre, radius = sphere_of(ball, seen[k])
        points, rays = reflected_rays(ball.camera, centre, float(radius), problem.pixels[:, k])
        toward = lamps.seen_from(points)
        across = np.cross(rays, toward)
        columns.append(np.arctan2(np.sqrt((across * across).sum(axis=1)), (rays * toward).sum(axis=1)))
    return np.stack(columns, axis=1)
