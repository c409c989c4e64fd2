"""Unknown strengths of lights: how far the answer is trusted, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from psstereo.capture import Capture
from psstereo.errors import InputError, OptionError, RigError, UnsupportedError
from psstereo.lights import Led, Rig
from psstereo.normals.strength_refinement import Refined
from psstereo.normals.strengths import estimate_strengths
from psstereo.stack import MemoryStack
from psstereo_synth import ring, spiral
from tests.unit.normals.strength_captures import bent, drawn, hilly, lit_by, relative, seen


@pytest.mark.parametrize("noise", [0.0, 0.002, 0.01, 0.03])
@pytest.mark.parametrize("count", [6, 24])
def test_a_plane_is_refused(count, noise):
    strengths = drawn(count)
    with pytest.raises(InputError, match="strengths") as caught:
        estimate_strengths(lit_by(seen(bent(0.0), spiral(count), noise), strengths))
    assert caught.value.remedy == "Keep the given strengths, or measure them with a white sphere or card."


@pytest.mark.parametrize("noise", [0.0, 0.002, 0.01])
def test_what_is_told_is_at_least_as_good_as_expected(noise):
    """From a deep relief to a flat one: either the error is of the size that was told, or it is refused."""
    strengths, told = drawn(12), 0
    for height in (1.0, 0.3, 0.1, 0.03, 0.01):
        capture = lit_by(seen(bent(height), spiral(12), noise), strengths)
        try:
            found = estimate_strengths(capture)
        except InputError:
            continue
        told += 1
        error = np.sqrt((relative(found.strengths, strengths) ** 2).mean())
        assert error <= found.health.expected_error <= 0.15
    assert told >= 2


@pytest.mark.parametrize(
    ("directions", "words"),
    [
        (ring(3), "3 lights"),
        (np.array([[np.sin(a), 0.0, np.cos(a)] for a in (-0.6, -0.2, 0.3, 0.5)]), "one plane"),
        (np.array([[np.sin(a), 0.0, np.cos(a)] for a in (-0.6, -0.2, 0.3, 0.5)] + [[0, 0.6, 0.8]]), "but for one"),
        (spiral(12, max_tilt=np.radians(2)), "all alike"),
    ],
)
def test_lights_with_which_strengths_cannot_be_told_are_refused(directions, words):
    """The images would be fitted exactly by wrong strengths, so that no residual could tell."""
    with pytest.raises(RigError, match=words):
        estimate_strengths(hilly(directions))


def test_a_near_lamp_taken_for_a_distant_one_is_told_by_the_regions():
    """Each region sees strengths of its own; with the same images from afar, they agree."""
    normals = bent(1.0)
    y, x = np.mgrid[0:48, 0:48] / 24 - 1.0
    directions = spiral(12)
    near = seen(normals, directions, 0.0)
    slope = np.einsum("mc,hwc->mhw", directions[:, :2], np.dstack([x, -y]))
    fall = 1.0 / (1.2 - slope) ** 2  # nearer to the lamp, brighter
    with pytest.raises(InputError, match="uncertain by"):
        estimate_strengths(replace(near, stack=MemoryStack(near.stack.read()[..., 0] * fall)))
    assert estimate_strengths(near).health.expected_error < 0.01


def test_dark_and_saturated_images_are_refused_by_name():
    capture = hilly()
    images = capture.stack.read().copy()
    images[4] = 0.0
    with pytest.raises(InputError, match="nothing that can be used"):
        estimate_strengths(replace(capture, stack=MemoryStack(images)))
    images[4, 20, 20:24] = 0.5
    with pytest.raises(InputError, match="Only 4 pixels"):
        estimate_strengths(replace(capture, stack=MemoryStack(images)))
    with pytest.raises(InputError, match="nothing that can be used"):
        estimate_strengths(replace(capture, stack=MemoryStack(np.zeros_like(images))))
    white = np.round(capture.stack.read() * 200 / images.max()).astype(np.uint8)
    white[2] = 255
    with pytest.raises(InputError, match="nothing that can be used"):
        estimate_strengths(replace(capture, stack=MemoryStack(white)))


def test_noise_alone_is_refused():
    images = np.abs(np.random.default_rng(0).standard_normal((12, 40, 40)))
    with pytest.raises(InputError, match="strengths"):
        estimate_strengths(Capture(stack=MemoryStack(images), rig=Rig.distant(spiral(12))))


def test_pixels_that_are_not_finite_are_left_out():
    capture, strengths = hilly(), drawn(12)
    images = capture.stack.read() * strengths[:, None, None, None]
    images[np.random.default_rng(0).random(images.shape) < 0.1] = np.nan
    images[0, :3] = np.inf
    found = estimate_strengths(replace(capture, stack=MemoryStack(images)))
    assert np.abs(relative(found.strengths, strengths)).max() < 1e-8


@pytest.mark.parametrize(
    "options", [{"prior": -1.0}, {"prior": np.nan}, {"worst_error": -0.1}, {"worst_error": np.inf}]
)
def test_options_that_make_no_sense(options):
    with pytest.raises(OptionError, match=next(iter(options)).replace("_", " ")):
        estimate_strengths(hilly(size=16), **options)


def test_other_refusals():
    capture = hilly(size=16)
    with pytest.raises(OptionError):
        estimate_strengths(capture, gray="grey")
    with pytest.raises(InputError, match="valid range"):
        estimate_strengths(capture, valid_range=(0.9, 0.1))
    lamp = Led(position=np.array([0.0, 0, 300]), axis=np.array([0.0, 0, -1]), mu=1.0, flux=np.ones(1))
    with pytest.raises(UnsupportedError):
        estimate_strengths(replace(capture, rig=Rig((lamp,) * 12)))
    with pytest.raises(InputError, match=r"At most 0\.01 %"):
        estimate_strengths(capture, worst_error=1e-4)


def test_a_prior_holds_strengths_near_to_the_nominal_ones():
    capture, strengths = hilly(), np.exp(0.1 * np.random.default_rng(0).standard_normal(12))
    off = [
        np.log(estimate_strengths(lit_by(capture, strengths), prior=prior, worst_error=10).strengths).std()
        for prior in (0.0, 0.1, 10.0, 1e4)
    ]
    assert off[0] == pytest.approx(np.log(strengths).std())
    assert off[0] > off[1] > off[2] > off[3]
    assert off[3] < 1e-3


def test_without_determinacy_nothing_is_expected():
    assert Refined(np.ones(4), 0.1, 0.0, 0.0, 1, settled=False).expected_error == np.inf
    assert Refined(np.ones(4), 0.1, 0.05, 0.0, 1, settled=True).expected_error == np.inf  # noise could feign it
