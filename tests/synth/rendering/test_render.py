"""From a scene to captures: what arrives, what comes back, and what is refused."""

import numpy as np
import pytest
from scipy.ndimage import binary_dilation, map_coordinates

from psstereo.camera import Pose
from psstereo.errors import InputError
from psstereo.lights import Directional, Led, Sun
from psstereo.metrics import angular_error
from psstereo.normals import GATES, LeastSquares, estimate_normals
from psstereo.stack import Response
from psstereo_synth.patterns import Checker
from psstereo_synth.rendering import render
from psstereo_synth.rendering.occlusion import Occlusion
from psstereo_synth.rigs import arc, spiral
from psstereo_synth.scenes import Material
from psstereo_synth.sensor import Sensor
from psstereo_synth.shapes import Bowl, Cliffs, GaussianHills, Plane, Sphere
from psstereo_synth.view import centred_orthographic
from tests.synth.rendering.rendered_scenes import (
    ALBEDO,
    OBLIQUE,
    ambient,
    image,
    pair,
    pinhole,
    scene,
    slanted,
    steps,
    suns,
)

# --- which way is which ---


@pytest.mark.parametrize("cameras", [None, (pinhole(),)], ids=["orthographic", "pinhole"])
def test_light_from_the_upper_right_brightens_what_faces_the_upper_right(cameras):
    toward = np.array([0.5, 0.4, 0.7])
    shown = image(render(scene(Sphere(), suns(toward), cameras=cameras))[0])
    row, column = np.unravel_index(shown.argmax(), shown.shape)
    middle = 0.5 * (len(shown) - 1)
    assert row < middle - 3  # rows run down: the brightest is above the middle
    assert column > middle + 3
    place = np.array([column - middle, middle - row])
    assert place @ [-0.4, 0.5] == pytest.approx(0, abs=1)  # and on the way to the light
    assert shown[0, 0] == shown[-1, -1] == 0


def test_a_wall_throws_its_shadow_away_from_the_light():
    made = render(scene(Cliffs(), suns([[0.5, 0, 0.5], [-0.5, 0, 0.5]]), 40))[0]
    x = 0.05 * (np.arange(40) - 19.5)
    # The high ground is 0.4 above the low one; the sun at 45 degrees throws as much of shadow. The pixels do not know
    # where between two of them the wall is.
    dark = x[image(made, 0)[7] == 0]
    assert dark.max() == pytest.approx(-0.025)
    assert -0.4 < dark.min() <= -0.325
    assert (image(made, 1) > 0).all()


# --- round trip ---


@pytest.mark.parametrize("cameras", [None, (slanted(64),)], ids=["straight", "slanted"])
@pytest.mark.parametrize(
    ("surface", "tilt"),
    [(Sphere(), 60), (GaussianHills(), 40), (GaussianHills(steepness=2.0), 60)],
    ids=["sphere", "hills", "steep hills"],
)
def test_noise_free_suns_come_back(surface, tilt, cameras):
    """Normals to 1e-6 degrees and albedo to 1e-9 of itself, wherever three lights are left."""
    lights = suns(spiral(24, max_tilt=np.radians(tilt)))
    paint = Material(albedo=Checker(low=0.2, high=0.8))
    (made,) = render(scene(surface, lights, 64, cameras=cameras, material=paint))
    found = estimate_normals(made.capture, LeastSquares(gate=GATES["shadow"]))
    assert found.normals.dtype == np.float64
    whole = made.truth.visibility.min(axis=0) == 1  # nothing is in shadow: exact by all lights
    assert whole.mean() > 0.1
    angles = np.degrees(angular_error(found.normals, made.truth.normals))
    assert np.nanmax(angles[whole]) < 1e-6
    relative = np.abs(found.albedo - made.truth.albedo) / made.truth.albedo
    assert np.nanmax(relative[whole]) < 1e-9
    # The gate tells shadows from light: without noise hardly any pixel in shadow is worse.
    seen = made.capture.mask & ((made.truth.visibility == 1).sum(axis=0) >= 6)
    assert (angles[seen] < 1e-6).mean() > 0.97
    assert (relative[seen] < 1e-9).mean() > 0.97


def test_coplanar_suns_cannot_come_back():
    (made,) = render(scene(GaussianHills(), suns(arc(6)), 16))
    with pytest.raises(InputError, match="lie in one plane"):
        estimate_normals(made.capture)


