"""Two views of one scene: true disparities, and the same surface points photographed from both."""

from dataclasses import dataclass

import numpy as np

from psstereo.camera import Pinhole, Pose
from psstereo.errors import InputError, UnsupportedError
from psstereo.forward import Geometry
from psstereo.results import DepthKind
from psstereo.types import BoolArray, FloatArray, IntArray
from psstereo_synth.rendering.exposure import white_radiance
from psstereo_synth.rendering.occlusion import Occlusion, shadow_steps
from psstereo_synth.rendering.stage import Stage
from psstereo_synth.scenes import Scene, Viewpoint
from psstereo_synth.shapes import Relief
from psstereo_synth.shapes.mesh import require_extent
from psstereo_synth.shapes.rays import first_hits
from psstereo_synth.view import View, view_relief

__all__ = ["SamePoints", "TrueDisparity", "same_points", "side_by_side", "true_disparity"]

_SAMPLES = 512
"""Steps of a ray over the longer side of the surface."""
_SAME = 1e-6
"""Difference of the way along a ray, as a share, that is still the same point [1]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TrueDisparity:
    """What the matcher should find.

    Attributes
    ----------
    disparity : float64 array (h, w)
        Of the left view, also where the right one does not see the point; NaN without a surface [px].
    visible : bool array (h, w)
        Where the right view sees the point too.
    """

    disparity: FloatArray
    visible: BoolArray


@dataclass(frozen=True, kw_only=True, eq=False)
class SamePoints:
    """The same surface points photographed from two places, nothing interpolated.

    Attributes
    ----------
    pixels : int array (p, 2)
        Rows and columns of the first view that show the points.
    shape : (int, int)
        Rows and columns of the first view.
    first, second : array (m, p, c)
        Values as the sensor gives them.
    radiance : float64 array (2, m, p, c)
        From both places, before the sensor [W m⁻² sr⁻¹].
    points : float64 array (p, 3)
        The points, in the scene's frame [length].
    white_value : float
        Value of full scale.
    """

    pixels: IntArray
    shape: tuple[int, int]
    first: FloatArray
    second: FloatArray
    radiance: FloatArray
    points: FloatArray
    white_value: float

    def image(self, values: FloatArray) -> FloatArray:
        """Return values (m, p, c) as images (m, c, h, w) of the first view, shares of full scale, 0 elsewhere."""
        m, _, c = values.shape
        out = np.zeros((m, c, *self.shape))
        out[:, :, self.pixels[:, 0], self.pixels[:, 1]] = values.transpose(0, 2, 1) / self.white_value
        return out

    @property
    def mask(self) -> BoolArray:
        """Pixels of the first view that show a point that both see, bool (h, w)."""
        out = np.zeros(self.shape, np.bool_)
        out[self.pixels[:, 0], self.pixels[:, 1]] = True
        return out


def side_by_side(
    size: tuple[int, int], *, focal: float, distance: float, baseline: float, shift: float = 0.0
) -> tuple[Viewpoint, Viewpoint]:
    """Place two pinholes with parallel axes symmetrically over the origin.

    Parameters
    ----------
    size : (int, int)
        Rows and columns of the images.
    focal : float
        Focal length [px].
    distance : float
        Height over the origin [length].
    baseline : float
        Distance of the cameras [length].
    shift : float
        By how much both principal points are moved toward each other, so that what is at the origin appears in the
        middle of both; disparities fall by twice that [px].

    Returns
    -------
    left, right : Viewpoint
        The cameras.

    Raises
    ------
    InputError
        If the baseline is not positive.
    """
    if not 0 < baseline < np.inf:
        raise InputError(
            given=f"The baseline is {baseline}.", needed="A positive length.", remedy="Give the cameras' distance."
        )
    middle_x, middle_y = 0.5 * (size[1] - 1), 0.5 * (size[0] - 1)
    made = []
    for side in (-1.0, 1.0):
        camera = Pinhole(fx=focal, fy=focal, cx=middle_x + side * shift, cy=middle_y)
        made.append(Viewpoint(camera=camera, pose=Pose(position=np.array([0.5 * side * baseline, 0.0, distance]))))
    return made[0], made[1]


def true_disparity(scene: Scene, left: int = 0, right: int = 1) -> TrueDisparity:
    """Return the exact disparity of a rectified pair of views, by rays.

    Parameters
    ----------
    scene : Scene
        With pinholes side by side.
    left, right : int
        Which viewpoints.

    Returns
    -------
    TrueDisparity
        For the left view.

    Raises
    ------
    UnsupportedError
        If the views are not rectified, or the surface is a mesh.
    """
    one, two = scene.viewpoints[left], scene.viewpoints[right]
    view = _view(scene, left)
    _require_rectified(one, two)
    column = _project(two, view.geometry.points)[0]
    columns = np.nonzero(view.geometry.mask)[1]
    seen = _seen(scene, two, view.geometry.points, view.geometry.normals)
    disparity = view.geometry.scatter(np.asarray(columns - column), np.nan)
    return TrueDisparity(disparity=disparity, visible=view.geometry.scatter(seen.astype(np.float64)) > 0.5)


def same_points(scene: Scene, first: int = 0, second: int = 1) -> SamePoints:
    """Photograph the points that the first view's pixels show from where the second view stands.

    The second camera's pixels would show other points; here each point gets a pixel of its own. Shadows are those of
    the points, and so the same for both; the sensor's noise is not, as in two photographs.

    Parameters
    ----------
    scene : Scene
        A height field with two viewpoints or more.
    first, second : int
        Which viewpoints.

    Returns
    -------
    SamePoints
        Those that both see.

    Raises
    ------
    InputError
        If the views share no point.
    UnsupportedError
        If the surface is a mesh, or the scene has faults or bounced light, which belong to whole images.
    """
    if scene.faults or scene.bounce:
        raise UnsupportedError(
            given=f"The scene {scene.name} has faults or bounced light.",
            needed="Points are photographed one by one, and these belong to whole images.",
            remedy="Leave them out.",
        )
    view = _view(scene, first)
    other = scene.viewpoints[second]
    seen = _seen(scene, other, view.geometry.points, view.geometry.normals)
    if not seen.any():
        raise InputError(
            given=f"The views {first} and {second} of {scene.name} share no point.",
            needed="Views that overlap.",
            remedy="Move the cameras together.",
        )
    points, normals = view.geometry.points[seen], view.geometry.normals[seen]
    looks = [_look(scene, scene.viewpoints[n], points, normals) for n in (first, second)]
    occlusion = Occlusion(scene, [view])
    shadows = occlusion if shadow_steps(scene, occlusion)[0] else None
    stages = [Stage.prepare(scene, n, look, shadows, None) for n, look in zip((first, second), looks, strict=True)]
    sensor = scene.sensor
    if sensor.white is None:
        sensor = sensor.with_white(white_radiance(scene, stages, map))
    radiance = np.stack([[_radiance(stage, i) for i in range(len(scene.lights))] for stage in stages])
    shots = len(scene.lights) + 1
    taken = [
        [sensor.expose(radiance[v, i][None], n * shots + i)[0] for i in range(len(scene.lights))]
        for v, n in enumerate((first, second))
    ]
    return SamePoints(
        pixels=np.argwhere(view.geometry.mask)[seen],
        shape=scene.size,
        first=np.asarray(taken[0], np.float64),
        second=np.asarray(taken[1], np.float64),
        radiance=radiance,
        points=points,
        white_value=sensor.white_value,
    )


def _radiance(stage: Stage, light: int) -> FloatArray:
    found = stage.shade(stage.scene.lights[light]).radiance
    return found if stage.always is None else found + stage.always


def _relief(scene: Scene) -> Relief:
    if not isinstance(scene.surface, Relief):
        raise UnsupportedError(
            given=f"The surface of {scene.name} is a mesh.",
            needed="A height field, whose points are found exactly.",
            remedy="Take one of the shapes.",
        )
    return scene.surface


def _view(scene: Scene, number: int) -> View:
    viewpoint = scene.viewpoints[number]
    return view_relief(_relief(scene), viewpoint.camera, viewpoint.pose, scene.size)


def _look(scene: Scene, viewpoint: Viewpoint, points: FloatArray, normals: FloatArray) -> View:
    """Return a view whose pixels, one row of them, show given points."""
    backward = viewpoint.pose.position - points
    distances = np.sqrt((backward * backward).sum(axis=-1))
    geometry = Geometry(
        points=points,
        normals=normals,
        to_eye=backward / distances[:, None],
        mask=np.ones((1, len(points)), np.bool_),
        eye_distances=distances,
    )
    return View(camera=viewpoint.camera, pose=viewpoint.pose, geometry=geometry, depth=distances[None])


def _project(viewpoint: Viewpoint, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return columns and rows at which a pinhole shows points."""
    camera = viewpoint.camera
    if not isinstance(camera, Pinhole):
        raise UnsupportedError(
            given=f"A {camera.name} camera of depth kind {DepthKind(camera.depth_kind).value} looks at the scene.",
            needed="Pinholes: they stand somewhere.",
            remedy="Give the scene pinhole cameras.",
        )
    x, y, z = viewpoint.pose.to_camera(points).T
    return camera.cx + (camera.fx * x - camera.skew * y) / -z, camera.cy - camera.fy * y / -z


