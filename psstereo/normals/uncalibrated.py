"""Lights from the images alone: photometric stereo without calibration.

Images of a matte surface split into lights and normals up to a 3 × 3 matrix; that the normals belong to a surface
leaves a bas-relief transformation; maxima of brightness, entropy of the albedo or given strengths settle that, up to
the choice between a relief and its inverse, which no image of a matte surface tells. A person makes it.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from psstereo.camera import Orthographic
from psstereo.capture import Capture
from psstereo.catalogue import choose
from psstereo.errors import InputError, OptionError
from psstereo.lights import Rig
from psstereo.normals.albedo_criteria import albedo_of
from psstereo.normals.bas_relief import BasRelief, typical_facing, upright
from psstereo.normals.bas_relief_search import Resolved, by_entropy, by_maxima, by_strengths
from psstereo.normals.diffuse_maxima import find_maxima
from psstereo.normals.factorisation import Factorisation, factorise
from psstereo.normals.gram import weighted_gram
from psstereo.normals.integrability import IntegrableBasis
from psstereo.normals.light_colour import light_colours
from psstereo.normals.smoothing import steady_basis, trust_of
from psstereo.normals.thinning import SampleGrid, sample_grid
from psstereo.results import Outcome, Step
from psstereo.stack import PER_CHANNEL, gray_weights
from psstereo.types import BoolArray, FloatArray, Map, Progress, no_progress

__all__ = ["LightsFound", "UncalibratedHealth", "UncalibratedOptions", "find_lights"]

_PIXELS = 16_000
"""Pixels used at most; maxima and slopes need neighbours, so that these lie on a grid."""
_LEAST_LIGHTS = 4
_FLAT = 3.0
"""Third singular value of the normals over the residual below which the object counts as flat."""
_NO_SURFACE = 2.0
"""Ratio of the last singular values of integrability below which no basis stands out."""
_AMBIGUITIES = {"maxima": None, "entropy": None, "strengths": None}
_RELIEFS = {"convex": 1.0, "concave": -1.0}
_STAGES = 4


@dataclass(frozen=True, kw_only=True)
class UncalibratedOptions:
    """How lights are found.

    Attributes
    ----------
    ambiguity : {"maxima", "entropy", "strengths"}
        What resolves the bas-relief ambiguity: places that are brightest because they face the light, weighed by how
        plain the albedo is; the entropy of the albedo alone, for surfaces of few colours; or the rig's strengths taken
        for true, equal if nothing is known, for lights at several heights.
    relief : {"convex", "concave"}
        Which of the two surfaces that show the same images: the one whose normals lean outward from the middle of the
        mask on the whole, or its inverse.
    gray : str or sequence of float
        How channels become one value; the colours of the lights are taken out before.
    valid_range : (float, float) or None
        Raw values, as shares of full scale, outside of which an observation is left out; below 0.98 if absent and the
        images have a full scale.
    """

    ambiguity: Literal["maxima", "entropy", "strengths"] = "maxima"
    relief: Literal["convex", "concave"] = "convex"
    gray: str | Sequence[float] = "mean"
    valid_range: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        choose(_AMBIGUITIES, self.ambiguity, "way to resolve the ambiguity")
        choose(_RELIEFS, self.relief, "relief")
        if self.gray == PER_CHANNEL:
            raise OptionError(
                given="Lights are to be found from each channel on its own.",
                needed="All channels share the directions of the lights, so that one value a pixel is used.",
                remedy="Use gray='mean'; the colours of the lights are found all the same.",
            )


@dataclass(frozen=True, kw_only=True)
class UncalibratedHealth:
    """How far to trust what was found.

    Attributes
    ----------
    rank_three : float
        Share of the images' energy in three dimensions, shadows and highlights included [1].
    spread : float
        Median over pixels of the robust residual over the pixel's brightest value [1].
    relief_ratio : float
        Third singular value of the normals over that residual: near 1 for a flat object [1].
    integrability_ratio : float
        How far the basis in which the normals belong to a surface stands out: 1 for not at all [1].
    support, chance : float
        Share of maxima that agree (entropy of the albedo; relative residual of the strengths), and the median of the
        same figure over the transformations tried [1].
    evidence : int
        Maxima, pixels or lights that were asked.
    facing : float
        Median over pixels of n_z [1].
    outwardness : float
        How clearly the normals lean outward from the middle of the mask, from −1 to 1: near 0 the words convex and
        concave say little, and the choice between relief and inverse is open [1].
    remaining : str
        What stays unknown, as a sentence.
    """

    rank_three: float
    spread: float
    relief_ratio: float
    integrability_ratio: float
    support: float
    chance: float
    evidence: int
    facing: float
    outwardness: float
    remaining: str


@dataclass(frozen=True, kw_only=True, eq=False)
class LightsFound:
    """Lights that were found, and the capture that has them.

    Attributes
    ----------
    capture : Capture
        The same capture with the lights in its rig, ready for any normal solver.
    alternative : Rig
        The lights of the inverse relief, which explain the images as well: the choice that was not made.
    health : UncalibratedHealth
        How far to trust them.
    outcome : Outcome
        Whether the factorisation settled.
    step : Step
        What was done, for the record of a run.
    """

    capture: Capture
    alternative: Rig
    health: UncalibratedHealth
    outcome: Outcome
    step: Step

    @property
    def rig(self) -> Rig:
        """The lights."""
        return self.capture.rig


def find_lights(
    capture: Capture,
    options: UncalibratedOptions | None = None,
    *,
    over: Map = map,
    progress: Progress = no_progress,
) -> LightsFound:
    """Find directions and strengths of distant lights from the images.

    The directions of the capture's own rig are not used, and its strengths only if they are to resolve the ambiguity.
    Strengths come out up to one factor a channel. Directions are a few degrees off on real objects, and more where the
    albedo has no plain parts, on metal, or in deep hollows: any measured directions are better, if need be refined by
    :func:`psstereo.normals.refine_lights.refine_lights`. Not for near lights or for objects that are flat or bent in
    one direction only. Rays of a pinhole camera are taken for parallel.

    Parameters
    ----------
    capture : Capture
        Images and mask.
    options : UncalibratedOptions, optional
        How.
    over : map-like
        Executes the images, such as the ``map`` of a thread pool.
    progress : callable
        Told how far it is.

    Returns
    -------
    LightsFound
        Lights, the same capture under them, the alternative, and how far to trust all that.

    Raises
    ------
    InputError
        If there are fewer than four images, if the object is flat, if no basis makes its normals those of a surface,
        or if nothing resolves the ambiguity.
    """
    from threadpoolctl import threadpool_limits

    chosen = options or UncalibratedOptions()
    started = time.perf_counter()
    if len(capture.stack) < _LEAST_LIGHTS:
        raise InputError(
            given=f"There are {len(capture.stack)} images, and their lights are to be found.",
            needed=f"At least {_LEAST_LIGHTS} are needed: three always fit.",
            remedy="Take more images, ten or more if possible, or give the directions of the lights.",
        )
    given = chosen.ambiguity == "strengths"
    grid = sample_grid(
        capture,
        gray=PER_CHANNEL,
        limit=_PIXELS,
        strengths=given,
        valid_range=chosen.valid_range,
        over=over,
        progress=progress,
    )
    with threadpool_limits(1, user_api="blas"):  # or the last digits depend on the number of threads
        found = _find(grid, chosen, progress)
    colours = np.ones((len(capture.stack), capture.stack.shape[3])) if given else found.colours
    nominal = capture.rig.strengths(capture.stack.shape[3]) if given else colours
    rigs = [_rig(lights, nominal, chosen, given=given) for lights in (found.lights, found.lights * [-1.0, -1.0, 1.0])]
    return LightsFound(
        capture=replace(capture, rig=rigs[0]),
        alternative=rigs[1],
        health=found.health,
        outcome=Outcome.SOLVED if found.settled else Outcome.NOT_CONVERGED,
        step=Step(
            name="lights from the images",
            done=True,
            reason=_sentence(capture, chosen, found.health),
            seconds=time.perf_counter() - started,
        ),
    )


@dataclass(frozen=True, eq=False)
class _Found:
    lights: FloatArray
    colours: FloatArray
    health: UncalibratedHealth
    settled: bool


def _find(grid: SampleGrid, options: UncalibratedOptions, progress: Progress) -> _Found:
    """Find the lights (m, 3) from samples."""
    given = options.ambiguity == "strengths"
    channels, lights, _ = grid.values.shape
    colours = np.ones((lights, channels)) if given else light_colours(grid.values)
    weights = gray_weights(options.gray, channels).matrix[0]
    values = np.einsum("c,cmp->mp", weights, grid.values / colours.T[:, :, None])
    usable = np.isfinite(values)
    values = np.where(usable, values, 0.0)
    energy = np.linalg.eigvalsh(weighted_gram(values))
    parts = factorise(values, usable)
    progress("finding lights", 1, _STAGES)
    _require_relief(parts)
    basis, even = steady_basis(parts.fit.normals, parts.fit.spread, grid.mask)
    _require_surface(basis)
    progress("finding lights", 2, _STAGES)
    normals, rows, trust = _start(parts, basis, even)
    resolved = _resolve((normals, rows), parts.fit.spread, grid.mask, options)
    progress("finding lights", 3, _STAGES)
    relief, outward = _choose_side(resolved.relief, normals, trust, grid.mask, options.relief)
    log = np.array([[relief.mu, relief.nu, np.log(abs(relief.depth))]])
    progress("finding lights", _STAGES, _STAGES)
    health = UncalibratedHealth(
        rank_three=float(energy[-3:].sum() / energy.sum()),
        spread=parts.spread,
        relief_ratio=parts.relief_ratio,
        integrability_ratio=basis.ratio,
        support=resolved.support,
        chance=resolved.chance,
        evidence=resolved.evidence,
        facing=float(typical_facing(normals[:, trust > 0], log)[0]),
        outwardness=outward,
        remaining=_remaining(options),
    )
    return _Found(relief.lights(rows), colours, health, parts.settled)


def _require_relief(parts: Factorisation) -> None:
    if parts.relief_ratio < _FLAT:
        raise InputError(
            given="Three dimensions of the images stand out from the residual by a factor of "
            f"{parts.relief_ratio:.2g} only.",
            needed=f"A factor of {_FLAT:g}: an object that is flat, or bent in one direction only, tells nothing of "
            "its lights.",
            remedy="Give the directions of the lights; from this object they cannot be told.",
        )


def _require_surface(basis: IntegrableBasis) -> None:
    if basis.ratio < _NO_SURFACE:
        raise InputError(
            given=f"No basis makes the normals those of a surface better than others do (ratio {basis.ratio:.3g}).",
            needed=f"A ratio of at least {_NO_SURFACE:g}: a smooth surface, curved over many pixels.",
            remedy="Give the directions of the lights, or check that all images show the object from the same place.",
        )


def _start(parts: Factorisation, basis: IntegrableBasis, even: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return normals (3, p), lights (m, 3) and trust (p,) in a basis from which a search can start."""
    trust = trust_of(parts.fit.spread)
    normals = basis.matrix @ even
    lights = np.linalg.solve(basis.matrix.T, parts.lights.T).T
    start = upright(normals, trust)
    return start.normals(normals), start.lights(lights), trust


