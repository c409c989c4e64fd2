"""Every integrator, by name."""

from psstereo.depth.integrator import Integrator
from psstereo.depth.poisson import Poisson

__all__ = ["INTEGRATORS"]

INTEGRATORS: dict[str, type[Integrator]] = {
    Poisson.name: Poisson,
}
