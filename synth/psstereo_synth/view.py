"""What a camera sees of a surface."""

from dataclasses import dataclass

import numpy as np

from psstereo.camera import Camera, Orthographic, Pinhole, Pose
from psstereo.errors import InputError
from psstereo.forward.geometry import Geometry
from psstereo.results import DepthKind
from psstereo.types import FloatArray
from psstereo_synth.shapes.checks import positive, whole
from psstereo_synth.shapes.mesh import relief_mesh, require_extent
from psstereo_synth.shapes.rays import first_hits
from psstereo_synth.shapes.relief import Elevation, Relief

__all__ = ["View", "centred_orthographic", "centred_pinhole", "relief_mesh", "view_relief"]

_LEAST_DESCENT = 1e-12
"""Cosine to the vertical below which a parallel projection looks along the surface, for rounding [1]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """What a camera sees.

    Attributes
    ----------
    camera : Camera
        What projects.
    pose : Pose
        From the camera's frame to the scene's.
    geometry : Geometry
        Points, normals and directions to the eye, in the scene's frame.
    depth : float64 array (h, w)
        Depth of the camera's kind, NaN where it sees nothing [length].

    Raises
    ------
    InputError
        If the depth has another size than the mask.
    """

    camera: Camera
    pose: Pose
    geometry: Geometry
    depth: FloatArray

    def __post_init__(self) -> None:
        if self.depth.shape != self.geometry.mask.shape:
            raise InputError(
                given=f"A view has depths of the shape {self.depth.shape}, a mask of {self.geometry.mask.shape}.",
                needed="Both belong to the same image.",
                remedy="Build the view with view_relief or view_mesh.",
            )

    def normals(self) -> FloatArray:
        """Return the unit normals in the camera's frame, float64 (h, w, 3), NaN where it sees nothing [1]."""
        return self.geometry.scatter(np.asarray(self.geometry.normals @ self.pose.rotation), outside=np.nan)


def view_relief(
    relief: Relief, camera: Camera, pose: Pose, shape: tuple[int, int], *, scale: float = 1.0, samples: int = 256
) -> View:
    """Return what each pixel of a camera sees of a surface, at its centre.

    A parallel projection straight from above evaluates the surface itself. Any other view follows a ray from each pixel
    to where it first meets the surface, to rounding. Pixels that see nothing, the back of the surface, a vertical wall
    or the edge from below are left out of the mask.

    Parameters
    ----------
    relief : Relief
        The surface.
    camera : Camera
        A parallel or central projection.
    pose : Pose
        Where it stands in the scene, whose origin is the surface's.
    shape : (int, int)
        Rows and columns of the image.
    scale : float
        Length of the surface's unit in the scene [length].
    samples : int
        A ray is looked along in steps of at most the surface's longer side over this number; what is thinner along the
        ray can be missed.

    Returns
    -------
    View
        Geometry in the scene's frame and unit.

    Raises
    ------
    InputError
        If the image has no pixel, the camera is not above the surface, or it sees nothing of it.
    UnsupportedError
        If rays are needed and the surface does not know its extent.

    Examples
    --------
    >>> from psstereo_synth.shapes import Sphere
    >>> view = view_relief(Sphere(radius=0.5), *centred_orthographic((3, 3)), (3, 3))
    >>> view.depth[1, 1], view.normals()[1, 1]
    (np.float64(0.5), array([0., 0., 1.]))
    """
    _require_shape(shape)
    positive("view", scale=scale)
    whole("view", least=1, samples=samples)
    parallel = camera.depth_kind is DepthKind.HEIGHT
    if parallel and np.array_equal(pose.rotation, np.eye(3)):
        depth = _heights(relief, camera, pose, shape, scale)
    else:
        depth = _depths(relief, camera, pose, shape, scale=scale, samples=samples)
    points = pose.to_scene(camera.points(depth))
    found = _evaluate(relief, points, scale)
    normals = _normals(found)
    backward = pose.position - points
    to_eye = np.broadcast_to(pose.rotation[:, 2], points.shape) if parallel else backward
    with np.errstate(invalid="ignore", divide="ignore"):
        distances = np.sqrt((to_eye * to_eye).sum(axis=-1))
        to_eye = to_eye / distances[..., None]
    mask = np.isfinite(depth) & np.isfinite(normals).all(axis=-1) & ((normals * to_eye).sum(axis=-1) > 0.0)
    if not mask.any():
        raise InputError(
            given=f"None of the {mask.size} pixels sees the {relief.name}.",
            needed="A camera with the surface in its image.",
            remedy="Check pose, pixel size or focal length, and the surface's scale.",
        )
    geometry = Geometry(
        points=points[mask],
        normals=normals[mask],
        to_eye=pose.rotation[:, 2].copy() if parallel else to_eye[mask],
        mask=mask,
        eye_distances=None if parallel else distances[mask],
    )
    return View(camera=camera, pose=pose, geometry=geometry, depth=np.where(mask, depth, np.nan))


