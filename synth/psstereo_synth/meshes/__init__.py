"""Triangle meshes: views through OpenGL or rays, shadows, and one bounce of light."""

from psstereo_synth.meshes.interreflection import Gather
from psstereo_synth.meshes.mesh import TriangleMesh
from psstereo_synth.meshes.opengl import OpenGLError
from psstereo_synth.meshes.rays import RayCaster
from psstereo_synth.meshes.read import READABLE_SUFFIXES, read_mesh
from psstereo_synth.meshes.relief import mesh_of_relief
from psstereo_synth.meshes.shadows import RayShadows
from psstereo_synth.meshes.view import Engine, view_mesh
from psstereo_synth.meshes.view_opengl import view_mesh_opengl
from psstereo_synth.meshes.view_rays import view_mesh_rays

__all__ = [
    "READABLE_SUFFIXES",
    "Engine",
    "Gather",
    "OpenGLError",
    "RayCaster",
    "RayShadows",
    "TriangleMesh",
    "mesh_of_relief",
    "read_mesh",
    "view_mesh",
    "view_mesh_opengl",
    "view_mesh_rays",
]
