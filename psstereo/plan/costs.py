"""What solving costs: time a sample of each solver, by its readable reference and by its compiled twin.

Measured on one machine on scenes of 48 lights; :mod:`psstereo.plan.predict` scales them by what the machine at hand
does, so that only their ratios matter.
"""

from dataclasses import dataclass

__all__ = ["COSTS", "DEPTH", "MESH", "Cost"]


@dataclass(frozen=True, kw_only=True)
class Cost:
    """Cost of a solver on one thread.

    Attributes
    ----------
    readable : float
        Time a sample by the readable reference [s].
    compiled : float
        Time a sample by the compiled twin; that of the reference if there is none [s].
    load : float
        Time to load the compiled code [s].
    break_even : float
        Samples from which the compiled twin is used; infinite if there is none [1].
    start : float
        Time to load what the readable reference needs [s].
    learning : float
        Time a sample that it learns from before it solves, by the compiled twin; 0 if it learns nothing [s].
    """

    readable: float
    compiled: float
    load: float = 0.0
    break_even: float = float("inf")
    start: float = 0.0
    learning: float = 0.0


COSTS: dict[str, Cost] = {
    "least-squares": Cost(readable=30e-9, compiled=30e-9),
    "sky": Cost(readable=500e-9, compiled=500e-9),
    "trimmed": Cost(readable=35e-9, compiled=35e-9),
    "ambient": Cost(readable=550e-9, compiled=550e-9),
    "low-rank": Cost(readable=600e-9, compiled=600e-9),
    "robust": Cost(readable=800e-9, compiled=50e-9, load=0.42, break_even=1.5e6, start=0.15),
    "sparse-bayesian": Cost(readable=780e-9, compiled=115e-9, load=0.5, break_even=5e5, start=0.15),
    "response-bend": Cost(readable=1800e-9, compiled=140e-9, load=0.48, break_even=9e5, start=0.17),
    "bi-polynomial": Cost(readable=5900e-9, compiled=580e-9, load=0.48, break_even=1e5, start=0.17),
    "exemplar": Cost(readable=8000e-9, compiled=900e-9, load=0.5, break_even=4.5e4, start=0.17, learning=3600e-9),
    "bivariate": Cost(readable=4600e-9, compiled=1030e-9, load=0.39, break_even=2e5, start=0.15),
}
"""By the solver's name."""

DEPTH: dict[str, Cost] = {
    "poisson": Cost(readable=2.2e-6, compiled=0.4e-6, load=0.32, break_even=1e5, start=0.07),
    "discontinuity": Cost(readable=2.2e-6, compiled=1.6e-6, load=0.35, break_even=2.5e4, start=0.1),
}
"""By the integrator's name, a pixel instead of a sample."""

MESH = Cost(readable=0.2e-6, compiled=0.2e-6, start=0.035)
"""Of the mesh, a pixel."""
