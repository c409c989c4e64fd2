"""What cameras see of surfaces: against closed forms, a search by brute force, and each other."""

import numpy as np
import pytest

from psstereo.camera import Orthographic, Pinhole, Pose
from psstereo_synth.shapes import (
    RELIEFS,
    Bowl,
    Cliffs,
    GaussianHills,
    HeightGrid,
    Plane,
    Ripples,
    Sphere,
    Steps,
    Torus,
)
from psstereo_synth.view import centred_orthographic, centred_pinhole, relief_mesh, view_relief
from tests.synth.viewed_surfaces import SHAPE, VIEWS, above, make, oblique, residual, seen, turned


@pytest.mark.parametrize("where", VIEWS)
@pytest.mark.parametrize("name", RELIEFS)
class TestEverySurface:
    def test_points_lie_on_it_and_face_the_camera(self, name, where):
        relief, _, _, view = seen(name, where)
        g = view.geometry
        assert np.count_nonzero(g.mask) > 390
        assert residual(relief, view).max() < 5e-15
        found = relief.evaluate(g.points[:, 0], g.points[:, 1])
        n = np.stack([-found.slope_x, -found.slope_y, np.ones(len(g.points))], axis=1)
        np.testing.assert_allclose(g.normals, n / np.linalg.norm(n, axis=1)[:, None], rtol=0, atol=1e-15)
        assert ((g.normals * g.to_eye).sum(axis=1) > 0).all()

    def test_depth_mask_and_points_agree(self, name, where):
        _, camera, pose, view = seen(name, where)
        g = view.geometry
        np.testing.assert_array_equal(np.isfinite(view.depth), g.mask)
        np.testing.assert_array_equal(pose.to_scene(camera.points(view.depth))[g.mask], g.points)
        normals = view.normals()
        np.testing.assert_array_equal(np.isfinite(normals).all(axis=-1), g.mask)
        np.testing.assert_allclose(normals[g.mask] @ pose.rotation.T, g.normals, rtol=0, atol=1e-15)

    def test_eyes(self, name, where):
        _, camera, pose, view = seen(name, where)
        g = view.geometry
        if isinstance(camera, Orthographic):
            assert g.eye_distances is None
            np.testing.assert_array_equal(g.to_eye, pose.rotation[:, 2])
        else:
            back = g.points + g.eye_distances[:, None] * g.to_eye
            assert np.abs(back - pose.position).max() < 3e-15
            np.testing.assert_allclose(np.linalg.norm(g.to_eye, axis=1), 1, rtol=1e-15)


def rays_of(camera, pose, shape):
    origins = pose.to_scene(camera.points(np.zeros(shape)))
    directions = camera.rays(shape) @ pose.rotation.T
    return origins, directions


@pytest.mark.parametrize("where", ["oblique", "above", "askance"])
def test_a_sphere_in_closed_form(where):
    """The nearer root of |o + t d|² = r², where it is on the upper half."""
    camera, pose, shape = VIEWS[where]()
    o, d = rays_of(camera, pose, shape)
    a, b = (d * d).sum(-1), (o * d).sum(-1)
    # As the square of the distance from the ray to the centre, which does not cancel.
    gap = 0.81 - (np.cross(o, d) ** 2).sum(-1) / a
    with np.errstate(invalid="ignore"):
        t = (-b - np.sqrt(a * gap)) / a
    z = o[..., 2] + t * d[..., 2]
    there = (gap > 0) & (z > 0)
    view = view_relief(Sphere(radius=0.9), camera, pose, shape)
    mask = view.geometry.mask
    assert np.count_nonzero(there) > 490
    np.testing.assert_array_equal(mask, there)
    exact = (o + t[..., None] * d)[mask]
    assert np.abs(view.geometry.points - exact).max() < 1e-12
    assert np.abs(view.geometry.normals - exact / 0.9).max() < 1e-11


