"""All checks on one sample."""

from typing import Protocol

import numpy as np

from psstereo.plan.diagnosis.case import Case
from psstereo.plan.diagnosis.catalogue import CHECKS
from psstereo.plan.diagnosis.finding import Finding
from psstereo.plan.diagnosis.motion_probe import MotionProbe
from psstereo.plan.sample import Sample

__all__ = ["diagnose"]

_ORDER = {"fault": 0, "warning": 1, "note": 2}
_SPOILS = ("failed-flash", "duplicate-image", "duplicate-light")
"""Faults among the plain ones with which lights and images do not belong together."""
_LEAST = 64
"""Pixels with a fit below which only what needs none is said."""


class _Known(Protocol):
    """What is known of the capture besides the sample."""

    @property
    def lamps(self) -> bool:
        """Whether the lights are lamps at known places."""


def diagnose(sample: Sample, facts: _Known | None = None, *, motion: MotionProbe | None = None) -> tuple[Finding, ...]:
    """Say what is the matter with a capture.

    Parameters
    ----------
    sample : Sample
        A sample of its pixels, fitted as if the lights were distant.
    facts : object with an attribute `lamps`, optional
        Whether the lights are lamps at known places: then fall-off is no news, and neither are strengths.
    motion : MotionProbe, optional
        Fed with all frames; without it motion is told from eight lights on.

    Returns
    -------
    tuple of Finding
        Faults first; empty if all is well, as far as can be told. If images and lights do not belong together, causes
        that are read from a fit are not looked for, and a note says so.
    """
    case = Case(sample=sample, motion=motion, near=facts is not None and facts.lamps)
    found = [one for one in (check().look(case) for check in CHECKS.values() if check.stage == "plain") if one]
    spoilt = any(one.severity == "fault" and one.name in _SPOILS for one in found)
    fitted = int(np.isfinite(sample.albedo).sum()) >= _LEAST
    for stage in ("order", "fit"):
        if spoilt or not fitted:
            break
        more = [one for one in (check().look(case) for check in CHECKS.values() if check.stage == stage) if one]
        found += more
        spoilt = any(one.name != "light-depth" for one in more) and stage == "order"
    if spoilt:
        found.append(_left_out())
    return tuple(sorted(found, key=lambda one: _ORDER[one.severity]))


def _left_out() -> Finding:
    names = [name for name, check in CHECKS.items() if check.stage == "fit"]
    return Finding(
        name="not-checked",
        severity="note",
        figure=float(len(names)),
        unit="checks",
        sentence=f"Lights and images do not belong together, so that {', '.join(names)} could not be told.",
        remedy="Put the faults right and look again.",
        confidence=1.0,
    )
