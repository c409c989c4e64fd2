"""A height field sampled where it can throw shadows into pictures."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from psstereo.camera import Orthographic
from psstereo.lights import Distant, Light, Sun
from psstereo.types import FloatArray
from psstereo_synth.meshes import TriangleMesh
from psstereo_synth.scenes import Scene
from psstereo_synth.shapes import Relief
from psstereo_synth.shapes.finite import FiniteRelief
from psstereo_synth.view import View

__all__ = ["HeightField", "coarser_field", "field_of_views", "is_straight"]

_REACH = 1.0
"""How far beyond what is seen the surface is sampled at most, in longer sides of that [1]."""
_HALVINGS = 30
_CLOSEST = 0.05
_FINEST = 128
"""Nodes for half of a surface of which a single point is seen."""


@dataclass(frozen=True, kw_only=True, eq=False)
class HeightField:
    """Heights at the nodes of a grid.

    Attributes
    ----------
    x : float64 array (w,)
        Of the columns, growing [length].
    y : float64 array (h,)
        Of the rows, falling [length].
    heights : float64 array (h, w)
        NaN where there is no surface [length].
    cut : float
        Ground that is farther than this from what is seen is not in it; infinite if there is none [length].
    """

    x: FloatArray
    y: FloatArray
    heights: FloatArray
    cut: float = np.inf

    @property
    def spacing(self) -> tuple[float, float]:
        """Distance of neighbouring columns and rows [length]."""
        return float(self.x[1] - self.x[0]), float(self.y[0] - self.y[1])

    @property
    def origin(self) -> tuple[float, float]:
        """Where the node (0, 0) is [length]."""
        return float(self.x[0]), float(self.y[0])

    def raised(self, points: FloatArray) -> FloatArray:
        """Return points (p, 3), those that lie below the triangles of :meth:`mesh` lifted onto them.

        In a hollow the triangles are above the surface that they stand for: rays from below would not get anywhere.
        """
        column = (points[:, 0] - self.x[0]) / self.spacing[0]
        row = (self.y[0] - points[:, 1]) / self.spacing[1]
        rows, columns = self.heights.shape
        inside = (column >= 0) & (column <= columns - 1) & (row >= 0) & (row <= rows - 1)
        i = np.clip(np.floor(np.where(inside, row, 0.0)), 0, rows - 2).astype(np.intp)
        j = np.clip(np.floor(np.where(inside, column, 0.0)), 0, columns - 2).astype(np.intp)
        v, u = row - i, column - j
        a, b = self.heights[i, j], self.heights[i, j + 1]
        c, d = self.heights[i + 1, j], self.heights[i + 1, j + 1]
        over = np.where(u + v <= 1, a + u * (b - a) + v * (c - a), d + (1 - u) * (c - d) + (1 - v) * (b - d))
        result = np.array(points)
        result[:, 2] = np.fmax(points[:, 2], np.where(inside, over, np.nan))
        return result

    def mesh(self) -> TriangleMesh:
        """Return the field as triangles that face up."""
        rows, columns = self.heights.shape
        points = np.stack([*np.meshgrid(self.x, self.y), self.heights], axis=-1).reshape(-1, 3)
        known = np.isfinite(self.heights).ravel()
        corner = np.arange(rows * columns).reshape(rows, columns)
        a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]
        faces = np.concatenate(
            [np.stack([a, c, b], axis=-1).reshape(-1, 3), np.stack([b, c, d], axis=-1).reshape(-1, 3)]
        )
        points[~known] = 0.0  # no triangle uses them
        return TriangleMesh(vertices=points, faces=faces[known[faces].all(axis=1)])


def is_straight(view: View) -> bool:
    """Return whether a view is a parallel projection from straight above, whose pixels are nodes of a grid."""
    return isinstance(view.camera, Orthographic) and np.array_equal(view.pose.rotation, np.eye(3))


def field_of_views(relief: Relief, scene: Scene, views: Sequence[View]) -> HeightField:
    """Sample a height field where it is seen, and around that as far as it can throw shadows.

    Seen once from straight above, the pixels are nodes, so that what is lit is decided where it is seen. Otherwise the
    nodes are about as close as the pixels.

    Parameters
    ----------
    relief : Relief
        The surface.
    scene : Scene
        Whose lights say how far it throws shadows.
    views : sequence of View
        What is seen of it.

    Returns
    -------
    HeightField
        At most three times as wide and high as what is seen.
    """
    if len(views) == 1 and is_straight(views[0]):
        return _around_pixels(relief, scene, views[0])
    points = np.concatenate([view.geometry.points for view in views])
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    reach, cut = _reach(relief, scene, points[:, 2].min(), low, high)
    pitch = _pitch(relief, views, low, high, len(points))
    low, high = low - reach - pitch, high + reach + pitch
    if isinstance(relief, FiniteRelief):  # with nodes on its very edges
        extent = np.array(relief.extent)
        low, high = np.maximum(low, -extent), np.minimum(high, extent)
    counts = np.maximum(np.ceil((high - low) / pitch).astype(int) + 1, 2)
    x, y = np.linspace(low[0], high[0], counts[0]), np.linspace(high[1], low[1], counts[1])
    return HeightField(x=x, y=y, heights=_heights(relief, x, y), cut=cut)


def coarser_field(relief: Relief, field: HeightField, most: int) -> HeightField:
    """Sample the same part of a surface with at most so many nodes along a side."""
    columns, rows = min(len(field.x), most), min(len(field.y), most)
    x, y = np.linspace(field.x[0], field.x[-1], columns), np.linspace(field.y[0], field.y[-1], rows)
    return HeightField(x=x, y=y, heights=_heights(relief, x, y), cut=field.cut)


def _pitch(relief: Relief, views: Sequence[View], low: FloatArray, high: FloatArray, count: int) -> float:
    """Return how far apart nodes are to be, about as far as the pixels of a view."""
    longest = float(np.max(high - low))
    across = max(max(view.depth.shape) for view in views)
    if longest > 0:  # images of a single line have no area
        return float(max(np.sqrt(np.prod(high - low) * len(views) / count), longest / across))
    whole = max(relief.extent) if isinstance(relief, FiniteRelief) else 1.0
    return whole / _FINEST


def _around_pixels(relief: Relief, scene: Scene, view: View) -> HeightField:
    """Return the picture's own pixels as nodes, and more of them around it."""
    heights = np.asarray(view.depth + view.pose.position[2])
    rows, columns = heights.shape
    pitch = view.camera.pixel_size if isinstance(view.camera, Orthographic) else 1.0
    x0, y0 = float(view.pose.position[0]), float(view.pose.position[1])
    low = np.array([x0, y0 - pitch * (rows - 1)])
    high = np.array([x0 + pitch * (columns - 1), y0])
    reach, cut = _reach(relief, scene, float(np.nanmin(heights)), low, high)
    before, after = np.full(2, np.ceil(reach / pitch)), np.full(2, np.ceil(reach / pitch))
    if isinstance(relief, FiniteRelief):  # and one node more, which finds out where its edge is
        extent = np.array(relief.extent)
        before = np.clip(np.floor((low + extent) / pitch) + 1, 0, before + 1)
        after = np.clip(np.floor((extent - high) / pitch) + 1, 0, after + 1)
    left, below, right, above = (int(n) for n in (*before, *after))
    # A grid has two nodes each way, or it has no spacing.
    right, below = max(right, 2 - columns - left), max(below, 2 - rows - above)
    x = x0 + pitch * np.arange(-left, columns + right)
    y = y0 - pitch * np.arange(-above, rows + below)
    known = np.full((len(y), len(x)), np.nan)
    known[above : above + rows, left : left + columns] = heights
    for part in (
        np.s_[:above, :],
        np.s_[above + rows :, :],
        np.s_[above : above + rows, :left],
        np.s_[above : above + rows, left + columns :],
    ):
        if known[part].size:
            known[part] = relief.evaluate(*np.meshgrid(x[part[1]], y[part[0]])).height
    return HeightField(x=x, y=y, heights=_with_rim(relief, x, y, known), cut=cut)


