"""A capture under examination: its sample, and what several checks need, computed once when it is first asked for."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from psstereo.normals.strength_refinement import Refined, SampleSet, first_lit, refine_strengths
from psstereo.plan.diagnosis.contest import Contest, contest
from psstereo.plan.diagnosis.evidence import Evidence, evidence
from psstereo.plan.diagnosis.motion_probe import MotionProbe
from psstereo.plan.diagnosis.patterns import Pattern, smooth_patterns
from psstereo.plan.diagnosis.shifts import Shifts, shifts_from_residuals
from psstereo.plan.diagnosis.tone import Tone, tone
from psstereo.plan.sample import Sample

__all__ = ["Case"]

_MOST = 24_000
"""Observations from which strengths are told."""
_OFF = 0.08
"""Root-mean-square departure of strengths from which it counts."""
_SURE = 4.0
"""Departure over its expected error from which it counts."""
_VAGUE = 0.06
"""Expected error of strengths from which the images do not tell them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """What checks look at.

    Attributes
    ----------
    sample : Sample
        The sample.
    motion : MotionProbe or None
        Pieces of the frames, if someone kept them.
    near : bool
        Whether the capture's lights are lamps at known places, and the sample only takes them as distant.
    """

    sample: Sample
    motion: MotionProbe | None = None
    near: bool = False

    @cached_property
    def contest(self) -> Contest:
        """Other readings of the lights against the given one."""
        return contest(self.sample)

    @cached_property
    def strengths(self) -> Refined | None:
        """Strengths over those that the values were divided by; None where the images do not tell."""
        return _strengths(self.sample)

    @property
    def strengths_off(self) -> bool:
        """Whether strengths are other than given, beyond doubt."""
        found = self.strengths
        if found is None or not found.settled:
            return False
        departure = float(np.sqrt(np.mean(np.log(found.strengths) ** 2)))
        return found.expected_error < _VAGUE and departure > max(_OFF, _SURE * found.expected_error)

    @cached_property
    def evidence(self) -> Evidence:
        """Lit observations, with strengths put right if they are off."""
        if self.strengths_off and self.strengths is not None:
            factors = self.strengths.strengths[:, None]
            return evidence(replace(self.sample, values=self.sample.values / factors))
        return evidence(self.sample)

    @cached_property
    def shifts(self) -> Shifts | None:
        """Shifts between images by what the fit leaves unexplained."""
        return shifts_from_residuals(self.sample)

    @cached_property
    def patterns(self) -> dict[str, Pattern]:
        """Causes that bend brightness smoothly; see :func:`psstereo.plan.diagnosis.patterns.smooth_patterns`."""
        return smooth_patterns(self.sample, self.evidence)

    @cached_property
    def tone(self) -> Tone | None:
        """The tone curve that seems to be left, if one is."""
        return tone(self.sample, self.evidence, self.patterns)

    def best_pattern(self) -> str:
        """Name of the cause that explains most; empty if there is none.

        Causes of the wrong sign do not count: highlights bend brightness the other way than a gamma does.
        """
        wanted = {"response": -1, "near": 1}
        told = {name: one for name, one in self.patterns.items() if abs(one.size) > 3 * one.error}
        able = {name: one.share for name, one in told.items() if wanted.get(name, one.size) * one.size > 0}
        return max(able, key=lambda name: able[name], default="")


def _strengths(sample: Sample) -> Refined | None:
    count = len(sample.directions)
    whole = np.flatnonzero(np.isfinite(sample.values).all(axis=0) & np.isfinite(sample.albedo))
    if count < 5 or len(whole) < 64:
        return None
    whole = whole[:: max(-(-len(whole) * count // _MOST), 1)]
    values = sample.values[:, whole] / sample.albedo[whole]
    if not (values > 0).any(axis=1).all():
        return None
    samples = SampleSet(
        values=values,
        usable=np.ones(values.shape, np.bool_),
        lit=first_lit(values),
        directions=sample.directions,
        regions=np.asarray(sample.blocks[whole] % 8),
    )
    found = refine_strengths(samples, np.ones(count))
    return found if np.isfinite(found.strengths).all() and (found.strengths > 0).all() else None
