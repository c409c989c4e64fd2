import pickle

import numpy as np
import pytest

from psstereo.errors import InputError
from psstereo.lights import Beam, Directional, Led
from psstereo_synth.meshes import RayCaster, RayShadows, TriangleMesh
from psstereo_synth.meshes.exact import meet

HIGH = 2.5
UP = np.array([0.0, 0, 1])


def made(kind="icosphere", *arguments, shift=(0.0, 0, 0), scale=1.0, **options):
    import trimesh

    shape = getattr(trimesh.creation, kind)(*arguments)
    return TriangleMesh(vertices=scale * (shape.vertices + shift), faces=shape.faces, **options)


def floor(n=121, size=6.0):
    x, y = np.meshgrid(*[np.linspace(-size, size, n)] * 2)
    points = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    return points, np.tile(UP, (len(points), 1))


def sun(direction):
    d = np.asarray(direction, np.float64)
    return Beam(directions=d / np.linalg.norm(d), irradiance=np.ones(1))


def passes_at(points, directions, reach, centre):
    """How near segments come to a point, by projection onto them."""
    along = np.clip(((centre - points) * directions).sum(axis=1), 0, reach)
    return np.linalg.norm(points + along[:, None] * directions - centre, axis=1)


def inner_radius(mesh, centre):
    return np.abs(((mesh.centres - centre) * mesh.face_normals).sum(axis=1)).min()


def check_floor(mesh, points, normals, beam, scale=1.0):
    """Everything inside the shadow of the inscribed ball is dark, everything outside that of the other one lit."""
    centre = scale * np.array([0, 0, HIGH])
    directions = np.broadcast_to(beam.directions, points.shape)
    near = passes_at(points, directions, beam.distances, centre)
    lit = RayShadows(mesh).lit(points, normals, beam)
    assert lit.dtype == bool
    assert not lit[near < inner_radius(mesh, centre) - 1e-6 * scale].any()
    assert lit[near > scale * (1 + 1e-6)].all()
    return lit


@pytest.mark.parametrize("direction", [(0, 0, 1), (0.7, -0.4, 1), (-1.5, 0.2, 1)])
@pytest.mark.parametrize("scale", [1.0, 1e-6, 1e6])
def test_the_shadow_of_a_sphere_under_a_sun_is_an_ellipse(direction, scale):
    mesh = made("icosphere", 5, shift=(0, 0, HIGH), scale=scale)
    points, normals = floor(241, 8.0)
    beam = sun(direction)
    lit = check_floor(mesh, scale * points, normals, beam, scale)
    area = np.count_nonzero(~lit) * (16 / 240) ** 2
    np.testing.assert_allclose(area, np.pi / beam.directions[2], rtol=0.02)


def test_the_shadow_of_a_sphere_under_a_lamp():
    """From straight above, a disc of radius H tan(asin(r / (H − h))); askew, where segments pass the sphere."""
    mesh = made("icosphere", 5, shift=(0, 0, HIGH))
    points, normals = floor(241)
    height = 6.0
    for position in (np.array([0, 0, height]), np.array([2.0, -1.0, 5.0])):
        lamp = Led(position=position, axis=-UP, mu=0.0, flux=1.0)
        (beam,) = lamp.beams(points, 1)
        lit = check_floor(mesh, points, normals, beam)
        if position[0] == 0:
            radius = height * np.tan(np.arcsin(1 / (height - HIGH)))
            edge = np.linalg.norm(points[:, :2], axis=1)
            np.testing.assert_array_equal(
                lit[np.abs(edge - radius) > 0.01], (edge > radius)[np.abs(edge - radius) > 0.01]
            )


def test_what_lies_beyond_a_lamp_throws_no_shadow():
    mesh = made("icosphere", 3, shift=(0, 0, HIGH))
    points, normals = floor(31)
    (beam,) = Led(position=np.array([0, 0, 1.2]), axis=-UP, mu=1.0, flux=1.0).beams(points, 1)
    assert RayShadows(mesh).lit(points, normals, beam).all()
    (beam,) = Directional(direction=UP, strength=1.0).beams(points, 1)
    assert not RayShadows(mesh).lit(points, normals, beam).all()


