import itertools
import math
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import dblquad

from psstereo.errors import InputError
from psstereo.radiometry import polygon_irradiance

UP = np.array([0.0, 0.0, 1.0])
SQUARE = np.array([[1.0, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]])
ARROW = np.array([[1.0, 1, 0], [0, 0.2, 0], [-1, 1, 0], [0, -1, 0]])  # one corner turns inward


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def random_polygon(rng, corners):
    turn = np.sort(rng.uniform(0, 2 * np.pi, corners))
    flat = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=-1)
    return flat @ np.linalg.qr(rng.normal(size=(3, 3)))[0].T + 0.3 * rng.normal(size=3)


def by_area(point, normal, vertices):
    """∬ (n·r) cosθ / r² dA over a fan of the part above the horizon, each triangle by nested adaptive quadrature."""
    axis = unit(np.cross(vertices - vertices[0], np.roll(vertices, -1, axis=0) - vertices[0]).sum(axis=0))
    if (point - vertices[0]) @ axis <= 0:
        return 0.0
    above = []
    for a, b in zip(vertices - point, np.roll(vertices, -1, axis=0) - point, strict=True):
        if normal @ a > 0:
            above.append(a)
        if (normal @ a > 0) != (normal @ b > 0):
            above.append(a - (normal @ a) / (normal @ (b - a)) * (b - a))
    total = 0.0
    for b, c in itertools.pairwise(above[1:]):
        a, area = above[0], np.cross(b - above[0], c - above[0]) @ axis

        def integrand(v, u, a=a, b=b, c=c):
            r = a + u * ((b - a) + v * (c - b))
            return u * (normal @ r) * -(r @ axis) / (r @ r) ** 2

        total += area * dblquad(integrand, 0, 1, 0, 1, epsabs=1e-11, epsrel=1e-11)[0]
    return total


def test_against_quadrature_for_any_position_and_orientation():
    rng = np.random.default_rng(1)
    lit = cut = 0
    for _ in range(150):
        vertices, point, normal = (
            random_polygon(rng, rng.integers(3, 7)),
            2 * rng.normal(size=3),
            unit(rng.normal(size=3)),
        )
        want = by_area(point, normal, vertices)
        assert abs(float(polygon_irradiance(1.0, point, normal, vertices)) - want) < 1e-11
        lit += want > 0
        cut += want > 0 and ((vertices - point) @ normal < 0).any()
    assert lit > 40
    assert cut > 15


def test_a_rectangle_over_its_corner_has_a_closed_form():
    """E = L/2 (x/√(1+x²) atan(y/√(1+x²)) + the same with x and y exchanged), for x, y the sides over the height."""
    for x, y in [(1.0, 1.0), (0.1, 30.0), (1e-3, 2e-3), (1e4, 1e5)]:
        r, s = math.hypot(1, x), math.hypot(1, y)
        want = 0.5 * (x / r * math.atan(y / r) + y / s * math.atan(x / s))
        corners = np.array([[0, 0, 1], [0, y, 1], [x, y, 1], [x, 0, 1.0]])
        assert float(polygon_irradiance(1.0, [0, 0, 0], UP, corners)) == pytest.approx(
            want, rel=2e-14 / min(1, x * y) ** 0.5
        )


def test_non_convex_polygons_are_the_sum_of_their_triangles():
    rng = np.random.default_rng(2)
    for far in (1.0, 200.0):
        points = far * np.abs(rng.normal(size=(400, 3)))
        normals = unit(rng.normal(size=(400, 3)))
        whole = polygon_irradiance(1.0, points, normals, ARROW)
        halves = sum(polygon_irradiance(1.0, points, normals, ARROW[rows]) for rows in ([0, 1, 3], [1, 2, 3]))
        assert np.count_nonzero(whole) > 150
        assert (np.abs(whole - halves) * (points**2).sum(axis=-1)).max() < 2e-13


def test_parts_add_up_to_the_whole():
    rng = np.random.default_rng(3)
    points, normals = rng.normal(size=(500, 3)), unit(rng.normal(size=(500, 3)))
    whole = polygon_irradiance(1.0, points, normals, SQUARE)
    parts = sum(polygon_irradiance(1.0, points, normals, SQUARE[rows]) for rows in ([0, 1, 2], [0, 2, 3]))
    np.testing.assert_allclose(parts, whole, rtol=0, atol=1e-14)


def test_a_room_lights_every_surface_in_it_with_the_hemisphere():
    """Inside a cube whose six faces shine inward every surface gets π L: each of them cut by its horizon or not."""
    rng = np.random.default_rng(4)
    points, normals = rng.uniform(-0.99, 0.99, (300, 3)), unit(rng.normal(size=(300, 3)))
    total = np.zeros(300)
    for axis in range(3):
        for side in (-1.0, 1.0):
            face = np.roll(np.concatenate([SQUARE[:, :2], np.full((4, 1), side)], axis=1), axis + 1, axis=1)
            normal = np.cross(face[1] - face[0], face[2] - face[1])
            total += polygon_irradiance(2.0, points, normals, face if normal[axis] * side < 0 else face[::-1])
    np.testing.assert_allclose(total, 2 * np.pi, rtol=1e-13)


@pytest.mark.parametrize("height", [1e-3, 1e-6, 1e-12])
def test_close_up_it_fills_the_hemisphere(height):
    tilts = np.linspace(0, np.pi, 13)
    normals = np.stack([np.sin(tilts), 0 * tilts, -np.cos(tilts)], axis=-1)
    got = polygon_irradiance(3.0, [0.1, 0.2, height], normals, SQUARE)
    np.testing.assert_allclose(got, 1.5 * np.pi * (1 + np.cos(tilts)), rtol=0, atol=20 * height + 1e-14)


