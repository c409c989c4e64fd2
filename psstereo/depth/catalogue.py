"""Every integrator, by name."""

from psstereo.depth.bilateral import Bilateral
from psstereo.depth.discontinuity import Discontinuity
from psstereo.depth.frankot_chellappa import FrankotChellappa
from psstereo.depth.integrator import Integrator
from psstereo.depth.poisson import Poisson
from psstereo.depth.robust import LeastAbsolute

__all__ = ["INTEGRATORS"]

INTEGRATORS: dict[str, type[Integrator]] = {
    Poisson.name: Poisson,
    Discontinuity.name: Discontinuity,
    LeastAbsolute.name: LeastAbsolute,
    Bilateral.name: Bilateral,
    FrankotChellappa.name: FrankotChellappa,
}
