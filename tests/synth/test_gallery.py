"""The named scenes: each renders, and is what its sentence says."""

import numpy as np
import pytest

from psstereo.camera import Orthographic, Pinhole
from psstereo.errors import OptionError, RigError
from psstereo.lights import Disc, Led, Sun
from psstereo.metrics import angular_error
from psstereo.normals import GATES, LeastSquares, estimate_normals
from psstereo_synth.gallery import GALLERY, gallery_scene, summaries
from psstereo_synth.rendering import render
from psstereo_synth.scenes.file import Changes

SMALL = Changes(size=(48, 48))


@pytest.fixture(scope="module")
def rendered():
    """All scenes at 48 × 48 pixels, each rendered when it is first asked for."""
    known = {}

    def get(name):
        if name not in known:
            made = gallery_scene(name, SMALL)
            known[name] = made, render(made)
        return known[name]

    return get


def steps(rendering):
    return {step.name: step.done for step in rendering.steps}


def degrees(capture, truth, gate="auto"):
    return np.degrees(angular_error(estimate_normals(capture, LeastSquares(gate=GATES[gate])).normals, truth.normals))


@pytest.mark.parametrize("name", GALLERY)
def test_every_scene_renders(name, rendered):
    made, found = rendered(name)
    assert made.name == name
    assert len(found) == len(made.viewpoints)
    for one in found:
        images = one.capture.stack.read()
        assert images.shape[:3] == (len(made.lights), 48, 48)
        assert images.dtype == (np.uint8 if name == "low-light" else np.uint16)
        lit = images[:, one.capture.mask]
        full = np.iinfo(images.dtype).max
        assert (lit.max(axis=(1, 2)) > 0.03 * full).all()  # none is black
        assert (lit == full).mean() < 0.01  # and hardly anything is overexposed
        assert not images[:, ~one.capture.mask].any() or name == "low-light"  # where faults put what they like
        assert one.capture.mask.mean() > 0.2
        assert np.isfinite(one.truth.depth[one.capture.mask]).all()
        assert np.isfinite(one.truth.normals[one.capture.mask]).all()


def test_each_is_summed_up_in_one_sentence():
    found = summaries()
    assert list(found) == list(GALLERY)
    for name, sentence in found.items():
        assert sentence.endswith(".")
        assert sentence.count(". ") == 0
        assert sentence[0].isupper() or sentence[0].isdigit()
        assert 30 < len(sentence) <= 115
        assert sentence == gallery_scene(name, SMALL).summary
    assert len(set(found.values())) == len(found)


def test_they_are_all_there():
    assert list(GALLERY) == [
        "matte-sphere", "hills", "terrain-day", "glossy", "metallic", "three-lights", "narrow-cone", "coplanar-suns",
        "cliff", "room", "near-leds", "two-views", "low-light",
    ]  # fmt: skip
    assert {path.name for path in next(iter(GALLERY.values())).parent.glob("*.toml")} == {
        f"{name}.toml" for name in GALLERY
    }


def test_unknown_names():
    with pytest.raises(OptionError, match="Did you mean matte-sphere"):
        gallery_scene("matte-spere")


def test_changes_reach_the_scene():
    made = gallery_scene("low-light", Changes(size=(10, 12), lights=5, seed=7))
    assert (made.size, len(made.lights), made.seed, made.sensor.seed) == ((10, 12), 5, 7, 7)


def test_seeds_change_the_noise_and_nothing_else():
    made = [render(gallery_scene("low-light", Changes(size=(16, 16), lights=3, seed=seed)))[0] for seed in (1, 1, 2)]
    images = [one.capture.stack.read() for one in made]
    assert np.array_equal(images[0], images[1])
    assert (images[0] != images[2]).mean() > 0.3
    assert np.array_equal(made[0].truth.normals, made[2].truth.normals)


def test_matte_sphere_is_the_easiest(rendered):
    _, (one,) = rendered("matte-sphere")
    assert len(one.capture.rig) == 24
    assert not steps(one)["cast shadows"]
    assert np.nanmean(degrees(one.capture, one.truth)) < 0.05


def test_hills_have_shadows_and_edges(rendered):
    _, (one,) = rendered("hills")
    assert len(one.capture.rig) == 24
    dark = one.truth.visibility == 0
    faces = np.einsum("mi,hwi->mhw", one.capture.rig.directions, one.truth.normals) > 0
    assert (dark & ~faces).any()  # attached
    assert (dark & faces).any()  # cast
    assert len(np.unique(one.truth.albedo.round(6))) == 2


def test_terrain_is_under_a_sun_that_moves_from_east_to_west(rendered):
    made, (one,) = rendered("terrain-day")
    assert all(isinstance(light, Sun) for light in made.lights)
    assert np.degrees(2 * made.lights[0].angular_radius) == pytest.approx(0.533, abs=0.01)
    east, north, up = np.array([light.direction for light in made.lights]).T
    assert (np.diff(np.unwrap(np.arctan2(east, north))) > 0).all()  # from east over south to west
    assert east[0] > 0.8
    assert east[-1] < -0.8
    assert up.argmax() in (7, 8)
    shares = one.truth.visibility
    assert ((shares > 0) & (shares < 1)).mean() > 0.003  # penumbrae
    assert (shares[0] == 0).mean() > 0.3 > (shares[8] == 0).mean()  # long shadows in the morning, short ones at noon
    assert one.capture.dark.max() > 0
    assert one.capture.camera.length_unit == "km"


