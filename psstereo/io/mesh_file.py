"""Triangle meshes in files: PLY, glTF (binary) and OBJ."""

from pathlib import Path
from typing import Any, cast

import numpy as np

from psstereo.errors import InputError, MissingFileError, OptionError
from psstereo.surface_mesh import SurfaceMesh

__all__ = ["MESH_SUFFIXES", "write_mesh"]

MESH_SUFFIXES = (".ply", ".glb", ".obj")
"""Suffixes that :func:`write_mesh` knows."""


_METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "μm": 1e-6}
"""Lengths that can be told in metres, glTF's unit [m]."""


def write_mesh(mesh: SurfaceMesh, path: Path, *, unit: str | None = None) -> None:
    """Write a mesh, with its normals and colours or texture, in the format that the suffix names.

    Vertices keep their order, axes (x right, y up, z toward the camera: glTF's own) and numbers; PLY and GLB hold them
    in single precision. An existing file is replaced, but only once the new one is complete.

    ========= =========================================================================================================
    ``.ply``  binary; colours of the vertices, never the texture; the unit as a comment
    ``.glb``  the texture inside, else the colours; colours are written as they are, and a viewer that follows glTF to
              the letter takes them for linear and shows them lighter, which a texture is spared. The unit in the
              mesh's extras; if it is a metric length, a node turns the numbers into metres, as glTF wants them
    ``.obj``  text; with a texture, ``NAME.mtl`` and ``NAME_texture.png`` are written beside NAME.obj, which refers to
              them by bare names (spaces in them become underscores); else the colours; the unit as a comment
    ========= =========================================================================================================

    Parameters
    ----------
    mesh : SurfaceMesh
        The mesh.
    path : Path
        File to write: ``.ply``, ``.glb`` or ``.obj``.
    unit : str, optional
        Unit of the vertices, such as ``"mm"``, to be named in the file.

    Raises
    ------
    OptionError
        If the suffix is another one.
    InputError
        If there is nothing to write: no vertex, or no triangle in a format that needs one (``.glb``, a texture); or if
        the unit has line breaks in it.
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
    needs_triangles = suffix == ".glb" or (suffix == ".obj" and mesh.texture is not None)
    if len(mesh.vertices) == 0 or (needs_triangles and len(mesh.faces) == 0):
        raise InputError(
            given=f"The mesh has {len(mesh.vertices)} vertices and {len(mesh.faces)} triangles.",
            needed="Something must be there to write; a .glb file and a texture need at least one triangle.",
            remedy="Check the mask: single pixels give points, but no triangles. Points alone can go into a .ply file.",
        )
    if unit is not None and (not unit.isprintable() or not unit.strip()):
        raise InputError(
            given=f"The unit is {unit!r}.",
            needed="A word is needed, such as mm.",
            remedy="Correct it, or leave it out.",
        )
    if suffix == ".ply":
        files = {path.name: _ply(mesh, unit)}
    elif suffix == ".glb":
        files = {path.name: _glb(mesh, unit)}
    else:
        files = _obj(mesh, path, unit)
    for name, content in files.items():
        whole, unfinished = path.with_name(name), path.with_name(name + ".part")
        try:
            unfinished.write_bytes(content)
            unfinished.replace(whole)
        finally:
            unfinished.unlink(missing_ok=True)


def _shape(mesh: SurfaceMesh, material: Any = None) -> Any:
    """Return trimesh's mesh, with a material if one is given and else with colours."""
    import trimesh

    visuals: Any = trimesh.visual
    shape: Any = trimesh.Trimesh(
        vertices=np.asarray(mesh.vertices, np.float64),
        faces=mesh.faces,
        vertex_normals=mesh.normals,
        vertex_colors=mesh.colors if material is None else None,
        process=False,
    )
    if material is not None:
        shape.visual = visuals.TextureVisuals(uv=np.array(mesh.uv, np.float64), material=material)
    return shape


def _ply(mesh: SurfaceMesh, unit: str | None) -> bytes:
    content = bytes(_shape(mesh).export(file_type="ply", encoding="binary", vertex_normal=mesh.normals is not None))
    if unit is None:
        return content
    first, second, rest = content.split(b"\n", 2)
    return b"\n".join([first, second, b"comment unit " + unit.encode("utf-8"), rest])


def _glb(mesh: SurfaceMesh, unit: str | None) -> bytes:
    import trimesh
    from PIL import Image

    material, materials = None, cast(Any, trimesh.visual.material)
    if mesh.texture is not None:
        # Without a word glTF's surfaces are polished metal.
        material = materials.PBRMaterial(
            name="albedo", baseColorTexture=Image.fromarray(mesh.texture), metallicFactor=0.0, roughnessFactor=1.0
        )
    shape = _shape(mesh, material)
    if unit is None:
        return bytes(shape.export(file_type="glb", include_normals=mesh.normals is not None))
    shape.metadata["unit"] = unit
    scene: Any = trimesh.Scene()
    metres = _METRES.get(unit, 1.0)
    scene.add_geometry(shape, node_name="surface", transform=np.diag([metres, metres, metres, 1.0]))
    return bytes(scene.export(file_type="glb", include_normals=mesh.normals is not None))


def _obj(mesh: SurfaceMesh, path: Path, unit: str | None) -> dict[str, bytes]:
    """Return the files by name, the mesh itself last, so that whoever sees it finds the others."""
    import trimesh
    from PIL import Image

    header = "psstereo" if unit is None else f"psstereo, unit {unit}"
    material, materials = None, cast(Any, trimesh.visual.material)
    options: dict[str, Any] = {"include_color": mesh.colors is not None, "include_texture": False}
    bare = "_".join(path.stem.split()) or "mesh"
    if mesh.texture is not None:
        white, black = [255, 255, 255, 255], [0, 0, 0, 255]
        material = materials.SimpleMaterial(
            image=Image.fromarray(mesh.texture), ambient=white, diffuse=white, specular=black, name=f"{bare}_texture"
        )
        options = {"include_texture": True, "return_texture": True, "mtl_name": f"{bare}.mtl"}
    found = _shape(mesh, material).export(
        file_type="obj", include_normals=mesh.normals is not None, header=header, **options
    )
    text, beside = found if isinstance(found, tuple) else (found, {})
    return {**{str(name): bytes(content) for name, content in beside.items()}, path.name: str(text).encode("utf-8")}
