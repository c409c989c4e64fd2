"""Curvature from normals: closed forms, orders, noise, gaps."""

import numpy as np
import pytest
from scipy.linalg import eigh

from psstereo.camera import Orthographic, Pinhole
from psstereo.depth import curvature_from_normals
from psstereo.errors import InputError, OptionError

INNER = (slice(1, -1), slice(1, -1))


def grid(size):
    """Return a camera over the square of side 1.2 around the origin, and x and y of its pixels."""
    camera = Orthographic(pixel_size=1.2 / size, length_unit="mm")
    points = camera.points(np.zeros((size, size)))
    return camera, points[..., 0] - 0.6, points[..., 1] + 0.6


def sphere_seen_from_the_middle(size, radius, sense):
    """Return camera, normals and distances of a ball in front of a pinhole, or of the far wall of a hollow one."""
    camera = Pinhole(fx=1.3 * size, fy=1.1 * size, cx=0.45 * size, cy=0.52 * size, skew=0.05 * size)
    rays, centre = camera.rays((size, size)), np.array([0.1, 0.05, -4.0])
    a, b = np.sum(rays * rays, axis=-1), rays @ centre
    distance = (b - sense * np.sqrt(b * b - a * (centre @ centre - radius**2))) / a
    return camera, sense * (distance[..., None] * rays - centre) / radius, distance


def saddle(x, y):
    """Return height, slopes, mean and Gaussian curvature of a wave on a saddle, positive toward the viewer."""
    c, s = np.cos(3 * x + y), np.sin(3 * x + y)
    p, q, r, m, t = 0.9 * c + 0.2 * y, 0.3 * c + 0.2 * x, -2.7 * s, -0.9 * s + 0.2, -0.3 * s
    w = 1 + p * p + q * q
    mean = -((1 + q * q) * r - 2 * p * q * m + (1 + p * p) * t) / (2 * w**1.5)
    return 0.3 * s + 0.2 * x * y, np.stack([-p, -q, np.ones_like(p)], axis=-1), mean, (r * t - m * m) / w**2


def test_a_sphere_is_exact_under_parallel_projection():
    camera, x, y = grid(40)
    for sense in (1.0, -1.0):
        normals = np.stack([sense * x, sense * y, np.sqrt(4 - x * x - y * y)], axis=-1)
        found = curvature_from_normals(normals, camera)
        np.testing.assert_allclose(found.mean, sense / 2, rtol=1e-12)
        np.testing.assert_allclose(found.gaussian, 0.25, rtol=1e-12)
        assert (found.largest >= found.smallest).all()
        assert found.unit == "1/mm"


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_a_sphere_is_of_second_order_under_central_projection(sense):
    errors = []
    for size in (16, 32, 64, 128):
        camera, normals, distance = sphere_seen_from_the_middle(size, 3.2 if sense > 0 else 8.0, sense)
        found = curvature_from_normals(normals, camera, distance=distance, unit="m")
        radius = sense * (3.2 if sense > 0 else 8.0)
        errors.append(
            [
                np.nanmax(np.abs(part[INNER] - want)) / abs(want)
                for part, want in ((found.mean, 1 / radius), (found.gaussian, radius**-2))
            ]
        )
        assert found.unit == "1/m"
    orders = np.log2(np.array(errors)[:-1] / np.array(errors)[1:])
    assert (orders > 1.8).all(), orders


def test_unknown_distance_leaves_curvature_times_distance():
    camera, normals, distance = sphere_seen_from_the_middle(30, 3.2, 1.0)
    known = curvature_from_normals(normals, camera, distance=distance, unit="m")
    free = curvature_from_normals(normals, camera)
    assert free.unit == "1/distance"
    np.testing.assert_allclose(free.mean, known.mean * distance, rtol=1e-12)
    np.testing.assert_allclose(free.gaussian, known.gaussian * distance**2, rtol=1e-12)
    one = curvature_from_normals(normals, camera, distance=4.0, unit="m")
    np.testing.assert_allclose(one.mean * 4.0, free.mean, rtol=1e-12)


