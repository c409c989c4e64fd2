"""Terrain from the sun: coarse random terrain becomes fine; holes, shadows, windows; refusals that name the cause."""

import numpy as np
import pytest

from psstereo.brdf import lunar_weight
from psstereo.errors import InputError, OptionError
from psstereo.forward.horizon import shadow_height
from psstereo.lights.solar import from_azimuth
from psstereo.results import Outcome
from psstereo.sfs.terrain.flags import TerrainFlag
from psstereo.sfs.terrain.refine import TerrainOptions, enlarge, refine_terrain
from psstereo.sfs.terrain.tie import block_means
from psstereo_synth.shapes.terrain import Terrain

CELL = (10.0, 12.0)
EXPOSURE, HAZE = (0.8, 1.3, 0.6), (0.05, 0.1, 0.03)


def suns(*angles):
    pairs = np.radians(angles)
    return from_azimuth(pairs[:, 0], pairs[:, 1])


THREE = suns((315, 40), (75, 35), (195, 45))


def ground(size=48, slope=0.35, seed=3):
    """Return heights and exact slopes of random terrain of waves of six cells and more; cells are not square."""
    width = size * CELL[1]
    shape = Terrain(rms=10.0, half_width=width, seed=seed, longest=width / 2, shortest=6 * CELL[0], waves=200)
    x, y = np.meshgrid(CELL[0] * (np.arange(size) - size / 2), -CELL[1] * (np.arange(size) - size / 2))
    found = shape.evaluate(x, y)
    scale = slope / np.sqrt(np.mean(found.slope_x**2 + found.slope_y**2))
    return found.height * scale, found.slope_x * scale, found.slope_y * scale


def render(heights, p, q, toward, *, noise=0.0, lunar=False, albedo=1.0):
    """Return images by formulas of its own, with cast shadows."""
    rng, out = np.random.default_rng(1), []
    for k, sun in enumerate(toward):
        normal = np.stack([-p, -q, np.ones_like(p)]) / np.sqrt(1 + p * p + q * q)
        light, eye = np.maximum(np.tensordot(sun, normal, 1), 0), normal[2]
        part = float(lunar_weight(np.arccos(sun[2]))) if lunar else 0.0
        bright = albedo * light * (2 * part / (light + eye) + 1 - part) * (heights >= shadow_height(heights, CELL, sun))
        out.append(EXPOSURE[k] * (bright + noise * rng.standard_normal(p.shape)) + HAZE[k])
    return np.array(out)


def rms(array):
    return float(np.sqrt(np.nanmean(np.square(array))))


def ratio(result, heights):
    return rms(result.elevation - heights) / rms(result.coarse - heights)


@pytest.fixture(scope="module")
def hills():
    return ground()


@pytest.fixture(scope="module")
def wide():
    return ground(80)


@pytest.mark.parametrize(
    ("count", "lunar", "most"), [(1, False, 0.25), (3, False, 0.06), (1, True, 0.3), (3, True, 0.06)]
)
def test_an_eighth_of_the_resolution_and_suns_give_the_rest(wide, count, lunar, most):
    heights, p, q = wide
    images = render(heights, p, q, THREE[:count], noise=0.005, lunar=lunar)
    result = refine_terrain(
        block_means(heights, (8, 8)),
        images,
        THREE[:count],
        cell=CELL,
        reflectance="lunar-lambert" if lunar else "lambert",
    )
    assert ratio(result, heights) < most
    assert result.outcome is Outcome.SOLVED
    np.testing.assert_allclose(result.exposure, EXPOSURE[:count], rtol=0.08)
    np.testing.assert_allclose(result.haze, HAZE[:count], atol=0.05)
    assert rms(result.residuals) < 0.01
    np.testing.assert_allclose(np.linalg.norm(result.normals, axis=-1), 1)
    slopes = -result.normals[..., :2] / result.normals[..., 2:]
    assert rms(slopes[..., 0] - p) < 0.07
    assert rms(slopes[..., 1] - q) < 0.12


def test_brightness_and_lengths_may_have_any_unit(hills):
    heights, p, q = hills
    images = render(heights, p, q, THREE, noise=0.005)
    coarse = block_means(heights, (8, 8))
    one = refine_terrain(coarse, images, THREE, cell=CELL)
    other = refine_terrain(1e-3 * coarse + 4.0, 200.0 * images, 7.0 * THREE, cell=(CELL[0] * 1e-3, CELL[1] * 1e-3))
    np.testing.assert_allclose((other.elevation - 4.0) * 1e3, one.elevation, atol=1e-3)
    np.testing.assert_allclose(other.exposure, 200 * one.exposure, rtol=1e-5)