def _require_shape(shape: tuple[int, int]) -> None:
    if len(shape) != 2 or min(shape) < 1:
        raise InputError(
            given=f"The image is to have the shape {shape}.",
            needed="Rows and columns, at least one of each.",
            remedy="Give the shape as (rows, columns).",
        )


def _evaluate(relief: Relief, points: FloatArray, scale: float) -> Elevation:
    """Return the surface at places of the scene, in the surface's unit."""
    return relief.evaluate(points[..., 0] / scale, points[..., 1] / scale)


def _normals(found: Elevation) -> FloatArray:
    """Return unit normals; slopes too steep for a number give NaN."""
    zx, zy = found.slope_x, found.slope_y
    length = np.hypot(np.hypot(zx, zy), 1.0)
    return np.stack([-zx / length, -zy / length, 1.0 / length], axis=-1)


def _heights(relief: Relief, camera: Camera, pose: Pose, shape: tuple[int, int], scale: float) -> FloatArray:
    """Return the depths seen straight from above."""
    points = pose.to_scene(camera.points(np.zeros(shape)))
    return np.asarray(scale * _evaluate(relief, points, scale).height - pose.position[2])


def _depths(
    relief: Relief, camera: Camera, pose: Pose, shape: tuple[int, int], *, scale: float, samples: int
) -> FloatArray:
    """Return the depths at which the pixels' rays first meet the surface."""
    _require_above(relief, camera, pose, scale)
    parallel = camera.depth_kind is DepthKind.HEIGHT
    origins = pose.to_scene(camera.points(np.zeros(shape))).reshape(-1, 3) / scale
    directions = (camera.rays(shape) @ pose.rotation.T).reshape(-1, 3)
    nearest = np.full(len(origins), -np.inf if parallel else 0.0)
    along = scale * first_hits(require_extent(relief), origins, directions, nearest, samples=samples).reshape(shape)
    # Rays run away from the camera: distances grow along them, heights fall.
    return -along if parallel else along


def _require_above(relief: Relief, camera: Camera, pose: Pose, scale: float) -> None:
    """Refuse a camera that sees the surface from below."""
    if camera.depth_kind is DepthKind.HEIGHT:
        below, what = pose.rotation[2, 2] < _LEAST_DESCENT, f"looks along {(-pose.rotation[:, 2]).round(6).tolist()}"
    else:
        x, y, z = pose.position / scale
        ground = float(relief.evaluate(np.array([x]), np.array([y])).height[0])
        lowest = relief.bounds[0] if np.isnan(ground) else ground
        below, what = z <= lowest, f"stands at {pose.position.tolist()}"
    if below:
        raise InputError(
            given=f"The camera {what}, below the {relief.name} or along it.",
            needed="A surface z = f(x, y) is seen from above, from larger z.",
            remedy="Move the camera up, or turn it so that it looks down.",
        )


def centred_orthographic(
    shape: tuple[int, int], *, width: float = 2.0, rotation: FloatArray | None = None, length_unit: str = "relative"
) -> tuple[Orthographic, Pose]:
    """Place a parallel projection so that the scene's origin is at the middle of its image.

    Parameters
    ----------
    shape : (int, int)
        Rows and columns of the image.
    width : float
        Width of the image in the scene [length].
    rotation : float array (3, 3), optional
        Turns the camera about the scene's origin; straight from above if absent [1].
    length_unit : str
        Unit of `width`, for the camera's record.

    Returns
    -------
    camera : Orthographic
        With square pixels.
    pose : Pose
        The middle of the image at z = 0.

    Raises
    ------
    InputError
        If there is no pixel, the width is not positive, or the rotation is none.
    """
    _require_shape(shape)
    positive("picture", width=width)
    camera = Orthographic(pixel_size=width / shape[1], length_unit=length_unit)
    corner = 0.5 * camera.pixel_size * np.array([1.0 - shape[1], shape[0] - 1.0, 0.0])
    turned = Pose() if rotation is None else Pose(rotation=rotation)
    return camera, Pose(rotation=turned.rotation, position=turned.rotation @ corner)


def centred_pinhole(shape: tuple[int, int], *, focal: float, distance: float) -> tuple[Pinhole, Pose]:
    """Place a central projection over the scene's origin, which it sees in the middle of its image.

    Parameters
    ----------
    shape : (int, int)
        Rows and columns of the image.
    focal : float
        Focal length [px].
    distance : float
        Height over the origin [length].

    Returns
    -------
    camera : Pinhole
        With its principal point in the middle.
    pose : Pose
        At (0, 0, distance), looking along −z.

    Raises
    ------
    InputError
        If there is no pixel, or a length is not positive.
    """
    _require_shape(shape)
    positive("picture", distance=distance)
    camera = Pinhole(fx=focal, fy=focal, cx=0.5 * (shape[1] - 1), cy=0.5 * (shape[0] - 1))
    return camera, Pose(position=np.array([0.0, 0.0, distance]))