@pytest.mark.parametrize("camera", [slanted(), pinhole(position=(2.0, 1.0, 5.0))], ids=["orthographic", "pinhole"])
@pytest.mark.parametrize("kind", ["suns", "lamps"])
def test_the_rig_is_written_down_in_the_camera_s_frame(camera, kind):
    """Shading the true normals, at the true depth, with the capture's own lights gives its images again."""
    lights = suns(spiral(5, max_tilt=0.5))
    if kind == "lamps":
        lights = tuple(Led(position=3 * d, axis=-d, mu=1.5, flux=[9000.0]) for d in spiral(5, max_tilt=0.5))
    (made,) = render(scene(Sphere(), lights, cameras=(camera,)))
    capture, truth, mask = made.capture, made.truth, made.capture.mask
    points = capture.camera.points(truth.depth)[mask]
    for i, light in enumerate(capture.rig.lights):
        expected = ALBEDO / np.pi * light.irradiance(points, truth.normals[mask])[:, 0]
        assert image(made, i)[mask] == pytest.approx(expected, rel=1e-9, abs=1e-9)


# --- several views ---


def test_a_point_of_a_matte_surface_is_as_bright_from_everywhere():
    cameras = (pinhole(96, (-1.0, 0.0, 7.0)), pinhole(96, (1.0, 0.5, 7.0)))
    left, right = render(scene(GaussianHills(), suns(spiral(3, max_tilt=0.5)), 96, cameras=cameras))
    camera, pose = right.capture.camera, right.view.pose
    seen = pose.to_camera(left.view.geometry.points)
    place = [camera.cy - camera.fy * seen[:, 1] / -seen[:, 2], camera.cx + camera.fx * seen[:, 0] / -seen[:, 2]]
    inside = (np.min(place, axis=0) > 3) & (np.max(place, axis=0) < 92)
    assert inside.mean() > 0.5
    for i in range(3):
        there = map_coordinates(image(right, i), place, order=1)
        here = image(left, i)[left.capture.mask]
        both = inside & (here > 0) & (there > 0)
        relative = np.abs(here - there)[both] / here[both]
        assert np.median(relative) < 2e-3
        assert np.percentile(relative, 95) < 3e-2  # curvature within a pixel


def test_views_share_exposure_and_grid_but_not_their_noise(monkeypatch):
    prepared = []
    monkeypatch.setattr(Occlusion, "__init__", _counted(Occlusion.__init__, prepared))
    cameras = (pinhole(32), pinhole(32), pinhole(32, (0.5, 0.0, 7.0)))
    sensor = Sensor(bits=16, full_well=5000.0)
    made = render(scene(GaussianHills(), suns(spiral(3)), 32, cameras=cameras, sensor=sensor, ambient=ambient()))
    assert len(prepared) == 1
    assert len({one.capture.radiance_at_white for one in made}) == 1
    assert [one.capture.name for one in made] == ["scene 1", "scene 2", "scene 3"]
    same, other = image(made[0]), image(made[1])
    assert (same != other).mean() > 0.5  # the same scene from the same place, photographed twice
    assert np.array_equal(made[0].truth.visibility, made[1].truth.visibility)


def _counted(function, calls):
    def call(*arguments, **options):
        calls.append(arguments)
        return function(*arguments, **options)

    return call


# --- exposure ---


def test_the_brightest_value_is_at_nine_tenths():
    (made,) = render(scene(Sphere(), suns([[0, 0, 1], [0.3, 0, 0.9]]), 49, sensor=Sensor(bits=16)))
    assert image(made).max() == round(0.9 * 65535)
    assert made.capture.radiance_at_white == pytest.approx(ALBEDO / np.pi * 1000 / 0.9)
    both = {"sensor": Sensor(bits=None), "ambient": ambient()}
    (made,) = render(scene(Sphere(), suns([0, 0, 1]), 49, **both))
    assert image(made).max() == pytest.approx(0.9)
    assert made.capture.radiance_at_white == pytest.approx(ALBEDO * (1000 / np.pi + 20) / 0.9)
    two = (centred_orthographic((49, 49)), pinhole(49))
    made = render(scene(Sphere(), suns([0, 0, 1]), 49, cameras=two, **both))
    assert max(image(one).max() for one in made) == pytest.approx(0.9)


