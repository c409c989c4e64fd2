"""A camera or an object that moved between images."""

from typing import ClassVar, Literal

import numpy as np

from psstereo.plan.diagnosis.case import Case
from psstereo.plan.diagnosis.check import Check, listed
from psstereo.plan.diagnosis.finding import Finding
from psstereo.plan.diagnosis.shifts import Shifts

__all__ = ["Moved"]

_LEAST = 0.15
"""Root-mean-square shift from which it counts [px]."""
_FURTHEST = 3.0
"""Shift beyond which the linear estimate means something else [px]."""
_EXPLAINS = 0.04
"""Share of the misfit that shifts must take away."""
_SURE = 5.0
"""Shift over its error from which it is believed."""
_LIGHTS = 8
"""Lights below which highlights that wander look like shifts."""
_SHADING = 0.5
"""Shift that shading alone may feign where there is little detail in the albedo [px]."""
_STILL = 0.1
"""Shift and error below which detail says that nothing moved [px]."""
_TOLD = 0.5
"""Share of pieces of frames that must have an opinion."""


class Moved(Check):
    """Shifts between images, by residuals where there are eight lights, by detail where the frames were watched.

    The figure is rather too small: edges that are sharper than a shift is long say too little, by up to a half.
    """

    name: ClassVar[str] = "motion"
    summary: ClassVar[str] = "The images are shifted against each other by a fraction of a pixel or more."
    stage: ClassVar[Literal["plain", "order", "fit"]] = "fit"

    def look(self, case: Case) -> Finding | None:
        """Return a finding if shifts are beyond chance; see :meth:`Check.look`."""
        found = _believed(case)
        if found is None:
            return None
        length = np.hypot(*found.size.T)
        worst = tuple(int(i) for i in np.argsort(-length)[:3])
        sentence = (
            f"The images are shifted against each other by {found.rms:.2f} ± {found.error:.2f} pixels or more "
            f"(root mean square), most in images {listed(worst, case.sample.names)} with {length.max():.2f}."
        )
        remedy = "Register the images before solving, and fix camera and object; leave out images that moved most."
        severity: Literal["warning", "fault"] = "fault" if found.rms > 1 else "warning"
        return self.finding(severity, (found.rms, "px"), (sentence, remedy), 0.85, worst)


def _believed(case: Case) -> Shifts | None:
    """Return shifts that either way of measuring is sure of; detail tells them best where there is enough of it."""
    by_detail = None if case.motion is None else case.motion.shifts()
    if by_detail is not None and by_detail.share > _TOLD:
        if _sure(by_detail) and by_detail.rms > _SHADING:
            return by_detail
        if by_detail.error < _STILL and by_detail.rms < _STILL:
            return None
    if len(case.sample.directions) < _LIGHTS or case.shifts is None:
        return None
    best = case.best_pattern()
    rival = case.patterns[best].share if best else 0.0  # what bends brightness smoothly also looks like shifts
    found = case.shifts
    return found if _sure(found) and found.share > max(_EXPLAINS, rival) else None


def _sure(shifts: Shifts) -> bool:
    return _LEAST < shifts.rms < _FURTHEST and shifts.rms > _SURE * shifts.error
