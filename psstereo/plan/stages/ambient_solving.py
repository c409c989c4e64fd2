"""Ambient light as an unknown of every pixel."""

from typing import ClassVar

from psstereo.normals.ambient import AmbientLeastSquares
from psstereo.normals.sky import SkyLeastSquares
from psstereo.plan.facts import Facts
from psstereo.plan.stages.models import ModelStage

__all__ = ["AmbientSolving"]


class AmbientSolving(ModelStage):
    """Finds a level that all images of a pixel share."""

    name: ClassVar[str] = "ambient solving"
    summary: ClassVar[str] = "find the ambient light of each pixel"
    solvers: ClassVar[tuple[str, ...]] = (AmbientLeastSquares.name, SkyLeastSquares.name)
    needless: ClassVar[str] = "Nothing speaks for light that all images share."

    def figure(self, facts: Facts) -> str:
        """Return the level that was found; see :meth:`ModelStage.figure`."""
        if facts.ambient is None or facts.ambient_error is None:
            return super().figure(facts)
        return f"level {facts.ambient:.2%} ± {facts.ambient_error:.2%} of the albedo"
