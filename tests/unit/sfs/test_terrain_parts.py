"""Pieces of terrain from the sun: differences, means over cells, reflectance, windows, shadows, the first exposures."""

import numpy as np
import pytest

from psstereo.brdf import LunarLambert
from psstereo.errors import InputError
from psstereo.lights.solar import from_azimuth
from psstereo.sfs.terrain.albedo import fill_smoothly, smooth_albedo
from psstereo.sfs.terrain.exposure import Exposures, first_exposures
from psstereo.sfs.terrain.reflectance import Ground
from psstereo.sfs.terrain.stencils import Stencils
from psstereo.sfs.terrain.sunlight import clear_of_shadow
from psstereo.sfs.terrain.tie import Tie, block_means
from psstereo.sfs.terrain.windows import windows

UP = np.array([0.0, 0.0, 1.0])


def test_slopes_are_exact_on_parabolas_and_of_sixth_order_inside():
    x, y = np.meshgrid(2.0 * np.arange(14), -3.0 * np.arange(12))
    slope_x, slope_y = Stencils((12, 14), (2.0, 3.0)).slopes(0.3 * x * x - x * y + 2 * y - 0.1 * y * y)
    np.testing.assert_allclose(slope_x, 0.6 * x - y, atol=1e-10)
    np.testing.assert_allclose(slope_y, -x + 2 - 0.2 * y, atol=1e-10)
    errors = []
    for n in (24, 48):
        t = np.arange(n) / n
        heights = np.sin(2 * np.pi * t)[None].repeat(8, 0)
        found = Stencils((8, n), (1 / n, 1 / n)).slopes(heights)[0]
        errors.append(np.abs(found - 2 * np.pi * np.cos(2 * np.pi * t))[:, 4:-4].max())
    assert errors[0] / errors[1] == pytest.approx(64, rel=0.1)


def test_bending_leaves_planes_alone_and_counts_slope_changes():
    rows, columns = np.mgrid[:9, :10].astype(float)
    stencils = Stencils((9, 10), (2.0, 4.0))
    np.testing.assert_allclose(stencils.bend(3 * rows - columns + 5), 0, atol=1e-12)
    x, y = 2.0 * columns, -4.0 * rows
    for heights, energy in ((x * x / 2, 9 * 8), (y * y / 2, 10 * 7), (x * y, 2 * 8 * 9)):
        # One per cell times dx dy = 8 wherever the difference fits in.
        assert np.sum(heights * stencils.bend(heights)) == pytest.approx(8.0 * energy)


def test_plane_waves_see_the_symbols():
    n = 32
    stencils, area = Stencils((n, n), (2.0, 3.0)), np.s_[8:-8, 8:-8]
    a, b = 2 * np.pi * 5 / n, 2 * np.pi * 3 / n
    rows, columns = np.mgrid[:n, :n]
    wave = np.exp(1j * (a * rows + b * columns))
    x, y, bend = stencils.symbols(np.array(a), np.array(b))
    for part in (np.real, np.imag):
        slope_x, slope_y = stencils.slopes(part(wave))
        np.testing.assert_allclose(slope_x[area], part(1j * x * wave)[area], atol=1e-12)
        np.testing.assert_allclose(slope_y[area], part(1j * y * wave)[area], atol=1e-12)
        np.testing.assert_allclose(stencils.bend(part(wave))[area], part(bend * wave)[area], atol=1e-11)


@pytest.mark.parametrize("gaps", [False, True])
def test_the_tie_pulls_means_to_their_targets(gaps):
    rng = np.random.default_rng(1)
    valid = rng.random((10, 13)) > 0.3 if gaps else None
    tie = Tie(block=(4, 5), shape=(10, 13), target=np.full((3, 3), 7.0), weight=np.full((3, 3), 2.0), valid=valid)
    change, other = rng.normal(size=(2, 10, 13))
    assert np.sum(tie.product(change) * other) == pytest.approx(np.sum(change * tie.product(other)))
    inside = np.ones((10, 13), bool) if valid is None else valid
    assert tie.means(change)[1, 0] == pytest.approx(change[4:8, :5][inside[4:8, :5]].mean())
    assert tie.means(change)[2, 2] == pytest.approx(change[8:, 10:][inside[8:, 10:]].mean())

    def energy(z):
        return float(np.sum(2.0 * (tie.means(z) - 7.0) ** 2))

    slope = (energy(change + 1e-4 * other) - energy(change - 1e-4 * other)) / 2e-4
    assert slope == pytest.approx(-2.0 * np.sum(tie.pull(change) * other), rel=1e-6)
    part = tie.window(slice(4, 10), slice(5, 13))
    np.testing.assert_allclose(part.pull(change[4:, 5:]), tie.pull(change)[4:, 5:])


def test_means_over_blocks_are_unknown_where_a_pixel_is():
    field = np.arange(20.0).reshape(4, 5)
    field[0, 0] = np.nan
    np.testing.assert_array_equal(block_means(field, (2, 2)), [[np.nan, 5, np.nan], [13, 15, np.nan]])


