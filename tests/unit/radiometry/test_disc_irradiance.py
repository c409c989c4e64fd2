import math
import sys

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from psstereo.errors import InputError
from psstereo.radiometry import disc_irradiance, polygon_irradiance, sphere_irradiance

UP = np.array([0.0, 0.0, 1.0])


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def random_case(rng):
    size, far = 10 ** rng.uniform(-1, 1), 10 ** rng.uniform(-1, 1)
    return far * rng.normal(size=3), unit(rng.normal(size=3)), rng.normal(size=3), unit(rng.normal(size=3)), size


def by_area(point, normal, centre, axis, radius):
    """∬ (n·r) h / |r|⁴ dA over what is above the horizon, in strips across the direction in which n·r grows."""
    height = (point - centre) @ axis
    if height <= 0:
        return 0.0
    along = unit(normal - (normal @ axis) * axis)
    across = np.cross(axis, along)
    slope, level = normal @ along, normal @ (centre - point)
    start = max(-radius, -level / slope)
    if start >= radius:
        return 0.0

    def strip(angle):
        u = -radius * math.cos(angle)
        middle = centre + u * along - point
        shift = middle @ across
        gap = math.sqrt(middle @ middle - shift * shift)
        half = radius * math.sin(angle)
        ends = [
            v / (2 * gap**2 * (gap**2 + v * v)) + math.atan(v / gap) / (2 * gap**3)
            for v in (half + shift, shift - half)
        ]
        return max(level + slope * u, 0.0) * height * (ends[0] - ends[1]) * radius * math.sin(angle)

    first = math.acos(-start / radius)
    nearest = math.acos(min(1.0, max(-1.0, (centre - point) @ along / radius)))
    breaks = [nearest] if first < nearest < math.pi else None
    return quad(strip, first, math.pi, epsabs=1e-13, epsrel=1e-12, limit=400, points=breaks)[0]


def test_against_quadrature_for_any_position_and_orientation():
    rng = np.random.default_rng(1)
    cut = whole = 0
    for _ in range(400):
        point, normal, centre, axis, radius = random_case(rng)
        want = by_area(point, normal, centre, axis, radius)
        got = float(disc_irradiance(1.0, point, normal, centre, axis, radius))
        assert abs(got - want) < 1e-11
        swing = radius * math.hypot(*(normal - (normal @ axis) * axis))
        cut += want > 0 and normal @ (centre - point) < swing
        whole += want > 0 and normal @ (centre - point) >= swing
    assert cut > 60
    assert whole > 15


@pytest.mark.parametrize("ratio", [1e-12, 1e-3, 0.2, 1.0, 3.0, 1e4, 1e9])
def test_on_the_axis_it_is_the_sine_squared(ratio):
    want = math.pi * 2.5 * (ratio / math.hypot(1.0, ratio)) ** 2
    axis = unit(np.array([0.3, -0.5, 0.8]))
    got = disc_irradiance(2.5, 4.0 * axis, -axis, [0, 0, 0], axis, 4.0 * ratio)
    assert float(got) == pytest.approx(want, rel=1e-14, abs=0)


def test_the_closed_form_for_a_parallel_disc_at_forty_digits():
    """Ez = π/2 (1 − (d² + h² − R²) / S), Ed = π h / 2d ((d² + h² + R²) / S − 1), near, at the rim and far off."""
    with mp.workdps(60):
        for d, h, r in [
            (0.5, 1.0, 2.0),
            (3.0, 0.01, 3.0),
            (1e-6, 1.0, 1.0),
            (3e6, 4e6, 1.0),
            (7.0, 0.3, 1e-3),
            (1e-9, 1e-5, 1.0),
        ]:
            d_, h_, r_ = mp.mpf(d), mp.mpf(h), mp.mpf(r)
            s = mp.sqrt((d_**2 + h_**2 + r_**2) ** 2 - 4 * d_**2 * r_**2)
            want = [
                mp.pi * h_ / (2 * d_) * ((d_**2 + h_**2 + r_**2) / s - 1),
                mp.pi / 2 * (1 - (d_**2 + h_**2 - r_**2) / s),
            ]
            tilt = 0.2 * h / math.hypot(d + r, h)  # so that all of the disc is above the horizon
            for t in (0.0, tilt):
                normal = np.array([math.sin(t), 0.0, math.cos(t)])
                got = disc_irradiance(1.0, [0, 0, 0], normal, [d, 0, h], -UP, r)
                expected = mp.mpf(normal[0]) * want[0] + mp.mpf(normal[2]) * want[1]
                assert float(abs(mp.mpf(float(got)) / expected - 1)) < 4e-15


