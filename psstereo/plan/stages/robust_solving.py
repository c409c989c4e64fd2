"""Leaving highlights and cast shadows out by their residuals."""

from typing import ClassVar

from psstereo.normals import Robust
from psstereo.normals.low_rank import LowRank
from psstereo.normals.response_bend import ResponseBend
from psstereo.normals.sparse_bayesian import SparseBayesian
from psstereo.normals.trimmed import Trimmed
from psstereo.plan.facts import Facts
from psstereo.plan.stage import Skip, Use
from psstereo.plan.stages.models import ModelStage

__all__ = ["RobustSolving"]


class RobustSolving(ModelStage):
    """Fits Lambert's law to the observations that agree with it."""

    name: ClassVar[str] = "robust solving"
    summary: ClassVar[str] = "leave highlights and cast shadows out"
    solvers: ClassVar[tuple[str, ...]] = (Robust.name, Trimmed.name, SparseBayesian.name, LowRank.name)
    needless: ClassVar[str] = "Nothing speaks for outliers that least squares would follow."

    def figure(self, facts: Facts) -> str:
        """Return the shares of outliers; see :meth:`ModelStage.figure`."""
        if facts.bright_outliers is None or facts.dark_outliers is None:
            return ""
        return f"{facts.bright_outliers:.2%} too bright, {facts.dark_outliers:.2%} too dark"

    def whole(self, facts: Facts) -> Use | Skip:
        """Do it from eight lights on, unless the bent response does it as well; see :meth:`Stage.whole`."""
        if facts.lamps or facts.images < Robust.pays_from or facts.images >= ResponseBend.pays_from:
            return Skip(reason="It is done by the method that is used, or there are too few lights for it.")
        return Use(reason="Nothing was to be left out.", options={"solver": Robust.name})
