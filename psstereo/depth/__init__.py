"""From normals to depth, and from depth to a mesh."""

from psstereo.depth.catalogue import INTEGRATORS
from psstereo.depth.integrator import Integrator
from psstereo.depth.mesh import triangulate
from psstereo.depth.poisson import Poisson
from psstereo.depth.scale import with_distance

__all__ = ["INTEGRATORS", "Integrator", "Poisson", "triangulate", "with_distance"]
