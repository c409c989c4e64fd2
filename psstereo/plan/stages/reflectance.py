"""Reflectance that is not Lambert's."""

from typing import ClassVar

from psstereo.normals.bipolynomial import BiPolynomial
from psstereo.normals.bivariate import Bivariate
from psstereo.normals.response_bend import ResponseBend
from psstereo.plan.facts import Facts
from psstereo.plan.stage import Skip, Use
from psstereo.plan.stages.models import ModelStage

__all__ = ["Reflectance"]


class Reflectance(ModelStage):
    """Fits a reflectance of its own to every pixel."""

    name: ClassVar[str] = "non-Lambertian solving"
    summary: ClassVar[str] = "fit a reflectance to each pixel"
    solvers: ClassVar[tuple[str, ...]] = (ResponseBend.name, BiPolynomial.name, Bivariate.name)
    needless: ClassVar[str] = "Nothing speaks for a surface that is not matte outside its highlights."

    def whole(self, facts: Facts) -> Use | Skip:
        """Do it from sixteen lights on; see :meth:`Stage.whole`."""
        if facts.lamps or facts.images < ResponseBend.pays_from:
            return Skip(reason=f"It takes {ResponseBend.pays_from} lights.", figure=f"{facts.images} lights")
        return Use(reason="Nothing was to be left out.", options={"solver": ResponseBend.name})
