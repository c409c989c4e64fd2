"""Triangle meshes from files."""

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from psstereo.errors import InputError, MissingFileError, OptionError, UnreadableFileError
from psstereo_synth.meshes.mesh import TriangleMesh

__all__ = ["READABLE_SUFFIXES", "read_mesh"]

READABLE_SUFFIXES = (".glb", ".gltf", ".obj", ".off", ".ply", ".stl")
"""Suffixes that :func:`read_mesh` knows."""


def read_mesh(path: Path, *, smooth: bool = False) -> TriangleMesh:
    """Read the triangles of a file; all parts of a scene become one mesh, each at its place.

    Vertices that coincide are joined. Colours, materials and textures are left behind, and no other file is opened: a
    ``.gltf`` must hold its own data.

    Parameters
    ----------
    path : Path
        A file in one of the formats of :data:`READABLE_SUFFIXES`.
    smooth : bool
        Whether normals are to be interpolated between vertices.

    Returns
    -------
    TriangleMesh
        The mesh in the axes and the unit of the file.

    Raises
    ------
    MissingFileError
        If there is no such file.
    OptionError
        If the suffix is another one.
    UnreadableFileError
        If the file is damaged, or of another kind than its suffix says.
    InputError
        If it holds no triangles, or they are no usable mesh.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in READABLE_SUFFIXES:
        raise OptionError(
            given=f"The mesh file {path.name} has the suffix '{path.suffix}'.",
            needed=f"Known are {', '.join(READABLE_SUFFIXES)}.",
            remedy="Convert the mesh to .ply.",
        )
    if not path.is_file():
        raise MissingFileError(
            given=f"There is no file {path}.", needed="A mesh is read from a file.", remedy="Check the path."
        )
    loaded = _load(path, suffix[1:])
    triangles = np.asarray(getattr(loaded, "faces", ()), np.int64)
    if triangles.ndim != 2 or len(triangles) == 0:
        raise InputError(
            given=f"{path.name} holds no triangles.",
            needed="A surface made of triangles; points alone have nothing between them.",
            remedy="Triangulate the points first, or check that the file was written completely.",
        )
    return TriangleMesh(vertices=np.asarray(loaded.vertices, np.float64), faces=triangles, smooth=smooth)


def _load(path: Path, kind: str) -> Any:
    """Return trimesh's mesh of a file; from bytes without a resolver, so that it cannot name other files."""
    import trimesh

    content = path.read_bytes()
    options: dict[str, Any] = {"skip_materials": True} if kind in ("obj", "glb", "gltf") else {}
    try:
        return trimesh.load_scene(BytesIO(content), file_type=kind, **options).to_mesh()
    except Exception as error:  # the parsers raise whatever comes along for bytes that they do not expect
        raise UnreadableFileError(
            given=f"{path.name} cannot be read as {kind.upper()} ({type(error).__name__}: {error}).",
            needed="A complete file of the kind that its suffix says.",
            remedy="Write it again, or convert it to .ply with another program.",
        ) from error
