"""Which triangle OpenGL draws into each pixel, through pyrender."""

import os
import sys
import threading
from importlib import import_module
from typing import Any

import numpy as np

from psstereo.camera import Camera, Orthographic, Pinhole, Pose
from psstereo.errors import PsstereoError, UnsupportedError
from psstereo.types import FloatArray, IntArray
from psstereo_synth.meshes.mesh import TriangleMesh

__all__ = ["OpenGLError", "draw", "require_opengl"]

_LOCK = threading.Lock()
"""OpenGL has one current context a thread and pyrender's is never let go of: one drawing at a time."""
_MOST_FACES = 2**24 - 1
_NEAREST = 1e-3
"""Nearest point of a mesh over the farthest, below which 24 bits of depth are not enough [1]."""


class OpenGLError(PsstereoError, RuntimeError):
    """OpenGL that cannot draw off-screen here; the ray caster can do without it."""


def require_opengl() -> None:
    """Start OpenGL and let go of it again.

    pyrender reads the environment variable PYOPENGL_PLATFORM when it is imported; where it is not set, EGL is chosen on
    Linux, which needs no display.

    Raises
    ------
    OpenGLError
        If that fails; its remedy says what to install.
    """
    with _LOCK:
        _close(_started((8, 8)))


def draw(mesh: TriangleMesh, camera: Camera, pose: Pose, shape: tuple[int, int]) -> tuple[IntArray, FloatArray]:
    """Draw a mesh, each triangle in a colour that tells its number.

    pyrender shades nothing here. Its own depth is linearised with the formula of a perspective even where the camera is
    orthographic; that is undone.

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
    faces : int64 array (h, w)
        The triangle drawn at each pixel's centre, −1 where there is none; OpenGL moves corners onto a grid of some
        1/256 of a pixel first.
    depth : float64 array (h, w)
        The camera's depth from the depth buffer, to 24 bits of the mesh's range; NaN where there is none [length].

    Raises
    ------
    OpenGLError
        If OpenGL does not start, or does not draw this.
    UnsupportedError
        If the camera is another one, the mesh has more than 2²⁴ − 1 triangles, or a part of it lies behind a pinhole or
        right before it.
    """
    if len(mesh.faces) > _MOST_FACES:
        raise UnsupportedError(
            given=f"The mesh has {len(mesh.faces)} triangles.",
            needed=f"OpenGL's three colours of 8 bits tell {_MOST_FACES} apart.",
            remedy="Use the ray caster, or a coarser mesh.",
        )
    corners = pose.to_camera(mesh.corners.reshape(-1, 3))
    if isinstance(camera, Orthographic):
        corners, projection, near, far, origin = _parallel(corners, camera, shape)
    elif isinstance(camera, Pinhole):
        corners, projection, near, far, origin = _central(corners, camera, shape)
    else:
        raise UnsupportedError(
            given=f"The camera is a {camera.name}.",
            needed="OpenGL draws for an orthographic or a pinhole camera.",
            remedy="Use the ray caster.",
        )
    colour, linear = _drawn(corners, projection, near, far, shape)
    faces = colour.astype(np.int64) @ np.array([1, 256, 65536]) - 1
    faces = np.where(faces < len(mesh.faces), faces, -1)
    clip = (far + near - 2 * near * far / np.where(linear > 0, linear, np.nan)) / (far - near)  # −1 … 1
    if isinstance(camera, Orthographic):
        return faces, origin - (near + far + clip * (far - near)) / 2
    return faces, origin * 2 * near * far / (near + far - clip * (far - near))


def _parallel(
    corners: FloatArray, camera: Orthographic, shape: tuple[int, int]
) -> tuple[FloatArray, FloatArray, float, float, float]:
    """Return vertices moved before OpenGL's camera, the projection, near and far, and the height of the camera."""
    low, high = corners[:, 2].min(), corners[:, 2].max()
    depth = max(high - low, 1e-6 * camera.pixel_size)
    # With the far plane at twice the near one, the wrong linearisation and its undoing cost next to nothing.
    near, far, origin = 1.2 * depth, 2.4 * depth, high + 1.3 * depth
    rows, columns = shape
    p = np.zeros((4, 4))
    p[0, 0], p[0, 3] = 2 / (columns * camera.pixel_size), 1 / columns - 1
    p[1, 1], p[1, 3] = 2 / (rows * camera.pixel_size), 1 - 1 / rows
    p[2, 2], p[2, 3], p[3, 3] = 2 / (near - far), (far + near) / (near - far), 1.0
    return corners - [0.0, 0.0, origin], p, float(near), float(far), float(origin)