def test_bounced_light_does_not_overexpose():
    (made,) = render(scene(Bowl(), suns([0, 0, 1]), 33, bounce=64, sensor=Sensor(bits=16)))
    assert image(made).max() == pytest.approx(0.9 * 65535, abs=1)


# --- shadows ---


def bowl_is_lit(points, to_light):
    """A ray from inside a sphere around the origin leaves the bowl above its rim."""
    along = np.einsum("pi,pi->p", points, to_light)
    return (points - 2 * along[:, None] * to_light)[:, 2] > 0


@pytest.mark.parametrize("near", [False, True])
@pytest.mark.parametrize("camera", [centred_orthographic((96, 96)), pinhole(96)], ids=["straight", "pinhole"])
def test_the_shadow_in_a_bowl_is_that_of_its_rim(near, camera):
    light = Led(position=3 * OBLIQUE, axis=-OBLIQUE, mu=0.0, flux=[9000.0]) if near else suns(OBLIQUE)[0]
    (made,) = render(scene(Bowl(), [light], 96, cameras=(camera,)))
    geometry = made.view.geometry
    to_light = light.directions(geometry.points)
    lit = bowl_is_lit(geometry.points, to_light)
    faces = np.einsum("pi,pi->p", geometry.normals, to_light) > 0
    shown = made.truth.visibility[0][geometry.mask]
    assert set(np.unique(shown)) == {0, 1}
    wrong = (shown == 1) != (lit & faces)
    assert 0.1 < lit.mean() < 0.9
    assert wrong.mean() < 0.04  # a line of pixels around the edge of the shadow
    assert (image(made)[geometry.mask] > 0).tolist() == (shown == 1).tolist()


@pytest.mark.parametrize("camera", [centred_orthographic((64, 64)), slanted(64), pinhole(64)], ids=str)
def test_visibility_is_what_walking_along_the_rays_finds(camera):
    hills = GaussianHills(steepness=2.5)
    toward = np.array([0.8, -0.3, 0.35]) / np.linalg.norm([0.8, -0.3, 0.35])
    (made,) = render(scene(hills, suns(toward), 64, cameras=(camera,)))
    geometry = made.view.geometry
    free = np.full(len(geometry.points), True)
    for distance in np.arange(0.004, 2.5, 0.004):
        at = geometry.points + distance * toward
        free &= ~(at[:, 2] < hills.evaluate(at[:, 0], at[:, 1]).height)
    faces = geometry.normals @ toward > 0
    expected = geometry.scatter(faces & free, outside=False)
    shown = made.truth.visibility[0] == 1
    assert 0.1 < (faces & ~free).mean() < 0.5
    square = np.ones((3, 3))
    edges = binary_dilation(expected, square) & binary_dilation(~expected, square)
    assert (~edges)[geometry.mask].mean() > 0.4
    assert (shown == expected)[geometry.mask & ~edges].mean() > 0.995
    assert (shown == expected)[geometry.mask].mean() > 0.96


def test_ground_outside_the_picture_throws_shadows_too():
    camera, _ = centred_orthographic((20, 20), width=0.4)
    pose = Pose(position=np.array([-0.6 + 0.01, 0.19, 0.0]))  # the picture shows -0.6 ... -0.2
    slopes = np.tan(np.radians([50, 65]))
    (made,) = render(scene(Cliffs(), suns([[1, 0, slope] for slope in slopes]), 20, cameras=((camera, pose),)))
    x = pose.position[0] + 0.02 * np.arange(20)
    for i, slope in enumerate(slopes):
        edge = -0.4 / slope  # of the shadow of the wall at x = 0
        certain = np.abs(x - edge) > 0.02
        assert (image(made, i)[3] > 0)[certain].tolist() == (x < edge)[certain].tolist()
    assert (image(made, 0)[3] == 0).any()
    assert steps(made)["cast shadows"].reason == "A sweep along the horizon finds the shadows of parallel light."


def test_what_is_too_far_to_be_looked_at_is_said():
    camera, _ = centred_orthographic((20, 20), width=0.1)
    pose = Pose(position=np.array([-0.9, 0.0, 0.0]))
    (made,) = render(scene(Cliffs(), suns([1, 0, 0.1]), 20, cameras=((camera, pose),)))
    assert "Ground farther than 0.095 mm from what is seen throws none." in steps(made)["cast shadows"].reason


