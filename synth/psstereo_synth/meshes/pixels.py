"""From pixels to rays of a camera, and from what they hit to a view."""

import numpy as np

from psstereo.camera import Camera, Pose
from psstereo.errors import InputError, UnsupportedError
from psstereo.forward.geometry import Geometry
from psstereo.results import DepthKind
from psstereo.types import FloatArray, IntArray
from psstereo_synth.meshes.mesh import TriangleMesh
from psstereo_synth.view import View

__all__ = ["pixel_rays", "view_of_hits"]


def pixel_rays(mesh: TriangleMesh, camera: Camera, pose: Pose, shape: tuple[int, int]) -> tuple[FloatArray, FloatArray]:
    """Return the viewing rays in the scene, one a pixel in row-major order; those of a parallel projection start above.

    Parameters
    ----------
    mesh : TriangleMesh
        What is seen, in the scene's frame; rays of a parallel projection start before all of it.
    camera : Camera
        The camera, of a depth kind that is a height or a distance.
    pose : Pose
        Where it stands in the scene.
    shape : (int, int)
        Rows and columns of the image.

    Returns
    -------
    origins, directions : float64 array (h·w, 3)
        Rays; a central projection's directions have z component −1 in the camera's frame [length].

    Raises
    ------
    InputError
        If the shape is not two positive numbers.
    UnsupportedError
        If the camera's depth is neither height nor distance.
    """
    if len(shape) != 2 or min(shape) < 1:
        raise InputError(
            given=f"The image is to have the shape {shape}.",
            needed="Rows and columns, at least one of each.",
            remedy="Give the shape as (rows, columns).",
        )
    directions = camera.rays(shape).reshape(-1, 3) @ pose.rotation.T
    if camera.depth_kind is DepthKind.DISTANCE:
        return np.broadcast_to(pose.position, directions.shape), directions
    if camera.depth_kind is not DepthKind.HEIGHT:
        raise UnsupportedError(
            given=f"The camera {camera.name} measures depth as {camera.depth_kind}.",
            needed="A camera whose depth is a height or a distance.",
            remedy="Use an orthographic or a pinhole camera.",
        )
    above = pose.to_camera(mesh.corners)[..., 2].max() + 0.01 * mesh.radius
    return pose.to_scene(camera.points(np.full(shape, above)).reshape(-1, 3)), directions


def view_of_hits(
    mesh: TriangleMesh, camera: Camera, pose: Pose, shape: tuple[int, int], hits: tuple[IntArray, FloatArray]
) -> View:
    """Return the view of a mesh in which each pixel's triangle, and where it is met, are known.

    Where a triangle is seen from behind, its normal is turned over. Where an interpolated normal faces away from the
    camera, which happens near the outline of a coarse mesh, the triangle's own is taken: all normals face the camera.

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
    hits : int array (h·w,) and float64 array (h·w, 3)
        The triangle in each pixel, −1 where there is none, and barycentric coordinates in it [1].

    Returns
    -------
    View
        Points and normals in the scene's frame, and the camera's depth.

    Raises
    ------
    InputError
        If no pixel sees the mesh.
    """
    faces, weights = hits
    seen = faces >= 0
    if not seen.any():
        raise InputError(
            given=f"None of the {faces.size} pixels sees the mesh.",
            needed="A camera with the mesh in its image.",
            remedy="Check pose, pixel size or focal length, and the mesh's scale; mesh.centred() puts it around 0.",
        )
    which, where = faces[seen], weights[seen]
    points = np.einsum("pk,pkx->px", where, mesh.corners[which])
    to_eye, distances = pose.rotation[:, 2].copy(), None
    along = pose.to_camera(points)[:, 2]
    if camera.depth_kind is DepthKind.DISTANCE:
        back = pose.position - points
        distances = np.linalg.norm(back, axis=1)
        to_eye, along = back / distances[:, None], -along
    own = mesh.face_normals[which]
    side = np.copysign(1.0, (own * to_eye).sum(axis=1))[:, None]
    normals = side * mesh.normals_at(which, where)
    away = (normals * to_eye).sum(axis=1) <= 0
    normals[away] = (side * own)[away]
    mask = seen.reshape(shape)
    depth = np.full(shape, np.nan)
    depth[mask] = along
    geometry = Geometry(points=points, normals=normals, to_eye=to_eye, mask=mask, eye_distances=distances)
    return View(camera=camera, pose=pose, geometry=geometry, depth=depth)