def _heights(relief: Relief, x: FloatArray, y: FloatArray) -> FloatArray:
    return _with_rim(relief, x, y, relief.evaluate(*np.meshgrid(x, y)).height)


def _reach(relief: Relief, scene: Scene, lowest: float, low: FloatArray, high: FloatArray) -> tuple[float, float]:
    """Return how far around what is seen the surface matters, and beyond which distance it is left out though it does.

    Both are lengths; `low` and `high` are the corners of what is seen.
    """
    far = np.inf
    if isinstance(relief, FiniteRelief):
        extent = np.array(relief.extent)
        far = float(max(np.max(low + extent), np.max(extent - high), 0.0))
        if far == 0.0:
            return 0.0, np.inf
    lights = [*scene.lights, *([] if scene.ambient is None else [scene.ambient])]
    steepness = 0.0 if scene.bounce > 0 else min(_slope(light) for light in lights)
    if steepness > 0:
        far = min(far, (relief.bounds[1] - lowest) / steepness)
    most = _REACH * float(np.max(high - low))
    return (far, np.inf) if far <= most else (most, most)


def _slope(light: Light) -> float:
    """Return the slope of a light's lowest ray, zero if some are level or it is not known [1]."""
    if not isinstance(light, Distant):
        return 0.0
    x, y, z = light.direction
    elevation = np.arctan2(z, np.hypot(x, y)) - (light.angular_radius if isinstance(light, Sun) else 0.0)
    return float(max(np.tan(elevation), 0.0))


