"""Every cruel case, by family."""

from collections.abc import Callable

from psstereo.bench.stress import StressCase
from psstereo.catalogue import choose
from psstereo_synth.stress.figures import figure_cases
from psstereo_synth.stress.integration import integration_cases
from psstereo_synth.stress.lights import light_cases
from psstereo_synth.stress.near import near_cases
from psstereo_synth.stress.outliers import outlier_cases
from psstereo_synth.stress.shading import shading_cases
from psstereo_synth.stress.shapes import shape_cases
from psstereo_synth.stress.sources import source_cases
from psstereo_synth.stress.sun import sun_cases
from psstereo_synth.stress.values import value_cases

__all__ = ["STRESS_FAMILIES", "stress_cases"]

STRESS_FAMILIES: dict[str, Callable[[], list[StressCase]]] = {
    "lights": light_cases,
    "sun": sun_cases,
    "values": value_cases,
    "shapes": shape_cases,
    "sources": source_cases,
    "near": near_cases,
    "integration": integration_cases,
    "shading": shading_cases,
    "outliers": outlier_cases,
    "figures": figure_cases,
}
"""What makes the cases of each family."""


def stress_cases(*families: str) -> list[StressCase]:
    """Return the cases of some families, all if none is named.

    Parameters
    ----------
    *families : str
        Of `STRESS_FAMILIES`.

    Returns
    -------
    list of StressCase
        In the order of the families; large ones are made by
        :func:`~psstereo_synth.stress.integration.grid_case` alone.

    Raises
    ------
    OptionError
        If a family is unknown.

    Examples
    --------
    >>> {case.family for case in stress_cases("sun")}
    {'sun'}
    """
    return [case for name in families or STRESS_FAMILIES for case in choose(STRESS_FAMILIES, name, "family of cases")()]