@pytest.mark.parametrize("angle", [1e-6, 1e-4, 0.0199, 0.0201, 0.3, 1.0, 1.5])
def test_seen_from_its_axis_it_is_a_cap_also_under_the_horizon(angle):
    """A disc and a sphere of the same outline are the same to a receiver: two formulas that share nothing."""
    rng = np.random.default_rng(2)
    toward = unit(rng.normal(size=3))
    normals = unit(rng.normal(size=(4000, 3)))
    grazing = unit(np.cross(toward, rng.normal(size=(500, 3)))) + rng.uniform(-1.2, 1.2, (500, 1)) * angle * toward
    normals = np.concatenate([normals, unit(grazing)])
    got = disc_irradiance(1.0, np.zeros(3), normals, toward, -toward, math.tan(angle))
    want = sphere_irradiance(1.0, math.sin(angle), 1.0, np.clip(normals @ toward, -1, 1))
    facing = math.pi * math.sin(angle) ** 2
    assert np.abs(got - want).max() < 3e-14 * facing
    assert np.count_nonzero((want > 0) & (normals @ toward < math.sin(angle))) > 200


def test_the_rule_for_far_discs_takes_over_without_a_step(monkeypatch):
    rng = np.random.default_rng(3)
    toward = unit(np.array([1.0, 2.0, 3.0]))
    normals = unit(np.cross(toward, rng.normal(size=(2000, 3))) + 0.02 * rng.normal(size=(2000, 3)))
    module = sys.modules["psstereo.radiometry.disc_irradiance"]
    values = []
    for limit in (1e9, 10.0):
        monkeypatch.setattr(module, "_FAR", limit)
        values.append(disc_irradiance(1.0, 49 * toward, normals, [0, 0, 0], UP, 1.0))
    facing = math.pi * toward[2] / 49**2
    assert np.abs(values[0] - values[1]).max() < 1e-13 * facing


@pytest.mark.parametrize("height", [1e-3, 1e-6, 1e-12])
def test_close_up_it_fills_the_hemisphere(height):
    """From π L, facing it, to π L (1 + cos t) / 2 for a surface that is tilted by t."""
    tilts = np.linspace(0, np.pi, 13)
    normals = np.stack([np.sin(tilts), 0 * tilts, -np.cos(tilts)], axis=-1)
    got = disc_irradiance(3.0, [0.1, 0.2, height], normals, [0, 0, 0], UP, 1.0)
    np.testing.assert_allclose(got, 1.5 * np.pi * (1 + np.cos(tilts)), rtol=0, atol=20 * height + 1e-14)


@pytest.mark.parametrize("cosines", [(1.0, 1.0), (0.6, 0.8)])
def test_far_away_it_is_a_lamp_at_second_order(cosines):
    emission, incidence = cosines
    point = np.array([math.sqrt(1 - emission**2), 0.0, emission])
    normal = -incidence * point + math.sqrt(1 - incidence**2) * np.array([0.0, 1.0, 0.0])
    errors = []
    for distance in (1e1, 1e2, 1e3):
        got = float(disc_irradiance(1.0, distance * point, normal, [0, 0, 0], UP, 1.0))
        errors.append(abs(got / (math.pi * emission * incidence / distance**2) - 1))
    np.testing.assert_allclose(-np.diff(np.log10(errors)), 2.0, rtol=0, atol=0.02)
    got = float(disc_irradiance(1.0, 1e9 * point, normal, [0, 0, 0], UP, 1.0))
    assert got == pytest.approx(math.pi * emission * incidence / 1e18, rel=1e-14)


