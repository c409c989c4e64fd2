"""From normals to depth, and from depth to a mesh."""

from psstereo.depth.bilateral import Bilateral
from psstereo.depth.catalogue import INTEGRATORS
from psstereo.depth.discontinuity import Discontinuity
from psstereo.depth.frankot_chellappa import FrankotChellappa
from psstereo.depth.integrator import Integrator
from psstereo.depth.mesh import triangulate
from psstereo.depth.poisson import Poisson
from psstereo.depth.prior import Prior
from psstereo.depth.robust import LeastAbsolute
from psstereo.depth.scale import with_distance
from psstereo.depth.weighted import solve_weighted

__all__ = [
    "INTEGRATORS",
    "Bilateral",
    "Discontinuity",
    "FrankotChellappa",
    "Integrator",
    "LeastAbsolute",
    "Poisson",
    "Prior",
    "solve_weighted",
    "triangulate",
    "with_distance",
]
