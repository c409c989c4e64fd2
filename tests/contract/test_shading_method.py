"""What every method of shape from shading promises."""

from dataclasses import replace

import numpy as np
import pytest

from psstereo.camera import Orthographic, Pinhole
from psstereo.depth import Prior
from psstereo.errors import InputError, UnsupportedError
from psstereo.flags import Flag
from psstereo.lights import Directional, Harmonics, Led, real_harmonics
from psstereo.results import DepthKind, Outcome
from psstereo.sfs import SHADING_METHODS, Basis, ShadedImage

SHAPE = (24, 28)
SUN = Directional(direction=np.array([0.5, 0.3, 0.81]), strength=np.array([0.8]))
EYE_LAMP = Led(position=np.zeros(3), axis=np.array([0.0, 0.0, -1.0]), mu=0.0, flux=np.array([2.0]))
SKY = Harmonics(coefficients=np.array([0.3, 0.05, 0.15, 0.08, 0.0, 0.0, 0.02, 0.0, 0.0]))
CAMERAS = {Orthographic: Orthographic(), Pinhole: Pinhole(fx=60.0, fy=60.0, cx=13.5, cy=11.5)}
LIGHTS = {Directional: SUN, Led: EYE_LAMP, Harmonics: SKY}


def hill(light, camera, bump=4.0):
    """Return the image of a hill: heights over the image plane, or distances of about 1 from the lamp."""
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float)
    height = bump * np.exp(-((columns - 13.0) ** 2 + (rows - 11.0) ** 2) / 40.0)
    depth = height if isinstance(camera, Orthographic) else 1.0 - height / 60.0
    points = camera.points(depth)
    across, down = np.gradient(points, axis=1), np.gradient(points, axis=0)
    normals = np.cross(across, -down)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return ShadedImage(image=light.irradiance(points, normals)[..., 0], light=light, camera=camera)


CASES = [
    pytest.param(method(), LIGHTS[light], CAMERAS[camera], id=f"{name}-{light.name}-{camera.name}")
    for name, method in SHADING_METHODS.items()
    for light in method.lights
    for camera in method.cameras
    if not (light is Led and camera is Orthographic)
]
ONE_EACH = [case for place, case in enumerate(CASES) if place == 0 or case.values[0] != CASES[place - 1].values[0]]
every_case = pytest.mark.parametrize(("method", "light", "camera"), CASES)
every_method = pytest.mark.parametrize(("method", "light", "camera"), ONE_EACH)


def check_honest(result, shape=SHAPE):
    """Check that every pixel is a number, or has a flag that says why not."""
    normals, depth, flags = result.normals.normals, result.depth.depth, result.normals.flags
    assert normals.shape == (*shape, 3)
    assert depth.shape == flags.shape == shape
    assert flags.dtype == np.uint16
    lost = np.isnan(normals).any(axis=-1)
    assert (flags[lost] & ~np.uint16(Flag.OVER_BRIGHT) != 0).all()
    assert (flags[np.isnan(depth)] & np.uint16(Flag.NO_DEPTH | Flag.OUTSIDE_MASK) != 0).all()
    np.testing.assert_allclose(np.linalg.norm(normals[~lost], axis=-1), 1.0, rtol=1e-9)
    assert not np.isinf(depth).any()


@every_case
def test_the_result_is_whole_and_its_assumptions_are_named(method, light, camera):
    result = method.recover(hill(light, camera))
    check_honest(result)
    assert {"light", "albedo", "ambient"} <= {one.name for one in result.assumptions}
    assert any(one.basis is Basis.ASSUMED for one in result.assumptions)
    assert all(one.sentence.endswith(".") for one in result.assumptions)
    wanted = DepthKind.HEIGHT if isinstance(camera, Orthographic) else DepthKind.DISTANCE
    assert result.depth.kind is wanted
    assert result.normals.facts["method"] == method.name
    assert np.isnan(result.normals.uncertainty).all()


@every_case
def test_twice_the_light_shows_the_same_surface(method, light, camera):
    image = hill(light, camera)
    brighter = replace(image, image=0.25 + 1.5 * image.image, albedo=1.5, ambient=0.25)
    one, other = method.recover(image), method.recover(brighter)
    # Descents that end where little is left to gain end a little elsewhere.
    span = np.nanmax(one.depth.depth) - np.nanmin(one.depth.depth)
    np.testing.assert_allclose(other.depth.depth, one.depth.depth, rtol=0, atol=0.01 * span)
    np.testing.assert_allclose(other.normals.albedo[one.normals.albedo > 0], 1.5)