def _resolve(
    split: tuple[FloatArray, FloatArray], spread: FloatArray, mask: BoolArray, options: UncalibratedOptions
) -> Resolved:
    normals, lights = split
    if options.ambiguity == "strengths":
        return by_strengths(lights)
    albedo = albedo_of(normals, trust_of(spread), mask)
    if options.ambiguity == "entropy":
        return by_entropy(albedo)
    return by_maxima(find_maxima(normals, lights, spread, mask), albedo)


def _choose_side(
    relief: BasRelief, normals: FloatArray, trust: FloatArray, mask: BoolArray, wanted: str
) -> tuple[BasRelief, float]:
    """Return the relief or its inverse, whichever is as wanted, and how clearly the normals lean outward."""
    b = relief.normals(normals)
    some = trust > 0
    rows, columns = np.nonzero(mask)
    x, y = columns[some] - columns[some].mean(), rows[some].mean() - rows[some]
    b = b[:, some] / np.sqrt((b[:, some] * b[:, some]).sum(axis=0))
    along = float(b[0] @ x + b[1] @ y)
    most = float(np.sqrt((b[:2] * b[:2]).sum() * (x @ x + y @ y)))
    outward = along / most if most > 0 else 0.0
    if outward * _RELIEFS[wanted] < 0:
        return BasRelief(mu=relief.mu, nu=relief.nu, depth=-relief.depth), -outward
    return relief, outward