def _with_rim(relief: Relief, x: FloatArray, y: FloatArray, heights: FloatArray) -> FloatArray:
    """Return heights that go on to the surface's edge, at the nodes next to it that are outside.

    A bowl is vertical at its rim: without these its shadow would be thrown by the last node inside, which can be lower
    by many pixels. Where the surface rises to its edge it is as high as that, and larger by less than a pixel; where it
    falls it goes on down in a line, so that what is convex stays so.
    """
    known = np.isfinite(heights)
    if known.all() or not known.any():
        return heights
    beside = _filled(relief, x, y, heights, ((0, 1), (0, -1), (1, 0), (-1, 0)))
    corners = _filled(relief, x, y, heights, ((1, 1), (1, -1), (-1, 1), (-1, -1)))
    return np.where(np.isnan(beside), corners, beside)


def _filled(
    relief: Relief, x: FloatArray, y: FloatArray, heights: FloatArray, ways: tuple[tuple[int, int], ...]
) -> FloatArray:
    """Return heights with those of nodes outside that are some ways, in rows and columns, from nodes inside."""
    known, result = np.isfinite(heights), heights.copy()
    for down, right in ways:
        edge = ~known & np.roll(known, (down, right), axis=(0, 1))
        # What is rolled in from the other side of the grid is no neighbour.
        if down:
            edge[0 if down > 0 else -1] = False
        if right:
            edge[:, 0 if right > 0 else -1] = False
        row, column = np.nonzero(edge)
        if len(row):
            last = heights[row - down, column - right]
            way, height = _edge(relief, (x[column - right], y[row - down]), (x[column], y[row]), last)
            result[row, column] = np.fmax(result[row, column], last + np.minimum(height - last, (height - last) / way))
    return result


def _edge(
    relief: Relief, inside: tuple[FloatArray, FloatArray], outside: tuple[FloatArray, FloatArray], last: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return where between places inside and outside a surface ends, as a share of the way, and how high it is there.

    Edges that are very close to the place inside are told a little farther away, lest lines through both be upright.
    """
    known, unknown, height = np.zeros(len(last)), np.ones(len(last)), last
    for _ in range(_HALVINGS):
        middle = 0.5 * (known + unknown)
        found = relief.evaluate(
            (1 - middle) * inside[0] + middle * outside[0], (1 - middle) * inside[1] + middle * outside[1]
        ).height
        there = np.isfinite(found)
        height = np.where(there, found, height)
        known, unknown = np.where(there, middle, known), np.where(there, unknown, middle)
    return np.maximum(known, _CLOSEST), height
