"""Surfaces z = f(x, y) whose heights and slopes are known everywhere."""

from psstereo_synth.shapes.bowl import Bowl
from psstereo_synth.shapes.catalogue import RELIEFS
from psstereo_synth.shapes.cliffs import Cliffs
from psstereo_synth.shapes.cone import Cone
from psstereo_synth.shapes.elevation import read_elevation
from psstereo_synth.shapes.ellipsoid import Ellipsoid
from psstereo_synth.shapes.finite import FiniteRelief, SquareRelief
from psstereo_synth.shapes.grid import HeightGrid
from psstereo_synth.shapes.hills import GaussianHills
from psstereo_synth.shapes.plane import Plane
from psstereo_synth.shapes.relief import Elevation, Relief
from psstereo_synth.shapes.ripples import Ripples
from psstereo_synth.shapes.sphere import Sphere
from psstereo_synth.shapes.steps import Steps
from psstereo_synth.shapes.terrain import Terrain
from psstereo_synth.shapes.torus import Torus
from psstereo_synth.shapes.vase import Vase

__all__ = [
    "RELIEFS",
    "Bowl",
    "Cliffs",
    "Cone",
    "Elevation",
    "Ellipsoid",
    "FiniteRelief",
    "GaussianHills",
    "HeightGrid",
    "Plane",
    "Relief",
    "Ripples",
    "Sphere",
    "SquareRelief",
    "Steps",
    "Terrain",
    "Torus",
    "Vase",
    "read_elevation",
]
