"""Images whose light did not fire."""

from typing import ClassVar, Literal

import numpy as np

from psstereo.plan.diagnosis.case import Case
from psstereo.plan.diagnosis.check import Check, listed
from psstereo.plan.diagnosis.finding import Finding
from psstereo.types import FloatArray

__all__ = ["FailedFlash"]

_DIM = 0.15
"""Share of the brightness that the other images promise."""
_FACING = 0.3
"""z of a light, and cosine of a surface, from which light must be seen."""
_LEAST = 32
"""Pixels below which nothing is said."""
_KNOWN = 0.5
"""Share of an image's observations that must be usable."""


class FailedFlash(Check):
    """Images that are all but black although their light should reach the surface."""

    name: ClassVar[str] = "failed-flash"
    summary: ClassVar[str] = "An image is all but black: its light did not fire."
    stage: ClassVar[Literal["plain", "order", "fit"]] = "plain"

    def look(self, case: Case) -> Finding | None:
        """Return a finding if images are far darker than the others promise; see :meth:`Check.look`."""
        share = _brightness(case)
        dark = tuple(int(i) for i in np.flatnonzero(share < _DIM))
        if not dark or len(dark) > len(share) // 2:
            return None
        least = float(share[list(dark)].min())
        sentence = (
            f"The images {listed(dark, case.sample.names)} show {100 * least:.0f} % of the brightness that the other "
            "images promise: their light seems not to have fired."
        )
        remedy = "Take them again, or leave these images and their lights out."
        return self.finding("fault", (100 * least, "%"), (sentence, remedy), 0.95, dark)


def _brightness(case: Case) -> FloatArray:
    """Return how bright each image is against what the others promise, (m,); 1 where nothing can be said."""
    sample = case.sample
    count = len(sample.directions)
    share = np.ones(count)
    good = np.isfinite(sample.albedo) & (sample.albedo > 0)
    if good.sum() < _LEAST:
        return share
    known = np.isfinite(sample.values[:, good])
    values = np.where(known, sample.values[:, good], 0.0)
    level = np.quantile(values, 0.9, axis=1)
    middle = float(np.median(level))
    model = np.maximum(sample.directions @ sample.normals[good].T, 0.0)
    for i in range(count):
        if not level[i] < _DIM * middle or sample.directions[i, 2] < _FACING or known[i].mean() < _KNOWN:
            continue  # bright enough, from behind, or saturated
        facing = model[i] > _FACING
        # with few lights the dark image has bent the normals away from its light, so that it promises itself little
        if count < 5:
            share[i] = level[i] / middle
        elif facing.sum() >= _LEAST:
            promised = model[i, facing] * sample.albedo[good][facing]
            share[i] = float((values[i, facing] * promised).sum() / (promised * promised).sum())
    return share