def test_far_away_it_is_a_lamp_at_second_order():
    toward = unit(np.array([1.0, 2.0, 3.0]))
    errors = []
    for distance in (1e1, 1e2, 1e3):
        got = float(polygon_irradiance(1.0, distance * toward, -toward, SQUARE))
        errors.append(abs(got / (4 * toward[2] / distance**2) - 1))
    np.testing.assert_allclose(-np.diff(np.log10(errors)), 2.0, rtol=0, atol=0.02)
    assert float(polygon_irradiance(1.0, 1e9 * toward, -toward, SQUARE)) == pytest.approx(4e-18 * toward[2], rel=1e-14)


@pytest.mark.parametrize("tilt", [0.0, 0.01])
def test_the_rule_for_far_polygons_takes_over_without_a_step(monkeypatch, tilt):
    rng = np.random.default_rng(5)
    toward = unit(np.array([1.0, 2.0, 3.0]))
    normals = unit(np.cross(toward, rng.normal(size=(1000, 3))) + tilt * rng.normal(size=(1000, 3)))
    module = sys.modules["psstereo.radiometry.polygon_irradiance"]
    values = []
    for limit in (1e9, 10.0):
        monkeypatch.setattr(module, "_FAR", limit)
        values.append(polygon_irradiance(1.0, 49 * toward, normals, SQUARE))
    facing = 4 * toward[2] / 49**2
    assert np.abs(values[0] - values[1]).max() < 1e-13 * facing


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([1e-150, 1e-3, 1e5, 1e150]))
def test_motion_scale_and_first_vertex_do_not_matter(seed, factor):
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    vertices, points, normals = SQUARE + rng.normal(size=3), rng.normal(size=(20, 3)), unit(rng.normal(size=(20, 3)))
    here = polygon_irradiance(1.0, points, normals, vertices)
    there = polygon_irradiance(
        1.0, factor * points @ turn.T, normals @ turn.T, np.roll(factor * vertices @ turn.T, 1, 0)
    )
    np.testing.assert_allclose(there, here, rtol=0, atol=1e-11)


def test_it_shines_to_one_side():
    above, below = [0.3, 0.2, 1.0], [0.3, 0.2, -1.0]
    assert polygon_irradiance(1.0, above, -UP, SQUARE) > 0.5
    assert polygon_irradiance(1.0, below, UP, SQUARE) == 0.0
    assert polygon_irradiance(1.0, below, UP, SQUARE[::-1]) == pytest.approx(
        float(polygon_irradiance(1.0, above, -UP, SQUARE)), rel=1e-14
    )


def test_in_its_plane():
    points = [[2, 0, 0], [-1.5, 1, 0], [0.5, 0, 0], [1, 0, 0], [1, 1, 0], [0, -1, 0]]
    got = polygon_irradiance(1.0, points, -UP, SQUARE)
    np.testing.assert_array_equal(got, [0.0, 0.0, np.nan, np.nan, np.nan, np.nan])
    notch = polygon_irradiance(1.0, [[0, 0.9, 0], [0, -0.5, 0]], -UP, ARROW)
    np.testing.assert_array_equal(notch, [0.0, np.nan])


def test_what_is_not_known_stays_so_and_shapes_broadcast():
    normals = np.array([[np.nan, 0, 0], [0, 0, -1.0], [0, 0, -1.0]])
    got = polygon_irradiance([[1.0], [2.0]], [[0, 0, 1], [0, np.nan, 1], [0, 0, 1]], normals, SQUARE)
    assert np.isnan(got).tolist() == [[True, True, False]] * 2
    assert got[1, 2] == 2 * got[0, 2]
    grid = polygon_irradiance(1.0, np.ones((4, 1, 3)), unit(np.ones((5, 3))), SQUARE)
    assert grid.shape == (4, 5)


@pytest.mark.parametrize(
    "vertices",
    [
        SQUARE[:2],
        SQUARE[:, :2],
        SQUARE[None],
        0 * SQUARE,
        np.where(SQUARE == 1, np.nan, SQUARE),
        [[0, 0, 0], [1, 1, 1], [2, 2, 2.0]],
        SQUARE * [1, 1, 0] + np.eye(4, 3, k=2),
    ],
)
def test_what_is_no_flat_polygon_is_refused(vertices):
    with pytest.raises(InputError):
        polygon_irradiance(1.0, [0, 0, 1], -UP, vertices)


def test_what_means_nothing_is_refused():
    for bad in ([-1.0, [0, 0, 1], -UP], [np.nan, [0, 0, 1], -UP], [1.0, [0, 1], -UP], [1.0, [0, 0, 1], 2 * UP]):
        with pytest.raises(InputError):
            polygon_irradiance(*bad, SQUARE)


def test_blocks_give_the_same(monkeypatch):
    rng = np.random.default_rng(6)
    points, normals = rng.normal(size=(101, 3)), unit(rng.normal(size=(101, 3)))
    whole = polygon_irradiance(1.0, points, normals, SQUARE)
    monkeypatch.setattr(sys.modules["psstereo.radiometry.polygon_irradiance"], "_BLOCK", 40)
    np.testing.assert_array_equal(polygon_irradiance(1.0, points, normals, SQUARE), whole)
    assert polygon_irradiance(1.0, points[:0], normals[:0], SQUARE).shape == (0,)
