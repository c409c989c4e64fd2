"""What a rendering leaves out because it makes no difference, and light that bounces once."""

from importlib import import_module

import numpy as np
import pytest

from psstereo.brdf import BlinnPhong, Merl
from psstereo.errors import UnsupportedError
from psstereo.lights import Directional, Led, Sun
from psstereo_synth.meshes import TriangleMesh
from psstereo_synth.patterns import Constant
from psstereo_synth.rendering import render
from psstereo_synth.rendering.occlusion import Occlusion
from psstereo_synth.rigs import spiral
from psstereo_synth.scenes import Material
from psstereo_synth.shapes import Bowl, GaussianHills, Sphere
from psstereo_synth.view import centred_orthographic
from tests.synth.rendering.rendered_scenes import ALBEDO, WIDE, ambient, image, pair, pinhole, scene, steps, suns

# --- what is left out is not missed ---


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
