"""Each surface against its own equation, and the numbers that none of them takes."""

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from psstereo.errors import InputError, PsstereoError
from psstereo_synth.shapes import (
    Bowl,
    Cliffs,
    Cone,
    Ellipsoid,
    GaussianHills,
    Plane,
    Ripples,
    Sphere,
    Steps,
    Terrain,
    Torus,
    Vase,
)


def inside(relief, count=4000, seed=0):
    half = np.array(relief.extent)
    x, y = np.random.default_rng(seed).uniform(-half, half, (count, 2)).T
    found = relief.evaluate(x, y)
    there = np.isfinite(found.height)
    assert there.sum() > 1000
    return x[there], y[there], found.height[there], found.slope_x[there], found.slope_y[there]


def on_equation(gradient, value, zx, zy):
    """Largest value of F(x, y, z), and the largest cosine between (1, 0, zx) or (0, 1, zy) and ∇F."""
    gx, gy, gz = gradient
    size = np.sqrt(gx**2 + gy**2 + gz**2)
    along_x = np.abs(gx + zx * gz) / (size * np.hypot(1, zx))
    along_y = np.abs(gy + zy * gz) / (size * np.hypot(1, zy))
    return np.abs(value).max(), max(along_x.max(), along_y.max())


def equations():
    """F and ∇F of quadrics and the torus, which the surfaces solve for z."""

    def sphere(x, y, z):
        return (2 * x, 2 * y, 2 * z), x * x + y * y + z * z - 0.81

    def ellipsoid(x, y, z):
        a, b, c = 0.9**2, 0.7**2, 0.5**2
        return (2 * x / a, 2 * y / b, 2 * z / c), x * x / a + y * y / b + z * z / c - 1

    def cone(x, y, z):
        k = (0.9 / 0.6) ** 2
        return (2 * x, 2 * y, 2 * k * (0.6 - z)), x * x + y * y - k * (0.6 - z) ** 2

    def torus(x, y, z):
        s = x * x + y * y + z * z + 0.6**2 - 0.3**2
        ring = 8 * 0.6**2
        return (4 * s * x - ring * x, 4 * s * y - ring * y, 4 * s * z), s * s - 4 * 0.6**2 * (x * x + y * y)

    return [(Sphere(), sphere), (Bowl(), sphere), (Ellipsoid(), ellipsoid), (Cone(), cone), (Torus(), torus)]


@pytest.mark.parametrize(("relief", "equation"), equations(), ids=lambda value: getattr(value, "name", ""))
def test_closed_surfaces_solve_their_equation(relief, equation):
    x, y, z, zx, zy = inside(relief)
    gradient, value = equation(x, y, z)
    off, tilt = on_equation(gradient, value, zx, zy)
    assert off < 2e-15
    assert tilt < 1e-14


def test_which_half():
    assert (inside(Sphere())[2] > 0).all()
    assert (inside(Bowl())[2] < 0).all()
    assert (inside(Torus())[2] > 0).all()


def test_heights_in_closed_form():
    at = np.array([0.25])
    assert Plane(slope_x=2.0, slope_y=-0.5).evaluate(at, 2 * at).height == 0.25
    assert Sphere(radius=0.5).evaluate(0 * at, 0 * at).height == 0.5
    assert Cone(radius=1.0, height=0.5).evaluate(at, 0 * at).height == 0.375
    assert Torus(major=0.5, minor=0.25).evaluate(2 * at, 0 * at).height == 0.25
    assert Vase(radius=0.5, half_length=1.0, swell=0.5).evaluate(0 * at, -2 * at).height == 0.75
    assert Vase(radius=0.5, half_length=1.0, swell=0.5).evaluate(0 * at, 2 * at).height == 0.25


def test_close_to_the_rim_nothing_is_lost():
    """Beside the rim a sphere's height is a small difference; compare with fifty digits."""
    with mpmath.workdps(50):
        for gap in (1e-3, 1e-8, 1e-13):
            x = np.array([0.9 * (1 - gap)])
            exact = mpmath.sqrt(mpmath.mpf(0.9) ** 2 - mpmath.mpf(float(x[0])) ** 2)
            found = Sphere(radius=0.9).evaluate(x, np.zeros(1))
            assert abs(float(found.height[0] / exact - 1)) < 1e-15
            assert abs(float(found.slope_x[0] / (-mpmath.mpf(float(x[0])) / exact) - 1)) < 1e-15


