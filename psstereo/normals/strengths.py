"""Strengths of lights from the images, when only the directions are known (semi-calibrated photometric stereo).

A pixel shows ``V_ip = e_i l_i · b_p`` with the strengths e_i unknown; a gain of each frame, such as its exposure time,
is part of them. The images determine them up to a common factor, unless all lights but one lie in a plane, or all
normals are alike: then other strengths with other normals show the same images. A closed form (Hadamard product of two
small matrices), the images' own brightness and the nominal strengths give starts. The best one is refined by robust
Gauss–Newton steps in log e with the normals eliminated; shadows and highlights are found by the model as it improves,
and badly fitted pixels lose their say.

How far to trust them is judged by the images too. Regions of the image are asked how far they would pull the strengths
on their own: noise averages out over a region, but gloss, interreflection or a lamp that is near do not, and what
regions disagree about is a measure of what they are wrong about together. To this comes a thousandth of the brightness
over the root of the *determinacy*, the least share of a light's information that survives not knowing the normals.
Where that expected error is large, strengths cannot be told, and the method refuses. It cannot see what every region
agrees on: a surface that reflects less of the light from the side looks like one under lamps that are weaker there.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from psstereo.capture import Capture
from psstereo.errors import InputError, OptionError, RigError
from psstereo.lights import Rig, StrengthUnit
from psstereo.normals.low_rank_fit import fit_normals
from psstereo.normals.strength_refinement import (
    Refined,
    SampleSet,
    brightness,
    first_lit,
    refine_strengths,
    robust_spread,
)
from psstereo.normals.strength_steps import closed_form
from psstereo.normals.thinning import SampleGrid, sample_grid
from psstereo.normals.verdict import VerdictArray
from psstereo.results import Outcome, Step
from psstereo.stack import PER_CHANNEL
from psstereo.types import BoolArray, FloatArray, IntArray, Map, Progress, no_progress

__all__ = ["StrengthEstimate", "StrengthHealth", "estimate_strengths"]

_PIXELS = 8192
"""Pixels used: far more than the unknowns need, and more would only repeat the same model error."""
_LEAST_PIXELS = 10
"""Pixels that an image must light, for a light or for normals to be told from."""
_BANDS = 5
"""Regions are bands of rows, this many, split into this many pieces each."""
_WORST_ERROR = 0.15
"""Expected error from which strengths count as not to be told."""
_LOOSE_RIG = 1e-2
"""Least singular value of the equations l × M l = 0 beside that of M = 1, over the root of the number of lights."""


@dataclass(frozen=True, kw_only=True)
class StrengthHealth:
    """How well strengths are told by the images.

    Attributes
    ----------
    expected_error : float
        Root-mean-square relative error of the strengths that regions of the image and the determinacy tell [1].
    determinacy : float
        Least share, over combinations of lights, of the information that is left when normals are unknown [1].
    eigenvalue_ratio : float
        Second smallest over smallest eigenvalue of the closed form: below 3, gloss or shadows spoil it; NaN if too few
        pixels are lit by all lights [1].
    spread_before, spread_after : float
        Median over pixels of the robust residual over the pixel's brightest value, with the nominal strengths and with
        the estimated ones [1].
    residual_before, residual_after : float
        Root-mean-square residual of plain least squares over all observations, relative to the values [1].
    """

    expected_error: float
    determinacy: float
    eigenvalue_ratio: float
    spread_before: float
    spread_after: float
    residual_before: float
    residual_after: float


@dataclass(frozen=True, kw_only=True, eq=False)
class StrengthEstimate:
    """Estimated strengths and the capture that has them.

    Attributes
    ----------
    strengths : float64 array (m,) or (m, c)
        Factors on the nominal strengths, mean one over the lights; one a channel if channels were kept apart [1].
    capture : Capture
        The same capture with the new strengths in its rig, ready for any normal solver.
    health : StrengthHealth
        How well they are told; the worst of the channels if they were kept apart.
    rounds : int
        Rounds done.
    outcome : Outcome
        Whether the rounds settled.
    step : Step
        What was found, for the record of a run.
    """

    strengths: FloatArray
    capture: Capture
    health: StrengthHealth
    rounds: int
    outcome: Outcome
    step: Step

    @property
    def rig(self) -> Rig:
        """The lights with the estimated strengths."""
        return self.capture.rig

    @property
    def departures(self) -> FloatArray:
        """How much stronger each light is than nominal, beside the others: 0.1 for a tenth, shaped as `strengths` [1].

        Their median is zero, so that a few wrong numbers among the nominal strengths do not make the others look wrong.
        """
        return np.asarray(self.strengths / np.median(self.strengths, axis=0) - 1.0)


@dataclass(frozen=True, eq=False)
class _Told:
    refined: Refined
    health: StrengthHealth


def estimate_strengths(
    capture: Capture,
    *,
    gray: str | Sequence[float] = "mean",
    prior: float = 0.0,
    valid_range: tuple[float, float] | None = None,
    observation_mask: BoolArray | VerdictArray | None = None,
    worst_error: float = _WORST_ERROR,
    over: Map = map,
    progress: Progress = no_progress,
) -> StrengthEstimate:
    """Estimate the strengths of lights whose directions are known.

    Not for flat objects, for lights that are all but one in a plane, or where interreflection or gloss rules
    everywhere: the expected error tells, and beyond `worst_error` the method refuses. Where lamps were measured, the
    measured strengths are better than these.

    Parameters
    ----------
    capture : Capture
        Images and lights; the rig's strengths are the nominal ones, all equal if nothing is known.
    gray : str or sequence of float
        How channels become one value; one factor a light then serves all its channels. ``"per-channel"`` estimates a
        factor for each channel; the balance between channels stays nominal.
    prior : float
        Weight of a tie of log strengths to the nominal ones, as a share of a light's own information; 0 for none,
        0.01 for lamps known to a few per cent [1].
    valid_range : (float, float), optional
        Raw values, as shares of full scale, outside of which an observation is left out; below 0.98 if absent and the
        images have a full scale [1].
    observation_mask : bool or uint8 array (m, h, w), optional
        Observations that may take part, or verdicts; see :func:`psstereo.normals.estimate_normals`.
    worst_error : float
        Expected relative error beyond which to refuse [1].
    over : map-like
        Executes the images, such as the ``map`` of a thread pool.
    progress : callable
        Told how far it is.

    Returns
    -------
    StrengthEstimate
        Strengths, new capture, and how far to trust them.

    Raises
    ------
    RigError
        If there are fewer than four lights, or directions with which strengths cannot be told.
    InputError
        If the images do not tell strengths: a flat object, one that is nowhere near matte, or a light that reaches
        next to nothing.
    OptionError
        If the prior or the worst error is negative or not a number, or the gray value is unknown.
    UnsupportedError
        If a light is not distant.

    Examples
    --------
    >>> import numpy as np
    >>> from psstereo import Capture, MemoryStack, Rig, lambertian_images
    >>> rng = np.random.default_rng(0)
    >>> normals = rng.uniform([-0.5, -0.5, 1], [0.5, 0.5, 1], (20, 20, 3))
    >>> normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    >>> directions = [[0, 0, 1], [1, 0, 2], [0, 1, 2], [-1, 0, 2], [0, -1, 2]]
    >>> images = lambertian_images(normals, np.full((20, 20), 0.2), Rig.distant(directions, [1, 2, 1, 0.5, 0.5]))
    >>> found = estimate_strengths(Capture(stack=MemoryStack(images), rig=Rig.distant(directions)))
    >>> found.strengths.round(6).tolist()
    [1.0, 2.0, 1.0, 0.5, 0.5]
    """
    from threadpoolctl import threadpool_limits

    started = time.perf_counter()
    _check_options(prior, worst_error)
    directions = capture.rig.directions
    _require_tellable(capture.rig)
    grid = sample_grid(
        capture,
        gray=gray,
        limit=_PIXELS,
        strengths=True,
        valid_range=valid_range,
        observation_mask=observation_mask,
        over=over,
        progress=progress,
    )
    regions, told = _regions(grid), []
    with threadpool_limits(1, user_api="blas"):  # or the last digits depend on the number of threads
        for k, values in enumerate(grid.values):
            _require_lit(values, capture.stack.names)
            told.append(_estimate(values, directions, regions, prior))
            _require_told(told[-1].health, worst_error)
            progress("estimating strengths", k + 1, len(grid.values))
    factors = np.stack([one.refined.strengths for one in told], axis=1)
    health = max((one.health for one in told), key=lambda health: health.expected_error)
    settled = all(one.refined.settled for one in told)
    reason = _sentence(factors, health)
    return StrengthEstimate(
        strengths=factors if grid.gray == PER_CHANNEL else factors[:, 0],
        capture=replace(capture, rig=_rig(capture, factors)),
        health=health,
        rounds=max(one.refined.rounds for one in told),
        outcome=Outcome.SOLVED if settled else Outcome.NOT_CONVERGED,
        step=Step(name="light strengths", done=True, reason=reason, seconds=time.perf_counter() - started),
    )


def _rig(capture: Capture, factors: FloatArray) -> Rig:
    """Return the rig with factors (m, 1 or c) on its strengths, which are no irradiances any more."""
    strengths = capture.rig.strengths(capture.stack.shape[3]) * factors
    source = f"{capture.rig.source}, strengths from the images"
    return Rig.distant(capture.rig.directions, strengths, strength_unit=StrengthUnit.RELATIVE, source=source)


def _regions(grid: SampleGrid) -> IntArray:
    """Return which of about equal parts of the image each pixel of the grid lies in, (p,)."""
    rows, columns = np.nonzero(grid.mask)
    count = len(rows)
    band = np.arange(count) * _BANDS // count
    region = np.zeros(count, np.intp)
    region[np.lexsort((columns, band))] = np.arange(count) * _BANDS**2 // count
    return region


def _estimate(values: FloatArray, directions: FloatArray, regions: IntArray, prior: float) -> _Told:
    """Estimate the strengths of one channel from samples (m, p)."""
    usable = np.isfinite(values)
    samples = SampleSet(np.where(usable, values, 0.0), usable, first_lit(values), directions, regions)
    ones = np.ones(len(values))
    closed, ratio = _closed(samples)
    starts = [one for one in (brightness(values), closed, ones) if one is not None]
    start = min(starts, key=lambda one: robust_spread(samples, one / one.mean(), rounds=1))
    refined = refine_strengths(samples, start, prior)
    health = StrengthHealth(
        expected_error=refined.expected_error,
        determinacy=refined.determinacy,
        eigenvalue_ratio=ratio,
        spread_before=robust_spread(samples, ones),
        spread_after=refined.spread,
        residual_before=_plain_residual(samples, ones),
        residual_after=_plain_residual(samples, refined.strengths),
    )
    return _Told(refined, health)


def _closed(samples: SampleSet) -> tuple[FloatArray | None, float]:
    """Return the closed form's strengths, None if it has too few pixels or failed, and its eigenvalue ratio."""
    if np.count_nonzero((samples.lit > 0).all(axis=0)) < 4 * len(samples.lit):
        return None, float("nan")
    strengths, ratio = closed_form(samples.values, samples.directions, samples.lit)
    return (strengths if np.isfinite(strengths).all() and (strengths > 0).all() else None), ratio