def test_a_cylinder_has_one_curvature_and_a_saddle_two_signs():
    camera, x, y = grid(50)
    turn = 0.4
    across = np.cos(turn) * x + np.sin(turn) * y
    normals = np.stack([np.cos(turn) * across, np.sin(turn) * across, np.sqrt(1 - across**2)], axis=-1)
    found = curvature_from_normals(normals, camera)
    np.testing.assert_allclose(found.largest, 1.0, rtol=1e-11)
    np.testing.assert_allclose(found.smallest, 0.0, atol=1e-11)
    np.testing.assert_allclose(found.gaussian, 0.0, atol=1e-11)
    # z = x y: at the middle both curvatures are 1, one toward the viewer and one away.
    found = curvature_from_normals(np.stack([-y, -x, np.ones_like(x)], axis=-1), camera)
    middle = (25, 25)
    assert found.largest[middle] == pytest.approx(1.0, abs=2e-3)
    assert found.smallest[middle] == pytest.approx(-1.0, abs=2e-3)
    assert found.gaussian[middle] == pytest.approx(-1.0, abs=2e-3)


@pytest.mark.parametrize("central", [False, True])
def test_a_smooth_surface_is_of_second_order(central):
    errors = []
    for size in (32, 64, 128, 256):
        camera, x, y = grid(size)
        options = {}
        if central:
            camera = Pinhole(fx=2.0 * size, fy=1.9 * size, cx=size / 2, cy=size / 2)
            rays, distance = camera.rays((size, size)), np.full((size, size), 3.0)
            for _ in range(25):
                distance = 3.0 - saddle(distance * rays[..., 0], distance * rays[..., 1])[0]
            x, y, options = distance * rays[..., 0], distance * rays[..., 1], {"distance": distance, "unit": "m"}
        _, normals, mean, gaussian = saddle(x, y)
        found = curvature_from_normals(normals, camera, **options)
        errors.append([np.abs(found.mean - mean)[INNER].max(), np.abs(found.gaussian - gaussian)[INNER].max()])
        # Where a neighbour is missing the error falls like the pixel.
        assert np.abs(found.mean - mean).max() < 5.0 / size
    orders = np.log2(np.array(errors)[:-1] / np.array(errors)[1:])
    assert (orders > 1.85).all(), orders


def test_principal_curvatures_solve_the_eigenproblem_of_the_two_fundamental_forms():
    """Another way: II x = k I x from tangents in space and differences of the normals, symmetrised."""
    rng = np.random.default_rng(3)
    camera = Pinhole(fx=30.0, fy=26.0, cx=3.0, cy=2.0, skew=4.0)
    normals = np.array([0.2, -0.1, 1.0]) + 0.15 * rng.normal(size=(3, 3, 3))
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    n, ray = normals[1, 1], camera.rays((3, 3))[1, 1]
    steps = [np.array([1 / 30, 0, 0]), np.array([-4 / 30 / 26, -1 / 26, 0])]
    tangents = [q - ray * (n @ q) / (n @ ray) for q in steps]
    turns = [0.5 * (normals[1, 2] - normals[1, 0]), 0.5 * (normals[2, 1] - normals[0, 1])]
    # Only what lies in the tangent plane counts, read off along the ray.
    turns = [d - ray * (n @ d) / (n @ ray) for d in turns]
    first = np.array([[a @ b for b in tangents] for a in tangents])
    operator = np.linalg.solve(first, np.array([[t @ d for d in turns] for t in tangents]))
    second = first @ operator
    expected = eigh(0.5 * (second + second.T), first, eigvals_only=True)
    found = curvature_from_normals(normals, camera)
    np.testing.assert_allclose([found.smallest[1, 1], found.largest[1, 1]], expected, rtol=1e-11)
    assert found.mean[1, 1] == pytest.approx(expected.mean(), rel=1e-11)
    assert found.gaussian[1, 1] == pytest.approx(expected.prod(), rel=1e-11)


def test_noise_and_waves_come_out_as_the_docstring_says():
    rng = np.random.default_rng(11)
    camera = Orthographic(pixel_size=0.5, length_unit="mm")
    noise = 0.01 * rng.normal(size=(150, 150, 3)) + [0.0, 0.0, 1.0]
    rough = curvature_from_normals(noise, camera).mean[INNER]
    assert rough.std() == pytest.approx(0.01 / (2 * 0.5), rel=0.03)
    smooth = curvature_from_normals(noise, camera, smoothing=2.0).mean[12:-12, 12:-12]
    assert smooth.std() == pytest.approx(0.141 * 0.01 / (2.0**2 * 0.5), rel=0.06)
    column = np.arange(150.0)
    slope = 1e-3 * np.sin(2 * np.pi * column / 15)
    wave = np.broadcast_to(np.stack([-slope, 0 * slope, 0 * slope + 1], axis=-1), (30, 150, 3))
    found = curvature_from_normals(wave, camera, smoothing=2.0).mean[15, 30:-30]
    exact = -0.5 * 1e-3 * (2 * np.pi / 15) / 0.5 * np.cos(2 * np.pi * column / 15)[30:-30]
    np.testing.assert_allclose(found, np.exp(-2 * np.pi**2 * 4 / 225) * exact, rtol=0, atol=1e-3 * np.abs(exact).max())


