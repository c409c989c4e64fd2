"""Rows of the light file that belong to other images."""

from typing import ClassVar, Literal

import numpy as np

from psstereo.plan.diagnosis.case import Case
from psstereo.plan.diagnosis.check import Check, listed
from psstereo.plan.diagnosis.finding import Finding

__all__ = ["LightOrder"]


class LightOrder(Check):
    """Order of the lights, by residuals where they tell and by integrability where they do not."""

    name: ClassVar[str] = "light-order"
    summary: ClassVar[str] = "Rows of the light file are exchanged, or in another order than the images."
    stage: ClassVar[Literal["plain", "order", "fit"]] = "order"

    def look(self, case: Case) -> Finding | None:
        """Return a finding if another order fits far better; see :meth:`Check.look`."""
        found = case.contest
        moved = found.moved
        if not found.by or not moved:
            return None
        given = np.arange(len(found.winner.order))
        names = case.sample.names
        order = found.winner.order
        if len(moved) == 2:
            what, remedy = "are exchanged", f"Exchange rows {moved[0] + 1} and {moved[1] + 1} of the light file."
        elif len(moved) > 2 and any((np.roll(given, k) == order).all() for k in given):
            shift = int(order[0])
            what = f"are {min(shift, len(given) - shift)} off"
            remedy = f"Move the rows on, so that image 1 has the light that is now in row {shift + 1}."
        else:
            what = "are in another order"
            wanted = ", ".join(str(int(i) + 1) for i in order[:24]) + (" …" if len(order) > 24 else "")
            remedy = f"Check the order of files; this order of the present rows fits: {wanted}."
        figure = found.before / max(found.after, np.finfo(np.float64).tiny)
        if found.by == "residual":
            why = f"their residuals fall {figure:.1f} times, from {found.before:.2g} to {found.after:.2g} of the albedo"
        else:
            before, after = np.sqrt(found.before), np.sqrt(found.after)
            why = f"the relative curl of the normals falls from {before:.2f} to {after:.2f}"
        sentence = (
            f"The lights of images {listed(moved, names)} {what}: put right, {why}, in {found.agreement:.0%} of places."
        )
        return self.finding("fault", (figure, "×"), (sentence, remedy), found.agreement, moved)
