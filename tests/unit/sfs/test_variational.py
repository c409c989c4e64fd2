import numpy as np
import pytest

from psstereo.camera import Orthographic, Pinhole
from psstereo.depth import Prior
from psstereo.errors import InputError, OptionError, UnsupportedError
from psstereo.flags import Flag
from psstereo.lights import Directional, Harmonics, Led
from psstereo.results import DepthKind, Outcome
from psstereo.sfs.assumption import Basis
from psstereo.sfs.image import ShadedImage
from psstereo.sfs.variational import Variational
from psstereo_synth.shapes import GaussianHills, Vase
from psstereo_synth.view import centred_orthographic, centred_pinhole, view_relief

SUN = Directional(direction=np.array([0.4, 0.3, 0.866]), strength=np.ones(1))
FOUR = Directional(direction=np.array([0.4, 0.3, 0.866]), strength=np.array([4.0]))
HILLS = GaussianHills()
SKY = Harmonics(coefficients=np.array([1.0, 0.1, 0.3, 0.25, 0.05, 0.02, -0.03, 0.05, 0.02]))


def view_of(relief, n, *, pinhole=False):
    camera, pose = centred_pinhole((n, n), focal=1.6 * n, distance=3.5) if pinhole else centred_orthographic((n, n))
    return view_relief(relief, camera, pose, (n, n))


def border(mask):
    inner = np.pad(mask, 1)
    return mask & ~(inner[:-2, 1:-1] & inner[2:, 1:-1] & inner[1:-1, :-2] & inner[1:-1, 2:])


def lit(normals, light):
    return np.nan_to_num(light.irradiance(np.zeros(3), np.nan_to_num(normals))[..., 0])


def picture(view, light=SUN, *, held=True, **more):
    mask = view.geometry.mask
    known = np.where(border(mask), view.depth, np.nan) if held else None
    image = lit(view.normals(), light)
    return ShadedImage(
        **{"image": image, "light": light, "mask": mask, "camera": view.camera, "heights": known, **more}
    )


def mean_angle(result, view):
    ours, true = result.normals.normals, view.normals()
    angle = 2.0 * np.arctan2(np.linalg.norm(ours - true, axis=-1), np.linalg.norm(ours + true, axis=-1))
    return np.degrees(np.nanmean(angle))


@pytest.fixture(scope="module")
def hills():
    return view_of(HILLS, 96)


@pytest.fixture(scope="module")
def small():
    return view_of(HILLS, 40)


@pytest.mark.parametrize("light", [SUN, SKY], ids=["sun", "sky"])
def test_hills_are_found_from_a_flat_start(hills, light):
    found = Variational().recover(picture(hills, light))
    assert found.normals.outcome is Outcome.SOLVED
    assert mean_angle(found, hills) < 0.5
    assert found.depth.kind is DepthKind.HEIGHT
    np.testing.assert_allclose(found.depth.depth, hills.depth, rtol=0, atol=0.01)
    assert found.normals.facts["data_residual"] < 1e-3


def test_vase_with_its_shadow_is_found_from_a_flat_start():
    # Light across the axis: one side lies in its own shadow, and the ridge that faces the light could be a groove.
    view = view_of(Vase(), 96)
    light = Directional(direction=np.array([0.5, 0.0, 0.8660254]), strength=np.ones(1))
    found = Variational().recover(picture(view, light))
    assert mean_angle(found, view) < 1.5
    dark = picture(view, light).irradiance <= 0.02
    assert ((found.normals.flags[dark] & Flag.UNLIT) > 0).all()


def test_error_falls_with_the_size_of_the_pixel(hills):
    halves = [view_of(HILLS, 48), hills]
    errors = [mean_angle(Variational().recover(picture(view)), view) for view in halves]
    assert errors[1] < 0.6 * errors[0]