def test_smoothing_is_exact_on_spheres_up_to_any_border_and_keeps_components_apart():
    camera, x, y = grid(40)
    mask = np.random.default_rng(2).random(x.shape) > 0.4
    parts = np.where(x > 0, 7, 3)
    there = np.where(x > 0, x - 0.5, x)
    normals = np.stack([there, y, np.sqrt(4 - there**2 - y * y)], axis=-1)
    found = curvature_from_normals(normals, camera, mask=mask, components=parts, smoothing=1.5)
    assert np.isfinite(found.mean[mask]).all()
    assert np.isnan(found.mean[~mask]).all()
    np.testing.assert_allclose(found.mean[mask], 0.5, rtol=1e-9)
    # The same without smoothing, and what happens if nothing is said of the crack.
    plain = curvature_from_normals(normals, camera, components=parts)
    np.testing.assert_allclose(plain.mean, 0.5, rtol=1e-9)
    assert np.abs(curvature_from_normals(normals, camera).mean).max() > 0.6


@pytest.mark.parametrize("smoothing", [0.0, 2.0])
def test_without_neighbours_there_is_no_curvature(smoothing):
    camera, x, y = grid(20)
    normals = np.stack([x, y, np.sqrt(4 - x * x - y * y)], axis=-1)
    normals[10, 10] = np.nan
    mask = np.zeros((20, 20), bool)
    mask[2] = True  # a line
    mask[8:13, 8:13] = True
    parts = np.ones((20, 20), np.int32)
    parts[8, 8] = 0
    found = curvature_from_normals(normals, camera, mask=mask, components=parts, smoothing=smoothing)
    wanted = mask.copy()
    wanted[10, 10] = wanted[8, 8] = False
    if smoothing == 0:
        wanted[2] = False
    for part in (found.mean, found.gaussian, found.largest, found.smallest):
        np.testing.assert_array_equal(np.isfinite(part), wanted)
    if smoothing > 0:
        mask[8:13, 8:13] = False
        found = curvature_from_normals(normals, camera, mask=mask, smoothing=smoothing)
        assert np.isnan(found.mean).all()


def test_unknown_distances_leave_gaps():
    camera, normals, distance = sphere_seen_from_the_middle(12, 3.2, 1.0)
    distance[3, 4] = np.nan
    found = curvature_from_normals(normals, camera, distance=distance, unit="m")
    assert np.argwhere(np.isnan(found.mean)).tolist() == [[3, 4]]


NORMALS = np.broadcast_to([0.0, 0.0, 1.0], (4, 5, 3))
PINHOLE = Pinhole(fx=9.0, fy=9.0, cx=2.0, cy=2.0)


@pytest.mark.parametrize(
    ("camera", "options", "message"),
    [
        (Orthographic(), {"distance": 3.0, "unit": "mm"}, "The camera is orthographic"),
        (PINHOLE, {"distance": 3.0}, "its unit None"),
        (PINHOLE, {"unit": "mm"}, "distance absent"),
        (PINHOLE, {"distance": np.ones((4, 4)), "unit": "mm"}, r"shape \(4, 4\)"),
        (PINHOLE, {"distance": -1.0, "unit": "mm"}, "negative"),
        (PINHOLE, {"distance": np.full((4, 5), np.nan), "unit": "mm"}, "none is known"),
        (PINHOLE, {"distance": np.inf, "unit": "mm"}, "infinite"),
        (PINHOLE, {"components": np.ones((4, 4), int)}, "components"),
        (PINHOLE, {"smoothing": 0.3}, "smoothing is 0.3"),
        (PINHOLE, {"smoothing": np.nan}, "smoothing is nan"),
        (PINHOLE, {"smoothing": np.inf}, "smoothing is inf"),
    ],
)
def test_hostile_options_are_refused(camera, options, message):
    with pytest.raises((InputError, OptionError), match=message):
        curvature_from_normals(NORMALS, camera, **options)
