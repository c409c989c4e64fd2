import numpy as np
import pytest

from psstereo.errors import InputError
from psstereo.forward.geometry import Geometry
from psstereo_synth.meshes import RayCaster, TriangleMesh
from psstereo_synth.meshes.interreflection import Gather


def seen_from(points, normals):
    p, n = np.atleast_2d(points).astype(float), np.atleast_2d(normals).astype(float)
    return Geometry(points=p, normals=n, to_eye=np.array([0.0, 0, 1]), mask=np.ones((1, len(p)), bool))


def square(corners):
    return TriangleMesh(vertices=np.array(corners, float), faces=np.array([[0, 1, 2], [0, 2, 3]]))


CEILING = square([[-1, -1, 1.5], [-1, 1, 1.5], [1, 1, 1.5], [1, -1, 1.5]])  # faces down
WALL = square([[0, -1, 0], [0, 1, 0], [0, 1, 2], [0, -1, 2]])  # faces +x


def above(a, b, c):
    """Share of the sky of a point that a rectangle a × b, parallel at the distance c with a corner above it, takes."""
    x, y = a / c, b / c
    p, q = np.hypot(1, x), np.hypot(1, y)
    return (x / p * np.arctan2(y, p) + y / q * np.arctan2(x, q)) / (2 * np.pi)


def beside(distance, width, height):
    """The same for an upright rectangle whose lower corner is straight before the point, on the floor."""
    slant = np.hypot(distance, height)
    return (np.arctan2(width, distance) - distance / slant * np.arctan2(width, slant)) / (2 * np.pi)


def gathered(mesh, points, normals, **options):
    return Gather.prepare(seen_from(points, normals), RayCaster(mesh), **options)


@pytest.mark.parametrize(("x", "y"), [(0.0, 0.0), (0.4, -0.3), (0.9, 0.9)])
def test_a_parallel_square(x, y):
    exact = sum(above(1 + s * x, 1 + t * y, 1.5) for s in (-1, 1) for t in (-1, 1))
    gather = gathered(CEILING, [x, y, 0], [0, 0, 1], samples=16384)
    np.testing.assert_allclose(gather.seen, exact, rtol=0, atol=2e-3)
    np.testing.assert_allclose(gather.irradiance(np.full((2, 1), 7.0)), [[7 * gather.seen[0]]], rtol=1e-12)


@pytest.mark.parametrize(("x", "y"), [(0.5, 0.0), (1.0, 0.5), (3.0, -0.9)])
def test_an_upright_square(x, y):
    exact = beside(x, 1 + y, 2) + beside(x, 1 - y, 2)
    gather = gathered(WALL, [x, y, 0], [0, 0, 1], samples=16384)
    np.testing.assert_allclose(gather.seen, exact, rtol=0, atol=2e-3)


def test_the_error_falls_faster_than_that_of_independent_directions():
    exact = 4 * above(1, 1, 1.5)
    points, normals = np.zeros((400, 3)), np.tile([0.0, 0, 1], (400, 1))
    counts = np.array([16, 64, 256, 1024])
    errors = []
    for samples in counts:
        shares = gathered(CEILING, points, normals, samples=int(samples), seed=3).seen
        errors.append(np.sqrt(((shares - exact) ** 2).mean()))
        assert abs(shares.mean() - exact) < 4 * errors[-1] / np.sqrt(400)
    independent = np.sqrt(exact * (1 - exact) / counts)
    assert (errors < independent).all()
    orders = -np.diff(np.log(errors)) / np.diff(np.log(counts))
    assert (orders > 0.4).all()
    assert orders.mean() > 0.55
    assert errors[-1] < 0.33 * independent[-1]


def test_a_square_seen_from_behind_sends_nothing():
    assert gathered(CEILING, [0, 0, 3], [0, 0, -1], samples=64).seen == [0]
    assert gathered(CEILING, [0, 0, 3], [0, 0, 1], samples=64).seen == [0]


def inward(kind, *arguments):
    import trimesh

    shape = getattr(trimesh.creation, kind)(*arguments)
    return TriangleMesh(vertices=shape.vertices, faces=shape.faces[:, ::-1])