def test_polygons_of_many_sides_tend_to_it_at_second_order():
    rng = np.random.default_rng(4)
    points = rng.normal(size=(300, 3))
    points[:, 2] = 0.2 + np.abs(points[:, 2])
    normals = unit(rng.normal(size=(300, 3)))
    disc = disc_irradiance(1.0, points, normals, [0, 0, 0], UP, 1.0)
    errors = []
    for sides in (32, 64, 128, 256):
        turn = 2 * np.pi * np.arange(sides) / sides
        corners = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=-1)
        errors.append(np.abs(polygon_irradiance(1.0, points, normals, corners) - disc).max())
    np.testing.assert_allclose(-np.diff(np.log2(errors)), 2.0, rtol=0, atol=0.05)


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([2.0**-400, 1e-3, 1e5, 2.0**400]))
def test_motion_and_scale_do_not_matter(seed, factor):
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    point, normal, centre, axis, radius = random_case(rng)
    here = disc_irradiance(1.0, point, normal, centre, axis, radius)
    there = disc_irradiance(
        1.0, factor * (turn @ point), turn @ normal, factor * (turn @ centre), turn @ axis, factor * radius
    )
    assert float(there) == pytest.approx(float(here), rel=0, abs=2e-12)


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_never_negative_and_never_more_than_the_hemisphere(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(200, 3)) * 10 ** rng.uniform(-6, 3, (200, 1))
    got = disc_irradiance(1.0, points, unit(rng.normal(size=(200, 3))), [0, 0, 0], UP, 1.0)
    assert (got >= 0).all()
    assert (got <= np.pi * (1 + 1e-13)).all()


def test_behind_it_and_in_its_plane():
    normals = np.array([0.0, 0.0, -1.0])
    got = disc_irradiance(1.0, [[0, 0, -1], [2, 0, 0], [0.5, 0, 0], [1, 0, 0], [0, 0, 0]], normals, [0, 0, 0], UP, 1.0)
    np.testing.assert_array_equal(got, [0.0, 0.0, np.nan, np.nan, np.nan])


def test_what_is_not_known_stays_so():
    normals = np.array([[np.nan, 0, 0], [0, 0, -1.0], [0, 0, -1.0]])
    got = disc_irradiance(1.0, [[0, 0, 1], [0, np.nan, 1], [0, 0, 1]], normals, [0, 0, 0], UP, 1.0)
    assert np.isnan(got).tolist() == [True, True, False]
    assert np.isnan(disc_irradiance(1.0, [0, 0, -1.0], normals, [0, 0, 0], UP, 1.0)).tolist() == [True, False, False]
    assert np.isnan(disc_irradiance([np.nan, 1.0], [0, 0, 1], -UP, [0, 0, 0], UP, 1.0)).tolist() == [True, False]


def test_all_arguments_broadcast():
    rng = np.random.default_rng(5)
    points, axes, radii = rng.normal(size=(4, 1, 3)), unit(rng.normal(size=(5, 3))), rng.uniform(0, 2, (3, 1, 1))
    got = disc_irradiance(2.0, points, UP, [0, 0, 1.0], axes, radii)
    assert got.shape == (3, 4, 5)
    assert got[1, 2, 3] == disc_irradiance(2.0, points[2, 0], UP, [0, 0, 1.0], axes[3], radii[1, 0, 0])
    assert disc_irradiance(1.0, [0, 0, 1], -UP, [0, 0, 0], UP, 0.0) == 0.0


def test_what_means_nothing_is_refused():
    good = [1.0, [0, 0, 1], -UP, [0, 0, 0], UP, 1.0]
    for index, bad in [
        (0, -1.0),
        (0, np.nan),
        (1, [0, 1]),
        (2, 2 * UP),
        (2, np.full(3, np.nan)),
        (4, 0 * UP),
        (5, -1.0),
        (5, np.nan),
    ]:
        with pytest.raises(InputError):
            disc_irradiance(*good[:index], bad, *good[index + 1 :])