def _plain_residual(samples: SampleSet, strengths: FloatArray) -> float:
    corrected = samples.values / strengths[:, None]
    fit = fit_normals(corrected, samples.directions, samples.usable.astype(np.float64))
    size = np.sqrt((corrected**2).sum())
    return float(np.sqrt((samples.usable * (corrected - fit.model) ** 2).sum()) / size)


def _require_lit(values: FloatArray, names: tuple[str, ...]) -> None:
    """Refuse images that show too little: of a light that reaches a few pixels only, nothing can be told."""
    lit = (values > 0).sum(axis=1)
    few = np.flatnonzero(lit < _LEAST_PIXELS)
    if len(few):
        raise InputError(
            given=f"Only {lit[few[0]]} pixels that can be used are lit in the image {names[few[0]]}"
            + (f", and {len(few) - 1} more images show as little." if len(few) > 1 else "."),
            needed=f"Each light must reach {_LEAST_PIXELS} pixels of the sample, to be compared with the others.",
            remedy="Leave such images out together with their lights, or widen the mask or the valid range.",
        )


def _check_options(prior: float, worst_error: float) -> None:
    for name, value in (("prior", prior), ("worst error", worst_error)):
        if not 0 <= value < np.inf:
            raise OptionError(
                given=f"The {name} is {value}.",
                needed="A number of at least 0 is needed.",
                remedy=f"Use 0 for no prior, and {_WORST_ERROR:g} for the worst error.",
            )