def test_pinhole_distances_are_metric_with_known_ones():
    view = view_of(HILLS, 96, pinhole=True)
    found = Variational().recover(picture(view))
    assert found.depth.kind is DepthKind.DISTANCE
    assert mean_angle(found, view) < 0.7
    np.testing.assert_allclose(found.depth.depth, view.depth, rtol=3e-3)


def test_pinhole_normals_are_those_of_the_points():
    # Whatever the surface: normals must be across its points' differences.
    camera = Pinhole(fx=90.0, fy=70.0, cx=11.0, cy=25.0, skew=0.4)
    rows, columns = np.indices((40, 40))
    truth = 300.0 + 0.6 * columns - 0.4 * rows
    found = Variational().recover(
        ShadedImage(
            image=np.full((40, 40), 0.7),
            light=SUN,
            camera=camera,
            prior=Prior(depth=truth, sigma=1e-3, unit="mm"),
        )
    )
    assert found.depth.unit == "mm"
    np.testing.assert_allclose(found.depth.depth, truth, rtol=1e-5)
    points = camera.points(truth)
    across, down = points[1:-1, 2:] - points[1:-1, :-2], points[2:, 1:-1] - points[:-2, 1:-1]
    normal = np.cross(down, across)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    np.testing.assert_allclose(found.normals.normals[1:-1, 1:-1], normal, atol=1e-3)


def test_coarse_prior_gives_normals_within_a_degree():
    view = view_of(HILLS, 128)
    blocks = view.depth.reshape(8, 16, 8, 16).mean(axis=(1, 3))
    place = np.clip((np.arange(128) - 7.5) / 16, 0, 7)
    low = np.minimum(place.astype(int), 6)
    share = place - low
    rows = blocks[low] * (1 - share)[:, None] + blocks[low + 1] * share[:, None]
    coarse = rows[:, low] * (1 - share) + rows[:, low + 1] * share
    error = float(np.sqrt(np.mean((coarse - view.depth) ** 2)))
    # A block's error is the same at its 256 pixels: as a single one it counts with 16 times its size.
    prior = Prior(depth=coarse, sigma=16 * error, unit=view.camera.unit)
    found = Variational().recover(picture(view, prior=prior))
    assert mean_angle(found, view) < 1.0
    assert np.sqrt(np.mean((found.depth.depth - view.depth) ** 2)) < 0.2 * error


def test_prior_counts_by_its_own_error(small):
    wrong = Prior(depth=np.full((40, 40), 0.5), sigma=np.full((40, 40), 1e-4), unit="relative")
    near = Variational().recover(picture(small, held=False, prior=wrong))
    far = Variational().recover(picture(small, held=False, prior=Prior(depth=wrong.depth, sigma=9.0, unit="relative")))
    assert np.abs(near.depth.depth - 0.5).max() < 5e-3
    assert np.ptp(far.depth.depth) > 0.1


def test_known_heights_are_kept(small):
    found = Variational().recover(picture(small))
    edge = border(np.ones((40, 40), bool))
    np.testing.assert_allclose(found.depth.depth[edge], small.depth[edge], rtol=0, atol=1e-12)


@pytest.mark.parametrize(("noise", "smoothness", "limit"), [(0.01, 0.1, 1.5), (0.05, 1.0, 4.0)])
def test_noise_asks_for_smoothness(hills, noise, smoothness, limit):
    rng = np.random.default_rng(3)
    image = picture(hills).image + noise * rng.normal(size=(96, 96))
    found = Variational(smoothness=smoothness).recover(picture(hills, image=image))
    assert mean_angle(found, hills) < limit
    over = image > 1.0
    assert over.any() == bool((found.normals.flags & Flag.OVER_BRIGHT).any())


