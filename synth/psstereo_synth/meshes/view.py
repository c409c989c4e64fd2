"""A view of a mesh, by OpenGL where there is one and by rays elsewhere."""

from typing import Literal, get_args

from psstereo.camera import Camera, Pose
from psstereo.errors import OptionError, UnsupportedError
from psstereo_synth.meshes.mesh import TriangleMesh
from psstereo_synth.meshes.opengl import OpenGLError
from psstereo_synth.meshes.view_opengl import view_mesh_opengl
from psstereo_synth.meshes.view_rays import view_mesh_rays
from psstereo_synth.view import View

__all__ = ["Engine", "view_mesh"]

Engine = Literal["auto", "opengl", "rays"]


def view_mesh(
    mesh: TriangleMesh, camera: Camera, pose: Pose, shape: tuple[int, int], *, engine: Engine = "auto"
) -> tuple[View, str]:
    """Look at a mesh with one of two engines that agree, and say with which.

    Both give the same triangles, depths and normals, in double precision; only features thinner than a pixel are
    safer with rays. In software OpenGL costs two to three times as much as rays and some seconds to load. Take
    ``"rays"`` where a ray caster is needed anyway, for shadows.

    Parameters
    ----------
    mesh : TriangleMesh
        What is seen, in the scene's frame.
    camera : Camera
        The camera.
    pose : Pose
        Where it stands in the scene.
    shape : (int, int)
        Rows and columns of the image.
    engine : {"auto", "opengl", "rays"}
        ``"auto"`` takes OpenGL, and rays if it does not start or cannot draw this mesh with this camera.

    Returns
    -------
    view : View
        Points and normals in the scene's frame, and the camera's depth.
    reason : str
        A sentence that says which engine was taken and why.

    Raises
    ------
    OptionError
        If there is no such engine.
    OpenGLError
        If OpenGL is asked for and does not start.
    UnsupportedError
        If the engine asked for cannot do with this camera or mesh.
    InputError
        If no pixel sees the mesh, or the shape is not two positive numbers.
    """
    if engine not in get_args(Engine):
        raise OptionError(
            given=f"The engine '{engine}' is asked for.",
            needed=f"Known are {', '.join(get_args(Engine))}.",
            remedy="Choose one of these; auto finds out what works.",
        )
    if engine == "rays":
        return view_mesh_rays(mesh, camera, pose, shape), "The mesh was viewed by casting rays, as asked for."
    if engine == "opengl":
        return view_mesh_opengl(mesh, camera, pose, shape), "The mesh was viewed with OpenGL, as asked for."
    try:
        view = view_mesh_opengl(mesh, camera, pose, shape)
    except (OpenGLError, UnsupportedError) as error:
        reason = f"The mesh was viewed by casting rays, because OpenGL cannot be used here: {error.given}"
        if isinstance(error, OpenGLError):
            reason += f" {error.remedy}"
        return view_mesh_rays(mesh, camera, pose, shape), reason
    return view, "The mesh was viewed with OpenGL through pyrender, which works here; rays are the alternative."