def _require_tellable(rig: Rig) -> None:
    """Refuse directions with which a linear map can change strengths without turning any light."""
    directions = rig.directions
    if len(rig) < 4:
        raise RigError(
            given=f"There are {len(rig)} lights.",
            needed="With unknown strengths four or more are needed, no three of them in one plane if they are four.",
            remedy="Take more images, keep the given strengths, or measure them with a white sphere or card.",
        )
    rig.require_spanning()
    looseness = _looseness(directions)
    if looseness < _LOOSE_RIG:
        raise RigError(
            given=f"The light directions are all alike, or lie in one plane but for one (measure {looseness:.2g}).",
            needed=f"Strengths can be told from {_LOOSE_RIG:g} on: other strengths would fit such lights as well.",
            remedy="Add lights elsewhere, keep the given strengths, or measure them with a white sphere or card.",
        )


def _looseness(directions: FloatArray) -> float:
    """Return how far from zero l × M l stays for any M that is not a multiple of 1.

    A map M that leaves all directions in place but scales them differently changes strengths and normals together
    without changing any image. It exists if and only if the directions lie in a plane and a line, or are three.
    """
    cross = np.zeros((len(directions), 3, 3))
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -directions[:, 2], directions[:, 1], -directions[:, 0]
    cross -= cross.transpose(0, 2, 1)
    rows = np.einsum("mij,mk->mijk", cross, directions).reshape(-1, 9)
    return float(np.linalg.svd(rows, compute_uv=False)[-2] / np.sqrt(len(directions)))


def _require_told(health: StrengthHealth, worst_error: float) -> None:
    if health.expected_error <= worst_error:
        return
    size = f"uncertain by {100 * health.expected_error:.2g} %" if np.isfinite(health.expected_error) else "open"
    raise InputError(
        given=f"The images leave the strengths {size} (determinacy {health.determinacy:.2g}, robust residual "
        f"{100 * health.spread_after:.2g} %).",
        needed=f"At most {100 * worst_error:g} % is accepted: normals in many directions and a surface near to matte.",
        remedy="Keep the given strengths, or measure them with a white sphere or card.",
    )


def _sentence(factors: FloatArray, health: StrengthHealth) -> str:
    each = "" if factors.shape[1] == 1 else " in each channel"
    return (
        f"Strengths of {len(factors)} lights were found from the images{each}: {factors.min():.2f} to "
        f"{factors.max():.2f} times the nominal ones, expected to be right within {100 * health.expected_error:.2g} %; "
        f"robust residual {100 * health.spread_before:.2g} % before, {100 * health.spread_after:.2g} % after."
    )
