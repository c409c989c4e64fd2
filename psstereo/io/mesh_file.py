"""Triangle meshes in files: PLY, glTF (binary) and OBJ."""

from pathlib import Path
from typing import Any

import numpy as np

from psstereo.errors import InputError, MissingFileError, OptionError
from psstereo.surface_mesh import SurfaceMesh

__all__ = ["MESH_SUFFIXES", "write_mesh"]

MESH_SUFFIXES = (".ply", ".glb", ".obj")
"""Suffixes that :func:`write_mesh` knows."""


def write_mesh(mesh: SurfaceMesh, path: Path) -> None:
    """Write a mesh, with its normals and colours, in the format that the suffix names.

    Vertices keep their order, axes (x right, y up, z toward the camera: glTF's own) and unit; PLY and GLB hold them in
    single precision. Colours are written as they are; a viewer that follows glTF to the letter takes them for linear
    and shows them lighter. An existing file is replaced, but only once the new one is complete.

    Parameters
    ----------
    mesh : SurfaceMesh
        The mesh.
    path : Path
        File to write: ``.ply`` (binary), ``.glb`` or ``.obj``.

    Raises
    ------
    OptionError
        If the suffix is another one.
    InputError
        If there is nothing to write: no vertex, or no triangle in a format that needs one (``.glb``).
    MissingFileError
        If the folder does not exist.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in MESH_SUFFIXES:
        raise OptionError(
            given=f"The mesh file {path.name} has the suffix '{path.suffix}'.",
            needed=f"Known are {', '.join(MESH_SUFFIXES)}.",
            remedy="Choose one of these; .ply is read by most programs.",
        )
    if not path.parent.is_dir():
        raise MissingFileError(
            given=f"The folder {path.parent} does not exist.",
            needed="A mesh is written into an existing folder.",
            remedy="Create the folder first, or check the path.",
        )
    if len(mesh.vertices) == 0 or (suffix == ".glb" and len(mesh.faces) == 0):
        raise InputError(
            given=f"The mesh has {len(mesh.vertices)} vertices and {len(mesh.faces)} triangles.",
            needed="Something must be there to write; a .glb file needs at least one triangle.",
            remedy="Check the mask: single pixels give points, but no triangles. Points alone can go into a .ply file.",
        )
    content = _encoded(mesh, suffix)
    unfinished = path.with_name(path.name + ".part")
    try:
        unfinished.write_bytes(content)
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)


def _encoded(mesh: SurfaceMesh, suffix: str) -> bytes:
    import trimesh

    shape: Any = trimesh.Trimesh(
        vertices=np.asarray(mesh.vertices, np.float64),
        faces=mesh.faces,
        vertex_normals=mesh.normals,
        vertex_colors=mesh.colors,
        process=False,
    )
    normals = mesh.normals is not None
    if suffix == ".ply":
        return bytes(shape.export(file_type="ply", encoding="binary", vertex_normal=normals))
    if suffix == ".glb":
        return bytes(shape.export(file_type="glb", include_normals=normals))
    text = shape.export(
        file_type="obj", include_normals=normals, include_color=mesh.colors is not None, include_texture=False
    )
    return str(text).encode("utf-8")