@pytest.mark.parametrize("where", ["oblique", "above", "askance"])
def test_a_bowl_in_closed_form(where):
    """The farther root, where the nearer one is not on the bowl: its rim hides what lies behind it."""
    camera, pose, shape = VIEWS[where]()
    o, d = rays_of(camera, pose, shape)
    a, b = (d * d).sum(-1), (o * d).sum(-1)
    gap = 0.81 - (np.cross(o, d) ** 2).sum(-1) / a
    with np.errstate(invalid="ignore"):
        near, far = ((-b + side * np.sqrt(a * gap)) / a for side in (-1, 1))
        there = (gap > 0) & (o[..., 2] + near * d[..., 2] > 0) & (o[..., 2] + far * d[..., 2] < 0)
    view = view_relief(Bowl(radius=0.9), camera, pose, shape)
    assert np.count_nonzero(there) > 245
    np.testing.assert_array_equal(view.geometry.mask, there)
    assert np.abs(view.geometry.points - (o + far[..., None] * d)[there]).max() < 1e-12


@pytest.mark.parametrize("where", ["oblique", "above", "askance"])
def test_a_plane_in_closed_form(where):
    camera, pose, shape = VIEWS[where]()
    o, d = rays_of(camera, pose, shape)
    normal = np.array([-0.3, 0.2, 1.0])
    t = -(o @ normal) / (d @ normal)
    p = o + t[..., None] * d
    there = (np.abs(p[..., :2]) <= 1).all(axis=-1)
    view = view_relief(Plane(slope_x=0.3, slope_y=-0.2), camera, pose, shape)
    np.testing.assert_array_equal(view.geometry.mask, there)
    assert np.abs(view.geometry.points - p[there]).max() < 1e-14


def search(relief, camera, pose, shape, count=20001):
    """Whether each ray comes from above to below the surface, and the step in which it does first."""
    o, d = rays_of(camera, pose, shape)
    o, d = o.reshape(-1, 3), d.reshape(-1, 3)
    low, high = relief.bounds
    first, last = (high + 0.01 - o[:, 2]) / d[:, 2], (low - 0.01 - o[:, 2]) / d[:, 2]
    hits = np.full((len(o), 2), np.nan)
    for i in range(len(o)):
        t = np.linspace(first[i], last[i], count)
        p = o[i] + t[:, None] * d[i]
        gap = p[:, 2] - relief.evaluate(p[:, 0], p[:, 1]).height
        below = np.flatnonzero(gap <= 0)
        if below.size and gap[below[0] - 1] > 0:
            hits[i] = t[below[0] - 1], t[below[0]]
    return hits.reshape(*shape, 2)


@pytest.mark.slow
@pytest.mark.parametrize(
    "relief",
    [GaussianHills(steepness=2.0), Ripples(amplitude=0.15), Torus(), Steps(rise=0.15, ramp=0.05)],
    ids=lambda r: r.name,
)
def test_the_first_crossing_is_found_where_the_surface_hides_itself(relief):
    camera, pose, shape = oblique(tilt=1.15, shape=(24, 31))
    view = view_relief(relief, camera, pose, shape)
    hits = search(relief, camera, pose, shape)
    known = np.isfinite(hits[..., 0])
    # Walls and edges aside, what is found is in the first step of the search.
    found = view.geometry.mask
    assert found.sum() > 100
    assert np.count_nonzero(known != found) <= 1
    both = known & found
    t = -view.depth[both]
    assert (t >= hits[both][:, 0] - 1e-12).all()
    assert (t <= hits[both][:, 1] + 1e-12).all()


def test_hidden_parts_are_really_hidden():
    """Some crests of the ripples hide troughs: rays meet the surface up to several times."""
    relief = Ripples(amplitude=0.15)
    camera, pose, shape = oblique(tilt=1.15)
    view = view_relief(relief, camera, pose, shape)
    p = view.geometry.points
    back = p + np.linspace(0.02, 1.5, 300)[:, None, None] * pose.rotation[:, 2]
    over = back[..., 2] - relief.evaluate(back[..., 0], back[..., 1]).height
    assert (np.isnan(over) | (over > 0)).all()  # nothing stands between the points and the camera
    assert view.geometry.mask.sum() < view_relief(Plane(), camera, pose, shape).geometry.mask.sum() * 1.2


