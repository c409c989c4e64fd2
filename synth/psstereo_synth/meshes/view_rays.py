"""A view of a mesh by casting a ray through the centre of every pixel."""

from psstereo.camera import Camera, Pose
from psstereo_synth.meshes.mesh import TriangleMesh
from psstereo_synth.meshes.pixels import pixel_rays, view_of_hits
from psstereo_synth.meshes.rays import RayCaster
from psstereo_synth.view import View

__all__ = ["view_mesh_rays"]


def view_mesh_rays(mesh: TriangleMesh | RayCaster, camera: Camera, pose: Pose, shape: tuple[int, int]) -> View:
    """Look at a mesh with a ray caster.

    A pixel sees what the ray through its centre meets first, in double precision; no pixel is a mixture.

    Parameters
    ----------
    mesh : TriangleMesh or RayCaster
        What is seen, in the scene's frame; a caster that exists already saves building its tree.
    camera : Camera
        The camera.
    pose : Pose
        Where it stands in the scene.
    shape : (int, int)
        Rows and columns of the image.

    Returns
    -------
    View
        Points and normals in the scene's frame, and the camera's depth.

    Raises
    ------
    InputError
        If no pixel sees the mesh, or the shape is not two positive numbers.
    UnsupportedError
        If the camera's depth is neither height nor distance.
    """
    caster = mesh if isinstance(mesh, RayCaster) else RayCaster(mesh)
    faces, _, weights = caster.first_hit(*pixel_rays(caster.mesh, camera, pose, shape))
    return view_of_hits(caster.mesh, camera, pose, shape, (faces, weights))
