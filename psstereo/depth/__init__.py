"""From normals to depth, and from depth to a mesh; what can be read off normals and depth maps."""

from psstereo.depth.bilateral import Bilateral
from psstereo.depth.catalogue import INTEGRATORS
from psstereo.depth.curvature import Curvature, curvature_from_normals
from psstereo.depth.discontinuity import Discontinuity
from psstereo.depth.frankot_chellappa import FrankotChellappa
from psstereo.depth.from_depth import normals_from_depth
from psstereo.depth.given_normals import Integration, free_constants, integrate_normals
from psstereo.depth.integrator import Integrator
from psstereo.depth.mesh import triangulate
from psstereo.depth.poisson import Poisson
from psstereo.depth.prior import Prior
from psstereo.depth.relief import BandRelief, relief_from_normals
from psstereo.depth.robust import LeastAbsolute
from psstereo.depth.scale import with_distance
from psstereo.depth.tiled import TiledResult, integrate_tiled
from psstereo.depth.weighted import solve_weighted

__all__ = [
    "INTEGRATORS",
    "BandRelief",
    "Bilateral",
    "Curvature",
    "Discontinuity",
    "FrankotChellappa",
    "Integration",
    "Integrator",
    "LeastAbsolute",
    "Poisson",
    "Prior",
    "TiledResult",
    "curvature_from_normals",
    "free_constants",
    "integrate_normals",
    "integrate_tiled",
    "normals_from_depth",
    "relief_from_normals",
    "solve_weighted",
    "triangulate",
    "with_distance",
]
