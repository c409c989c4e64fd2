"""Near lamps: what is refused, and what is said about it."""

from dataclasses import replace

import numpy as np
import pytest

from psstereo.errors import InputError, OptionError, RigError, UnsupportedError
from psstereo.lights import Directional, Led, Rig
from psstereo.near import NearOptions, solve_near
from psstereo.normals import GATES, LeastSquares
from psstereo.pipeline import Options, reconstruct
from psstereo.stack import MemoryStack
from tests.unit.near.near_scenes import parallel_sphere, pinhole_sphere, ring, shoot


def with_images(capture, images, **changes):
    return replace(capture, stack=MemoryStack(images), **changes)


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (Options(clip=1.0), "clip"),
        (Options(verdicts=True), "verdict"),
        (Options(gate=GATES["none"]), "gate"),
        (Options(observation_mask=np.ones((12, 32, 32), np.bool_)), "mask of observations"),
    ],
)
def test_the_pipeline_refuses_what_the_method_does_not_know(options, word):
    capture = shoot(*pinhole_sphere(32), ring())
    with pytest.raises(UnsupportedError, match=word):
        reconstruct(capture, options)


def test_a_solver_for_distant_lights_still_refuses_lamps():
    capture = shoot(*pinhole_sphere(32), ring())
    with pytest.raises(UnsupportedError):
        reconstruct(capture, Options(solver=LeastSquares()))


REFUSED = {
    "three lamps": (lambda c: with_images(c, c.stack.read()[:3], rig=c.rig.select([0, 1, 2])), RigError, "3 lamps"),
    "a sun among them": (
        lambda c: replace(c, rig=Rig((*c.rig.lights[:-1], Directional(direction=[0, 0, 1.0], strength=[1.0])))),
        UnsupportedError,
        "Light 12 is of the kind directional",
    ),
    "all on a line": (
        lambda c: replace(
            c, rig=Rig(tuple(Led(position=[i, 2.0 * i, 0], axis=[0, 0, -1], mu=0, flux=1) for i in range(12)))
        ),
        RigError,
        "one line",
    ),
    "too many channels": (
        lambda c: replace(
            c, rig=Rig((*c.rig.lights[:-1], Led(position=[1, 2, 3], axis=[0, 0, -1], mu=0, flux=[1, 1, 1])))
        ),
        RigError,
        "3 channels",
    ),
    "a size of pixels that is not known": (
        lambda c: replace(c, camera=type(parallel_sphere(8)[0])()),
        InputError,
        "how large a pixel is",
    ),
    "lamps behind the camera that shine away": (
        lambda c: replace(
            c, rig=Rig(tuple(Led(position=x.position, axis=[0, 0, 1], mu=1, flux=1) for x in c.rig.lights))
        ),
        InputError,
        "At no distance",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_captures_that_cannot_be_solved_are_refused(case):
    change, error, words = REFUSED[case]
    with pytest.raises(error, match=words):
        solve_near(change(shoot(*pinhole_sphere(24), ring())))


def test_a_distance_with_lamps_inside_or_behind_the_object_is_refused():
    camera, depth, normals, mask = pinhole_sphere(24)
    lamps = ring(height=-300.0)
    capture = shoot(camera, depth, normals, mask, lamps)
    with pytest.raises(RigError, match="in front of the object"):
        solve_near(capture, NearOptions(distance=200.0))
    centre = tuple(lamp.moved(np.eye(3), -lamp.position + [i, -i, -300.0 - i * i]) for i, lamp in enumerate(lamps))
    with pytest.raises(RigError, match="inside or behind"):
        solve_near(replace(capture, rig=Rig(centre)), NearOptions(distance=301.0))


@pytest.mark.parametrize(
    "options",
    [
        {"distance": float("nan")},
        {"distance": float("inf")},
        {"hold_distance": True},
        {"max_rounds": 0},
        {"tolerance": 0.0},
        {"tolerance": float("nan")},
    ],
)
def test_options_out_of_range_are_refused(options):
    with pytest.raises(OptionError):
        NearOptions(**options)


def test_a_distance_behind_the_camera_and_an_empty_range_are_refused():
    capture = shoot(*pinhole_sphere(24), ring())
    with pytest.raises(OptionError, match="positive length"):
        solve_near(capture, NearOptions(distance=-5.0))
    with pytest.raises(InputError, match="lower end"):
        solve_near(capture, NearOptions(valid_range=(0.5, 0.1)))
    with pytest.raises(OptionError):
        solve_near(capture, NearOptions(gray="nonsense"))
