"""From a scene to captures: what arrives, what comes back, what is left out, and the same bytes whoever works."""

from concurrent.futures import ThreadPoolExecutor
from importlib import import_module

import numpy as np
import pytest
import trimesh
from scipy.ndimage import binary_dilation, map_coordinates

from psstereo.brdf import BlinnPhong, Merl
from psstereo.camera import Pose
from psstereo.errors import InputError, OptionError, UnsupportedError
from psstereo.io import write_capture
from psstereo.lights import Ambient, Directional, Disc, Harmonics, Led, Polygon, Sun, Total
from psstereo.metrics import angular_error
from psstereo.normals import GATES, LeastSquares, estimate_normals
from psstereo.stack import Response
from psstereo_synth.faults import DeadPixels, Duplicate, LightError, Motion, WrongOrder
from psstereo_synth.meshes import TriangleMesh
from psstereo_synth.meshes import view as mesh_view
from psstereo_synth.meshes.opengl import OpenGLError
from psstereo_synth.patterns import Checker, Constant
from psstereo_synth.rendering import memory, render
from psstereo_synth.rendering.occlusion import Occlusion
from psstereo_synth.rigs import arc, ring, spiral
from psstereo_synth.scenes import Material, Scene, Viewpoint
from psstereo_synth.sensor import Sensor
from psstereo_synth.shapes import Bowl, Cliffs, GaussianHills, Plane, Sphere, Steps, Torus
from psstereo_synth.view import centred_orthographic, centred_pinhole

RADIANCES = Sensor(bits=None, white=1.0)
"""Delivers radiances as they are."""
ALBEDO = 0.6
OBLIQUE = np.array([0.6, 0.3, 0.5]) / np.linalg.norm([0.6, 0.3, 0.5])


def suns(directions, strength=1000.0):
    return tuple(Directional(direction=d, strength=strength) for d in np.atleast_2d(directions))


def scene(surface, lights, size=48, *, cameras=None, **others):
    shape = size if isinstance(size, tuple) else (size, size)
    viewpoints = cameras or (centred_orthographic(shape),)
    given = {"material": Material(albedo=Constant(albedo=ALBEDO)), "sensor": RADIANCES}
    return Scene(
        surface=surface,
        viewpoints=tuple(Viewpoint(camera=camera, pose=pose) for camera, pose in viewpoints),
        size=shape,
        lights=tuple(lights),
        **(given | others),
    )


def pinhole(size=48, position=(0.0, 0.0, 7.0), target=(0.0, 0.0, 0.0), focal=2.6):
    camera, _ = centred_pinhole((size, size), focal=focal * size, distance=1.0)
    return camera, Pose.looking_at(np.array(position), np.array(target))


def slanted(size=48, position=(2.0, 1.0, 4.0)):
    """A parallel camera that looks at the origin from somewhere, with the origin in the middle of its image."""
    rotation = Pose.looking_at(np.array(position), np.zeros(3)).rotation
    return centred_orthographic((size, size), rotation=rotation)


def image(rendering, i=0):
    return rendering.capture.stack.frame(i)[..., 0]


def steps(rendering):
    return {step.name: step for step in rendering.steps}


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


def ambient():
    return Ambient(radiance=[20.0])


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


# --- what is left out is not missed ---


def pair(made, **forced):
    return render(made)[0], render(made.changed(**forced))[0]


def test_a_convex_surface_has_no_shadow(monkeypatch):
    made = scene(Sphere(), suns(spiral(6, max_tilt=1.4)))
    quick = render(made)[0]
    assert not steps(quick)["cast shadows"].done
    assert "convex" in steps(quick)["cast shadows"].reason
    monkeypatch.setattr(Sphere, "convex", False)
    slow = render(made)[0]
    assert steps(slow)["cast shadows"].done
    assert np.array_equal(quick.capture.stack.read(), slow.capture.stack.read())
    lamps = made.changed(lights=tuple(Led(position=4 * d, axis=-d, mu=0.0, flux=[9e3]) for d in spiral(3)))
    by_rays = render(lamps)[0].capture.stack.read()
    monkeypatch.undo()
    quick = render(lamps)[0]
    assert not steps(quick)["cast shadows"].done
    assert np.isclose(by_rays, quick.capture.stack.read()).mean() > 0.99  # facets throw shadows at the terminator


