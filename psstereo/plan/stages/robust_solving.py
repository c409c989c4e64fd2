"""Leaving highlights and cast shadows out by their residuals."""

from typing import ClassVar

from psstereo.normals import Robust
from psstereo.normals.low_rank import LowRank
from psstereo.normals.sparse_bayesian import SparseBayesian
from psstereo.normals.trimmed import Trimmed
from psstereo.plan.facts import Facts
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
