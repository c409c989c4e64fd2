"""Reflectance that is not Lambert's."""

from typing import ClassVar

from psstereo.normals.bipolynomial import BiPolynomial
from psstereo.normals.bivariate import Bivariate
from psstereo.normals.exemplar import Exemplar
from psstereo.normals.response_bend import ResponseBend
from psstereo.plan.stages.models import ModelStage

__all__ = ["Reflectance"]


class Reflectance(ModelStage):
    """Fits a reflectance of its own to every pixel."""

    name: ClassVar[str] = "non-Lambertian solving"
    summary: ClassVar[str] = "fit a reflectance to each pixel"
    solvers: ClassVar[tuple[str, ...]] = (ResponseBend.name, BiPolynomial.name, Bivariate.name, Exemplar.name)
    needless: ClassVar[str] = "Nothing speaks for a surface that is not matte outside its highlights."