def test_high_lights_need_no_sweep(monkeypatch):
    made = scene(GaussianHills(), suns(spiral(6, max_tilt=0.3)))
    quick = render(made)[0]
    assert steps(quick)["cast shadows"].reason == "Every light stands higher than the steepest slope."
    monkeypatch.setattr(Occlusion, "may_block", lambda *_: True)
    monkeypatch.setattr("psstereo.forward.ReliefShadows.may_block", lambda *_: True)
    slow = render(made)[0]
    assert steps(slow)["cast shadows"].done
    assert np.array_equal(quick.capture.stack.read(), slow.capture.stack.read())


def test_high_suns_with_a_disc_need_no_sweep_either():
    sun = Sun.of_irradiance([0.05, 0, 1], 1000.0)
    made = render(scene(GaussianHills(), [sun]))[0]
    assert not steps(made)["cast shadows"].done
    assert "is exact" in steps(made)["quadrature over lights"].reason
    low = render(scene(GaussianHills(), [Sun.of_irradiance([1, 0, 0.3], 1000.0)]))[0]
    assert steps(low)["cast shadows"].done
    assert "unblocked share" in steps(low)["quadrature over lights"].reason


WIDE = [
    Sun.of_irradiance(OBLIQUE, 1000.0, angular_radius=0.3),
    Disc(centre=3 * OBLIQUE, axis=-OBLIQUE, radius=0.5, radiance=100.0),
    Polygon(vertices=np.array([[-1, -1, 3], [-1, 1, 3], [1, 1, 3], [1, -1, 3.0]]), radiance=100.0),
    Ambient(radiance=5.0),
    Harmonics(coefficients=[1, 0, 0.5, 0, 0, 0, 0, 0, 0]),
]


@pytest.mark.parametrize("light", WIDE, ids=lambda light: light.name)
def test_unblocked_light_on_a_matte_surface_needs_no_quadrature(light):
    few, many = pair(scene(Sphere(), [light], beams=3), beams=300)
    assert steps(few)["quadrature over lights"].reason.startswith(f"The irradiance of {light.name} light")
    assert image(few).max() > 0
    assert np.array_equal(image(few), image(many))


def test_gloss_needs_quadrature():
    shiny = Material(model=BlinnPhong, parameters={"specular": 0.3, "exponent": 50.0}, albedo=Constant(albedo=0.3))
    few, many = pair(scene(Sphere(), [WIDE[1]], beams=4, material=shiny), beams=400)
    assert steps(few)["quadrature over lights"].done
    assert not np.allclose(image(few), image(many), rtol=1e-3)


def test_the_light_of_the_surroundings_counts_where_steps_are_told():
    made = render(scene(GaussianHills(), suns([0, 0, 1]), 16, ambient=ambient(), beams=20))[0]
    assert steps(made)["cast shadows"].done
    assert "20 directions stand for ambient light" in steps(made)["quadrature over lights"].reason
    assert "ambient" in steps(made)["penumbra"].reason


def test_a_convex_surface_sees_nothing_of_itself(monkeypatch):
    made = scene(Sphere(), suns(spiral(3)), bounce=32)
    quick = render(made)[0]
    assert not steps(quick)["interreflection"].done
    monkeypatch.setattr(import_module("psstereo_synth.rendering.render"), "_bounces", lambda _: True)
    slow = render(made)[0]
    assert steps(slow)["interreflection"].done
    assert slow.capture.stack.read() == pytest.approx(quick.capture.stack.read(), abs=0.5)  # of 190


def test_height_fields_load_no_opengl():
    made = render(scene(GaussianHills(), suns([0, 0, 1]), 8))[0]
    assert steps(made)["OpenGL"] == made.steps[0]
    assert not steps(made)["OpenGL"].done


# --- bounced light ---


