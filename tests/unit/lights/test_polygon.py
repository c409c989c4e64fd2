import math

import numpy as np
import pytest

from psstereo.errors import RigError
from psstereo.lights import Disc, Led, Polygon

PANEL = np.array([[1.0, 0.5, 3], [1, -0.5, 3], [-1, -0.5, 3], [-1, 0.5, 3]])  # seen from below: counter-clockwise
KITE = np.array([[0.0, 0, 0], [1, 0.3, 0], [1.5, 1.5, 0], [0.3, 1, 0], [0.1, 0.6, 0]])


def scene(seed=0, count=400):
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(count, 3))
    return rng.uniform(-1, 1, (count, 3)), normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def beam_sum(light, points, normals, count):
    return sum(
        b.irradiance * np.maximum((normals * b.directions).sum(-1), 0.0)[..., None] for b in light.beams(points, count)
    )


def test_axis_area_and_middle():
    panel = Polygon(vertices=PANEL, radiance=1.0)
    np.testing.assert_allclose(panel.axis, [0, 0, -1], rtol=0, atol=1e-15)
    assert panel.area == pytest.approx(2.0, rel=1e-15)
    np.testing.assert_allclose(panel.centroid, [0, 0, 3], rtol=0, atol=1e-15)
    wedge = Polygon(vertices=[[0, 0, 0], [3, 0, 0], [0, 3, 0]], radiance=1.0)
    np.testing.assert_allclose(wedge.centroid, [1, 1, 0], rtol=1e-15)
    skew = Polygon(vertices=KITE, radiance=1.0)
    x, y = KITE[:, 0], KITE[:, 1]
    cross = x * np.roll(y, -1) - np.roll(x, -1) * y
    assert skew.area == pytest.approx(cross.sum() / 2, rel=1e-14)
    assert skew.centroid[0] == pytest.approx(((x + np.roll(x, -1)) * cross).sum() / (3 * cross.sum()), rel=1e-14)


def test_many_sides_tend_to_a_disc_at_second_order():
    points, normals = scene()
    disc = Disc(centre=[0, 0, 3], axis=[0, 0, -1], radius=1.0, radiance=[1.0, 2.0])
    errors = []
    for sides in (16, 32, 64, 128):
        turn = 2 * np.pi * np.arange(sides) / sides
        ring = np.stack([np.cos(turn), -np.sin(turn), 3 + 0 * turn], axis=-1)
        polygon = Polygon(vertices=ring, radiance=[1.0, 2.0])
        errors.append(np.abs(polygon.irradiance(points, normals) - disc.irradiance(points, normals)).max())
    np.testing.assert_allclose(-np.diff(np.log2(errors)), 2.0, rtol=0, atol=0.05)


def test_shrinking_it_tends_to_its_lamp_at_second_order():
    points, normals = scene()
    errors = []
    for size in (0.4, 0.2, 0.1, 0.05):
        corners = size * (KITE - KITE.mean(axis=0)) * [1, -1, 1] + [0.5, 0.2, 3]
        polygon = Polygon(vertices=corners, radiance=1 / size**2)
        lamp = polygon.idealised()
        assert isinstance(lamp, Led)
        assert lamp.mu == 1.0
        up = ((lamp.position - points) * normals).sum(-1) > size
        errors.append(np.abs(polygon.irradiance(points, normals) - lamp.irradiance(points, normals))[up].max())
    np.testing.assert_allclose(-np.diff(np.log2(errors)), 2.0, rtol=0, atol=0.1)


@pytest.mark.parametrize(("count", "tolerance"), [(2, 0.15), (8, 1e-2), (32, 5e-5), (128, 1e-9), (512, 1e-13)])
def test_beams_converge_fast_while_it_is_up(count, tolerance):
    points, normals = scene()
    panel = Polygon(vertices=PANEL, radiance=[1.0, 3.0])
    up = ((panel.vertices[:, None] - points) * normals).sum(-1).min(axis=0) > 0
    assert np.count_nonzero(up) > 100
    want = panel.irradiance(points[up], normals[up])
    assert len(list(panel.beams(points, count))) == count
    assert np.abs(beam_sum(panel, points[up], normals[up], count) - want).max() / want.max() < tolerance


def test_one_beam_is_the_lamp():
    points, _ = scene()
    (beam,) = Polygon(vertices=PANEL, radiance=[1.0, 3.0]).beams(points, 1)
    lamp = next(Polygon(vertices=PANEL, radiance=[1.0, 3.0]).idealised().beams(points, 1))
    np.testing.assert_allclose(beam.irradiance, lamp.irradiance, rtol=1e-13)


def test_it_shines_to_one_side():
    points, normals = scene()
    above = points + np.array([0, 0, 6.0])
    front, back = (Polygon(vertices=v, radiance=1.0) for v in (PANEL, PANEL[::-1]))
    assert not front.irradiance(above, normals).any()
    assert not any(b.irradiance.any() for b in front.beams(above, 8))
    np.testing.assert_allclose(
        back.irradiance(above, normals), front.irradiance(points * [1, 1, -1], normals * [1, 1, -1]), rtol=0, atol=1e-15
    )


def pentagram():
    turn = 2 * np.pi * 2 * np.arange(5) / 5
    return np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=-1)


@pytest.mark.parametrize(
    ("vertices", "words"),
    [
        ([[0, 0, 0], [2, 0, 0], [0.2, 0.2, 0], [0, 2, 0]], "not convex"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.0]], r"not convex|area"),
        ([[0, 0, 0], [2, 0, 0], [0, 1, 0], [1, 1, 0.0]], "not convex"),
        (pentagram(), "not convex"),
        ([[0, 0, 0], [1, 0, 0], [1, 0, 0], [0, 1, 0]], "repeats"),
        ([[0, 0, 0], [1, 0, 0], [1, 1, 0.1], [0, 1, 0]], "one plane"),
        ([[0, 0, 0], [1, 1, 0], [2, 2, 0]], "area"),
        ([[0, 0, 0], [0, 0, 0], [0, 0, 0]], "area"),
        ([[0, 0, 0], [1, 0, 0]], "vertices"),
        ([[0, 0], [1, 0], [0, 1]], "vertices"),
        ([[0, 0, 0], [1, 0, np.nan], [0, 1, 0]], "finite"),
    ],
)
def test_what_is_no_convex_polygon_is_refused(vertices, words):
    with pytest.raises(RigError, match=words):
        Polygon(vertices=vertices, radiance=1.0)


def test_a_vertex_on_an_edge_is_fine():
    points, normals = scene()
    more = np.insert(PANEL, 1, (PANEL[0] + PANEL[1]) / 2, axis=0)
    one, other = (Polygon(vertices=v, radiance=1.0).irradiance(points, normals) for v in (PANEL, more))
    np.testing.assert_allclose(other, one, rtol=0, atol=1e-14)


@pytest.mark.parametrize("radiance", [0.0, -1.0, np.nan, [[1.0]]])
def test_radiances_that_mean_nothing_are_refused(radiance):
    with pytest.raises(RigError):
        Polygon(vertices=PANEL, radiance=radiance)


def test_on_it_nothing_is_known():
    panel = Polygon(vertices=PANEL, radiance=1.0)
    up = np.array([0.0, 0.0, 1.0])
    got = panel.irradiance(np.array([[0, 0, 3.0], [5, 0, 3], [0, 0, 3 - 1e-12]]), up)[:, 0]
    assert np.isnan(got[0])
    assert got[1] == 0.0
    assert got[2] == pytest.approx(math.pi, rel=1e-11)
