"""Directions of lights that are known nearly, refined from the images of the object itself.

The images split into lights and normals up to a 3 × 3 matrix. Within that freedom the images say how each light differs
from the others, far more sharply than a mirror ball or a ruler does; the matrix itself comes from all nominal lights
together, from strengths if they are known, and from the normals having to belong to a surface. What is gained is
therefore mainly the agreement between lights: an error that all lights share, such as a turn of the whole rig, is seen
by the last two only.

What limits all this is the surface not being matte, which does not average out over pixels. Its effect is judged as if
half of the pixels' residuals conspired, which on measured and rendered objects is what they do at most. Each light
moves by as much as its disagreement deserves against the doubt in the nominal one, and none moves where that judgement
exceeds the disagreement.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from psstereo.capture import Capture
from psstereo.errors import InputError, OptionError
from psstereo.lights import Rig
from psstereo.normals.factorisation import Factorisation, factorise
from psstereo.normals.integrability import IntegrabilityForm
from psstereo.normals.low_rank_fit import DARK, first_weights, fit_normals, reweighted
from psstereo.normals.smoothing import steady_basis
from psstereo.normals.thinning import sample_grid
from psstereo.results import Outcome, Step
from psstereo.stack import PER_CHANNEL
from psstereo.types import BoolArray, FloatArray, Map, Progress, no_progress

__all__ = ["LightsRefined", "RefineHealth", "RefineOptions", "refine_lights"]

_PIXELS = 16_000
_LEAST_LIGHTS = 5
_FLAT = 3.0
"""Third singular value of the normals over the residual below which the object counts as flat."""
_UNISON = 0.5
"""Share of the residuals that is taken to be alike at all pixels."""
_SHARPEST = 2e-3
"""Least doubt in strengths that the search for the common matrix heeds."""
_CLEAR = 1.5
"""Disagreement over the expected error up to which lights are left as they are."""
_ROUNDS = 8
_STAGES = 3


@dataclass(frozen=True, kw_only=True)
class RefineOptions:
    """How lights are refined.

    Attributes
    ----------
    doubt : float
        How far nominal directions may be off, as a standard deviation of either component [rad].
    strengths : bool
        Whether strengths are refined too; else the nominal ones stay.
    strength_doubt : float
        How far nominal strengths may be off, as a standard deviation of their logarithm; infinite if nothing is known
        of them [1].
    gray : str or sequence of float
        How channels become one value.
    valid_range : (float, float) or None
        Raw values, as shares of full scale, outside of which an observation is left out; below 0.98 if absent and the
        images have a full scale.
    """

    doubt: float = float(np.radians(3.0))
    strengths: bool = False
    strength_doubt: float = 0.05
    gray: str | Sequence[float] = "mean"
    valid_range: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if not 0 < self.doubt < np.pi or not self.strength_doubt >= 0 or self.gray == PER_CHANNEL:
            raise OptionError(
                given=f"The doubt in directions is {np.degrees(self.doubt):.3g}°, that in strengths "
                f"{self.strength_doubt}, and channels are combined by {self.gray}.",
                needed="A positive angle, a number that is not negative, and one value a pixel.",
                remedy="Use 3° for directions measured by hand, 0.05 for strengths, and gray='mean'.",
            )


@dataclass(frozen=True, kw_only=True)
class RefineHealth:
    """How far to trust refined lights.

    Attributes
    ----------
    disagreement : float
        Root mean square angle between nominal lights and those that the images want [rad].
    expected_error : float
        Root mean square angle by which the images' lights may be off because the surface is not matte [rad].
    relief_ratio : float
        Third singular value of the normals over the residual: near 1 for a flat object [1].
    integrability_ratio : float
        How far the basis in which the normals belong to a surface stands out: 1 for not at all [1].
    spread_before, spread_after : float
        Root mean square over lights of the median residual of an image over the pixel's brightest value, with the
        nominal lights and with the refined ones [1].
    """

    disagreement: float
    expected_error: float
    relief_ratio: float
    integrability_ratio: float
    spread_before: float
    spread_after: float


@dataclass(frozen=True, kw_only=True, eq=False)
class LightsRefined:
    """Refined lights and the capture that has them.

    Attributes
    ----------
    capture : Capture
        The capture with the refined lights, or as it was if nothing was changed.
    changed : bool
        Whether anything was changed.
    moved : float64 array (m,)
        Angle by which each light moved [rad].
    factors : float64 array (m,)
        Factor on each nominal strength, mean one; 1 unless strengths are refined [1].
    health : RefineHealth
        How far to trust them.
    outcome : Outcome
        Whether the factorisation settled.
    step : Step
        What was done and why, for the record of a run.
    """

    capture: Capture
    changed: bool
    moved: FloatArray
    factors: FloatArray
    health: RefineHealth
    outcome: Outcome
    step: Step

    @property
    def rig(self) -> Rig:
        """The lights."""
        return self.capture.rig


def refine_lights(
    capture: Capture, options: RefineOptions | None = None, *, over: Map = map, progress: Progress = no_progress
) -> LightsRefined:
    """Refine the directions of nearly calibrated distant lights, and their strengths if wanted.

    Not for directions that are off by tens of degrees or in the wrong order: find such lights from the images alone.
    Not for flat objects either, which are refused. Lights that agree with the images as well as a surface that is not
    quite matte lets them are left as they are.

    Parameters
    ----------
    capture : Capture
        Images and nominal lights.
    options : RefineOptions, optional
        How.
    over : map-like
        Executes the images, such as the ``map`` of a thread pool.
    progress : callable
        Told how far it is.

    Returns
    -------
    LightsRefined
        Lights, the same capture under them, how far each moved, and how far to trust that.

    Raises
    ------
    InputError
        If there are fewer than five images, or the object is flat.
    RigError
        If the nominal lights lie in one plane.
    UnsupportedError
        If a light is not distant.
    """
    from threadpoolctl import threadpool_limits

    chosen = options or RefineOptions()
    started = time.perf_counter()
    directions = capture.rig.directions
    capture.rig.require_spanning()
    if len(capture.rig) < _LEAST_LIGHTS:
        raise InputError(
            given=f"There are {len(capture.rig)} lights to be refined.",
            needed=f"At least {_LEAST_LIGHTS}: with fewer, every pixel fits any lights.",
            remedy="Use the nominal directions, or take more images.",
        )
    grid = sample_grid(
        capture,
        gray=chosen.gray,
        limit=_PIXELS,
        strengths=True,
        valid_range=chosen.valid_range,
        over=over,
        progress=progress,
    )
    with threadpool_limits(1, user_api="blas"):  # or the last digits depend on the number of threads
        found = _refine(grid.values[0], grid.mask, directions, chosen, progress)
    why = found.why_not()
    kept = np.ones(len(directions))
    return LightsRefined(
        capture=capture if why else replace(capture, rig=_rig(capture, found, chosen)),
        changed=not why,
        moved=np.zeros(len(directions)) if why else _angles(found.lights, directions),
        factors=found.factors if chosen.strengths and not why else kept,
        health=found.health,
        outcome=Outcome.SOLVED if found.settled else Outcome.NOT_CONVERGED,
        step=Step(
            name="refined lights",
            done=not why,
            reason=why or _sentence(found, directions),
            seconds=time.perf_counter() - started,
        ),
    )


@dataclass(frozen=True, eq=False)
class _Refined:
    lights: FloatArray
    factors: FloatArray
    health: RefineHealth
    settled: bool

    def why_not(self) -> str:
        """Return why the nominal lights should stay; empty if they should not."""
        health = self.health
        if health.disagreement <= _CLEAR * health.expected_error:
            return (
                f"The images disagree with the nominal lights by {np.degrees(health.disagreement):.2f}°, which may "
                "be because the surface is not quite matte (expected "
                f"{np.degrees(health.expected_error):.2f}°): they stay."
            )
        if not health.spread_after < health.spread_before:
            return (
                f"Refined lights explain the images no better (residual {health.spread_after:.2%}) than the "
                f"nominal ones do ({health.spread_before:.2%}): they stay."
            )
        return ""


def _refine(
    values: FloatArray, mask: BoolArray, nominal: FloatArray, options: RefineOptions, progress: Progress
) -> _Refined:
    usable = np.isfinite(values)
    plain = np.where(usable, values, 0.0)
    parts = factorise(plain, usable, nominal)
    progress("refining lights", 1, _STAGES)
    if parts.relief_ratio < _FLAT:
        raise InputError(
            given="Three dimensions of the images stand out from the residual by a factor of "
            f"{parts.relief_ratio:.2g} only.",
            needed=f"A factor of {_FLAT:g}: an object that is flat, or bent in one direction only, tells nothing of "
            "its lights.",
            remedy="Use the nominal directions.",
        )
    basis, _ = steady_basis(parts.fit.normals, parts.fit.spread, mask)
    change = _common_matrix(parts.lights, nominal, basis.form, options)
    progress("refining lights", 2, _STAGES)
    wanted = parts.lights @ change
    length = np.sqrt((wanted * wanted).sum(axis=1))
    wanted = wanted / length[:, None]
    expected = _expected_errors(parts, change, wanted * length[:, None])
    lights = _blend(nominal, wanted, options.doubt**2 / (options.doubt**2 + expected**2))
    factors = _blended_factors(length, expected, options) if options.strengths else np.ones(len(length))
    health = RefineHealth(
        disagreement=_rms(_angles(wanted, nominal) / np.sqrt(2)),
        expected_error=_rms(expected),
        relief_ratio=parts.relief_ratio,
        integrability_ratio=basis.ratio,
        spread_before=_disagreement(plain, usable, nominal),
        spread_after=_disagreement(plain, usable, factors[:, None] * lights),
    )
    progress("refining lights", _STAGES, _STAGES)
    return _Refined(lights, factors, health, parts.settled)


def _common_matrix(
    lights: FloatArray, nominal: FloatArray, form: IntegrabilityForm, options: RefineOptions
) -> FloatArray:
    """Return the matrix (3, 3) that takes factored lights to the nominal ones, as strengths and surface have it too."""
    from scipy.optimize import least_squares

    start = np.linalg.lstsq(lights, nominal, rcond=None)[0]

    def excess(flat: FloatArray) -> FloatArray:
        matrix = start @ (np.eye(3) + flat.reshape(3, 3))
        found = lights @ matrix
        length = np.sqrt((found * found).sum(axis=1, keepdims=True))
        strength = np.log(length[:, 0])
        return np.concatenate(
            [
                ((found / length - nominal) / options.doubt).ravel(),
                [strength.mean()],  # the common factor of strengths is free
                (strength - strength.mean()) / max(options.strength_doubt, _SHARPEST),
                form.violations(np.linalg.inv(matrix)),
            ]
        )

    fit = least_squares(excess, np.zeros(9), loss="soft_l1", xtol=1e-12, ftol=1e-12)
    return np.asarray(start @ (np.eye(3) + fit.x.reshape(3, 3)))


def _disagreement(values: FloatArray, usable: BoolArray, lights: FloatArray) -> float:
    """Return the root mean square over lights of each one's median residual over a pixel's brightest value.

    Normals are fitted robustly, so that a single wrong light does not spoil them but stands out itself.
    """
    fit = fit_normals(values, lights, first_weights(np.where(usable, values, np.nan)))
    for _ in range(_ROUNDS):
        fit = fit_normals(values, lights, reweighted(values, usable, fit))
    fitted = np.isfinite(fit.spread)
    brightest = np.where(fitted, fit.model.max(axis=0), np.inf)
    lit = usable & fitted & (fit.model > DARK * brightest)
    share = np.abs(values - fit.model) / brightest
    medians = [float(np.median(row[some])) for row, some in zip(share, lit, strict=True) if some.any()]
    return _rms(np.array(medians)) if medians else float("inf")


def _expected_errors(parts: Factorisation, change: FloatArray, lights: FloatArray) -> FloatArray:
    """Return by how much each light may be off in either direction if half of all residuals conspired, (m,) [rad]."""
    fit = parts.fit
    normals = np.linalg.solve(change, fit.normals)
    fitted = np.isfinite(fit.spread)
    brightest = np.where(fitted, (lights @ normals).max(axis=0), 1.0)
    even = normals / np.where(brightest > 0, brightest, 1.0)
    say = np.where(fitted, fit.model.max(axis=0), 0.0) ** 2 * fit.weights
    errors = []
    for light, weight in zip(lights, say, strict=True):
        length = float(np.sqrt(light @ light))
        matrix = (even * weight) @ even.T / max(float(weight.sum()), np.finfo(np.float64).tiny)
        across = np.eye(3) - np.outer(light, light) / length**2
        variance = np.trace(across @ np.linalg.pinv(matrix) @ across) / 2
        errors.append(_UNISON * parts.spread * np.sqrt(max(float(variance), 0.0)) / length)
    return np.array(errors)


def _blend(nominal: FloatArray, wanted: FloatArray, share: FloatArray) -> FloatArray:
    mixed = nominal + share[:, None] * (wanted - nominal)
    return np.asarray(mixed / np.sqrt((mixed * mixed).sum(axis=1, keepdims=True)))


def _blended_factors(length: FloatArray, expected: FloatArray, options: RefineOptions) -> FloatArray:
    log = np.log(length)
    log -= log.mean()
    doubt = options.strength_doubt
    share = np.ones(len(log)) if np.isinf(doubt) else doubt**2 / np.maximum(doubt**2 + expected**2, 1e-300)
    factors = np.exp(share * log)
    return np.asarray(factors / factors.mean())


def _rig(capture: Capture, found: _Refined, options: RefineOptions) -> Rig:
    strengths = capture.rig.strengths(capture.stack.shape[3])
    source = f"{capture.rig.source}, refined from the images"
    if not options.strengths:
        return Rig.distant(found.lights, strengths, strength_unit=capture.rig.strength_unit, source=source)
    return Rig.distant(found.lights, strengths * found.factors[:, None], source=source)


def _angles(one: FloatArray, other: FloatArray) -> FloatArray:
    cross = np.cross(one, other)
    return np.asarray(np.arctan2(np.sqrt((cross * cross).sum(axis=1)), (one * other).sum(axis=1)))


def _rms(values: FloatArray) -> float:
    return float(np.sqrt((values * values).mean()))


def _sentence(found: _Refined, nominal: FloatArray) -> str:
    moved, health = np.degrees(_angles(found.lights, nominal)), found.health
    return (
        f"{len(moved)} lights moved by {np.sqrt((moved**2).mean()):.2f}° on the whole and {moved.max():.2f}° at most "
        f"(light {int(moved.argmax()) + 1}), expected to be right within {np.degrees(health.expected_error):.2f}° of "
        f"each other; residual {health.spread_before:.2%} before, {health.spread_after:.2%} after."
    )