@pytest.mark.parametrize("camera", [centred_orthographic((65, 65)), pinhole(65)], ids=["straight", "pinhole"])
@pytest.mark.parametrize("albedo", [0.3, 0.9])
def test_one_bounce_in_a_bowl_is_the_same_everywhere(albedo, camera):
    """Inside a sphere each part sees every other as dA / (4 π R²): E₁ = albedo · E_sun · π R² / (4 π R²)."""
    material = Material(albedo=Constant(albedo=albedo))
    (made,) = render(scene(Bowl(), suns([0, 0, 1]), 65, cameras=(camera,), bounce=256, material=material))
    geometry = made.view.geometry
    direct = albedo / np.pi * 1000 * geometry.normals[:, 2]
    bounced = (image(made)[geometry.mask] - direct) * np.pi / albedo
    assert bounced.mean() == pytest.approx(albedo * 1000 / 4, rel=0.025)
    assert bounced.std() < 0.02 * bounced.mean()
    assert steps(made)["interreflection"].done


def test_coarser_patches_do_not_swallow_what_lies_under_them(monkeypatch):
    monkeypatch.setattr(import_module("psstereo_synth.rendering.occlusion"), "_PATCHES", 33)
    (made,) = render(scene(Bowl(), suns([0, 0, 1]), 64, bounce=128))
    direct = ALBEDO / np.pi * 1000 * made.view.geometry.normals[:, 2]
    bounced = (image(made)[made.capture.mask] - direct) * np.pi / ALBEDO
    assert np.percentile(bounced, [2, 98]) == pytest.approx(ALBEDO * 1000 / 4, rel=0.12)


def test_bounced_light_has_the_colours_of_light_and_surface():
    paint, light = np.array([0.2, 0.4, 0.8]), np.array([300.0, 200.0, 100.0])
    material = Material(albedo=Constant(albedo=paint))
    (made,) = render(
        scene(Bowl(), [Directional(direction=[0, 0, 1], strength=light)], 21, bounce=64, material=material)
    )
    shown = made.capture.stack.frame(0)[made.capture.mask]
    direct = paint / np.pi * light * made.view.geometry.normals[:, 2:]
    expected = paint / np.pi * paint * light / 4
    assert (shown - direct).mean(axis=0) == pytest.approx(expected, rel=0.08)


def test_a_measured_reflectance_has_no_part_that_bounces():
    measured = Merl(table=np.full((90, 90, 180, 1), 0.2))
    with pytest.raises(UnsupportedError, match="Bounced light"):
        render(scene(Bowl(), suns([0, 0, 1]), 9, bounce=4, material=Material(model=measured)))
    (made,) = render(scene(Bowl(), suns([0, 0, 1]), 9, material=Material(model=measured)))
    assert made.truth.albedo is None
    assert image(made).max() > 0


def test_triangles_without_area_send_nothing_out():
    corners = np.array([[-1, 0, 0], [1, 0, 0], [1, 2, 0], [-1, 2, 0], [-1, 0, 2], [1, 0, 2.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 4, 5], [0, 5, 1], [0, 1, 1]])
    mesh = TriangleMesh(vertices=corners - [0, 1, 0], faces=faces)
    (made,) = render(scene(mesh, suns([0, 0.7, 0.7]), 16, bounce=16), engine="rays")
    assert np.isfinite(image(made)).all()


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


# --- threads, seeds, faults ---


HARD = scene(
    Steps(),
    [WIDE[1], WIDE[2], *suns(spiral(3))],
    24,
    sensor=Sensor(bits=12, full_well=3000.0, read_noise=4.0, prnu=0.01, dark_level=0.02),
    faults=(Motion(rms=0.4), DeadPixels(dead=0.01, hot=0.01), WrongOrder(kind="swap"), LightError(strength=0.05)),
    ambient=Ambient(radiance=3.0),
    dark_frame=True,
    bounce=8,
    beams=12,
    seed=3,
)


def content(made):
    return [
        part.tobytes()
        for one in made
        for part in (one.capture.stack.read(), one.capture.dark, one.truth.visibility, one.truth.normals)
    ]


@pytest.mark.parametrize("cameras", [None, (pinhole(24), pinhole(24, (0.5, 0.0, 6.0)))], ids=["one view", "two views"])
def test_the_same_bytes_on_any_number_of_threads(cameras):
    made = HARD
    if cameras:
        made = HARD.changed(viewpoints=tuple(Viewpoint(camera=camera, pose=pose) for camera, pose in cameras))
    once = content(render(made))
    for threads in (2, 3):
        with ThreadPoolExecutor(threads) as pool:
            assert content(render(made, over=pool.map)) == once