def test_a_glancing_ray_over_a_crest_is_not_lost():
    """Between two samples the ray dips below a crest and comes out again: only the search of dips finds it."""
    relief = Ripples(amplitude=0.1, wavelength=2.0, direction=0.0)  # one crest at x = 0
    camera = Orthographic(pixel_size=1e-5)
    level = np.arctan(-2 * np.pi / 2.0 * 0.1 * np.sin(np.pi * 0.1))  # slope of the surface at x = 0.1
    z = 0.1 * np.cos(np.pi * 0.1)
    along = np.array([np.cos(level), 0, np.sin(level)])
    up = np.array([-np.sin(level), 0, np.cos(level)])
    rotation = np.stack([np.cross(up, -along), up, -along], axis=1)
    # Pixels in a column climb by 1e-5 across the tangent at x = 0.1: those below it are hits, the others are not.
    start = np.array([0.1, 0.0, z]) + up * 2.5e-5
    view = view_relief(relief, camera, Pose(rotation=rotation, position=start), (6, 1), samples=16)
    p = view.geometry.points
    assert view.geometry.mask[3:, 0].all()
    assert (np.abs(p[-3:, 0] - 0.1) < 0.02).all()
    missed = view.depth[:3, 0]
    assert (np.isnan(missed) | (np.abs(missed) > 0.3)).all()


def test_walls_are_left_out():
    """A camera that faces the wall of a cliff sees it as a gap of wall · sin(tilt) between the two grounds."""
    rotation = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]]).T @ turned(0.7, 0.0)
    shape = (400, 3)
    camera, pose = centred_orthographic(shape, width=2.0 * 3 / 400 * 1.5, rotation=rotation)
    facing = pose.rotation[:, 2]
    assert abs(facing[1]) < 1e-15
    view = view_relief(Cliffs(height=0.4), camera, pose, shape)
    column = np.flatnonzero(view.geometry.mask[:, 1])
    gap = np.diff(column).max() - 1
    expected = 0.4 * np.sin(0.7) / camera.pixel_size if facing[0] < 0 else 0
    assert expected > 10
    assert abs(gap - expected) <= 1
    assert residual(Cliffs(height=0.4), view).max() < 1e-14


def test_the_open_side_of_a_relief_is_not_seen():
    """Below the near edge of a raised plate rays pass under it, and see nothing, not its back."""
    plate = HeightGrid(heights=np.full((5, 5), 0.5), spacing=(0.5, 0.5))
    camera, pose, shape = oblique(tilt=1.2, width=4.0)
    view = view_relief(plate, camera, pose, shape)
    o, d = rays_of(camera, pose, shape)
    p = o + ((0.5 - o[..., 2]) / d[..., 2])[..., None] * d
    np.testing.assert_array_equal(view.geometry.mask, (np.abs(p[..., :2]) <= 1).all(axis=-1))


def test_a_pinhole_far_away_sees_what_a_parallel_projection_sees():
    relief = GaussianHills()
    far = view_relief(relief, *centred_pinhole((60, 60), focal=3e9, distance=1e8), (60, 60))
    near = view_relief(relief, *centred_orthographic((60, 60)), (60, 60))
    np.testing.assert_array_equal(far.geometry.mask, near.geometry.mask)
    assert np.abs(far.geometry.points - near.geometry.points).max() < 5e-8
    np.testing.assert_allclose(1e8 - far.depth, near.depth, rtol=0, atol=1e-7)


@pytest.mark.parametrize("name", sorted(set(RELIEFS) - {"cliffs"}))
def test_rays_straight_down_find_what_evaluation_finds(name):
    """A turn about z takes the way of rays; turned back, the picture is the same."""
    relief, shape = make(name), (41, 41)
    straight = view_relief(relief, *centred_orthographic(shape), shape)
    quarter = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    round_z = view_relief(relief, *centred_orthographic(shape, rotation=quarter), shape)
    depth = np.rot90(round_z.depth, 1)
    same = np.isfinite(depth) == np.isfinite(straight.depth)
    assert np.mean(same) > 0.995  # rounding decides on the outline
    both = np.isfinite(depth) & np.isfinite(straight.depth)
    assert np.abs(depth - straight.depth)[both].max() < 1e-13


def test_straight_down_nothing_is_rounded():
    camera, pose = centred_orthographic((65, 65))
    view = view_relief(Sphere(radius=0.5), camera, pose, (65, 65))
    x = (np.arange(65) - 32) * 2 / 65
    z2 = 0.25 - x**2 - x[:, None] ** 2
    np.testing.assert_array_equal(view.geometry.mask, z2 > 0)
    np.testing.assert_allclose(view.depth[view.geometry.mask] ** 2, z2[z2 > 0], rtol=0, atol=3e-16)
    assert view.geometry.points[:, 2].max() == 0.5