def test_gloss_misleads_least_squares(rendered):
    _, (one,) = rendered("glossy")
    found = degrees(one.capture, one.truth)
    assert np.nanpercentile(found, 95) > 20 * 0.05
    assert not rendered("glossy")[0].material.constant


def test_metal_misleads_it_more(rendered):
    _, (glossy,) = rendered("glossy")
    _, (one,) = rendered("metallic")
    assert one.truth.albedo[one.capture.mask].max() == 0
    assert np.nanmean(degrees(one.capture, one.truth)) > 3 * np.nanmean(degrees(glossy.capture, glossy.truth))


def test_three_lights_fit_exactly_even_in_shadow(rendered):
    _, (one,) = rendered("three-lights")
    assert len(one.capture.rig) == 3
    found = estimate_normals(one.capture, LeastSquares(gate=GATES["none"]))
    images = one.capture.stack.read()[..., 0] / one.capture.stack.white * one.capture.radiance_at_white
    light = one.capture.rig.directions * one.capture.rig.strengths(1)
    again = np.einsum("mi,hwi->mhw", light, found.normals * found.albedo.reshape(48, 48, 1) / np.pi)
    assert again == pytest.approx(images, rel=1e-3, abs=0.05)  # shadows too, which are wrong
    shadow = one.truth.visibility.min(axis=0) == 0
    error = np.degrees(angular_error(found.normals, one.truth.normals))
    assert shadow.mean() > 0.02
    assert error[shadow].mean() > 100 * error[~shadow].mean()


def test_a_narrow_cone_is_badly_conditioned(rendered):
    _, (one,) = rendered("narrow-cone")
    assert np.degrees(np.arccos(one.capture.rig.directions[:, 2].min())) < 5
    assert one.capture.rig.condition() > 10
    assert np.nanmean(degrees(one.capture, one.truth)) > 1


def test_coplanar_suns_are_refused(rendered):
    _, (one,) = rendered("coplanar-suns")
    assert len(one.capture.rig) == 12
    with pytest.raises(RigError, match="lie in one plane"):
        estimate_normals(one.capture)


def test_the_cliff_is_a_jump_that_normals_do_not_show(rendered):
    _, (one,) = rendered("cliff")
    assert np.nanmax(np.abs(np.diff(one.truth.depth, axis=1))) == pytest.approx(0.4)
    assert one.truth.normals[one.capture.mask].tolist() == [[0, 0, 1]] * one.capture.mask.sum()
    assert (one.truth.visibility == 0).any()


def test_the_room_has_a_skylight_penumbrae_and_light_between_the_steps(rendered):
    made, (one,) = rendered("room")
    assert all(isinstance(light, Disc) for light in made.lights)
    assert all(isinstance(light, Led) for light in one.capture.rig.lights)
    done = steps(one)
    assert done["penumbra"]
    assert done["interreflection"]
    shares = one.truth.visibility
    assert ((shares > 0.02) & (shares < 0.98)).mean() > 0.02
    direct = render(made.changed(bounce=0, sensor=made.sensor.with_white(one.capture.radiance_at_white)))[0]
    more = one.capture.stack.read().astype(int) - direct.capture.stack.read()
    assert more.min() >= 0
    assert more.max() > 0.02 * 65535


def test_leds_are_near_and_the_camera_too(rendered):
    made, (one,) = rendered("near-leds")
    assert isinstance(one.capture.camera, Pinhole)
    assert all(isinstance(light, Led) for light in made.lights)
    # Two object sizes away: the ball is 1.8 across, and 4 / 1.8 = 2.2.
    assert np.linalg.norm(made.lights[0].position) / 1.8 == pytest.approx(2.2, abs=0.05)


def test_two_views_see_the_same_brightness(rendered):
    made, found = rendered("two-views")
    assert len(found) == 2
    assert all(isinstance(one.capture.camera, Pinhole) for one in found)
    first, second = (one.capture.stack.read()[:, one.capture.mask] for one in found)
    assert first.mean() == pytest.approx(second.mean(), rel=0.03)
    assert found[0].capture.radiance_at_white == found[1].capture.radiance_at_white
    assert made.viewpoints[1].pose.position[0] - made.viewpoints[0].pose.position[0] == pytest.approx(0.8)


def test_low_light_is_noisy_curved_and_shaky(rendered):
    made, (one,) = rendered("low-light")
    assert one.capture.stack.dtype == np.uint8
    assert one.capture.response.exponent == 2.2
    assert {fault.name for fault in made.faults} == {"motion", "dead-pixels"}
    assert isinstance(one.capture.camera, Orthographic)
    _, (hills,) = rendered("hills")
    assert np.nanmedian(degrees(one.capture, one.truth)) > 20 * np.nanmedian(degrees(hills.capture, hills.truth))