@pytest.mark.parametrize("weight", [0.0, 0.4, 1.0, None])
def test_the_ground_is_the_reflectance_and_its_derivatives(weight):
    sun, eye = from_azimuth(np.radians(250.0), np.radians(35.0)), from_azimuth(np.radians(20.0), np.radians(80.0))
    ground = Ground.under(sun, eye, weight)
    p, q = np.random.default_rng(2).uniform(-0.5, 0.5, (2, 5, 6))
    found = ground.shade(p, q)
    normals = np.stack([-p, -q, np.ones_like(p)], axis=-1) / np.sqrt(1 + p * p + q * q)[..., None]
    brdf = LunarLambert(albedo=np.array([1.0]), weight=None if weight is None else np.array([weight]))
    rho = brdf.evaluate(normals.reshape(-1, 3), sun, np.broadcast_to(eye, (30, 3))).reshape(5, 6)
    np.testing.assert_allclose(found.value, np.pi * rho * (normals @ sun), rtol=1e-12)
    for derivative, dp, dq in ((found.along_x, 1e-6, 0), (found.along_y, 0, 1e-6)):
        steps = (ground.shade(p + dp, q + dq).value - ground.shade(p - dp, q - dq).value) / 2e-6
        np.testing.assert_allclose(derivative, steps, atol=1e-8)


def test_windows_cover_everything_once():
    shape = (210, 333)
    total, reached = np.zeros((2, *shape))
    for one in windows(shape, (8, 8), 64, 24):
        assert all(part.start % 8 == 0 for part in one.proper)
        total[one.rows, one.columns] += one.blend[0][:, None] * one.blend[1]
        still = np.ones((one.rows.stop - one.rows.start, one.columns.stop - one.columns.start))
        still[one.inner] = 0
        reached[one.rows, one.columns] += still * one.blend[0][:, None] * one.blend[1]
    np.testing.assert_allclose(total, 1)
    np.testing.assert_array_equal(reached, 0)  # whatever is kept still has no weight
    assert len(windows(shape, (8, 8), None, 24)) == 1


def test_weights_vanish_in_and_beside_shadow():
    share = np.full((9, 12), 0.8)
    share[:, 6:] = 0.0
    share[0, 0] = np.nan
    cast = np.zeros(share.shape, bool)
    cast[:, :2] = True  # predicted, but the image is bright there: the terrain of the moment is wrong
    cast[:, 9:] = True
    weight, around = clear_of_shadow(share, cast)
    np.testing.assert_allclose(weight[4], [1, 1, 1, 1, 0.6, 0.2, 0, 0, 0, 0, 0, 0])
    assert weight[0, 0] == 0
    np.testing.assert_allclose(around[4], [0] * 9 + [1] * 3)


def test_exposures_start_from_a_line_and_refuse_what_follows_no_sun():
    rng = np.random.default_rng(0)
    shade = rng.uniform(0.2, 0.9, (20, 20))
    found = first_exposures([3.0 * shade + 0.5], [shade], ["Image 1"])
    assert found.exposure == pytest.approx(3.0)
    assert found.haze == pytest.approx(0.5)
    level = first_exposures([np.where(shade > 0.5, 2.0, 1.0)], [np.full((20, 20), 0.5)], ["Image 1"])
    assert level.haze == 0
    for image, words in (
        (1 - shade, "azimuth"),
        (rng.random((20, 20)), "follow"),
        (np.full((20, 20), 0.1), "same brightness"),
        (np.full((20, 20), np.nan), "0 known pixels"),
    ):
        with pytest.raises(InputError, match=words):
            first_exposures([shade, image], [shade, shade], ["Image 1", "Image 2"])
    with pytest.raises(InputError, match="puts 0 in the sun"):
        first_exposures([shade], [np.zeros((20, 20))], ["Image 1"])
    moved = Exposures(exposure=np.array([2.0]), haze=np.array([0.1])).moved(np.array([-3.0, 0.5]))
    assert moved.exposure == 1.0  # half at most
    assert moved.haze == pytest.approx(1.1)


def test_gaps_are_filled_by_a_membrane():
    rows, columns = np.mgrid[:12, :15].astype(float)
    plane = 1e4 + 3 * rows - 2 * columns
    known = np.ones(plane.shape, bool)
    known[4:8, 5:10] = False
    found = fill_smoothly(np.where(known, plane, np.nan), known)
    np.testing.assert_allclose(found, plane, atol=1e-2)
    np.testing.assert_array_equal(found[known], plane[known])


def test_albedo_is_smooth_where_stiff_and_has_the_mean_one():
    rng = np.random.default_rng(4)
    evidence, weight = 2.0 + rng.normal(0, 0.1, (16, 16)), np.ones((16, 16))
    weight[3:6] = 0
    loose, stiff = (smooth_albedo(evidence, weight, s, np.ones((16, 16)), threads=1) for s in (1e-6, 1e6))
    used = weight > 0
    np.testing.assert_allclose(loose[used], evidence[used] / evidence[used].mean(), atol=1e-4)
    np.testing.assert_allclose(stiff, 1.0, atol=1e-3)