def test_the_rim_itself_is_left_out_and_edges_are_not():
    at, zero = np.array([0.9, -0.9]), np.zeros(2)
    for relief in (Sphere(), Bowl(), Ellipsoid()):
        assert np.isnan(relief.evaluate(at, zero).height).all()
    assert np.isnan(Torus(major=0.5, minor=0.25).evaluate(np.array([0.25, 0.75]), zero).height).all()
    assert (Cone().evaluate(at, zero).height == 0).all()
    ones = np.array([1.0, -1.0])
    for relief in (Plane(), GaussianHills(), Ripples(), Steps(), Cliffs(), Terrain()):
        assert np.isfinite(relief.evaluate(ones, ones).height).all()
        assert np.isnan(relief.evaluate(np.nextafter(ones, 2 * ones), ones).height).all()


def test_the_tip_of_a_cone_is_level():
    found = Cone().evaluate(np.zeros(1), np.zeros(1))
    assert (found.height, found.slope_x, found.slope_y) == (0.6, 0.0, 0.0)
    beside = Cone().evaluate(np.array([1e-300]), np.zeros(1))
    assert beside.slope_x == pytest.approx(-0.6 / 0.9, rel=1e-15)


def test_half_a_cylinder_is_a_vase_without_swell():
    x, _, z, zx, zy = inside(Vase(swell=0.0))
    np.testing.assert_allclose(np.hypot(x, z), 0.5, rtol=1e-15)
    assert (zy == 0).all()
    np.testing.assert_allclose(zx, -x / z, rtol=1e-15)


def test_a_vase_is_a_surface_of_revolution():
    x, y, z, zx, _ = inside(Vase())
    radius = 0.5 * (1 - 0.4 * np.sin(np.pi * y / 0.9))
    np.testing.assert_allclose(np.hypot(x, z), radius, rtol=0, atol=3e-16)
    # The normal meets the axis: (−zx, −zy, 1) and (x, 0, z) are parallel across the axis.
    assert (np.abs(-zx * z - x) / np.hypot(1, zx)).max() < 1e-15


def test_gaussian_hills_by_another_formula():
    """One Gaussian has the same ratio of slope to offset everywhere, and curvature from its width."""
    hills = GaussianHills(count=1, steepness=0.8, seed=3)
    x, y, z, zx, zy = inside(hills)
    log = np.log(np.abs(z))
    design = np.stack([np.ones_like(x), x, y, x * x + y * y], axis=1)
    c, *_ = np.linalg.lstsq(design, log, rcond=None)
    sigma = np.sqrt(-0.5 / c[3])
    x0, y0 = c[1] * sigma**2, c[2] * sigma**2
    assert np.abs(design @ c - log).max() < 1e-9
    np.testing.assert_allclose(zx, -z * (x - x0) / sigma**2, rtol=0, atol=1e-9)
    np.testing.assert_allclose(zy, -z * (y - y0) / sigma**2, rtol=0, atol=1e-9)
    height = np.exp(c[0] + (x0**2 + y0**2) / (2 * sigma**2))
    assert 0.4 * 0.999 < height / sigma < 0.8 * 1.001
    assert 0.12 * 0.999 < sigma < 0.3 * 1.001


def test_more_hills_leave_the_first_as_they_are():
    one, two = (GaussianHills(count=count, seed=5)._hills for count in (3, 4))
    np.testing.assert_array_equal(one, two[:3])


def test_steepness_scales_hills():
    x, y, z, zx, _ = inside(GaussianHills(steepness=0.5))
    twice = GaussianHills(steepness=1.0).evaluate(x, y)
    np.testing.assert_allclose(twice.height, 2 * z, rtol=1e-13, atol=1e-16)
    np.testing.assert_allclose(twice.slope_x, 2 * zx, rtol=1e-13, atol=1e-15)


@pytest.mark.parametrize("make", [lambda s: GaussianHills(seed=s), lambda s: Terrain(seed=s)])
def test_seeds_decide(make):
    x, y = np.zeros(1) + 0.1, np.zeros(1)
    assert make(1).evaluate(x, y).height == make(1).evaluate(x, y).height
    assert make(1).evaluate(x, y).height != make(2).evaluate(x, y).height
    assert make(1) != make(2)


def test_rings_are_round_and_smooth_in_the_middle():
    rings = Ripples(amplitude=0.1, wavelength=0.5)
    rho, turn = np.linspace(0, 0.9, 50), 0.7
    found = rings.evaluate(rho * np.cos(turn), rho * np.sin(turn))
    k = 4 * np.pi
    np.testing.assert_allclose(found.height, 0.1 * np.cos(k * rho), rtol=0, atol=5e-16)
    outward = found.slope_x * np.cos(turn) + found.slope_y * np.sin(turn)
    np.testing.assert_allclose(outward, -0.1 * k * np.sin(k * rho), rtol=0, atol=1e-14)
    tiny = rings.evaluate(np.array([1e-200]), np.array([0.0]))
    assert tiny.slope_x == pytest.approx(-0.1 * k * k * 1e-200, rel=1e-14)


