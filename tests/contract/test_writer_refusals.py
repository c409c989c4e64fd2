"""What no layout or not every layout holds: it is refused before anything is written."""

import numpy as np
import pytest

from psstereo.camera import Orthographic, Pinhole
from psstereo.capture import Capture, Truth
from psstereo.errors import (
    InputError,
    OptionError,
    UnsupportedError,
)
from psstereo.io import WRITERS, write_capture
from psstereo.lights import Light, Rig
from psstereo.stack import MemoryStack, Response
from tests.contract.written_captures import COUNT, NEAR, SHAPE, Failing, changed, distant, every_writer, near, sample

# What a layout cannot hold is refused before anything is written.


class Glow(Light):
    """Light from everywhere, which no file of lights holds."""

    name = "glow"
    positional = False

    @property
    def channels(self):
        return 1

    def directions(self, points):
        return np.full(np.shape(points), np.nan)

    def irradiance(self, points, normals):
        return np.ones((*np.shape(points)[:-1], 1))

    def beams(self, points, count):
        yield from ()

    def moved(self, rotation, translation):
        return self


@pytest.fixture
def refuse(tmp_path):
    """Return what checks that a capture is refused before an image is asked for or anything is written."""

    def check(capture, truth, name, kind, match):
        untouched = changed(capture, stack=Failing(capture.stack, None))
        with pytest.raises(kind, match=match) as caught:
            write_capture(untouched, tmp_path / "x", name, truth=truth)
        assert caught.value.needed
        assert caught.value.remedy
        assert list(tmp_path.iterdir()) == []
        assert untouched.stack.asked == []

    return check


@every_writer
def test_the_wrong_kind_of_lights(name, refuse):
    capture, truth = sample(name)
    glow = Rig((*capture.rig.lights[1:], Glow()))
    refuse(changed(capture, rig=glow), truth, name, UnsupportedError, "glow")
    other = (distant("capture") if name in NEAR else near())[0].rig
    mixed = Rig((*capture.rig.lights[1:], other.lights[0]))
    refuse(changed(capture, rig=mixed), truth, name, UnsupportedError, f"Light {COUNT} is")
    if name != "capture":
        refuse(changed(capture, rig=other), truth, name, UnsupportedError, "Light 1 is")


@pytest.mark.parametrize("name", sorted(NEAR))
def test_lamps_need_a_pinhole(name, refuse):
    capture, truth = near()
    refuse(changed(capture, camera=Orthographic()), truth, name, UnsupportedError, "orthographic")


def test_luces_needs_one_focal_length_and_a_depth(refuse):
    capture, truth = near()
    for odd in ({"fy": 400.0}, {"skew": 0.1}):
        camera = Pinhole(**{"fx": 333.0, "fy": 333.0, "cx": 9.0, "cy": 6.0, **odd})
        refuse(changed(capture, camera=camera), truth, "luces", UnsupportedError, "focal length")
    for depth in (None, np.full(SHAPE, np.nan)):
        refuse(capture, Truth(depth=depth), "luces", InputError, "no true depth")


@pytest.mark.parametrize("name", sorted(set(WRITERS) - {"capture"}))
def test_floats_responses_and_levels_need_our_own_layout(name, refuse):
    capture, truth = sample(name)
    values = capture.stack.read()
    for dtype in (np.float32, np.float64):
        floats = changed(capture, stack=MemoryStack(values.astype(dtype) / 65535))
        refuse(floats, truth, name, UnsupportedError, f"float{dtype().itemsize * 8}")
    refuse(changed(capture, response=Response("srgb")), truth, name, UnsupportedError, "srgb")
    for white in (0.0, -3.0, np.nan, 65536.0):
        odd = changed(capture, stack=MemoryStack(values, white=white))
        refuse(odd, truth, name, InputError, "full scale")
    dark = np.full((*SHAPE, 3), 0.5)
    refuse(changed(capture, dark=dark), truth, name, UnsupportedError, "dark image")


@every_writer
def test_images_of_many_channels(name, refuse):
    capture, truth = sample(name, coloured=False)
    many = changed(capture, stack=MemoryStack(np.repeat(capture.stack.read(), 5, axis=3)))
    refuse(many, Truth(depth=truth.depth), name, UnsupportedError, "5 channels")
    two = changed(capture, stack=MemoryStack(np.repeat(capture.stack.read(), 2, axis=3)))
    refuse(two, Truth(depth=truth.depth), name, UnsupportedError, "2 channels")


@every_writer
def test_strengths_for_other_channels(name, refuse):
    capture, truth = sample(name)
    gray = changed(capture, stack=MemoryStack(capture.stack.read()[..., :1]))
    refuse(gray, Truth(depth=truth.depth), name, InputError, "3 channels")


@every_writer
@pytest.mark.parametrize("part", ["normals", "depth", "albedo", "visibility"])
def test_truth_of_other_sizes(name, part, refuse):
    capture, truth = sample(name)
    parts = {"depth": truth.depth, part: getattr(truth, part)[:-1]}
    refuse(capture, Truth(**parts), name, InputError, f"true {part} have the shape")
    whole = {"depth": truth.depth, part: np.ones_like(getattr(truth, part), dtype=np.int64)}
    refuse(capture, Truth(**whole), name, InputError, "int64")


@every_writer
def test_truth_without_a_normal(name, refuse):
    capture, truth = sample(name)
    for nothing in (0.0, np.nan):
        normals = np.full((*SHAPE, 3), nothing)
        refuse(capture, Truth(depth=truth.depth, normals=normals), name, InputError, "everywhere")


@pytest.mark.parametrize(("name", "most"), [("lp", 1000), ("near-ps", 9999)])
def test_too_many_images(name, most, refuse):
    capture, _ = sample(name)
    for count, fits in ((most, True), (most + 1, False)):
        images = np.broadcast_to(np.uint8(1), (count, 1, 1, 3))
        many = Capture(stack=MemoryStack(images), rig=Rig((capture.rig.lights[0],) * count), camera=capture.camera)
        if fits:
            WRITERS[name].check(many, None)
        else:
            refuse(many, None, name, UnsupportedError, f"{count} images")


def test_rti_knows_lights_of_one_strength_before_the_object_only(refuse):
    capture, _ = distant("lp")
    behind = np.vstack([capture.rig.directions[1:], [[1.0, 0.2, 0.0]]])
    refuse(changed(capture, rig=Rig.distant(behind)), None, "lp", UnsupportedError, f"Light {COUNT} has z")
    odd = Rig.distant(capture.rig.directions, np.arange(1.0, COUNT + 1))
    refuse(changed(capture, rig=odd), None, "lp", UnsupportedError, "strengths from 1 to 7")


@pytest.mark.parametrize("bad", ["", "  \t", "\ud800"])
def test_names_that_no_text_holds(bad, refuse):
    capture, truth = sample("capture")
    refuse(changed(capture, name=bad), truth, "capture", InputError, "name of the capture")
    if not bad.strip():
        camera = Orthographic(pixel_size=0.1, length_unit=bad)
        refuse(changed(capture, camera=camera), truth, "capture", InputError, "unit of length")


def test_an_unknown_layout_is_refused(tmp_path):
    capture, _ = sample("capture")
    with pytest.raises(OptionError, match=r"diligant.*Did you mean diligent"):
        write_capture(capture, tmp_path / "x", "diligant")
    assert list(tmp_path.iterdir()) == []