@pytest.mark.parametrize(("kind", "arguments"), [("box", ()), ("icosphere", (3,)), ("torus", (1.0, 0.4))])
def test_a_closed_room_fills_the_whole_sky(kind, arguments):
    """Every direction from every point of the wall ends on the wall: nothing leaks, no ray hits its own start."""
    room = inward(kind, *arguments)
    gather = gathered(room, room.centres, room.face_normals, samples=128)
    np.testing.assert_allclose(gather.seen, 1, rtol=1e-12)
    own = gather.transport.diagonal()
    np.testing.assert_array_equal(own, 0)


def test_inside_a_sphere_every_point_sees_every_part_alike():
    """The share of each part is its area over 4πR², whatever the two points: the integrating sphere."""
    room = inward("icosphere", 3)
    gather = gathered(room, room.centres[::40], room.face_normals[::40], samples=8192)
    radiosity = np.stack([np.ones(len(room.faces)), room.centres[:, 2] > 0.5, room.centres[:, 0] ** 2], axis=1)
    mean = (room.areas[:, None] * radiosity).sum(axis=0) / room.areas.sum()
    np.testing.assert_allclose(mean, [1, 0.25, 1 / 3], atol=0.02)
    np.testing.assert_allclose(gather.irradiance(radiosity), np.tile(mean, (32, 1)), rtol=0, atol=0.01)


def test_walls_of_a_cube_share_as_the_formula_says():
    """Parallel walls of a cube exchange 0.19982 of their light, neighbours 0.20004."""
    room = inward("box")
    side = np.linspace(-0.475, 0.475, 20)
    x, y = (v.ravel() for v in np.meshgrid(side, side))
    points = np.stack([x, y, np.full(400, -0.5)], axis=1)
    gather = gathered(room, points, np.tile([0.0, 0, 1], (400, 1)), samples=256)
    top, left = room.face_normals[:, 2] < -0.5, room.face_normals[:, 0] > 0.5
    shares = gather.irradiance(np.stack([top, left], axis=1).astype(float)).mean(axis=0)
    np.testing.assert_allclose(shares, [0.19982, 0.20004], rtol=0, atol=1e-3)


def test_the_same_seed_gives_the_same_and_blocks_do_not_show(monkeypatch):
    from psstereo_synth.meshes import interreflection

    room = inward("icosphere", 2)
    first = gathered(room, room.centres, room.face_normals, samples=32, seed=5).transport.toarray()
    monkeypatch.setattr(interreflection, "_RAYS", 100)
    again = gathered(room, room.centres, room.face_normals, samples=32, seed=5).transport.toarray()
    np.testing.assert_array_equal(first, again)
    part = gathered(room, room.centres[:7], room.face_normals[:7], samples=32, seed=5).transport.toarray()
    np.testing.assert_array_equal(first[:7], part)
    assert (gathered(room, room.centres, room.face_normals, samples=32, seed=6).transport.toarray() != first).any()


def test_directions_have_the_density_of_the_cosine():
    from psstereo_synth.meshes.interreflection import _directions

    rng = np.random.default_rng(0)
    normals = np.concatenate([rng.normal(size=(40, 3)), np.eye(3), -np.eye(3)])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    d = _directions(normals, rng.random((46, 2)), 4096)
    np.testing.assert_allclose(np.linalg.norm(d, axis=2), 1, rtol=1e-13)
    cosine = np.einsum("psx,px->ps", d, normals)
    assert (cosine >= 0).all()
    np.testing.assert_allclose(cosine.mean(axis=1), 2 / 3, atol=1e-3)
    np.testing.assert_allclose((cosine**2).mean(axis=1), 1 / 2, atol=1e-3)
    np.testing.assert_allclose(d.mean(axis=1), normals * 2 / 3, atol=2e-3)


@pytest.mark.parametrize(
    "radiosity", [np.ones((3, 1)), np.ones(2), [[np.nan], [1.0]], [[-1.0], [1.0]], [[np.inf], [1.0]]]
)
def test_hostile_radiosities_are_refused(radiosity):
    gather = gathered(CEILING, [0, 0, 0], [0, 0, 1], samples=16)
    with pytest.raises(InputError):
        gather.irradiance(radiosity)


@pytest.mark.parametrize("samples", [0, -5])
def test_no_samples_are_refused(samples):
    with pytest.raises(InputError):
        gathered(CEILING, [0, 0, 0], [0, 0, 1], samples=samples)