def test_cast_shadows_are_left_out_and_told(hills):
    heights, p, q = hills
    low = suns((315, 18), (75, 15), (195, 20))
    images = render(heights, p, q, low, noise=0.005)
    result = refine_terrain(block_means(heights, (8, 8)), images, low, cell=CELL)
    assert ratio(result, heights) < 0.12
    for sun, shadow in zip(low, result.shadows, strict=True):
        dark = heights < shadow_height(heights, CELL, sun)
        assert dark.mean() > 0.05
        assert (shadow | ~dark).mean() > 0.98
        assert (~shadow | dark).mean() > 0.85
    shadowed = (result.flags & TerrainFlag.SHADOWED) > 0
    np.testing.assert_array_equal(shadowed, result.shadows.any(axis=0))
    np.testing.assert_array_equal(np.isnan(result.residuals), result.shadows)
    unseen = (result.flags & TerrainFlag.NO_IMAGE) > 0
    np.testing.assert_array_equal(unseen, result.shadows.all(axis=0))


def test_an_elevation_on_the_images_grid_is_refined_too(hills):
    heights, p, q = hills
    images = render(heights, p, q, THREE, noise=0.005)
    smooth = enlarge(block_means(heights, (8, 8)), (8, 8))
    plain = refine_terrain(smooth, images, THREE, cell=CELL)
    assert ratio(plain, heights) < 0.6
    told = refine_terrain(smooth, images, THREE, cell=CELL, options=TerrainOptions(support=8))
    assert ratio(told, heights) < 0.35


def test_windows_leave_no_seams():
    heights, p, q = ground(128)
    images = render(heights, p, q, THREE[:2], noise=0.005)
    coarse = block_means(heights, (8, 8))
    whole = refine_terrain(coarse, images, THREE[:2], cell=CELL)
    tiled = refine_terrain(coarse, images, THREE[:2], cell=CELL, options=TerrainOptions(tile=64, overlap=24, threads=2))
    difference = tiled.elevation - whole.elevation
    assert rms(difference) < 0.2 * rms(whole.elevation - heights)
    ramps = np.abs(np.diff(difference, axis=1)).mean(axis=0)[36:92]
    assert ramps.max() < 0.1 * rms(whole.elevation - heights)
    np.testing.assert_allclose(tiled.exposure, whole.exposure, rtol=0.01)


def test_holes_are_flagged_and_only_what_nobody_knows_is_nan(hills):
    heights, p, q = hills
    images = render(heights, p, q, THREE[:2], noise=0.005)
    images[:, 20:26, 20:28] = np.nan
    images[1, 40:44, 40:44] = np.nan
    coarse = block_means(heights, (8, 8))
    coarse[3, 2:5] = np.nan
    result = refine_terrain(coarse, images, THREE[:2], cell=CELL)
    unknown = np.zeros(heights.shape, bool)
    unknown[24:26, 20:28] = True
    np.testing.assert_array_equal(np.isnan(result.elevation), unknown)
    np.testing.assert_array_equal((result.flags & TerrainFlag.UNKNOWN) > 0, unknown)
    assert result.outcome is Outcome.PARTIAL
    assert ((result.flags[24:32, 16:40] & TerrainFlag.NO_ELEVATION) > 0).all()
    assert ((result.flags[20:26, 20:28] & TerrainFlag.NO_IMAGE) > 0).all()
    assert ((result.flags[40:44, 40:44] & TerrainFlag.MISSING_SAMPLE) > 0).all()
    known = np.isfinite(result.elevation)
    assert rms((result.elevation - heights)[known]) < 0.3 * rms(result.coarse - heights)


def test_albedo_that_varies_slowly_is_found_beside_the_heights(hills):
    heights, p, q = hills
    rows, columns = np.mgrid[:48, :48] / 48
    albedo = 1 + 0.25 * np.sin(2 * np.pi * columns) * np.cos(np.pi * rows)
    albedo /= albedo.mean()
    images = render(heights, p, q, THREE, noise=0.002, albedo=albedo)
    coarse = block_means(heights, (8, 8))
    constant = refine_terrain(coarse, images, THREE, cell=CELL)
    free = refine_terrain(coarse, images, THREE, cell=CELL, options=TerrainOptions(albedo_step=0.02))
    assert rms(free.albedo - albedo) < 0.3 * rms(1 - albedo)
    assert ratio(free, heights) < 0.6 * ratio(constant, heights)
    np.testing.assert_array_equal(constant.albedo, 1)


def test_too_few_rounds_are_told(hills):
    heights, p, q = hills
    images = render(heights, p, q, THREE[:1])
    reports = []
    result = refine_terrain(
        block_means(heights, (8, 8)),
        images,
        THREE[:1],
        cell=CELL,
        options=TerrainOptions(rounds=1),
        progress=lambda *report: reports.append(report),
    )
    assert result.outcome is Outcome.NOT_CONVERGED
    assert ((result.flags & TerrainFlag.NOT_CONVERGED) > 0).all()
    assert reports[-1][1] == reports[-1][2]