def _rig(lights: FloatArray, strengths: FloatArray, options: UncalibratedOptions, *, given: bool) -> Rig:
    length = np.sqrt((lights * lights).sum(axis=1))
    source = f"found from the images ({options.ambiguity}, {options.relief})"
    if not given:
        strengths = strengths * (length / length.mean())[:, None]
    return Rig.distant(lights / length[:, None], strengths, source=source)


def _remaining(options: UncalibratedOptions) -> str:
    scale = "" if options.ambiguity == "strengths" else " The strengths have a common factor in each channel."
    return (
        f"The inverse relief under lights turned by half a turn about the view shows the same images; {options.relief} "
        f"was chosen.{scale}"
    )


_EVIDENCE = {
    "maxima": "{share:.0%} of {evidence} maxima of brightness agree ({chance:.0%} by chance)",
    "entropy": "the entropy of the albedo is {share:.3g} ({chance:.3g} by chance)",
    "strengths": "the strengths of {evidence} lights are met within {share:.2%}",
}


def _sentence(capture: Capture, options: UncalibratedOptions, health: UncalibratedHealth) -> str:
    evidence = _EVIDENCE[options.ambiguity].format(share=health.support, chance=health.chance, evidence=health.evidence)
    words = [
        f"Directions{'' if options.ambiguity == 'strengths' else ' and strengths'} of {len(capture.stack)} lights were "
        f"found from the images: three dimensions hold {health.rank_three:.1%} of their energy, integrability stands "
        f"out by {health.integrability_ratio:.2g}, {evidence}.",
        health.remaining,
    ]
    if abs(health.outwardness) < 0.2:
        words.append(f"The normals hardly lean outward ({health.outwardness:.2f}): try the other relief too.")
    if not isinstance(capture.camera, Orthographic):
        words.append("The camera's rays were taken for parallel.")
    return " ".join(words)
