import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from psstereo.errors import InputError
from psstereo_synth.meshes import RayCaster, TriangleMesh
from psstereo_synth.meshes.exact import Neighbours, meet


def made(kind="icosphere", *arguments, scale=1.0, shift=0.0, **options):
    import trimesh

    shape = getattr(trimesh.creation, kind)(*arguments)
    return TriangleMesh(vertices=shape.vertices * scale + shift, faces=shape.faces, **options)


def rays_at(mesh, count=400, seed=0, spread=3.0):
    """Rays from around a mesh toward points near it."""
    rng = np.random.default_rng(seed)
    origins = rng.normal(size=(count, 3))
    origins *= spread * mesh.radius / np.linalg.norm(origins, axis=1, keepdims=True)
    targets = rng.uniform(-1.1, 1.1, (count, 3)) * mesh.radius
    return origins + mesh.middle, targets - origins


def brute_force(mesh, origins, directions):
    """Every ray against every triangle."""
    count = len(mesh.faces)
    nearest, faces = np.full(len(origins), np.inf), np.full(len(origins), -1)
    for i, (o, d) in enumerate(zip(origins, directions, strict=True)):
        inside, distance, _ = meet(mesh.corners, np.tile(o, (count, 1)), np.tile(d, (count, 1)))
        distance = np.where(inside, distance, np.inf)
        if inside.any():
            faces[i], nearest[i] = distance.argmin(), distance.min()
    return faces, nearest


def test_meeting_a_triangle_against_a_linear_system():
    rng = np.random.default_rng(1)
    corners, origins, directions = rng.normal(size=(300, 3, 3)), rng.normal(size=(300, 3)), rng.normal(size=(300, 3))
    inside, distance, weights = meet(corners, origins, directions)
    for i in range(300):
        a, b, c = corners[i]
        u, v, t = np.linalg.solve(np.stack([b - a, c - a, -directions[i]], axis=1), origins[i] - a)
        np.testing.assert_allclose([distance[i], *weights[i]], [t, 1 - u - v, u, v], rtol=1e-9, atol=1e-9)
        assert inside[i] == (min(u, v, 1 - u - v, t) >= 0)
    assert 10 < np.count_nonzero(inside) < 100


def test_a_ray_in_the_plane_or_a_triangle_without_area_is_not_met():
    flat = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0, 0], [1, 0, 0], [2, 0, 0]]])
    inside, _, weights = meet(flat, np.array([[-1.0, 0.2, 0], [0.5, 0, 1]]), np.array([[1.0, 0, 0], [0, 0, -1]]))
    assert not inside.any()
    assert np.isnan(weights).all()


@pytest.mark.parametrize("kind", ["icosphere", "torus", "box"])
@pytest.mark.parametrize(("scale", "shift"), [(1.0, 0.0), (1e-7, 0.0), (1e7, 0.0), (1.0, 1000.0)])
def test_first_hits_are_those_of_every_ray_against_every_triangle(kind, scale, shift):
    arguments = {"icosphere": (2,), "torus": (1.0, 0.4), "box": ()}[kind]
    mesh = made(kind, *arguments, scale=scale, shift=shift)
    origins, directions = rays_at(mesh)
    faces, distances, weights = RayCaster(mesh).first_hit(origins, directions)
    want, far = brute_force(mesh, origins, directions)
    np.testing.assert_array_equal(faces, want)
    assert 100 < np.count_nonzero(faces >= 0) < 400
    hit = faces >= 0
    np.testing.assert_allclose(distances[hit], far[hit], rtol=1e-12)
    assert np.isinf(distances[~hit]).all()
    points = np.einsum("pk,pkx->px", weights[hit], mesh.corners[faces[hit]])
    along = origins[hit] + distances[hit, None] * directions[hit]
    np.testing.assert_allclose(points, along, rtol=0, atol=1e-12 * (mesh.radius + 1000 * abs(shift)))
    np.testing.assert_allclose(weights[hit].sum(axis=1), 1, rtol=1e-14)


def test_a_camera_very_far_away_hits_the_same():
    mesh = made("torus", 1.0, 0.4)
    _, directions = rays_at(mesh, 300)
    rng = np.random.default_rng(3)
    targets = rng.uniform(-1, 1, (300, 3)) * [1.4, 1.4, 0.4]
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    near, _, _ = RayCaster(mesh).first_hit(targets - 10 * unit, unit)
    far, distances, _ = RayCaster(mesh).first_hit(targets - 1e6 * unit, unit)
    assert np.count_nonzero(near >= 0) > 200
    np.testing.assert_array_equal(near, far)
    assert (np.abs(distances[far >= 0] - 1e6) < 3).all()


def test_nothing_slips_through_seams_and_corners():
    """From inside a closed body every ray hits, aimed at edges and vertices too."""
    mesh = made("icosphere", 4)
    caster = RayCaster(mesh)
    rng = np.random.default_rng(0)
    edges = np.concatenate([mesh.vertices[mesh.faces[:, [k, (k + 1) % 3]]] for k in range(3)])
    for _ in range(5):
        share = rng.uniform(size=(len(edges), 1))
        target = edges[:, 0] * share + edges[:, 1] * (1 - share)
        origins = rng.uniform(-0.5, 0.5, target.shape)
        faces, distances, weights = caster.first_hit(origins, target - origins)
        assert (faces >= 0).all()
        np.testing.assert_allclose(distances, 1, rtol=1e-9)
        assert (weights >= -1e-12).all()
    assert (caster.first_hit(np.zeros_like(mesh.vertices), mesh.vertices)[0] >= 0).all()