@every_method
def test_threads_and_repetition_change_nothing(method, light, camera):
    image = hill(light, camera)
    one, other = method.recover(image), replace(method, threads=3).recover(image)
    np.testing.assert_array_equal(other.depth.depth, one.depth.depth)
    np.testing.assert_array_equal(other.normals.normals, one.normals.normals)


@every_case
def test_impossible_and_missing_light_is_flagged(method, light, camera):
    image = hill(light, camera)
    values = image.image.copy()
    values[5, 6], values[14, 20] = 50.0 * values.max(), 0.0
    result = method.recover(replace(image, image=values))
    check_honest(result)
    nearer = isinstance(light, Led)  # under a lamp nothing is too bright to be near enough
    assert nearer or result.normals.flags[5, 6] & Flag.OVER_BRIGHT
    assert result.normals.flags[14, 20] & Flag.UNLIT
    assert not result.normals.flags[8, 8] & (Flag.OVER_BRIGHT | Flag.UNLIT)


@every_method
@pytest.mark.parametrize("what", ["flat", "noise", "staircase", "raking"])
def test_awkward_images_are_solved_or_refused_in_words(method, light, camera, what):
    image = hill(light, camera)
    values, rng = image.image, np.random.default_rng(4)
    if what == "flat":
        values = np.full(SHAPE, values.max())
    elif what == "noise":
        values = values + rng.normal(0.0, 0.2 * values.max(), SHAPE)
    elif what == "staircase":
        values = np.round(values / values.max() * 10) / 10 * values.max()
    else:
        light = Directional(direction=np.array([1.0, 0.0, 0.02]), strength=np.array([1.0]))
        values = hill(light, camera).image if isinstance(camera, Orthographic) else values
        light = light if isinstance(camera, Orthographic) else image.light
    try:
        result = method.recover(replace(image, image=values, light=light))
    except UnsupportedError:
        assert what == "raking"
        return
    check_honest(result)
    assert result.normals.outcome in Outcome


@every_method
def test_masks_leave_nan_outside(method, light, camera):
    image = hill(light, camera)
    mask = np.ones(SHAPE, bool)
    mask[:, :3], mask[9:12, 15:19] = False, False
    if not method.any_mask:
        with pytest.raises(UnsupportedError, match="mask"):
            method.recover(replace(image, mask=mask))
        return
    result = method.recover(replace(image, mask=mask))
    check_honest(result)
    assert np.isnan(result.depth.depth[~mask]).all()
    assert (result.normals.flags[~mask] == Flag.OUTSIDE_MASK).all()
    assert np.isfinite(result.normals.normals[mask]).mean() > 0.9


@every_method
def test_a_single_pixel_and_a_single_row_are_solved(method, light, camera):
    image = hill(light, camera)
    row = method.recover(ShadedImage(image=image.image[:1], light=light, camera=camera))
    check_honest(row, (1, SHAPE[1]))
    one = method.recover(ShadedImage(image=image.image[:1, :1], light=light, camera=camera))
    check_honest(one, (1, 1))


@every_method
def test_what_the_method_does_not_regard_is_refused(method, light, camera):
    image = hill(light, camera)
    with pytest.raises(InputError):
        method.recover(replace(image, image=np.zeros(SHAPE)))
    if not method.takes_heights:
        with pytest.raises(UnsupportedError, match="known heights"):
            method.recover(replace(image, heights=np.zeros(SHAPE)))
    if not method.takes_prior:
        with pytest.raises(UnsupportedError, match="prior"):
            method.recover(replace(image, prior=Prior(depth=np.ones(SHAPE), sigma=1.0, unit="px")))
    for kind, other in LIGHTS.items():
        if not issubclass(kind, method.lights):
            with pytest.raises(UnsupportedError, match=kind.name):
                method.recover(replace(image, light=other))


@pytest.mark.parametrize(
    "change",
    [
        {"image": np.zeros((4, 4, 3))},
        {"image": np.zeros(SHAPE, int)},
        {"mask": np.ones((3, 3), bool)},
        {"mask": np.zeros(SHAPE, bool)},
        {"albedo": -1.0},
        {"albedo": np.full(SHAPE, np.nan)},
        {"heights": np.zeros((2, 2))},
        {"ambient": np.inf},
    ],
)
def test_hostile_images_are_refused(change):
    with pytest.raises(InputError):
        replace(hill(SUN, Orthographic()), **change)


def test_lights_of_several_channels_are_refused():
    with pytest.raises(UnsupportedError, match="3 channels"):
        replace(hill(SUN, Orthographic()), light=Directional(direction=np.array([0, 0, 1.0]), strength=np.ones(3)))


def test_the_sky_of_these_tests_is_light():
    directions = np.random.default_rng(1).normal(size=(50, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    assert (real_harmonics(directions) @ SKY.coefficients > 0).all()