def test_a_camera_may_hang_anywhere_over_a_parallel_projection():
    camera, pose = centred_orthographic((9, 9))
    lifted = Pose(position=pose.position + np.array([0, 0, 7.0]))
    low, high = (view_relief(Sphere(), camera, p, (9, 9)) for p in (pose, lifted))
    np.testing.assert_allclose(high.depth, low.depth - 7.0, rtol=0, atol=1e-15)
    np.testing.assert_allclose(high.geometry.points, low.geometry.points, rtol=0, atol=1e-15)


@pytest.mark.parametrize("scale", [1e-3, 50.0, 1e6])
def test_scale_is_the_length_of_the_unit(scale):
    relief = GaussianHills()
    for small, large in (
        (oblique(), (*centred_orthographic(SHAPE, width=2.6 * scale, rotation=turned(1.0)), SHAPE)),
        (above(), above(distance=4.0 * scale)),
        ((*centred_orthographic(SHAPE), SHAPE), (*centred_orthographic(SHAPE, width=2 * scale), SHAPE)),
    ):
        one, other = view_relief(relief, *small), view_relief(relief, *large, scale=scale)
        assert np.mean(one.geometry.mask != other.geometry.mask) < 0.002
        both = one.geometry.mask & other.geometry.mask
        np.testing.assert_allclose(other.depth[both], scale * one.depth[both], rtol=1e-12, atol=1e-13 * scale)
        np.testing.assert_allclose(other.normals()[both], one.normals()[both], rtol=0, atol=1e-11)


def test_middle_of_the_picture():
    for shape in ((7, 9), (8, 10)):
        camera, pose = centred_orthographic(shape, width=3.0, rotation=turned(0.5))
        corners = pose.to_scene(camera.points(np.zeros(shape)))
        np.testing.assert_allclose(corners.mean(axis=(0, 1)), 0, atol=1e-15)
        assert np.linalg.norm(corners[0, 1] - corners[0, 0]) * shape[1] == pytest.approx(3.0)
        pinhole, pose = centred_pinhole(shape, focal=50.0, distance=2.0)
        rays = pinhole.rays(shape).mean(axis=(0, 1))
        np.testing.assert_allclose(pose.position + 2.0 * rays, 0, atol=1e-15)


def test_a_camera_beside_a_hill_and_lower_than_its_top_is_fine():
    camera, pose = (
        Pinhole(fx=60.0, fy=60.0, cx=30.0, cy=30.0),
        Pose.looking_at(np.array([0.0, -2.5, 0.3]), np.array([0.0, 0.0, 0.35]), np.array([0.0, 0, 1])),
    )
    view = view_relief(Sphere(radius=0.9), camera, pose, (61, 61))
    assert residual(Sphere(radius=0.9), view).max() < 1e-14
    assert view.geometry.mask[20:30, 30].all()
    np.testing.assert_allclose(np.linalg.norm(view.geometry.points, axis=1), 0.9, rtol=1e-14)


@pytest.mark.parametrize("name", RELIEFS)
def test_meshes_lie_on_the_surface_and_face_up(name):
    relief = make(name)
    vertices, faces = relief_mesh(relief, 60)
    assert vertices.dtype == np.float64
    assert faces.dtype == np.int32
    np.testing.assert_array_equal(vertices[:, 2], relief.evaluate(vertices[:, 0], vertices[:, 1]).height)
    np.testing.assert_array_equal(np.unique(faces), np.arange(len(vertices)))
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    area = 0.5 * np.cross(b - a, c - a)[:, 2]
    assert (area > 0).all()
    x, y = np.random.default_rng(0).uniform(-1, 1, (2, 20000)) * np.array(relief.extent)[:, None]
    ground = np.isfinite(relief.evaluate(x, y).height).mean() * 4 * np.prod(relief.extent)
    assert 0.9 * ground < area.sum() < 1.02 * ground
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    assert np.unique(edges, axis=0, return_counts=True)[1].max() == 2


def test_cells_of_meshes_are_about_square():
    vertices, _ = relief_mesh(HeightGrid(heights=np.zeros((5, 9)), spacing=(0.5, 0.25)), 41)
    assert len(vertices) == 41 * 11
    assert np.ptp(vertices, axis=0).tolist() == [4.0, 1.0, 0.0]
