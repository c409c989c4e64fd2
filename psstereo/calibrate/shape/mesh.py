"""What a camera sees of a mesh that stands in register with it: normals, ray by ray."""

from typing import Any

import numpy as np

from psstereo.camera import Camera, Orthographic, Pinhole
from psstereo.errors import InputError, UnsupportedError
from psstereo.types import FloatArray, IntArray

__all__ = ["mesh_normals"]


def mesh_normals(
    vertices: FloatArray, faces: IntArray, camera: Camera, shape: tuple[int, int], *, smooth: bool = True
) -> FloatArray:
    """Return the normals of a mesh at the pixels that see it.

    Not for fine detail: a mesh coarser than a pixel shows its facets, which smoothing hides but does not make right.

    Parameters
    ----------
    vertices : float array (v, 3)
        In the camera's frame, x right, y up, z toward the camera; under parallel projection pixel (0, 0) is at
        x = y = 0 and a pixel is `pixel_size` wide [length].
    faces : int array (f, 3)
        Triangles.
    camera : Camera
        Orthographic or pinhole.
    shape : (int, int)
        Rows and columns of the image [px].
    smooth : bool
        Whether normals are interpolated between the vertices.

    Returns
    -------
    float64 array (h, w, 3)
        Unit normals toward the camera, NaN where it is not seen [1].

    Raises
    ------
    InputError
        If the mesh is none, or no pixel sees it.
    UnsupportedError
        If the camera is another one.
    """
    import trimesh

    points, corners = np.asarray(vertices, np.float64), np.asarray(faces)
    fine = points.ndim == 2 and points.shape[1:] == (3,) and np.isfinite(points).all() and len(points) > 0
    fine = fine and corners.ndim == 2 and corners.shape[1:] == (3,) and corners.dtype.kind in "iu" and len(corners) > 0
    if not fine or corners.min() < 0 or corners.max() >= len(points):
        raise InputError(
            given=f"The mesh has vertices of the shape {points.shape} and faces of the shape {corners.shape}.",
            needed="Finite vertices (v, 3) and triangles (f, 3) that name them.",
            remedy="Export it as triangles.",
        )
    mesh = trimesh.Trimesh(points, corners, process=False)
    starts, rays = _rays(camera, shape, float(points[:, 2].max()))
    places, index, face = mesh.ray.intersects_location(starts, rays, multiple_hits=False)
    if len(index) == 0:
        raise InputError(
            given="No pixel of the image sees the mesh.",
            needed="A mesh in the camera's frame: x right, y up, z toward the camera.",
            remedy="Put it in register, and check its unit and the direction of y and z.",
        )
    normals = np.asarray(mesh.face_normals[face], np.float64)
    if smooth:
        barycentric: Any = trimesh.triangles.points_to_barycentric
        weights = barycentric(mesh.triangles[face], places)
        mixed = (mesh.vertex_normals[corners[face]] * weights[..., None]).sum(axis=1)
        length = np.linalg.norm(mixed, axis=1, keepdims=True)
        normals = np.where(length > 1e-6, mixed / np.where(length > 1e-6, length, 1.0), normals)
    # Outward or inward: what is seen faces the camera, whatever the order of the corners.
    normals = normals * -np.where((normals * rays[index]).sum(axis=1) < 0, -1.0, 1.0)[:, None]
    answer = np.full((shape[0] * shape[1], 3), np.nan)
    answer[index] = normals
    return answer.reshape(*shape, 3)


def _rays(camera: Camera, shape: tuple[int, int], top: float) -> tuple[FloatArray, FloatArray]:
    rays = camera.rays(shape).reshape(-1, 3)
    if isinstance(camera, Orthographic):
        starts = camera.points(np.full(shape, top + 1.0 + abs(top))).reshape(-1, 3)
    elif isinstance(camera, Pinhole):
        starts = np.zeros_like(rays)
    else:
        raise UnsupportedError(
            given=f"The camera is {camera.name}.", needed="Parallel or central projection.", remedy="Use one of these."
        )
    return starts, rays / np.linalg.norm(rays, axis=1, keepdims=True)
