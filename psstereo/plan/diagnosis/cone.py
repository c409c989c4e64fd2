"""Lights that lie nearly in a plane, or in a narrow cone: noise becomes large errors."""

from typing import ClassVar, Literal

import numpy as np

from psstereo.plan.diagnosis.case import Case
from psstereo.plan.diagnosis.check import Check
from psstereo.plan.diagnosis.finding import Finding
from psstereo.types import FloatArray

__all__ = ["LightCone", "amplification"]

_COSTS = 3.5
"""Amplification over that of a good rig from which it is a warning."""
_RUINS = 20.0
_FLAT = 0.35
"""Smallest over second singular value below which lights rather lie in a plane than in a cone."""


def amplification(directions: FloatArray, normals: FloatArray | None = None) -> float:
    """Return by how much a rig's directions enlarge errors of angle, against a good rig of as many lights.

    A ring of m lights 54.7° off the view gives a surface that faces the camera errors of ``√(6 / m)`` times the noise
    over its albedo; that is the measure.

    Parameters
    ----------
    directions : float64 array (m, 3)
        Unit vectors to the lights.
    normals : float64 array (n, 3), optional
        For which normals; facing the camera if absent.

    Returns
    -------
    float
        1 for that ring, infinite for lights in a plane [1].
    """
    gram = directions.T @ directions
    values, vectors = np.linalg.eigh(gram)
    if not values[0] > 1e-12 * values[-1]:
        return float("inf")
    inverse = (vectors / values) @ vectors.T
    n = np.array([[0.0, 0.0, 1.0]]) if normals is None else normals
    # the part of the error along the normal changes the albedo only
    variance = np.trace(inverse) - np.einsum("ni,ij,nj->n", n, inverse, n)
    return float(np.sqrt(np.median(variance) * len(directions) / 6.0))


class LightCone(Check):
    """Condition of the light directions."""

    name: ClassVar[str] = "light-cone"
    summary: ClassVar[str] = "The lights lie nearly in a plane or all near the camera, which enlarges errors."
    stage: ClassVar[Literal["plain", "order", "fit"]] = "plain"

    def look(self, case: Case) -> Finding | None:
        """Return a finding if errors grow several times over; see :meth:`Check.look`."""
        lights = case.sample.directions
        factor = amplification(lights)
        if not factor >= _COSTS:
            return None
        values = np.linalg.svd(lights, compute_uv=False)
        middle = lights.mean(axis=0)
        length = float(np.linalg.norm(middle))
        cosines = np.clip(lights @ middle / max(length, np.finfo(np.float64).tiny), -1, 1)
        half = float(np.degrees(np.max(np.arctan2(np.sqrt(1 - cosines**2), cosines))))
        flat = values[2] < _FLAT * values[1]
        where = (
            f"lie nearly in one plane (singular values {values[0]:.2g}, {values[1]:.2g}, {values[2]:.2g})"
            if flat
            else f"lie in a cone of {half:.0f}° half-angle"
        )
        remedy = (
            "Add an image with a light well outside that plane."
            if flat
            else "Put lights 40° to 60° off the view, or take many more images and expect noisy normals."
        )
        sentence = f"The lights {where}: noise makes {factor:.1f} times the error of angle that a ring at 55° would."
        return self.finding("fault" if factor > _RUINS else "warning", (factor, "×"), (sentence, remedy), 1.0)
