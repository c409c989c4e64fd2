"""Lights from an object whose shape is known in the image: a sphere, a board, a mesh put in register."""

from psstereo.calibrate.shape.known_shape import ShapeCalibration, calibrate_known_shape, sphere_normals
from psstereo.calibrate.shape.mesh import mesh_normals

__all__ = [
    "ShapeCalibration",
    "calibrate_known_shape",
    "mesh_normals",
    "sphere_normals",
]