def test_relief_chooses_between_bump_and_hollow():
    # A light straight above tells nothing of the side: the option alone does.
    rows, columns = np.indices((48, 48)) - 23.5
    slopes = np.stack([0.5 * columns / 24, -0.5 * rows / 24, np.ones((48, 48))], axis=-1)
    normals = slopes / np.linalg.norm(slopes, axis=-1, keepdims=True)
    light = Directional(direction=np.array([0.0, 0.0, 1.0]), strength=np.ones(1))
    for relief, sign in (("convex", 1.0), ("concave", -1.0)):
        found = Variational(relief=relief).recover(ShadedImage(image=normals[..., 2], light=light))
        middle, corner = found.depth.depth[24, 24], found.depth.depth[2, 2]
        assert sign * (middle - corner) > 5.0
        stated = {one.name: one for one in found.assumptions}
        assert stated["relief"].basis is Basis.ASSUMED
        assert stated["boundary"].basis is Basis.ASSUMED


def test_energy_never_rises(hills):
    facts = Variational().recover(picture(hills)).normals.facts
    assert facts["energy"] < facts["energy_at_start"]


def test_step_limit_is_reported(hills):
    found = Variational(max_steps=1, tolerance=1e-9).recover(picture(hills))
    assert found.normals.outcome is Outcome.NOT_CONVERGED
    assert found.depth.outcome is Outcome.NOT_CONVERGED
    assert (found.normals.flags & Flag.NOT_CONVERGED).all()


def test_area_flattens(small):
    taut = Variational(area=1.0).recover(picture(small, held=False))
    plain = Variational().recover(picture(small, held=False))
    assert np.ptp(taut.depth.depth) < 0.5 * np.ptp(plain.depth.depth)


def test_dark_pixels_are_a_bound_or_say_nothing(small):
    image = picture(small).image.copy()
    image[15:25, 15:25] = 0.0
    bound = Variational().recover(picture(small, image=image))
    silent = Variational(shadows="unknown").recover(picture(small, image=image))
    hole = np.zeros((40, 40), bool)
    hole[15:25, 15:25] = True
    for found in (bound, silent):
        np.testing.assert_array_equal((found.normals.flags & Flag.UNLIT) > 0, hole)
    inner = np.s_[18:22, 18:22]
    assert lit(bound.normals.normals, SUN)[inner].mean() < 0.5
    # Without a say, the hole is bridged smoothly: the true surface is lit there.
    assert mean_angle(silent, small) < 2.0


def test_threads_and_units_do_not_matter(hills):
    plain = Variational().recover(picture(hills))
    threads = Variational(threads=3).recover(picture(hills))
    np.testing.assert_array_equal(threads.depth.depth, plain.depth.depth)
    doubled = Variational().recover(picture(hills, image=8.0 * picture(hills).image, light=FOUR, albedo=2.0))
    np.testing.assert_array_equal(doubled.depth.depth, plain.depth.depth)


def hostile(kind, small):
    rng = np.random.default_rng(5)
    image = picture(small).image
    return {
        "bright": 1.4 * image,
        "random": rng.random((40, 40)),
        "staircase": np.round(4 * image) / 4,
        "flat": np.full((40, 40), 0.866),
        "facing": np.ones((40, 40)),
        "hot": np.where(rng.random((40, 40)) < 0.02, 1e6, image),
        "half dark": np.where(np.arange(40) < 20, 0.0, image),
        "one pixel": np.where(np.arange(1600).reshape(40, 40) == 500, image, np.nan),
        "holes": np.where(rng.random((40, 40)) < 0.4, np.nan, image),
        "row": image[:1],
        "column": image[:, :1],
        "corner": image[:2, :2],
    }[kind]


@pytest.mark.parametrize(
    "kind",
    [
        "bright",
        "random",
        "staircase",
        "flat",
        "facing",
        "hot",
        "half dark",
        "one pixel",
        "holes",
        "row",
        "column",
        "corner",
    ],
)
def test_every_number_is_finite_or_flagged(kind, small):
    image = ShadedImage(image=hostile(kind, small), light=SUN)
    found = Variational(max_steps=8).recover(image)
    flags, inside = found.normals.flags, image.inside
    lost = np.isnan(found.normals.normals).any(axis=-1)
    assert (flags[inside & lost] & np.uint16(Flag.NOT_FINITE) > 0).all()
    assert (flags[inside & np.isnan(found.depth.depth)] & np.uint16(Flag.NO_DEPTH) > 0).all()
    assert np.isnan(found.depth.depth[~inside]).all()
    lengths = np.linalg.norm(found.normals.normals[inside & ~lost], axis=-1)
    np.testing.assert_allclose(lengths, 1.0, rtol=1e-12)


