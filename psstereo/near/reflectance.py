"""Normals and depth once more with exemplar materials, where Lambert's law leaves more than noise.

A robust fit of Lambert's law outvotes narrow highlights; wide ones and metal bend its normals, and by them the depth.
Once it has found about where the surface is, the exemplars of :mod:`psstereo.normals.exemplar` are fitted under lamps
that each pixel sees from its own place. Their normals move the surface, and its distance goes where the light of
their materials falls off as it should. The materials are told anew at every size of the image, since they are only as
good as the places are.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from psstereo.errors import RigError
from psstereo.kernels.misfit import sky_of
from psstereo.kernels.near import NearFit
from psstereo.near.alternate import Alternation, Settled
from psstereo.near.exemplars import NOISE, blended, exemplar_state, fit_exemplars
from psstereo.near.level import Level, coarse_level, coarse_values, image_factors, refined, sampled_level
from psstereo.near.materials import Look, look
from psstereo.near.options import NearOptions, Round
from psstereo.near.profile import Profile, least_energy
from psstereo.normals.exemplar import Exemplar, ExemplarState
from psstereo.stack import PixelSet
from psstereo.types import FloatArray, Progress

__all__ = ["ExemplarAlternation", "Reflectance", "require_enough", "settle_reflectance"]

_BROKEN = 0.05
"""Share of pixels at which Lambert's law has to fail before exemplars are fitted; on matte scenes with noise it seems
to at up to one in seventy."""

_ROUNDS = 20
"""Rounds at each image size, at most."""

_FITS = 60
"""Fits of each pixel in a typical run of a small image, looks at materials and distances included."""

_PUPILS, _WITNESSES = 1500, 800
"""Pixels from which materials are told, as by the solver for distant lights; and the distance, which takes several
looks at each."""

_MOST = 0.5
"""Share of pixels at which Lambert's law has to fail before it is no longer asked for the distance, and half of the
evidence is enough for exemplars [1]."""

_UNKNOWNS = 5
"""Of a pixel, for what residuals promise: a normal, and some amounts that are not zero."""

_PASSES = 4
"""Looks for the distance at the coarsest size, at most."""

_ROUGH = 1e-3
"""Change at which rounds end that are not the last [1]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Reflectance:
    """What the surface was taken for.

    Attributes
    ----------
    state : ExemplarState or None
        The exemplars; None for Lambert's law alone.
    reason : str
        Why, as a sentence.
    broken : float or None
        Share of pixels at which exemplars explain much that Lambert's law does not; None if nobody looked [1].
    materials : int
        How many the object was found to be made of; 0 if each pixel has its own [1].
    noise : float
        Evidence for exemplars that chance brings about [1].
    """

    state: ExemplarState | None = None
    reason: str
    broken: float | None = None
    materials: int = 0
    noise: float = NOISE

    def facts(self) -> dict[str, Any]:
        """Return plain figures for the record."""
        return {
            "reflectance": "lambert" if self.state is None else "exemplar",
            "reflectance_reason": self.reason,
            "lambert_broken": self.broken,
            "materials": self.materials,
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class ExemplarAlternation(Alternation):
    """An alternation whose normals are those of exemplars where they have a share.

    Attributes
    ----------
    state : ExemplarState
        The exemplars.
    noise : float
        Evidence that chance brings about [1].
    """

    state: ExemplarState
    noise: float

    def fit(self, level: Level, q: FloatArray, start: FloatArray | None = None) -> NearFit:
        """Fit all pixels of a level at a surface; Lambert's law comes first and tells where it will do."""
        matte = super().fit(level, q, start)
        found = fit_exemplars(
            level, self.lamps, q, matte.scaled, self.state, pull=True, noise=self.noise, over=self.over
        )
        energy = (1.0 - found.share) * matte.energy + np.where(found.share > 0, found.share * found.energy, 0.0)
        return matte._replace(
            scaled=blended(matte.scaled, found), energy=energy, pull=found.pull, stiffness=found.stiffness
        )


def require_enough(options: NearOptions, lamps: int) -> None:
    """Refuse too few lamps for exemplars that were asked for.

    Parameters
    ----------
    options : NearOptions
        What was asked for.
    lamps : int
        How many there are.

    Raises
    ------
    RigError
        If there are fewer than sixteen.
    """
    least = Exemplar.least_lights
    if options.reflectance == "exemplar" and lamps < least:
        raise RigError(
            given=f"There are {lamps} lamps.",
            needed=f"Exemplar materials need {least} or more.",
            remedy="Take more images, or leave the solver out: highlights are then outvoted where that is possible.",
        )


def settle_reflectance(
    alternation: Alternation,
    fine: Level,
    pixels: PixelSet,
    settled: Settled,
    *,
    options: NearOptions,
    progress: Progress,
) -> tuple[Settled, Reflectance]:
    """Decide what the surface is taken for, and alternate with exemplars if they are needed.

    Parameters
    ----------
    alternation : Alternation
        By Lambert's law.
    fine : Level
        The full image.
    pixels : PixelSet
        Its pixels.
    settled : Settled
        Where the alternation by Lambert's law ended.
    options : NearOptions
        What was asked for.
    progress : callable
        Told how far it is.

    Returns
    -------
    Settled
        Where the last alternation ended.
    Reflectance
        What the surface was taken for, and why.
    """
    wanted, lamps, least = options.reflectance, len(alternation.lamps), Exemplar.least_lights
    if wanted == "lambert":
        return settled, Reflectance(reason="Lambert's law was asked for.")
    if lamps < least:
        return settled, Reflectance(reason=f"Exemplar materials need {least} lamps or more, and there are {lamps}.")
    teacher = _Teacher(alternation, options.exemplars, fine, settled.q)
    seen = teacher.look(fine, settled.q)
    why = f"at {seen.broken:.0%} of {seen.pixels} pixels exemplar materials explain much that Lambert's law does not."
    if wanted == "auto" and (seen.broken < _BROKEN or seen.materials is None):
        return settled, Reflectance(reason=f"Lambert's law stands: {why}", broken=seen.broken)
    found, last = _descend(teacher, fine, pixels, settled, options=options, progress=progress)
    reason = "Exemplar materials were asked for." if wanted == "exemplar" else f"{why[0].upper()}{why[1:]}"
    return found, Reflectance(
        state=replace(last.state, sky=sky_of(teacher.directions)),
        reason=reason,
        broken=seen.broken,
        materials=len(last.state.dictionary.mix),
        noise=last.noise,
    )


@dataclass(frozen=True, eq=False)
class _Teacher:
    """Tells materials and distances at any size of the image."""

    alternation: Alternation
    exemplars: Exemplar
    fine: Level
    q: FloatArray

    @property
    def directions(self) -> FloatArray:
        """Directions to the lamps from the middle of the object, (m, 3) [1]."""
        away = self.alternation.lamps[:, :3] - np.median(self.fine.view.points(self.q), axis=0)
        return np.asarray(away / np.sqrt((away * away).sum(axis=1, keepdims=True)))

    def state(self, materials: FloatArray | None) -> ExemplarState:
        """Return the exemplars with these materials, or with every lobe for itself."""
        work = float(len(self.alternation.lamps)) * len(self.fine) * _FITS
        # Error bars that know model error are for the answer, not for the way there.
        return replace(exemplar_state(self.exemplars, self.directions, materials, work), sky=None)

    def look(self, level: Level, q: FloatArray) -> Look:
        """Look at some pixels of a level."""
        sample, chosen = sampled_level(level, _PUPILS)
        start = self.alternation.fit(sample, q[chosen]).scaled
        count = self.exemplars.shared or 1
        return look(sample, self.alternation.lamps, q[chosen], start, self.state(None), count=count)

    def taught(self, q: FloatArray, seen: Look, *, held: bool) -> ExemplarAlternation:
        """Return the alternation with the materials that were seen, its distance held perhaps."""
        known: FloatArray | None = np.array(self.exemplars.materials) if self.exemplars.materials else None
        if known is None and self.exemplars.shared:
            known = seen.materials
        a = self.alternation
        return ExemplarAlternation(
            lamps=a.lamps,
            integrator=a.integrator,
            hold=float(np.median(q)) if held and a.hold is None else a.hold,
            work=a.work,
            over=a.over,
            state=self.state(known),
            noise=NOISE * (0.5 if seen.broken > _MOST else 1.0),
            last_stands=True,
        )

    def profile(self, level: Level, q: FloatArray) -> tuple[Profile, float]:
        """Return where the least energy is, and the standard deviation of the distance that it tells."""
        sample, chosen = sampled_level(level, _WITNESSES)
        free, lamps, at = self.state(None), self.alternation.lamps, q[chosen]

        def energies(shift: float) -> FloatArray:
            matte = self.alternation.fit(sample, at + shift)
            found = fit_exemplars(sample, lamps, at + shift, matte.scaled, free, pull=False)
            return np.where(np.isfinite(found.energy), found.energy, matte.energy)

        found = least_energy(lambda shift: float(energies(shift).sum()), self.alternation.length(level, q))
        usable = float(np.isfinite(sample.store.read(0, len(sample))).sum())
        freedom = max(usable - len(sample) * _UNKNOWNS, 1.0)
        stiffness = found.stiffness * len(level) / len(sample)
        spread = np.sqrt(found.energy / freedom / stiffness) if stiffness > 0 else np.inf
        return found, float(spread)


def _descend(
    teacher: _Teacher, fine: Level, pixels: PixelSet, settled: Settled, *, options: NearOptions, progress: Progress
) -> tuple[Settled, ExemplarAlternation]:
    """Alternate at several image sizes, at the coarsest until the distance stays.

    The distance goes where the pixels pull it, and is looked for where few of them obey Lambert's law.
    """
    factors = image_factors(len(pixels))
    level, q = fine, settled.q
    if factors[0] > 1:
        level = coarse_level(fine, pixels, fine.view.camera, factors[0])
        q = coarse_values(q, pixels, level)
    # From far off the pull is quicker than looking around.
    alternation = teacher.taught(q, teacher.look(level, q), held=False)
    limit = min(options.max_rounds, _ROUNDS)
    found = alternation.run(level, q, tolerance=_ROUGH, limit=limit)
    rounds = [*settled.rounds, *_marked(found)]
    q, spread, moved = found.q, found.moved.spread, np.inf
    ways = [factors[0]] * _PASSES + (factors[1:] or [1])
    for number, factor in enumerate(ways):
        last = number + 1 == len(ways)
        if number < _PASSES and not moved > _ROUGH:
            continue
        if factor != level.factor:
            finer = fine if factor == 1 else coarse_level(fine, pixels, fine.view.camera, factor)
            q, level = refined(level, q, finer), finer
        before, length = float(np.median(q)), teacher.alternation.length(level, q)
        seen = teacher.look(level, q)
        free = teacher.alternation.hold is None and seen.broken > _MOST
        if free:
            profile, spread = teacher.profile(level, q)
            q = q + profile.shift
            seen = teacher.look(level, q)
        alternation = teacher.taught(q, seen, held=free)
        found = alternation.run(level, q, tolerance=options.tolerance if last else _ROUGH, limit=limit)
        q, spread = found.q, spread if free else found.moved.spread
        moved = abs(float(np.median(q)) - before) / length
        rounds.extend(_marked(found))
        progress("fitting materials", number + 1, len(ways))
    moved_last = replace(found.moved, spread=spread)
    return replace(found, rounds=tuple(rounds), moved=moved_last), alternation


def _marked(found: Settled) -> list[Round]:
    """Return the rounds of an alternation with exemplars."""
    return [replace(one, reflectance="exemplar") for one in found.rounds]
