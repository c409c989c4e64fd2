import numpy as np
import pytest

from psstereo.calibrate.response import response_from_shading, response_of_capture
from psstereo.capture import Capture
from psstereo.errors import InputError
from psstereo.lights import Rig
from psstereo.stack import FlatField, MemoryStack, Response


def photographs(exponent, *, count=12, size=28, shine=0.0, dark=0.0, seed=0, strengths=None):
    """A painted ball, values of 8 bits (m, p)."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[-1 : 1 : size * 1j, -1 : 1 : size * 1j]
    inside = x * x + y * y < 0.95
    normals = np.stack([x, y, np.sqrt(np.maximum(1 - x * x - y * y, 0))], -1)[inside]
    turn, height = np.arange(count) * 2.39996, np.radians(35 + 45 * ((np.arange(count) * 0.618) % 1))
    lights = np.stack([np.cos(turn) * np.cos(height), np.sin(turn) * np.cos(height), np.sin(height)], 1)
    half = lights + np.array([0.0, 0.0, 1.0])
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    cosine = np.maximum(lights @ normals.T, 0)
    light = rng.uniform(0.4, 0.9, len(normals)) * cosine + shine * np.maximum(half @ normals.T, 0) ** 50 * (cosine > 0)
    light = light * (1.0 if strengths is None else np.asarray(strengths)[:, None]) + dark
    return np.round(255 * np.clip(light, 0, 1) ** (1 / exponent)).astype(np.uint8), lights, inside


@pytest.mark.parametrize(("exponent", "count"), [(0.7, 12), (2.2, 6)])
def test_eight_bits_tell_the_exponent_to_half_a_percent(exponent, count):
    values, lights, _ = photographs(exponent, count=count)
    found = response_from_shading(values / 255, lights)
    assert abs(found.exponent / exponent - 1) < 4e-3
    assert found.response.name == "gamma"
    assert found.exponent_error < 0.01


def test_linear_photographs_stay_linear():
    values, lights, _ = photographs(1.0)
    assert response_from_shading(values / 255, lights).response.is_linear


def test_highlights_are_left_out():
    values, lights, _ = photographs(2.2, count=12, shine=0.3)
    found = response_from_shading(values / 255, lights)
    assert abs(found.exponent / 2.2 - 1) < 0.01
    assert abs(found.exponent - 2.2) < 4 * found.exponent_error


def test_strengths_and_the_dark_level_take_part():
    strengths = np.linspace(0.5, 1.1, 8)
    values, lights, _ = photographs(2.2, count=8, strengths=strengths, dark=0.03)
    dark = np.full(values.shape[1], 0.03 ** (1 / 2.2))
    found = response_from_shading(values / 255, lights, strengths, dark=dark)
    assert abs(found.exponent / 2.2 - 1) < 5e-3
    blind = response_from_shading(values / 255, lights, strengths)
    assert abs(blind.exponent / 2.2 - 1) > 0.01
    # an error bar that knows of it
    assert blind.exponent_error > 3 * found.exponent_error


def capture_of(exponent, **more):
    values, lights, inside = photographs(exponent)
    images = np.zeros((len(values), *inside.shape, 1), np.uint8)
    images[:, inside] = values[..., None]
    return Capture(stack=MemoryStack(images), rig=Rig.distant(lights), mask=inside, **more)


def test_of_a_capture():
    assert abs(response_of_capture(capture_of(2.2)).exponent / 2.2 - 1) < 4e-3


@pytest.mark.parametrize(
    "more", [{"response": Response("srgb")}, {"flat": FlatField(np.ones((28, 28, 1)))}], ids=["response", "flat"]
)
def test_values_that_were_changed_are_refused(more):
    with pytest.raises(InputError, match="no longer as the camera gave them"):
        response_of_capture(capture_of(2.2, **more))


def test_what_cannot_be_used_is_refused():
    values, lights, _ = photographs(2.2)
    with pytest.raises(InputError, match="lit by 5 lights"):
        response_from_shading(values[:4] / 255, lights[:4])
    with pytest.raises(InputError, match="directions of"):
        response_from_shading(values / 255, lights[:4])
    with pytest.raises(InputError, match="Strengths"):
        response_from_shading(values / 255, lights, -np.ones(12))