def test_seeds():
    once = render(HARD)[0].capture
    other = render(HARD.changed(seed=4))[0].capture
    noise = render(HARD.changed(sensor=Sensor(**{**vars(HARD.sensor), "seed": 1})))[0].capture
    assert (once.stack.read() != other.stack.read()).any()
    assert (once.stack.read() != noise.stack.read()).mean() > 0.3
    fluxes = [[getattr(light, "flux", 0) for light in one.rig.lights] for one in (once, other, noise)]
    assert fluxes[0] != fluxes[1]
    assert fluxes[0] == fluxes[2]


def test_lights_that_were_exchanged_are_exchanged_in_the_rig_alone():
    plain = scene(Torus(), suns(ring(4, tilt=1.2)), 24)
    right, wrong = render(plain)[0], render(plain.changed(faults=(WrongOrder(kind="cycle", by=1),)))[0]
    assert np.array_equal(wrong.capture.stack.read(), right.capture.stack.read())
    assert np.array_equal(wrong.capture.rig.directions, np.roll(right.capture.rig.directions, 1, axis=0))


def test_an_image_that_is_there_twice_has_its_own_truth_twice():
    plain = scene(Torus(), suns(ring(4, tilt=1.2)), 24)
    right, wrong = render(plain)[0], render(plain.changed(faults=(Duplicate(image=3, of=1),)))[0]
    assert np.array_equal(wrong.capture.rig.directions, right.capture.rig.directions)
    same = [np.array_equal(image(wrong, i), image(wrong, j)) for i in range(4) for j in range(i)]
    assert sum(same) == 1
    for i in range(4):
        (really,) = [j for j in range(4) if np.array_equal(image(wrong, i), image(right, j))]
        assert np.array_equal(wrong.truth.visibility[i], right.truth.visibility[really])


def test_errors_of_the_lights_are_the_same_for_all_views():
    cameras = (centred_orthographic((8, 8)), slanted(8))
    made = render(scene(Plane(), suns(spiral(3)), 8, cameras=cameras, faults=(LightError(direction=0.1),)))
    in_scene = [one.capture.rig.directions @ one.view.pose.rotation.T for one in made]
    assert in_scene[0] == pytest.approx(in_scene[1], abs=1e-12)
    assert np.abs(in_scene[0] - spiral(3)).max() > 0.02


def test_progress_counts_the_images():
    told = []
    render(scene(Plane(), suns(spiral(3)), 8), progress=lambda *step: told.append(step))
    assert told == [("rendering", 1, 3), ("rendering", 2, 3), ("rendering", 3, 3)]


# --- meshes ---


def ball(subdivisions=4):
    body = trimesh.creation.icosphere(subdivisions=subdivisions, radius=0.9)
    return TriangleMesh(vertices=body.vertices, faces=body.faces, smooth=True)


def test_a_mesh_of_a_ball_looks_like_the_ball():
    lights = suns(spiral(4))
    exact = render(scene(Sphere(), lights))[0]
    made = render(scene(ball(), lights), engine="rays")[0]
    both = exact.capture.mask & made.capture.mask
    assert both.sum() > 0.95 * exact.capture.mask.sum()
    difference = np.abs(exact.capture.stack.read() - made.capture.stack.read())[:, both]
    assert np.percentile(difference, 98) < 2  # of 190
    assert steps(made)["view of the mesh"].reason.endswith("as asked for.")
    assert steps(made)["cast shadows"].reason == "Rays are cast at the mesh."


def test_without_opengl_meshes_are_seen_by_rays(monkeypatch):
    def broken(*_):
        raise OpenGLError(given="There is no display.", needed="OpenGL.", remedy="Take rays.")

    monkeypatch.setattr(mesh_view, "view_mesh_opengl", broken)
    made = scene(ball(2), suns([0, 0, 1]), 16)
    shown = render(made)[0]
    assert "There is no display" in steps(shown)["view of the mesh"].reason
    assert np.array_equal(image(shown), image(render(made, engine="rays")[0]))
    with pytest.raises(OpenGLError, match="no display"):
        render(made, engine="opengl")


