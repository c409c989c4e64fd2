"""Every surface, by name."""

from psstereo_synth.shapes.bowl import Bowl
from psstereo_synth.shapes.cliffs import Cliffs
from psstereo_synth.shapes.cone import Cone
from psstereo_synth.shapes.ellipsoid import Ellipsoid
from psstereo_synth.shapes.grid import HeightGrid
from psstereo_synth.shapes.hills import GaussianHills
from psstereo_synth.shapes.plane import Plane
from psstereo_synth.shapes.relief import Relief
from psstereo_synth.shapes.ripples import Ripples
from psstereo_synth.shapes.sphere import Sphere
from psstereo_synth.shapes.steps import Steps
from psstereo_synth.shapes.terrain import Terrain
from psstereo_synth.shapes.torus import Torus
from psstereo_synth.shapes.vase import Vase

__all__ = ["RELIEFS"]

RELIEFS: dict[str, type[Relief]] = {
    Plane.name: Plane,
    Sphere.name: Sphere,
    Bowl.name: Bowl,
    Ellipsoid.name: Ellipsoid,
    Cone.name: Cone,
    Torus.name: Torus,
    Vase.name: Vase,
    GaussianHills.name: GaussianHills,
    Ripples.name: Ripples,
    Steps.name: Steps,
    Cliffs.name: Cliffs,
    Terrain.name: Terrain,
    HeightGrid.name: HeightGrid,
}