def test_an_elevation_trusted_too_much_is_noted_and_a_level_one_tells_no_exposure(hills):
    heights, p, q = hills
    images = render(heights, p, q, THREE)
    exact = refine_terrain(
        block_means(heights, (8, 8)), images, THREE, cell=CELL, options=TerrainOptions(elevation_error=1e-9)
    )
    assert exact.outcome is Outcome.SOLVED
    assert ratio(exact, heights) < 0.06
    assert "instead of 1e-09" in exact.facts["notes"][0]
    level = refine_terrain(np.zeros((6, 6)), images, THREE, cell=CELL)
    sentence = next(one.sentence for one in level.assumptions if one.name == "exposure")
    assert "level" in sentence
    np.testing.assert_array_equal(level.haze, 0)


def test_suns_that_tell_little_are_noted(hills):
    heights, p, q = hills
    same = suns((315, 40), (316, 40))
    images = render(heights, p, q, same)
    coarse = block_means(heights, (8, 8))
    result = refine_terrain(coarse, images, same, cell=CELL)
    assert ratio(result, heights) < 0.3
    assert "image 1 within 2°" in result.facts["notes"][0]
    names = [one.name for one in result.assumptions]
    assert len(names) == len(set(names)) == 7


CASES = {
    "below the horizon": ({"suns": suns((315, 40), (75, -1), (195, 45))}, "image 2 stands -1.00°"),
    "two suns": ({"suns": THREE[:2]}, "there are 3 images"),
    "sizes": ({"images": [np.ones((64, 64)), np.ones((64, 60)), np.ones((64, 64))]}, "60 × 64"),
    "no images": ({"images": []}, "No image"),
    "colours": ({"images": np.ones((3, 64, 64, 3))}, "image 1"),
    "elevation": ({"elevation": np.full((8, 8), np.nan)}, "no number"),
    "infinite": ({"elevation": np.full((8, 8), np.inf)}, "infinite"),
    "grid": ({"elevation": np.zeros((9, 8))}, "8 × 9 cells"),
    "finer": ({"elevation": np.zeros((128, 128))}, "128 × 128 cells"),
    "zero cell": ({"cell": (10.0, 0.0)}, "in size"),
    "one cell": ({"cell": (10.0,)}, "in size"),
    "nan cell": ({"cell": (10.0, np.nan)}, "in size"),
    "view": ({"view": (0.0, 0.0, -1.0)}, "camera of image 1"),
}


@pytest.mark.parametrize("case", CASES)
def test_hostile_input_is_refused(hills, case):
    heights, p, q = hills
    change, words = CASES[case]
    given = {
        "elevation": block_means(heights, (8, 8)),
        "images": render(heights, p, q, THREE),
        "suns": THREE,
        "cell": CELL,
        **change,
    }
    with pytest.raises(InputError, match=words) as caught:
        refine_terrain(**given)
    assert caught.value.needed
    assert caught.value.remedy


def test_images_that_show_no_sun_are_refused(hills):
    heights, p, q = hills
    coarse = block_means(heights, (8, 8))
    images = render(heights, p, q, THREE)
    dark = images.copy()
    dark[1] = 0.1
    with pytest.raises(InputError, match=r"Image 2 has the same brightness, 0\.1"):
        refine_terrain(coarse, dark, THREE, cell=CELL)
    noise = images.copy()
    noise[2] = np.random.default_rng(0).normal(0.1, 0.01, heights.shape)
    with pytest.raises(InputError, match="Image 3 does not grow brighter"):
        refine_terrain(coarse, noise, THREE, cell=CELL)
    turned = suns((135, 40), (75, 35), (195, 45))
    with pytest.raises(InputError, match="clockwise from north"):
        refine_terrain(coarse, images, turned, cell=CELL)


def test_options_without_meaning_are_refused(hills):
    heights, p, q = hills
    for options in (
        {"noise": 0.0},
        {"tile": 10},
        {"tile": 96.0},
        {"lunar_weight": 1.5},
        {"rounds": 0},
        {"roughness": np.nan},
        {"overlap": -1},
    ):
        with pytest.raises(OptionError, match=next(iter(options))):
            TerrainOptions(**options)
    given = block_means(heights, (8, 8)), render(heights, p, q, THREE), THREE
    with pytest.raises(OptionError, match="hapke"):
        refine_terrain(*given, cell=CELL, reflectance="hapke")
    with pytest.raises(OptionError, match="lunar weight"):
        refine_terrain(*given, cell=CELL, options=TerrainOptions(lunar_weight=0.5))
    with pytest.raises(OptionError, match="support"):
        refine_terrain(*given, cell=CELL, options=TerrainOptions(support=4))
