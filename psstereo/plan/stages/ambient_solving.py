"""Ambient light as an unknown of every pixel."""

from typing import ClassVar

from psstereo.normals.ambient import AmbientLeastSquares
from psstereo.plan.facts import Facts
from psstereo.plan.stage import Skip, Use
from psstereo.plan.stages.models import ModelStage

__all__ = ["AmbientSolving"]


class AmbientSolving(ModelStage):
    """Finds a level that all images of a pixel share."""

    name: ClassVar[str] = "ambient solving"
    summary: ClassVar[str] = "find the ambient light of each pixel"
    solvers: ClassVar[tuple[str, ...]] = (AmbientLeastSquares.name,)
    needless: ClassVar[str] = "Nothing speaks for light that all images share."

    def figure(self, facts: Facts) -> str:
        """Return the level that was found; see :meth:`ModelStage.figure`."""
        if facts.ambient is None or facts.ambient_error is None:
            return super().figure(facts)
        return f"level {facts.ambient:.2%} ± {facts.ambient_error:.2%} of the albedo"

    def whole(self, facts: Facts) -> Use | Skip:
        """Leave it to the bent response, which has an ambient level as well; see :meth:`Stage.whole`."""
        del facts
        return Skip(reason="A bent response has an ambient level as well, and robust fits are told from it.")