def _seen(scene: Scene, viewpoint: Viewpoint, points: FloatArray, normals: FloatArray) -> BoolArray:
    """Return which points a view sees: inside its image, not from behind, with nothing in the way."""
    column, row = _project(viewpoint, points)
    height, width = scene.size
    inside = (column >= 0) & (column <= width - 1) & (row >= 0) & (row <= height - 1)
    ways = points - viewpoint.pose.position
    facing = (ways * normals).sum(axis=-1) < 0
    origins = np.broadcast_to(viewpoint.pose.position, points.shape)
    hits = first_hits(require_extent(_relief(scene)), origins, ways, np.zeros(len(points)), samples=_SAMPLES)
    with np.errstate(invalid="ignore"):
        return np.asarray(inside & facing & (np.abs(hits - 1) < _SAME))


def _require_rectified(left: Viewpoint, right: Viewpoint) -> None:
    a, b = left.camera, right.camera
    same = isinstance(a, Pinhole) and isinstance(b, Pinhole) and (a.fx, a.fy, a.cy) == (b.fx, b.fy, b.cy)
    aside = left.pose.to_camera(right.pose.position)
    parallel = np.abs(left.pose.rotation - right.pose.rotation).max() < 1e-12
    if not (same and parallel and np.abs(aside[1:]).max() < 1e-9 and aside[0] > 0):
        raise UnsupportedError(
            given="The two views are not rectified.",
            needed="Pinholes of the same focal length side by side, with parallel axes, the left one first.",
            remedy="Place them with side_by_side.",
        )