def test_islands_are_numbered_and_placed(small):
    mask = np.ones((40, 40), bool)
    mask[:, 18:20] = False
    heights = np.where(np.arange(40) < 2, small.depth, np.nan)
    found = Variational().recover(picture(small, mask=mask, heights=heights))
    components = found.depth.components
    assert components[0, 0] == 1
    assert components[0, 30] == 2
    assert abs(found.depth.depth[:, 20:].mean()) < 1e-9
    assert abs(found.depth.depth[:, :18].mean() - small.depth[:, :18].mean()) < 0.05
    assert found.normals.facts["untied_components"] == 1
    assert "1 piece of the mask" in {one.name: one.sentence for one in found.assumptions}["boundary"]


def test_grazing_light_stays_on_the_surface(small):
    light = Directional(direction=np.array([0.94, 0.2, 0.25]), strength=np.ones(1))
    found = Variational().recover(picture(small, light))
    assert mean_angle(found, small) < 3.0


def test_no_light_at_all_is_refused():
    with pytest.raises(InputError, match="must receive light"):
        Variational().recover(ShadedImage(image=np.full((9, 9), 0.01), light=SUN))
    with pytest.raises(InputError):
        Variational().recover(ShadedImage(image=np.zeros((9, 9)), light=SUN))


def test_lamps_are_refused():
    lamp = Led(position=np.zeros(3), axis=np.array([0.0, 0.0, -1.0]), mu=0.0, flux=np.ones(1))
    with pytest.raises(UnsupportedError, match="variational"):
        Variational().recover(ShadedImage(image=np.ones((9, 9)), light=lamp))


@pytest.mark.parametrize(
    "options",
    [
        {"smoothness": 0.0},
        {"smoothness": np.nan},
        {"area": -1.0},
        {"relief": "round"},
        {"shadows": "cast"},
        {"dark": 1.0},
        {"tolerance": 0.0},
        {"max_steps": 0},
        {"threads": 0},
    ],
)
def test_bad_options_are_refused(options):
    with pytest.raises(OptionError):
        Variational(**options)


def test_bad_heights_and_priors_are_refused():
    plain, pinhole = np.full((9, 9), 0.8), Pinhole(fx=20.0, fy=20.0, cx=4.0, cy=4.0)
    ones = np.ones((9, 9))
    for more in (
        {"heights": np.full((9, 9), np.inf)},
        {"heights": -ones, "camera": pinhole},
        {"prior": Prior(depth=ones[:3], sigma=1.0, unit="px")},
        {"prior": Prior(depth=ones, sigma=0.0, unit="px")},
        {"prior": Prior(depth=ones, sigma=1.0, unit="mm")},
        {"prior": Prior(depth=-ones, sigma=1.0, unit="mm"), "camera": pinhole},
    ):
        with pytest.raises(InputError):
            Variational().recover(ShadedImage(**{"image": plain, "light": SUN, "camera": Orthographic(), **more}))


def test_sky_polynomial_is_the_irradiance():
    from psstereo.kernels.shading_step import shade
    from psstereo.sfs.variational_light import light_polynomial

    rng = np.random.default_rng(8)
    normals = rng.normal(size=(3, 5000))
    polynomial, greatest = light_polynomial(SKY)
    truth = SKY.irradiance(np.zeros(3), (normals / np.linalg.norm(normals, axis=0)).T)[:, 0]
    np.testing.assert_allclose(greatest * shade(normals, polynomial), truth, rtol=1e-12)
    assert 0.999 * greatest < truth.max() <= greatest * (1 + 1e-12)
