"""One lamp from what a matte plane in a few poses shows: a start from logarithms, then Gauss–Newton on brightness."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from psstereo.errors import InputError
from psstereo.lights import Led
from psstereo.lights.sphere_rule import sphere_rule
from psstereo.radiometry.checks import in_range
from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["LampFit", "PlaneSamples", "calibrate_lamp"]

_FAN = 1024
"""Axes over the whole sphere of which those that face the plane are tried, 6 degrees apart."""
_ENOUGH = 2000
"""Samples that the start looks at."""
_WIDE = 6.0
"""Residuals over their robust scale from which a sample is left out: gloss, shadow, dirt."""
_DIM = 0.02
"""Share of the brightest sample below which a logarithm is more noise than signal."""
_LEAST = 20
"""Samples that a fit needs; a picture of a plane has thousands."""
_LARGEST_MU = 200.0
"""A lobe of 5 degrees; narrower ones are no LEDs."""
_ROUNDS = 4


@dataclass(frozen=True, kw_only=True, eq=False)
class PlaneSamples:
    """Places on a matte plane and how bright one lamp makes them.

    Attributes
    ----------
    points : float array (p, 3)
        Places, x right, y up, z toward the camera [length].
    normals : float array (p, 3) or (3,)
        Unit normals of the plane there [1].
    values : float array (p,) or (p, c)
        Linear brightness without ambient light; NaN where not usable.
    groups : int array (p,)
        Which samples may be wrong together: a pose, or a part of it. Errors are told from what groups disagree about.

    Raises
    ------
    InputError
        If shapes disagree, or places are not finite.
    """

    points: FloatArray
    normals: FloatArray
    values: FloatArray
    groups: IntArray

    def __post_init__(self) -> None:
        points = np.asarray(self.points, np.float64)
        values = np.asarray(self.values, np.float64)
        values = values[:, None] if values.ndim == 1 else values
        normals, groups = np.asarray(self.normals, np.float64), np.asarray(self.groups)
        shaped = points.ndim == 2 and points.shape[1:] == (3,) and values.ndim == 2 and len(values) == len(points)
        shaped = shaped and normals.shape in ((3,), points.shape) and groups.shape == points.shape[:1]
        off = np.abs(np.linalg.norm(normals, axis=-1) - 1.0)
        if not (shaped and np.isfinite(points).all() and (off < 1e-3).all()):
            raise InputError(
                given=f"Points have the shape {points.shape}, normals {normals.shape}, values {values.shape}, groups "
                f"{groups.shape}.",
                needed="(p, 3), (p, 3) or (3,), (p,) or (p, c), and (p,); finite places and unit normals.",
                remedy="Give each sample of the plane its place, brightness and group.",
            )
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "normals", np.broadcast_to(normals, points.shape))
        object.__setattr__(self, "values", values)
        object.__setattr__(self, "groups", np.unique(groups, return_inverse=True)[1].reshape(-1))


@dataclass(frozen=True, kw_only=True, eq=False)
class LampFit:
    """One lamp.

    Attributes
    ----------
    lamp : Led
        Position, axis, mu and flux, the latter times the plane's BRDF unless that was given.
    axis_error : float
        Root-mean-square angle of the axis' error [rad].
    mu_error : float
        Standard error of mu [1].
    flux_error : float array (c,)
        Relative standard errors of the flux along the axis [1].
    position_covariance : float array (3, 3) or None
        If the position was refined [square of the unit of length].
    residual : float
        Root-mean-square residual over the mean brightness [1].
    used : int
        Samples that took part.
    """

    lamp: Led
    axis_error: float
    mu_error: float
    flux_error: FloatArray
    position_covariance: FloatArray | None
    residual: float
    used: int


def calibrate_lamp(
    samples: PlaneSamples,
    position: npt.ArrayLike,
    *,
    brdf: float = 1.0,
    refine_position: bool = False,
    mu: float | None = None,
    name: str = "lamp",
) -> LampFit:
    """Find axis, exponent and flux of one lamp; see :func:`calibrate_lamps`.

    Parameters
    ----------
    samples : PlaneSamples
        What the plane shows.
    position : float array (3,)
        Where the lamp is [length].
    brdf : float
        ρ of the plane [sr⁻¹].
    refine_position : bool
        Whether brightness may move it.
    mu : float, optional
        The exponent, if it is known [1].
    name : str
        For messages.

    Returns
    -------
    LampFit
        The lamp and its errors.

    Raises
    ------
    InputError
        If it lights too few samples from in front, or a number cannot be.
    """
    place = np.asarray(position, np.float64)
    if place.shape != (3,) or not np.isfinite(place).all():
        raise InputError(
            given=f"The {name} is at {place.tolist()}.", needed="Three finite numbers.", remedy="Correct its position."
        )
    known = None if mu is None else float(in_range("exponent mu", mu, unit="1", high=_LARGEST_MU))
    problem = _Problem.of(samples, place, known, refine_position, name)
    found = problem.start()
    for _ in range(_ROUNDS):
        found = problem.refine(found)
        kept = problem.trimmed(found)
        if np.array_equal(kept.usable, problem.usable):
            break
        problem = kept
    return problem.answer(found, float(in_range("BRDF of the plane", brdf, unit="sr⁻¹", exclude_low=True)))


@dataclass(frozen=True, eq=False)
class _State:
    """Unknowns: position, axis, exponent, logarithms of the flux of each channel."""

    position: FloatArray
    axis: FloatArray
    mu: float
    log_flux: FloatArray


@dataclass(frozen=True, eq=False)
class _Problem:
    """Samples of one lamp that take part, and what is free."""

    samples: PlaneSamples
    usable: BoolArray
    position: FloatArray
    mu: float | None
    moves: bool

    @classmethod
    def of(cls, samples: PlaneSamples, position: FloatArray, mu: float | None, moves: bool, name: str) -> "_Problem":
        away, distance = _away(samples.points, position)
        front = -(away * samples.normals).sum(axis=1) > 1e-3
        usable = np.isfinite(samples.values).all(axis=1) & front & (distance > 0)
        if usable.sum() >= _LEAST:
            middle = np.where(usable[:, None], samples.values, 0.0).mean(axis=1)
            usable &= middle > _DIM * middle.max()
        if usable.sum() < _LEAST:
            raise InputError(
                given=f"The {name} at {np.round(position, 4).tolist()} lights {int(usable.sum())} samples of the plane"
                " from in front.",
                needed=f"At least {_LEAST}, of several poses.",
                remedy="Check the position and its frame (x right, y up, z toward the camera), the poses, and the order"
                " of the images.",
            )
        return cls(samples, usable, position, mu, moves)

    def start(self) -> _State:
        """Return the best of a fan of axes, each with its linear solution of the logarithms."""
        points, normals = self.samples.points[self.usable], self.samples.normals[self.usable]
        values = self.samples.values[self.usable]
        away, distance = _away(points, self.position)
        geometry = -(away * normals).sum(axis=1) / distance**2
        brightness = np.where(values > 0, values, np.nan).mean(axis=1)
        logs = np.log(brightness / geometry)
        known = np.isfinite(logs)
        weights = np.where(known, brightness, 0.0) ** 2  # even noise of brightness in the logarithm
        logs = np.where(known, logs, 0.0)
        best, loss = None, np.inf
        few = slice(None, None, max(1, len(points) // _ENOUGH))
        for axis in sphere_rule(_FAN)[0]:
            cosine = away[few] @ axis
            if not (cosine > 1e-3).all():
                continue
            flux, mu, size = _line(np.log(cosine), logs[few], weights[few], self.mu)
            if size < loss:
                best, loss = _State(self.position, axis, mu, np.full(values.shape[1], flux)), size
        if best is None:  # so wide a plane that no axis faces all of it: take the middle
            middle = away.mean(axis=0)
            best = _State(
                self.position,
                middle / np.linalg.norm(middle),
                1.0 if self.mu is None else self.mu,
                np.zeros(values.shape[1]),
            )
        shape = np.exp(-best.log_flux) * self.model(best)
        ratio = (values * shape).sum(axis=0) / (shape * shape).sum(axis=0)
        return _State(best.position, best.axis, best.mu, np.log(np.maximum(ratio, np.finfo(np.float64).tiny)))

    def model(self, state: _State) -> FloatArray:
        """Return the brightness (p, c) of the samples that take part."""
        away, distance = _away(self.samples.points[self.usable], state.position)
        lobe = np.maximum(away @ state.axis, 0.0) ** state.mu
        cosine = np.maximum(-(away * self.samples.normals[self.usable]).sum(axis=1), 0.0)
        return np.asarray((lobe * cosine / distance**2)[:, None] * np.exp(state.log_flux))

    def _unpack(self, x: FloatArray, base: _State, tangent: FloatArray) -> _State:
        channels = len(base.log_flux)
        axis = base.axis + x[channels : channels + 2] @ tangent
        mu = base.mu if self.mu is not None else float(x[channels + 2])
        position = base.position + x[-3:] if self.moves else base.position
        return _State(position, axis / np.linalg.norm(axis), mu, base.log_flux + x[:channels])

    def refine(self, base: _State) -> _State:
        """Return the least-squares fit of brightness from a start."""
        from scipy.optimize import least_squares

        tangent = _tangent(base.axis)
        x0, low, high = self._bounds(base)
        values = self.samples.values[self.usable]
        size = float(np.sqrt((values**2).mean()))

        def misfit(x: FloatArray) -> FloatArray:
            return ((self.model(self._unpack(x, base, tangent)) - values) / size).ravel()

        scale = np.ones(len(x0))
        if self.moves:
            scale[-3:] = np.median(_away(self.samples.points[self.usable], base.position)[1])
        fit = least_squares(misfit, x0, bounds=(low, high), x_scale=scale, xtol=1e-13, ftol=1e-13, gtol=1e-13)
        return self._unpack(fit.x, base, tangent)

    def _bounds(self, base: _State) -> tuple[FloatArray, FloatArray, FloatArray]:
        extra = (1 if self.mu is None else 0) + (3 if self.moves else 0)
        x0 = np.zeros(len(base.log_flux) + 2 + extra)
        low, high = np.full(len(x0), -np.inf), np.full(len(x0), np.inf)
        if self.mu is None:
            k = len(base.log_flux) + 2
            x0[k], low[k], high[k] = np.clip(base.mu, 1e-3, _LARGEST_MU - 1e-3), 0.0, _LARGEST_MU
        return x0, low, high

    def trimmed(self, state: _State) -> "_Problem":
        """Return the problem without samples that are far from the fit."""
        residual = (self.samples.values[self.usable] - self.model(state)).mean(axis=1)
        scale = 1.4826 * float(np.median(np.abs(residual))) + 1e-12 * float(
            np.abs(self.samples.values[self.usable]).max()
        )
        usable = self.usable.copy()
        usable[self.usable] = np.abs(residual) <= _WIDE * scale
        fine = usable.sum() >= max(_LEAST, 0.5 * self.usable.sum())
        return _Problem(self.samples, usable, self.position, self.mu, self.moves) if fine else self

    def answer(self, state: _State, rho: float) -> LampFit:
        """Return the lamp, with errors from what groups of samples disagree about."""
        values, channels = self.samples.values[self.usable], len(state.log_flux)
        tangent = _tangent(state.axis)
        x0 = self._bounds(state)[0]
        if self.mu is None:
            x0[channels + 2] = state.mu
        slopes = []
        for k in range(len(x0)):
            step = np.zeros(len(x0))
            step[k] = 1e-6 * (
                np.median(_away(self.samples.points, state.position)[1]) if self.moves and k >= len(x0) - 3 else 1.0
            )
            ahead, behind = (self.model(self._unpack(x0 + s * step, state, tangent)) for s in (1.0, -1.0))
            slopes.append((ahead - behind) / (2.0 * step[k]))
        jacobian = np.stack(slopes, axis=-1)  # (p, c, k)
        residual = values - self.model(state)
        covariance = _sandwich(jacobian, residual, self.samples.groups[self.usable])
        errors = np.sqrt(np.maximum(np.diagonal(covariance), 0.0))
        return LampFit(
            lamp=Led(position=state.position, axis=state.axis, mu=state.mu, flux=np.exp(state.log_flux) / rho),
            axis_error=float(np.hypot(errors[channels], errors[channels + 1])),
            mu_error=0.0 if self.mu is not None else float(errors[channels + 2]),
            flux_error=errors[:channels],
            position_covariance=covariance[-3:, -3:] if self.moves else None,
            residual=float(np.sqrt((residual**2).mean()) / values.mean()),
            used=int(self.usable.sum()),
        )


def _away(points: FloatArray, position: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return unit vectors from the lamp to points, and distances."""
    offset = points - position
    distance = np.sqrt((offset * offset).sum(axis=1))
    return offset / np.where(distance > 0, distance, 1.0)[:, None], distance