def test_rows_of_waves_do_not_change_along_their_crests():
    rows = Ripples(direction=0.4)
    s, t = np.random.default_rng(0).uniform(-0.6, 0.6, (2, 100))
    x, y = s * np.cos(0.4) - t * np.sin(0.4), s * np.sin(0.4) + t * np.cos(0.4)
    np.testing.assert_allclose(rows.evaluate(x, y).height, 0.05 * np.cos(4 * np.pi * s), rtol=0, atol=1e-15)


def test_long_waves_have_their_own_bounds():
    assert Ripples(amplitude=1.0, wavelength=8 * np.sqrt(2)).bounds == pytest.approx((np.cos(np.pi / 4), 1.0))
    assert Ripples(amplitude=1.0, wavelength=8, direction=0.0).bounds == pytest.approx((np.cos(np.pi / 4), 1.0))


def test_steps_are_level_and_rise():
    steps = Steps(count=4, rise=0.1, ramp=0.1)
    terraces = steps.evaluate(np.array([-0.8, -0.4, 0.0, 0.4, 0.8]), np.zeros(5))
    np.testing.assert_allclose(terraces.height, [0, 0.1, 0.2, 0.3, 0.4], rtol=0, atol=1e-16)
    assert (terraces.slope_x == 0).all()
    ramp = steps.evaluate(np.array([-0.6, 0.2]), np.zeros(2))
    np.testing.assert_allclose(ramp.height, [0.05, 0.25], rtol=1e-12)
    np.testing.assert_allclose(ramp.slope_x, 15 / 8, rtol=1e-12)
    x = np.linspace(-1, 1, 5001)
    assert (np.diff(steps.evaluate(x, 0 * x).height) >= -1e-15).all()


def test_ramps_may_touch():
    smooth = Steps(count=3, rise=0.1, ramp=0.5)
    x = np.linspace(-0.74, 0.74, 777)
    found = smooth.evaluate(x, 0 * x)
    assert np.abs(np.diff(found.height)).max() < 0.1 * 15 / 8 / 0.5 * (x[1] - x[0])
    with pytest.raises(InputError, match="overlap"):
        Steps(count=3, ramp=0.51)


def test_cliffs_jump_and_tapered_ones_end():
    x = np.array([-1e-12, 0.0])
    for y, jump in ((0.9, 0.4), (-0.9, 0.4)):
        assert np.diff(Cliffs().evaluate(x, np.full(2, y)).height) == pytest.approx(jump)
    tapered = Cliffs(tapered=True)
    for y, jump in ((0.9, 0.4), (0.5, 0.4), (0.0, 0.2), (-0.5, 0.0), (-0.9, 0.0)):
        assert np.diff(tapered.evaluate(x, np.full(2, y)).height) == pytest.approx(jump)


def test_terrain_in_fifty_digits():
    """Heights and slopes against the sum of waves in mpmath."""
    terrain = Terrain(waves=40, seed=2)
    (kx, ky), phase, amplitude = terrain._waves
    x, y = np.random.default_rng(0).uniform(-1, 1, (2, 10))
    found = terrain.evaluate(x, y)
    with mpmath.workdps(50):
        for i in range(10):
            angle = [
                mpmath.mpf(float(a)) * mpmath.mpf(float(x[i]))
                + mpmath.mpf(float(b)) * mpmath.mpf(float(y[i]))
                + float(p)
                for a, b, p in zip(kx, ky, phase, strict=True)
            ]
            z = sum(float(a) * mpmath.cos(t) for a, t in zip(amplitude, angle, strict=True))
            zx = sum(-float(a) * float(k) * mpmath.sin(t) for a, k, t in zip(amplitude, kx, angle, strict=True))
            zy = sum(-float(a) * float(k) * mpmath.sin(t) for a, k, t in zip(amplitude, ky, angle, strict=True))
            assert abs(float(found.height[i] - z)) < 1e-15
            assert abs(float(found.slope_x[i] - zx)) < 1e-13
            assert abs(float(found.slope_y[i] - zy)) < 1e-13


