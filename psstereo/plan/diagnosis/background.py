"""A mask that holds pixels which no light ever reaches."""

from typing import ClassVar, Literal

import numpy as np

from psstereo.plan.diagnosis.case import Case
from psstereo.plan.diagnosis.check import Check
from psstereo.plan.diagnosis.finding import Finding

__all__ = ["Background"]

_UNLIT = 0.02
"""Brightest value over that of a bright pixel below which a pixel is never lit."""
_NOTE, _WARNING = 0.005, 0.02
"""Share of pixels."""


class Background(Check):
    """Share of pixels that are black in every image."""

    name: ClassVar[str] = "background"
    summary: ClassVar[str] = "The mask holds pixels that no light ever reaches."
    stage: ClassVar[Literal["plain", "order", "fit"]] = "plain"

    def look(self, case: Case) -> Finding | None:
        """Return a finding if more than a few pixels are never lit; see :meth:`Check.look`."""
        top = np.where(np.isfinite(case.sample.values), case.sample.values, -np.inf).max(axis=0, initial=-np.inf)
        top = top[np.isfinite(top)]
        if not len(top):
            return None
        bright = float(np.quantile(top, 0.9))
        share = float((top < _UNLIT * bright).mean())
        if not share >= _NOTE or bright <= 0:
            return None
        sentence = f"{share:.1%} of the pixels under the mask are black in every image: they look like background."
        remedy = "Draw the mask tighter, or let it be made from the images (--mask auto)."
        return self.finding("warning" if share >= _WARNING else "note", (100 * share, "%"), (sentence, remedy), 0.8)
