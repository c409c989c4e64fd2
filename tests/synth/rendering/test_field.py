"""Height fields sampled for shadows: where the nodes are, what happens at edges, and what lies under the triangles."""

import numpy as np
import pytest

from psstereo.camera import Pose
from psstereo.lights import Directional, Led
from psstereo_synth.rendering.field import coarser_field, field_of_views
from psstereo_synth.scenes import Scene, Viewpoint
from psstereo_synth.shapes import Bowl, GaussianHills, HeightGrid, Plane, Sphere
from psstereo_synth.view import centred_orthographic, centred_pinhole, view_relief

LAMP = Led(position=[0, 0, 3], axis=[0, 0, -1], mu=1.0, flux=[1.0])


def field(relief, size=16, *, width=2.0, pose=None, light=LAMP, pinhole=False):
    camera, stands = centred_orthographic((size, size), width=width)
    if pinhole:
        camera, stands = centred_pinhole((size, size), focal=3 * size, distance=8.0)
    viewpoint = Viewpoint(camera=camera, pose=pose or stands)
    scene = Scene(surface=relief, viewpoints=(viewpoint,), size=(size, size), lights=(light,))
    view = view_relief(relief, viewpoint.camera, viewpoint.pose, (size, size))
    return field_of_views(relief, scene, [view]), view


def test_pixels_are_nodes_and_the_surface_goes_on_to_its_edge():
    hills = GaussianHills()
    made, view = field(hills)
    assert made.heights.shape == (18, 18)
    assert made.heights[1:-1, 1:-1] == pytest.approx(view.depth, abs=0)
    assert made.x == pytest.approx(np.linspace(-17, 17, 18) / 16)
    assert made.y == pytest.approx(-made.x)
    assert np.isfinite(made.heights).all()
    assert np.isinf(made.cut)
    # The last node is outside of the surface, on a line through the last pixel and the edge or at the edge's height.
    edge = hills.evaluate(np.array([1.0]), made.y[5:6]).height[0]
    last = made.heights[5, -2]
    line = last + 2 * (edge - last)
    assert made.heights[5, -1] >= min(edge, line) - 1e-9


def test_the_field_ends_where_the_surface_does():
    for pinhole in (False, True):
        made, _ = field(GaussianHills(), width=6.0, pinhole=pinhole)
        assert np.abs(made.x).max() <= 3.0
        known = np.isfinite(made.heights).any(axis=0)
        assert np.abs(made.x[known]).max() == pytest.approx(1.0, abs=2 * made.spacing[0])


@pytest.mark.parametrize("slope", [10.0, 2.0, 0.1, 0.0])
def test_it_reaches_as_far_as_shadows_do_and_no_farther_than_the_picture_is_wide(slope):
    hills, seen = GaussianHills(steepness=2.0), 0.5 * 15 / 16
    made, view = field(hills, width=0.5, light=Directional(direction=[1, 0, slope], strength=1.0))
    longest = (hills.bounds[1] - view.depth.min()) / slope if slope else np.inf
    assert made.x.max() - seen / 2 == pytest.approx(min(longest, seen), abs=2 * made.spacing[0])
    assert made.cut == (pytest.approx(seen) if longest > seen else np.inf)
    first = int(np.argmin(np.abs(made.x + seen / 2))), int(np.argmin(np.abs(made.y - seen / 2)))
    inner = made.heights[first[1] : first[1] + 16, first[0] : first[0] + 16]
    assert inner == pytest.approx(view.depth, abs=0)


@pytest.mark.parametrize("pinhole", [False, True])
def test_a_rim_is_as_high_as_it_is(pinhole):
    made, _ = field(Bowl(), 32, pinhole=pinhole)
    inside = np.isfinite(Bowl().evaluate(*np.meshgrid(made.x, made.y)).height)
    rim = np.isfinite(made.heights) & ~inside
    assert rim.sum() > 60
    assert made.heights[rim] == pytest.approx(np.zeros(rim.sum()), abs=1e-3)
    assert pinhole or made.heights[inside].max() < -0.02


def test_what_is_convex_stays_so_at_its_edge():
    made, _ = field(Sphere(), 40)
    inside = np.isfinite(Sphere().evaluate(*np.meshgrid(made.x, made.y)).height)
    bend = np.diff(made.heights, n=2, axis=1)
    mostly = inside[:, 1:-1] & (inside[:, :-2] | inside[:, 2:])
    at_edge = mostly & ~(inside[:, :-2] & inside[:, 2:])
    assert np.isfinite(bend[at_edge]).sum() > 40
    assert np.nanmax(bend[mostly]) < 0.02  # but where the edge is very close to the last node
    assert (bend[at_edge] < 1e-9).mean() > 0.9


def test_raised_points_lie_on_the_triangles():
    for pinhole in (False, True):
        made, view = field(Bowl(), 24, pinhole=pinhole)
        points = view.geometry.points
        raised = made.raised(points)
        assert np.array_equal(raised[:, :2], points[:, :2])
        assert (raised[:, 2] >= points[:, 2]).all()
        mesh = made.mesh()
        assert (mesh.face_normals[:, 2] > 0).all()
        if not pinhole:  # at nodes nothing changes
            assert raised == pytest.approx(points, abs=1e-12)
            continue
        # Brute force: the triangle over each point, by barycentric coordinates.
        for point, up in list(zip(points, raised, strict=True))[::17]:
            corners = mesh.corners
            a, b, c = (corners[:, k, :2] for k in range(3))
            area = _cross(b - a, c - a)
            weights = np.stack([_cross(b - point[:2], c - point[:2]), _cross(c - point[:2], a - point[:2])]) / area
            last = 1 - weights.sum(axis=0)
            over = np.flatnonzero((weights > -1e-9).all(axis=0) & (last > -1e-9))
            height = [weights[0, k] * corners[k, 0, 2] + weights[1, k] * corners[k, 1, 2] + last[k] * corners[k, 2, 2]
                      for k in over]  # fmt: skip
            assert len(over)
            assert up[2] == pytest.approx(max(point[2], height[0]), abs=1e-9)


def _cross(a, b):
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def test_points_beside_the_field_stay():
    made, _ = field(GaussianHills(), 8)
    far = np.array([[5.0, 0, 0], [0, -5, 1], [-5, 5, -9]])
    assert np.array_equal(made.raised(far), far)


def test_a_coarser_field_covers_the_same_ground():
    hills = GaussianHills()
    made, _ = field(hills, 30)
    coarse = coarser_field(hills, made, 7)
    assert coarse.heights.shape == (7, 7)
    assert (coarse.x[0], coarse.x[-1], coarse.y[0], coarse.y[-1]) == (made.x[0], made.x[-1], made.y[0], made.y[-1])
    assert coarser_field(hills, made, 1000).heights.shape == made.heights.shape


def test_missing_heights_stay_holes():
    heights = np.zeros((12, 12))
    heights[4:8, 4:8] = np.nan
    grid = HeightGrid(heights=heights, spacing=(0.18, 0.18))
    made, _ = field(grid, 40)
    assert np.isnan(made.heights).any()
    assert np.nanmax(np.abs(made.heights)) < 1e-9


def test_slanted_views_have_a_grid_about_as_fine_as_their_pixels():
    rotation = Pose.looking_at(np.array([2.0, 1.0, 4.0]), np.zeros(3)).rotation
    _, pose = centred_orthographic((32, 32), rotation=rotation)
    made, view = field(Plane(), 32, pose=pose)
    assert made.spacing[0] == pytest.approx(view.camera.pixel_size, rel=0.3)
    assert made.heights.size < 4 * 32 * 32