def random_points(mesh, count, seed=0):
    rng = np.random.default_rng(seed)
    faces = rng.choice(len(mesh.faces), count, p=mesh.areas / mesh.areas.sum())
    weights = rng.dirichlet(np.ones(3), count)
    return faces, np.einsum("pk,pkx->px", weights, mesh.corners[faces]), mesh.normals_at(faces, weights)


@pytest.mark.parametrize("shift", [0.0, 300.0])
def test_a_faceted_torus_against_every_ray_and_triangle(shift):
    mesh = made("torus", 1.0, 0.4, 48, 24, shift=(shift, 0, 0))
    faces, points, normals = random_points(mesh, 600)
    beam = sun((0.9, 0.3, 0.35))
    lit = RayShadows(mesh).lit(points, normals, beam)
    for i, (face, point) in enumerate(zip(faces, points, strict=True)):
        others = np.delete(np.arange(len(mesh.faces)), face)
        start, aim = (np.broadcast_to(v, (len(others), 3)) for v in (point, beam.directions))
        inside, _, weights = meet(mesh.corners[others], start, aim)
        blocked = inside.any() or normals[i] @ beam.directions < 0
        grazing = np.abs(weights[inside]).min(initial=1.0) < 1e-4 or abs(normals[i] @ beam.directions) < 1e-4
        assert grazing or lit[i] != blocked
    assert 100 < np.count_nonzero(lit) < 500
    facing = normals @ beam.directions > 0
    assert np.count_nonzero(facing & ~lit) > 20


@pytest.mark.parametrize("subdivisions", [2, 3, 4])
def test_a_smooth_sphere_throws_no_shadow_on_itself(subdivisions):
    """Rays from the triangles themselves would be cut off all along the edge of the attached shadow."""
    mesh = made("icosphere", subdivisions, smooth=True)
    faces, points, normals = random_points(mesh, 4000)
    beam = sun((1, 0.2, 0.3))
    lit = RayShadows(mesh).lit(points, normals, beam)
    facing = normals @ beam.directions
    ragged = (facing > 0) & (mesh.face_normals[faces] @ beam.directions < 0)
    assert np.count_nonzero(ragged) > 5
    assert lit[facing > 1e-3].all()
    assert not lit[facing < -0.5].any()


def test_points_that_face_away_are_dark_where_their_own_body_is_in_the_way():
    mesh = made("box")
    points = np.array([[0.1, 0.2, -0.5], [0.1, 0.2, 0.5]])
    np.testing.assert_array_equal(RayShadows(mesh).lit(points, points * [0, 0, 2.0], sun(UP)), [False, True])


def test_starting_points_are_kept_only_for_the_same_points():
    mesh = made("icosphere", 3, shift=(0, 0, HIGH))
    points, normals = floor(21)
    shadows, beam = RayShadows(mesh), sun(UP)
    first = shadows.lit(points, normals, beam)
    np.testing.assert_array_equal(shadows.lit(points, normals, beam), first)
    points[:, 0] += 3.0  # in place: the same array, other points
    moved = shadows.lit(points, normals, beam)
    np.testing.assert_array_equal(moved, RayShadows(mesh).lit(points, normals, beam))
    assert (moved != first).any()
    np.testing.assert_array_equal(shadows.lit(points[:50], normals[:50], beam), moved[:50])


def test_a_caster_is_taken_as_it_is_and_shadows_pickle():
    caster = RayCaster(made("icosphere", 2, shift=(0, 0, HIGH)))
    shadows = RayShadows(caster)
    assert shadows.caster is caster
    points, normals = floor(21)
    again = pickle.loads(pickle.dumps(shadows))
    np.testing.assert_array_equal(again.lit(points, normals, sun(UP)), shadows.lit(points, normals, sun(UP)))


def test_hostile_beams_are_refused():
    points, normals = floor(3)
    shadows = RayShadows(made("box"))
    for directions, distances in (
        (np.ones((2, 3)), np.inf),
        (UP, np.ones(2)),
        (np.full(3, np.nan), np.inf),
        (UP, np.nan),
        (np.zeros(3), np.inf),
    ):
        with pytest.raises(InputError):
            shadows.lit(points, normals, Beam(directions=directions, irradiance=np.ones(1), distances=distances))
    with pytest.raises(InputError):
        shadows.lit(points * np.nan, normals, sun(UP))