# --- all sizes, and what is refused ---


@pytest.mark.parametrize("size", [(1, 1), (1, 6), (6, 1), (2, 2)], ids=str)
@pytest.mark.parametrize("lights", [suns([0.8, 0.1, 0.2]), WIDE[1:2], WIDE[3:4]], ids=["sun", "disc", "ambient"])
@pytest.mark.parametrize("kind", ["straight", "slanted", "pinhole", "mesh"])
def test_the_smallest_images(size, lights, kind):
    cameras = {
        "straight": centred_orthographic(size),
        "slanted": centred_orthographic(size, rotation=slanted()[1].rotation),
        "pinhole": centred_pinhole(size, focal=4 * size[1], distance=8.0),
        "mesh": centred_orthographic(size),
    }
    surface = ball(1) if kind == "mesh" else GaussianHills(steepness=2)
    given = scene(surface, lights, size, cameras=(cameras[kind],), bounce=4, beams=8, sensor=Sensor(bits=None))
    try:
        (made,) = render(given, engine="rays")
    except InputError as error:
        assert "black under every light" in error.given or "sees" in error.given  # noqa: PT017
        return
    assert made.capture.stack.shape == (1, *size, 1)
    assert np.isfinite(made.capture.stack.read()).all()


def test_a_black_scene_has_no_exposure():
    black = Material(albedo=Constant(albedo=0.0))
    with pytest.raises(InputError, match="black under every light"):
        render(scene(Sphere(), suns([0, 0, 1]), 8, material=black, sensor=Sensor()))
    with pytest.raises(InputError, match="black under every light"):
        render(scene(Plane(), suns([0, 0, -1]), 8, sensor=Sensor()))
    (made,) = render(scene(Sphere(), suns([0, 0, 1]), 8, material=black))
    assert image(made).max() == 0


def test_channels_have_to_agree():
    material = Material(albedo=Constant(albedo=(0.1, 0.2, 0.3)))
    with pytest.raises(InputError, match="channels"):
        render(scene(Plane(), suns([0, 0, 1], [1.0, 2.0]), 8, material=material))


def test_engines_are_known_even_where_none_is_needed():
    with pytest.raises(OptionError, match="opengl"):
        render(scene(Plane(), suns([0, 0, 1]), 8), engine="openlg")


def test_what_cannot_fit_into_memory_is_refused_before_it_begins(monkeypatch):
    monkeypatch.setattr(memory, "_physical", lambda: 10**6)
    with pytest.raises(InputError, match=r"24 images of 100 × 100 pixels from 1 viewpoints take more than 0\.0 GB"):
        render(scene(Plane(), suns(spiral(24)), 100))
    render(scene(Plane(), suns([0, 0, 1]), 8))
    monkeypatch.setattr(memory, "_physical", lambda: None)
    render(scene(Plane(), suns([0, 0, 1]), 100))


def test_light_that_no_file_can_hold_stays_what_it_is_and_writers_refuse_it(tmp_path):
    lights = (WIDE[3], *suns(spiral(2)))
    (made,) = render(scene(Sphere(), lights, 16, sensor=Sensor()))
    assert isinstance(made.capture.rig.lights[0], Ambient)
    for layout in ("capture", "diligent", "lp"):
        with pytest.raises(UnsupportedError, match="ambient"):
            write_capture(made.capture, tmp_path / layout, layout, truth=made.truth)
    assert not list(tmp_path.iterdir())


def test_extended_lights_are_written_down_as_what_they_look_like_from_afar():
    (made,) = render(scene(Sphere(), WIDE[:3], 16))
    assert [type(light) for light in made.capture.rig.lights] == [Directional, Led, Led]


def test_a_sum_of_lights():
    both = Total(lights=(*suns([0, 0, 1]), Ambient(radiance=[20.0])))
    (made,) = render(scene(Sphere(), [both], 16))
    mask = made.capture.mask
    expected = ALBEDO / np.pi * (1000 * made.view.geometry.normals[:, 2] + 20 * np.pi)
    assert image(made)[mask] == pytest.approx(expected)
    assert made.capture.rig.lights[0] is not None