def _central(
    corners: FloatArray, camera: Pinhole, shape: tuple[int, int]
) -> tuple[FloatArray, FloatArray, float, float, float]:
    """Return vertices in units of the farthest one's depth, the projection, near and far, and that unit."""
    depths = -corners[:, 2]
    unit = float(depths.max())
    if depths.min() <= _NEAREST * unit:
        raise UnsupportedError(
            given=f"The mesh's depth from the pinhole is {depths.min():.4g} to {unit:.4g}.",
            needed="OpenGL needs all of it before the pinhole, none nearer than a thousandth of the farthest.",
            remedy="Use the ray caster, or move the camera back.",
        )
    near, far = 0.999 * depths.min() / unit, 1.001
    rows, columns = shape
    p = np.zeros((4, 4))
    p[0, 0], p[0, 1] = 2 * camera.fx / columns, -2 * camera.skew / columns
    p[0, 2] = 1 - (2 * camera.cx + 1) / columns
    p[1, 1], p[1, 2] = 2 * camera.fy / rows, (2 * camera.cy + 1) / rows - 1
    p[2, 2], p[2, 3], p[3, 2] = (far + near) / (near - far), 2 * far * near / (near - far), -1.0
    return corners / unit, p, float(near), float(far), unit


def _drawn(
    corners: FloatArray, projection: FloatArray, near: float, far: float, shape: tuple[int, int]
) -> tuple[Any, FloatArray]:
    """Return pyrender's colours, uint8 (h, w, 3), and what it takes for linear depth, 0 where there is nothing."""
    number = np.repeat(np.arange(1, len(corners) // 3 + 1), 3)
    colours = np.stack([number & 255, (number >> 8) & 255, number >> 16, np.full_like(number, 255)], axis=1)
    with _LOCK:
        renderer = _started(shape)
        try:
            return _render(renderer, corners, colours.astype(np.uint8), _camera(projection, near, far))
        except Exception as error:  # PyOpenGL's own errors, and whatever comes of a driver's odd answers
            raise OpenGLError(
                given=f"OpenGL started, but did not draw {shape[1]} × {shape[0]} pixels ({_said(error)}).",
                needed="An off-screen buffer of that size.",
                remedy="Use the ray caster, or a smaller image.",
            ) from error
        finally:
            _close(renderer)


def _render(renderer: Any, corners: FloatArray, colours: Any, camera: Any) -> tuple[Any, FloatArray]:
    import pyrender

    # No triangle shares a vertex, or its colour would run into the next; drawn from both sides. The bounds of meshes
    # and scenes, which pyrender cannot tell under NumPy 2, are never asked for.
    paint = pyrender.MetallicRoughnessMaterial(doubleSided=True)
    body = pyrender.Mesh([pyrender.Primitive(positions=corners, color_0=colours, material=paint)])
    scene = pyrender.Scene(bg_color=[0.0, 0.0, 0.0, 0.0])
    scene.add(body)
    scene.add(camera, pose=np.eye(4))
    colour, depth = renderer.render(scene, flags=pyrender.RenderFlags.FLAT)
    return np.array(colour), np.array(depth, np.float64)


def _camera(projection: FloatArray, near: float, far: float) -> Any:
    import pyrender

    gl: Any = import_module("OpenGL.GL")

    class Matrix(pyrender.Camera):  # type: ignore[misc]  # pyrender has no types
        """A camera of any projection: pyrender's own know neither an off-centre parallel one nor skew."""

        def get_projection_matrix(self, width: int | None = None, height: int | None = None) -> FloatArray:
            # pyrender asks for the matrix after it has turned multisampling on, which would mix triangles' numbers.
            gl.glDisable(gl.GL_MULTISAMPLE)
            return projection

    return Matrix(znear=near, zfar=far)


def _started(shape: tuple[int, int]) -> Any:
    if sys.platform.startswith("linux"):
        os.environ.setdefault("PYOPENGL_PLATFORM", "egl")
    try:
        import pyrender

        return pyrender.OffscreenRenderer(shape[1], shape[0])
    except Exception as error:  # ImportError, ValueError, AttributeError or PyOpenGL's own, as the platform likes
        platform = os.environ.get("PYOPENGL_PLATFORM", "the system's")
        raise OpenGLError(
            given=f"OpenGL does not start on the platform {platform} ({_said(error)}).",
            needed="Off-screen OpenGL 4.1, in software or hardware.",
            remedy="On Debian and Ubuntu install libegl1 and libgl1-mesa-dri; or use the ray caster.",
        ) from error


def _close(renderer: Any) -> None:
    try:
        renderer.delete()
    except Exception as error:
        raise OpenGLError(
            given=f"OpenGL did not let go of its buffers ({_said(error)}).",
            needed="A context that can be taken down.",
            remedy="Use the ray caster.",
        ) from error


def _said(error: Exception) -> str:
    lines = str(error).strip().splitlines()
    return f"{type(error).__name__}: {lines[0]}" if lines else type(error).__name__