def _tangent(axis: FloatArray) -> FloatArray:
    """Return two unit vectors across an axis, (2, 3)."""
    side = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    side /= np.linalg.norm(side)
    return np.stack([side, np.cross(axis, side)])


def _line(x: FloatArray, y: FloatArray, w: FloatArray, slope: float | None) -> tuple[float, float, float]:
    """Return intercept, slope and weighted squares of a line; the slope within the range of exponents, or as given."""
    total = w.sum()
    mx, my = (w @ x) / total, (w @ y) / total
    spread = w @ (x - mx) ** 2
    if slope is None:
        free = float(w @ ((x - mx) * (y - my)) / spread) if spread > 0 else 0.0
        slope = float(np.clip(free, 0.0, _LARGEST_MU))
    return float(my - slope * mx), slope, float(w @ (y - my - slope * (x - mx)) ** 2)


def _sandwich(jacobian: FloatArray, residual: FloatArray, groups: IntArray) -> FloatArray:
    """Return the covariance of the unknowns, by groups where there are enough of them, else by even noise."""
    p, c, k = jacobian.shape
    flat = jacobian.reshape(p * c, k)
    bread = np.linalg.pinv(flat.T @ flat, hermitian=True)
    noise = float((residual**2).sum() / max(p * c - k, 1)) * bread
    count = len(np.unique(groups))
    if count <= 2 * k:
        return np.asarray(noise)
    pulls = np.zeros((int(groups.max()) + 1, k))
    np.add.at(pulls, groups, (jacobian * residual[..., None]).sum(axis=1))
    meat = pulls.T @ pulls * (count / (count - 1.0))
    # Groups that agree by chance do not make the noise smaller than it is.
    together = bread @ meat @ bread
    return np.asarray(together if np.trace(together) > np.trace(noise) else noise)
