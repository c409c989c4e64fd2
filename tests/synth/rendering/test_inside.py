"""Lamps inside of what they light are refused, whatever they are."""

import numpy as np
import pytest
import trimesh

from psstereo.errors import InputError
from psstereo.lights import Directional, Disc, Led, Polygon, Sun, Total
from psstereo_synth.meshes import TriangleMesh
from psstereo_synth.rendering import render
from psstereo_synth.scenes import Scene, Viewpoint
from psstereo_synth.shapes import Bowl, Cliffs, GaussianHills, Sphere
from psstereo_synth.view import centred_orthographic


def body(shape):
    made = trimesh.creation.box((1.0, 1.0, 1.0)) if shape == "box" else trimesh.creation.icosphere(3, radius=0.5)
    return TriangleMesh(vertices=made.vertices, faces=made.faces)


SURFACES = {
    "sphere": Sphere(radius=0.5),
    "hills": GaussianHills(),
    "bowl": Bowl(),
    "ball": body("ball"),
    "box": body("box"),
}


def led(position):
    return Led(position=position, axis=[0, 0, -1], mu=0.0, flux=[1.0])


def disc(position):
    return Disc(centre=position, axis=[0, 0, -1], radius=0.05, radiance=[1.0])


def window(position):
    square = 0.05 * np.array([[-1, -1, 0], [-1, 1, 0], [1, 1, 0], [1, -1, 0.0]])
    return Polygon(vertices=square + position, radiance=[1.0])


def both(position):
    return Total(lights=(Directional(direction=[0, 0, 1], strength=[1.0]), led(position)))


def rendered(surface, *lights):
    camera, pose = centred_orthographic((12, 12))
    viewpoint = Viewpoint(camera=camera, pose=pose)
    return render(Scene(surface=surface, viewpoints=(viewpoint,), size=(12, 12), lights=lights, beams=8), engine="rays")


@pytest.mark.parametrize("make", [led, disc, window, both])
@pytest.mark.parametrize(
    ("name", "inside"),
    [
        ("sphere", [0.1, 0, 0.2]),
        ("sphere", [0, 0, -3]),
        ("hills", [0.2, 0.1, -2]),
        ("bowl", [0, 0, -0.95]),
        ("ball", [0.2, 0.1, 0.1]),
        ("box", [-0.3, 0.2, 0.4]),
    ],
)
def test_lamps_inside_are_refused(name, inside, make):
    with pytest.raises(InputError, match=f"Light 2, a {make(np.zeros(3)).name}, is inside the surface at") as caught:
        rendered(SURFACES[name], led([0, 0, 5.0]), make(np.array(inside, float)))
    assert "Move it" in caught.value.remedy


@pytest.mark.parametrize("make", [led, disc, window, both])
@pytest.mark.parametrize(
    ("name", "outside"),
    [
        ("sphere", [0, 0, 0.7]),
        ("sphere", [0.9, 0, 0.1]),
        ("hills", [0.2, 0.1, 2]),
        ("hills", [3.0, 0, -1]),  # beside the field there is nothing to be below
        ("bowl", [0, 0, -0.5]),
        ("ball", [0, 0, 0.7]),
        ("box", [0.8, 0, 0.1]),
        ("box", [0, 0, 0.6]),
    ],
)
def test_lamps_outside_are_fine(name, outside, make):
    found = rendered(SURFACES[name], led([0, 0, 5.0]), make(np.array(outside, float)))
    assert found[0].capture.stack.shape[0] == 2


def test_a_lamp_that_is_partly_inside_is_refused():
    wide = Disc(centre=[-0.5, 0, 0.1], axis=[0, 0, -1], radius=0.8, radiance=[1.0])
    with pytest.raises(InputError, match="a disc, is inside"):
        rendered(Cliffs(height=0.4), wide)  # its right side is in the cliff
    narrow = Disc(centre=[-0.5, 0, 0.1], axis=[0, 0, -1], radius=0.4, radiance=[1.0])
    assert rendered(Cliffs(height=0.4), narrow)


def test_distant_lights_are_never_inside():
    assert rendered(Sphere(), Directional(direction=[0, 0, 1], strength=1.0), Sun.of_irradiance([0, 0.1, 1], 1.0))