def test_an_outline_missed_by_a_hair_shows_what_is_behind():
    """A ray past an edge by 1e-9 goes on to the wall behind; one on this side of it stops, as far as Embree sees it."""
    vertices = np.array([[0.0, -1, 0], [0, 1, 0], [-1, 0, 0], [-5, -5, -3], [5, -5, -3], [0, 5, -3]])
    mesh = TriangleMesh(vertices=vertices, faces=np.array([[0, 1, 2], [3, 4, 5]]))
    origins = np.stack([np.linspace(1e-9, 1e-7, 50), np.linspace(-0.7, 0.7, 50), np.full(50, 2.0)], axis=1)
    down = np.tile([0.0, 0, -1], (50, 1))
    faces, distances, _ = RayCaster(mesh).first_hit(origins, down)
    np.testing.assert_array_equal(faces, 1)
    np.testing.assert_allclose(distances, 5, rtol=1e-14)


def test_occluded_by_what_is_before_the_end_only():
    mesh = made("icosphere", 3)
    caster = RayCaster(mesh)
    o, d = np.tile([0.0, 0, 3], (4, 1)), np.tile([0.0, 0, -2], (4, 1))
    ends = np.array([0.99, 1.01, np.inf, 0.0])
    np.testing.assert_array_equal(caster.occluded(o, d, ends), [False, True, True, False])
    np.testing.assert_array_equal(caster.occluded(o, -d), False)
    origins, directions = rays_at(mesh)
    _, distances, _ = caster.first_hit(origins, directions)
    hit = np.isfinite(distances)
    np.testing.assert_array_equal(caster.occluded(origins, directions, 1e9), hit)
    np.testing.assert_array_equal(caster.occluded(origins[hit], directions[hit], distances[hit] * (1 + 1e-5)), True)
    np.testing.assert_array_equal(caster.occluded(origins[hit], directions[hit], distances[hit] * (1 - 1e-5)), False)


def test_threads_and_pickles_give_the_same():
    mesh = made("torus", 1.0, 0.4)
    caster = RayCaster(mesh)
    work = [rays_at(mesh, 5000, seed) for seed in range(8)]
    alone = [caster.first_hit(*rays)[0] for rays in work]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda rays: caster.first_hit(*rays)[0], work))
    np.testing.assert_array_equal(together, alone)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(caster)).first_hit(*work[0])[0], alone[0])


def test_blocks_do_not_show():
    mesh = made("icosphere", 2)
    origins, directions = rays_at(mesh, 70_000)
    caster = RayCaster(mesh)
    whole = caster.faces_hit(origins, directions)
    np.testing.assert_array_equal(whole[65_000:], caster.faces_hit(origins[65_000:], directions[65_000:]))
    np.testing.assert_array_equal(whole[65_000:] >= 0, caster.occluded(origins, directions)[65_000:])


def test_no_rays_give_nothing():
    caster, none = RayCaster(made("box")), np.zeros((0, 3))
    assert caster.first_hit(none, none)[0].shape == (0,)
    assert caster.faces_hit(none, none).shape == (0,)
    assert caster.occluded(none, none).shape == (0,)
    assert caster.lifted(none, none).shape == (0, 3)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_hostile_rays_are_refused(bad):
    caster, good = RayCaster(made("box")), np.ones((2, 3))
    for o, d in (
        (good * bad, good),
        (good, good * bad),
        (good, 0 * good),
        (good, good[:1]),
        (good[:, :2], good[:, :2]),
    ):
        with pytest.raises(InputError):
            caster.first_hit(o, d)
    for reach in (np.nan, -1.0):
        with pytest.raises(InputError):
            caster.occluded(good, good, reach)


def test_neighbours_have_a_corner_in_common_even_where_corners_are_listed_apart():
    mesh = made("icosphere", 1)
    apart = TriangleMesh(vertices=mesh.corners.reshape(-1, 3), faces=np.arange(3 * len(mesh.faces)).reshape(-1, 3))
    shared = np.array([[np.intersect1d(a, b).size > 0 for b in mesh.faces] for a in mesh.faces])
    for body in (mesh, apart):
        row, other = Neighbours(body).pairs(np.arange(len(mesh.faces)))
        found = np.zeros_like(shared)
        found[row, other] = True
        np.testing.assert_array_equal(found, shared)
        assert (np.diff(row) >= 0).all()


def test_lifted_points_are_off_their_triangle_by_a_step_on_the_side_of_the_normal():
    mesh = made("icosphere", 2)
    caster = RayCaster(mesh)
    tilted = mesh.face_normals + 0.3 * np.roll(mesh.face_normals, 1, axis=1)
    tilted /= np.linalg.norm(tilted, axis=1, keepdims=True)
    for side in (1, -1):
        moved = caster.lifted(mesh.centres, side * tilted) - mesh.centres
        np.testing.assert_allclose(moved, side * caster.step * mesh.face_normals, rtol=0, atol=1e-14)
    away = np.array([[3.0, 0, 0]])
    np.testing.assert_allclose(caster.lifted(away, [[0, 0, 1.0]]) - away, [[0, 0, caster.step]], atol=1e-15)


def test_lifted_points_of_a_smooth_sphere_are_on_it():
    """The tangent planes of the corners are met a third of the way beyond the sphere, to the order of the sagitta."""
    for subdivisions in (2, 3):
        mesh = made("icosphere", subdivisions, smooth=True)
        heights = np.linalg.norm(RayCaster(mesh).lifted(mesh.centres, mesh.face_normals), axis=1)
        sagitta = 1 - np.linalg.norm(mesh.centres, axis=1)
        assert (heights > 1).all()
        assert (heights - 1 < 1.2 * sagitta).all()