def test_terrain_stays_in_its_band_and_has_its_spectrum():
    terrain = Terrain(waves=500, longest=1.0, shortest=0.05, hurst=0.7, rms=0.2)
    (kx, ky), _, amplitude = terrain._waves
    k = np.hypot(kx, ky)
    assert k.min() >= 2 * np.pi * (1 - 1e-12)
    assert k.max() <= 2 * np.pi / 0.05 * (1 + 1e-12)
    slope = np.polyfit(np.log(k), np.log(amplitude), 1)[0]
    assert slope == pytest.approx(-0.7, abs=1e-12)
    assert np.sqrt((amplitude**2).sum() / 2) == pytest.approx(0.2)
    # Evenly in log k: half of the waves lie below the geometric mean of the band.
    assert np.mean(k < 2 * np.pi / np.sqrt(0.05)) == pytest.approx(0.5, abs=0.003)


def test_terrain_has_its_height_on_average():
    x, y = np.random.default_rng(1).uniform(-1, 1, (2, 2000))
    mean = np.mean([(Terrain(seed=s, waves=64).evaluate(x, y).height ** 2).mean() for s in range(60)])
    assert np.sqrt(mean) == pytest.approx(0.05, rel=0.1)


def test_terrain_does_not_depend_on_how_it_is_cut(monkeypatch):
    from psstereo_synth.shapes import terrain as module

    x, y = np.random.default_rng(1).uniform(-1, 1, (2, 1000))
    whole = Terrain().evaluate(x, y)
    monkeypatch.setattr(module, "_BLOCK", 128 * 7)
    pieces = Terrain().evaluate(x, y)
    np.testing.assert_allclose(pieces.height, whole.height, rtol=0, atol=1e-15)
    np.testing.assert_allclose(pieces.slope_y, whole.slope_y, rtol=0, atol=1e-13)


LENGTHS = [
    (Plane, "half_width"),
    (Sphere, "radius"),
    (Bowl, "radius"),
    (Ellipsoid, "radius_x"),
    (Ellipsoid, "radius_y"),
    (Ellipsoid, "radius_z"),
    (Cone, "radius"),
    (Cone, "height"),
    (Torus, "major"),
    (Torus, "minor"),
    (Vase, "radius"),
    (Vase, "half_length"),
    (GaussianHills, "steepness"),
    (GaussianHills, "half_width"),
    (Ripples, "amplitude"),
    (Ripples, "wavelength"),
    (Ripples, "half_width"),
    (Steps, "rise"),
    (Steps, "ramp"),
    (Steps, "half_width"),
    (Cliffs, "height"),
    (Cliffs, "half_width"),
    (Terrain, "rms"),
    (Terrain, "longest"),
    (Terrain, "shortest"),
    (Terrain, "half_width"),
]


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
@pytest.mark.parametrize(("kind", "name"), LENGTHS)
def test_lengths_that_mean_nothing_are_refused(kind, name, value):
    with pytest.raises(InputError, match=name.replace("_", " ")) as caught:
        kind(**{name: value})
    assert caught.value.given
    assert caught.value.needed
    assert caught.value.remedy


@pytest.mark.parametrize(
    ("kind", "options"),
    [
        (Plane, {"slope_x": np.nan}),
        (Plane, {"slope_y": np.inf}),
        (Torus, {"major": 0.3, "minor": 0.3}),
        (Vase, {"swell": 1.0}),
        (Vase, {"swell": -0.1}),
        (Vase, {"swell": np.nan}),
        (GaussianHills, {"count": 0}),
        (GaussianHills, {"count": 2.5}),
        (GaussianHills, {"seed": -1}),
        (Ripples, {"direction": np.nan}),
        (Steps, {"count": 0}),
        (Terrain, {"waves": 0}),
        (Terrain, {"waves": True}),
        (Terrain, {"seed": -1}),
        (Terrain, {"hurst": 1.1}),
        (Terrain, {"hurst": np.nan}),
        (Terrain, {"longest": 0.1, "shortest": 0.2}),
    ],
)
def test_other_numbers_that_mean_nothing_are_refused(kind, options):
    with pytest.raises(PsstereoError):
        kind(**options)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32), st.floats(0.0, 1.0), st.floats(0.02, 1.0), st.integers(1, 40), st.floats(0.01, 100.0))
def test_bounds_of_any_terrain_hold(seed, hurst, share, waves, half_width):
    terrain = Terrain(
        seed=seed, hurst=hurst, longest=half_width, shortest=share * half_width, waves=waves, half_width=half_width
    )
    low, high = terrain.bounds
    x, y = np.random.default_rng(seed).uniform(-half_width, half_width, (2, 2000))
    z = terrain.evaluate(x, y).height
    assert low <= z.min()
    assert z.max() <= high
