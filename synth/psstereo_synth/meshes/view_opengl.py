"""A view of a mesh by OpenGL, corrected to what the rays through the pixels' centres really meet."""

import numpy as np

from psstereo.camera import Camera, Pose
from psstereo.types import FloatArray, IntArray
from psstereo_synth.meshes.exact import Neighbours, meet
from psstereo_synth.meshes.mesh import TriangleMesh
from psstereo_synth.meshes.opengl import draw
from psstereo_synth.meshes.pixels import pixel_rays, view_of_hits
from psstereo_synth.view import View

__all__ = ["view_mesh_opengl"]


def view_mesh_opengl(mesh: TriangleMesh, camera: Camera, pose: Pose, shape: tuple[int, int]) -> View:
    """Look at a mesh with OpenGL.

    OpenGL only says which triangle it would draw in a pixel; where the ray through the pixel's centre meets it is
    worked out in double precision. Near edges OpenGL's grid of corners makes it take the neighbour now and then: of the
    triangles drawn in a pixel and the eight around it, the one that the ray meets first is taken, and if it meets none,
    one of the triangles next to these. A pixel whose ray still meets nothing is left out of the mask. So a feature
    thinner than a pixel may be missed, where the ray caster finds it.

    Parameters
    ----------
    mesh : TriangleMesh
        What is seen, in the scene's frame.
    camera : Orthographic or Pinhole
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
    OpenGLError
        If OpenGL does not start, or does not draw this.
    UnsupportedError
        If OpenGL cannot draw this mesh with this camera; see :func:`psstereo_synth.meshes.opengl.draw`.
    InputError
        If no pixel sees the mesh, or the shape is not two positive numbers.
    """
    origins, directions = pixel_rays(mesh, camera, pose, shape)
    drawn, _ = draw(mesh, camera, pose, shape)
    faces, weights = _corrected(mesh, drawn, origins, directions)
    return view_of_hits(mesh, camera, pose, shape, (faces, weights))


class _Nearest:
    """The nearest triangle that each ray was found to meet so far."""

    def __init__(self, mesh: TriangleMesh, origins: FloatArray, directions: FloatArray) -> None:
        self._mesh, self._origins, self._directions = mesh, origins, directions
        self.faces = np.full(len(origins), -1)
        self.weights = np.full((len(origins), 3), np.nan)
        self._distances = np.full(len(origins), np.inf)

    def test(self, rays: IntArray, candidates: IntArray) -> None:
        """Take the candidates, one for each of the rays, that are met nearer than what was; no ray twice in a call."""
        inside, distances, weights = meet(self._mesh.corners[candidates], self._origins[rays], self._directions[rays])
        nearer = np.flatnonzero(inside & (distances < self._distances[rays]))
        rows = rays[nearer]
        self.faces[rows], self.weights[rows], self._distances[rows] = (
            candidates[nearer],
            weights[nearer],
            distances[nearer],
        )


def _corrected(
    mesh: TriangleMesh, drawn: IntArray, origins: FloatArray, directions: FloatArray
) -> tuple[IntArray, FloatArray]:
    nearest = _Nearest(mesh, origins, directions)
    framed = np.pad(drawn, 1, constant_values=-1)
    rows, columns = drawn.shape
    around = [framed[i : i + rows, j : j + columns].reshape(-1) for i in range(3) for j in range(3)]
    own = drawn.reshape(-1)
    nearest.test(*_different(own, np.full_like(own, -1)))
    for shifted in around:
        nearest.test(*_different(shifted, own))
    _test_next_to(nearest, Neighbours(mesh), around)
    return nearest.faces, nearest.weights


def _different(candidates: IntArray, known: IntArray) -> tuple[IntArray, IntArray]:
    rays = np.flatnonzero((candidates >= 0) & (candidates != known))
    return rays, candidates[rays]


def _test_next_to(nearest: _Nearest, neighbours: Neighbours, around: list[IntArray]) -> None:
    """Test the triangles next to those drawn around each pixel that has none yet."""
    for shifted in around:
        open_ = np.flatnonzero((nearest.faces < 0) & (shifted >= 0))
        row, candidates = neighbours.pairs(shifted[open_])
        # A ray is given one candidate a call: the first of each ray, then the second …
        first = np.searchsorted(row, np.arange(len(open_)))
        turn = np.arange(len(row)) - first[row]
        for k in range(int(turn.max(initial=-1)) + 1):
            now = turn == k
            nearest.test(open_[row[now]], candidates[now])
