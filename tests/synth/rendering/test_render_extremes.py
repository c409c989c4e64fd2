"""The same bytes whoever works, faults, meshes, the smallest images, and what is refused."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import trimesh

from psstereo.errors import InputError, OptionError, UnsupportedError
from psstereo.io import write_capture
from psstereo.lights import Ambient, Directional, Led, Total
from psstereo_synth.faults import DeadPixels, Duplicate, LightError, Motion, WrongOrder
from psstereo_synth.meshes import TriangleMesh
from psstereo_synth.meshes import view as mesh_view
from psstereo_synth.meshes.opengl import OpenGLError
from psstereo_synth.patterns import Constant
from psstereo_synth.rendering import memory, render
from psstereo_synth.rigs import ring, spiral
from psstereo_synth.scenes import Material, Viewpoint
from psstereo_synth.sensor import Sensor
from psstereo_synth.shapes import GaussianHills, Plane, Sphere, Steps, Torus
from psstereo_synth.view import centred_orthographic, centred_pinhole
from tests.synth.rendering.rendered_scenes import ALBEDO, WIDE, image, pinhole, scene, slanted, steps, suns

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