def segment(height):
    """Share of the unit disc above a level line."""
    t = np.clip(height, -1, 1)
    return (np.arccos(t) - t * np.sqrt(1 - t * t)) / np.pi


def test_the_penumbra_of_a_cliff_is_as_wide_as_the_sun():
    """Behind a wall the sun's disc rises over its edge; the share that has risen is a segment of the disc."""
    radius, elevation, height, n = np.radians(8), np.radians(40), 0.4, 200
    sun = Sun.of_irradiance([np.cos(elevation), 0, np.sin(elevation)], 1000.0, angular_radius=radius)
    camera, pose = centred_orthographic((5, n))
    (made,) = render(scene(Cliffs(height=height), [sun], (5, n), cameras=((camera, pose),), beams=400))
    x = pose.position[0] + camera.pixel_size * np.arange(n)
    low = x < -0.02
    edge = np.arctan2(height, x[x > 0][0] - x[low])  # how high the wall's edge, the first pixel above, stands
    expected = segment((np.sin(edge - elevation) / np.sin(radius)).clip(-1, 1))
    shown = made.truth.visibility[0, 2, low]
    assert np.abs(shown - expected).max() < 0.06  # steps of 400 directions
    assert np.abs(shown - expected).mean() < 0.008
    begins, ends = -height / np.tan(elevation - radius), -height / np.tan(elevation + radius)
    assert (shown[x[low] < begins - 0.02] == 1).all()
    assert (shown[x[low] > ends + 0.02] == 0).all()
    assert ((shown > 0) & (shown < 1)).sum() * camera.pixel_size == pytest.approx(ends - begins, abs=0.04)
    assert steps(made)["penumbra"].done
    assert isinstance(made.capture.rig.lights[0], Directional)  # as it would be written down


# --- light that is there in every image ---


def test_a_dark_frame_takes_the_ambient_light_away_exactly():
    lights, size = suns(spiral(6, max_tilt=0.8)), 32
    with_it = scene(GaussianHills(steepness=2), lights, size, ambient=ambient(), dark_frame=True)
    without = render(with_it.changed(ambient=None, dark_frame=False))[0].capture
    (made,) = render(with_it)
    left = made.capture.stack.read() - made.capture.dark
    assert left == pytest.approx(without.stack.read(), rel=1e-12, abs=1e-11)
    assert made.capture.dark.max() == pytest.approx(ALBEDO * 20, rel=0.02)
    assert made.capture.dark[..., 0].std() > 0.1  # hollows see less of the sky
    normals = estimate_normals(made.capture).normals
    assert np.nanmax(angular_error(normals, estimate_normals(without).normals)) < 1e-8


@pytest.mark.parametrize("curve", [Response("linear"), Response("srgb"), Response("gamma", 2.2)], ids=lambda c: c.name)
def test_a_dark_level_is_in_the_dark_frame(curve):
    sensor = Sensor(bits=16, white=400.0, dark_level=0.1, response=curve)
    (made,) = render(scene(Sphere(), suns([0, 0, 1]), 32, sensor=sensor, dark_frame=True))
    light = curve.linearise(made.capture.stack.frame(0), 65535.0) - made.capture.dark
    expected = made.view.geometry.normals[:, 2] * ALBEDO / np.pi * 1000 / 400 * 65535
    assert light[made.capture.mask][:, 0] == pytest.approx(expected, rel=1e-3, abs=30)


# --- a medium ---


def test_a_medium_takes_light_away_on_both_ways():
    lamp = Led(position=[0.5, 0.2, 2.0], axis=[0, 0, -1], mu=0.0, flux=[1000.0])
    camera = pinhole(16)
    clear, foggy = pair(scene(Plane(), [lamp], 16, cameras=(camera,)), extinction=0.2)
    geometry = clear.view.geometry
    ways = np.linalg.norm(lamp.position - geometry.points, axis=1) + np.linalg.norm([0, 0, 7] - geometry.points, axis=1)
    mask = geometry.mask
    assert image(foggy)[mask] == pytest.approx(image(clear)[mask] * np.exp(-0.2 * ways), rel=1e-12)
    assert steps(foggy)["medium"].reason == "It takes light away on the way from the lamps and to the eye."


def test_a_medium_without_any_way_is_left_out():
    clear, foggy = pair(scene(Plane(), suns([0, 0, 1]), 8), extinction=0.2)
    assert not steps(foggy)["medium"].done
    assert np.array_equal(image(clear), image(foggy))
