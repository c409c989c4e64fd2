"""Axes of the light file that point the other way."""

from typing import ClassVar, Literal

import numpy as np

from psstereo.plan.diagnosis.case import Case
from psstereo.plan.diagnosis.check import Check
from psstereo.plan.diagnosis.finding import Finding
from psstereo.types import FloatArray

__all__ = ["LightAxes", "LightDepth"]

_CONVEX = 0.25
"""Correlation of a normal's component with its place from which the object counts as bulging, or hollow."""
_SAME = 0.05
"""Difference of unit vectors below which two arrangements of lights are the same."""
_REMEDIES = {
    "y": "Turn the sign of y in the light file (or read it as y down).",
    "x": "Turn the sign of x in the light file.",
    "x or y": "Turn the sign of y in the light file, or else of x; if bumps look like dents, it was the other one.",
}


class LightAxes(Check):
    """Signs and names of x and y, by integrability and by the way that the object bulges."""

    name: ClassVar[str] = "light-axes"
    summary: ClassVar[str] = "The lights' y (or x) points the other way, or x and y are exchanged."
    stage: ClassVar[Literal["plain", "order", "fit"]] = "order"

    def look(self, case: Case) -> Finding | None:
        """Return a finding if other axes make a surface of the normals; see :meth:`Check.look`."""
        found = case.contest
        if found.by != "curl" or found.axes == 0:
            return None
        why = (
            f"the relative curl of the normals falls from {np.sqrt(found.before):.2f} to {np.sqrt(found.after):.2f}, "
            f"in {found.agreement:.0%} of places"
        )
        figure = float(np.sqrt(found.before))
        if found.axes == 1:
            axis = _mirrored(case)
            sentence = f"The lights' {axis} seems to point the other way: with it turned round, {why}."
            remedy = _REMEDIES[axis] + _same_as_exchanged(case.sample.directions)
        elif found.axes == 2:
            sentence = f"The lights' x and y seem to be exchanged: with them put back, {why}."
            remedy = "Exchange the columns x and y of the light file."
        else:
            sentence = f"The lights seem to be turned by 90° about the view: turned back, {why}."
            remedy = "Take (y, −x, z) for (x, y, z) in the light file, or (−y, x, z) if bumps then look like dents."
        return self.finding("fault", (figure, "relative curl"), (sentence, remedy), found.agreement)


class LightDepth(Check):
    """Sign of z: which way the surface faces."""

    name: ClassVar[str] = "light-depth"
    summary: ClassVar[str] = "The lights' z points into the scene, so that the surface turns its back on the camera."
    stage: ClassVar[Literal["plain", "order", "fit"]] = "order"

    def look(self, case: Case) -> Finding | None:
        """Return a finding if most of the surface faces away from the camera; see :meth:`Check.look`."""
        z = case.sample.normals[:, 2]
        z = z[np.isfinite(z)]
        if len(z) == 0:
            return None
        away = float((z < 0).mean())
        if away <= 0.5:
            return None
        lights = case.sample.directions[:, 2]
        share = float((lights < 0).mean())
        sentence = f"{away:.0%} of the normals point away from the camera, and {share:.0%} of the lights are behind it."
        remedy = (
            "Turn the sign of z in the light file; if bumps then look like dents, turn all three signs: its vectors "
            "point from the lights instead of to them."
        )
        return self.finding("fault", (100 * away, "%"), (sentence, remedy), min(1.0, away))


def _mirrored(case: Case) -> str:
    """Say which axis it is: on a bulging object normals point outward along the one that is right."""
    places, normals = case.contest.seen.places, case.contest.seen.normals
    length = np.sqrt((normals * normals).sum(axis=0))
    good = length > 0
    if good.sum() < 16:
        return "x or y"
    unit = normals[:, good] / length[good]
    away = places[:, good] - places[:, good].mean(axis=1, keepdims=True)
    score = []
    for axis in (0, 1):
        a, b = unit[axis] - unit[axis].mean(), away[axis]
        size = float(np.sqrt((a * a).sum() * (b * b).sum()))
        score.append(float((a * b).sum()) / size if size > 0 else 0.0)
    if score[0] > _CONVEX and score[1] < -_CONVEX:
        return "y"
    if score[1] > _CONVEX and score[0] < -_CONVEX:
        return "x"
    return "x or y"


def _same_as_exchanged(directions: FloatArray) -> str:
    """Say so if rows could have been exchanged instead: some arrangements are their own mirror image."""
    for axis in (1, 0):
        mirrored = directions * np.where(np.arange(3) == axis, -1.0, 1.0)
        distance = np.abs(mirrored[:, None] - directions).max(axis=2)
        order = distance.argmin(axis=1)
        moved = np.flatnonzero(order != np.arange(len(order)))
        if distance.min(axis=1).max() < _SAME and len(moved) == 2:
            return f" With these lights it may as well be that rows {moved[0] + 1} and {moved[1] + 1} are exchanged."
    return ""
