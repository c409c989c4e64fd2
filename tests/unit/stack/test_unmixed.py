import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from psstereo.capture import Capture
from psstereo.errors import InputError, OptionError
from psstereo.flags import Flag
from psstereo.lights import Rig
from psstereo.normals import GATES, LeastSquares, estimate_normals
from psstereo.stack import MemoryStack, Mixing, Response, UnmixedStack
from psstereo_synth import hills, ring

MATRIX = np.array([[0.8, 0.15, 0.02], [0.1, 0.7, 0.2], [0.05, 0.1, 0.9]])


def one_shot(*, steepness=0.3, size=32, matrix=MATRIX, bits=None):
    """One photograph of hills whose albedo varies and whose colour does not, and their normals, mask and shading."""
    surface = hills(size, size, steepness=steepness)
    albedo = np.random.default_rng(0).uniform(0.3, 0.9, (size, size))
    shading = np.maximum(np.nan_to_num(surface.normals) @ ring(3).T, 0.0) * albedo[..., None]
    photograph = shading @ matrix.T * 0.8
    if bits is not None:
        photograph = np.rint(photograph * (2**bits - 1)).astype(np.uint8 if bits == 8 else np.uint16)
    return photograph, surface, 0.8 * shading


def angle(a, b):
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(-1))


def test_three_lights_from_one_photograph_exactly():
    photograph, surface, shading = one_shot()
    stack = UnmixedStack(MemoryStack(photograph[None]), Mixing(MATRIX))
    assert stack.shape == (3, 32, 32, 1)
    for light in range(3):
        np.testing.assert_allclose(stack.frame(light)[..., 0], shading[..., light], rtol=0, atol=1e-14)
    result = estimate_normals(Capture(stack=stack, rig=Rig.distant(ring(3)), mask=surface.mask))
    assert angle(result.normals, surface.normals)[surface.mask].max() < np.radians(1e-6)
    assert (result.flags[surface.mask] == Flag.NO_REDUNDANCY).all()


@pytest.mark.parametrize(("bits", "limit"), [(16, 0.02), (8, 3.0)])
def test_rounding_is_magnified_by_no_more_than_the_noise_gain(bits, limit):
    photograph, surface, shading = one_shot(bits=bits)
    stack = UnmixedStack(MemoryStack(photograph[None]), Mixing(MATRIX))
    assert stack.dtype == np.float32
    found = np.concatenate([stack.frame(i) for i in range(3)], axis=2)
    worst = np.abs(np.linalg.inv(MATRIX)).sum(axis=1) * 0.5 / (2**bits - 1)
    assert (np.abs(found - shading).max(axis=(0, 1)) <= worst + 1e-6).all()
    result = estimate_normals(Capture(stack=stack, rig=Rig.distant(ring(3)), mask=surface.mask))
    assert np.degrees(angle(result.normals.astype(float), surface.normals)[surface.mask].max()) < limit


def test_two_photographs_give_six_lights_in_order():
    rng = np.random.default_rng(3)
    lights = rng.uniform(0, 0.3, (2, 5, 7, 3))
    stack = UnmixedStack(MemoryStack(lights @ MATRIX.T, names=("a", "b")), Mixing(MATRIX))
    assert len(stack) == 6
    assert stack.names[0] == "a, light 1"
    assert stack.names[5] == "b, light 3"
    with ThreadPoolExecutor(3) as pool:
        frames = list(pool.map(stack.frame, [5, 0, 3, 1, 4, 2]))
    for index, frame in zip([5, 0, 3, 1, 4, 2], frames, strict=True):
        np.testing.assert_allclose(frame[..., 0], lights[index // 3, ..., index % 3], rtol=0, atol=1e-14)
    np.testing.assert_array_equal(stack.frame(-1), stack.frame(5))
    with pytest.raises(IndexError):
        stack.frame(6)


def test_response_and_dark_level_are_undone_before():
    photograph, _, shading = one_shot()
    dark = np.random.default_rng(4).uniform(0, 0.05, photograph.shape)
    curved = (photograph + dark) ** (1 / 2.2)
    stack = UnmixedStack(MemoryStack(curved[None]), Mixing(MATRIX), response=Response("gamma", 2.2), dark=dark)
    for light in range(3):
        np.testing.assert_allclose(stack.frame(light)[..., 0], shading[..., light], rtol=0, atol=1e-13)


@pytest.mark.parametrize("gate", ["auto", "none"])
def test_a_saturated_channel_spoils_all_lights_there_and_nothing_else(gate):
    photograph, surface, _ = one_shot(bits=16)
    photograph[15, 16, 2] = 65535
    stack = UnmixedStack(MemoryStack(photograph[None]), Mixing(MATRIX))
    for light in range(3):
        np.testing.assert_array_equal(np.argwhere(np.isnan(stack.frame(light)[..., 0])), [[15, 16]])
    capture = Capture(stack=stack, rig=Rig.distant(ring(3)), mask=surface.mask)
    result = estimate_normals(capture, LeastSquares(gate=GATES[gate]))
    assert result.flags[15, 16] & Flag.TOO_FEW_LIGHTS  # whatever the gate: what was clipped cannot be told apart
    assert np.isfinite(result.normals[15, 17]).all()


def test_it_pickles():
    photograph, _, _ = one_shot()
    stack = UnmixedStack(MemoryStack(photograph[None]), Mixing(MATRIX))
    first = stack.frame(1)
    again = pickle.loads(pickle.dumps(stack))
    np.testing.assert_array_equal(again.frame(1), first)


def test_gains_of_the_noise():
    np.testing.assert_allclose(Mixing(np.diag([1.0, 2.0, 0.3])).noise_gain, 1.0)
    rng = np.random.default_rng(5)
    mixing = Mixing(MATRIX)
    s = rng.uniform(0, 1, 3)
    noise = rng.normal(0, 1e-3, (200_000, 3))
    spread = (np.linalg.solve(MATRIX, (MATRIX @ s + noise).T) - s[:, None]).std(axis=1)
    alone = 1e-3 / np.linalg.norm(MATRIX, axis=0)  # each light alone, all channels used
    np.testing.assert_allclose(spread / alone, mixing.noise_gain, rtol=0.02)


@pytest.mark.parametrize(
    "matrix",
    [
        np.zeros((3, 3)),
        np.ones((3, 3)),
        [[1, 0, 1], [0, 1, 1], [1, 1, 2]],
        [[1, 0, 0], [0, 1, 0], [0, 0, 0]],
        [[1, 1, 0], [1, 1.0001, 0], [0, 0, 1]],
    ],
)
def test_lights_of_the_same_colour_are_refused(matrix):
    with pytest.raises(OptionError, match="singular") as caught:
        Mixing(np.array(matrix, float))
    assert "one image a light" in caught.value.remedy


@pytest.mark.parametrize(
    "matrix", [np.eye(3)[:2], np.ones(3), np.eye(1), np.full((3, 3), np.nan), np.diag([1, 1, np.inf]), np.zeros((0, 0))]
)
def test_what_is_no_mixing_is_refused(matrix):
    with pytest.raises(OptionError, match="The mixing matrix has the shape"):
        Mixing(matrix)


def test_a_small_scale_is_no_singularity():
    assert Mixing(MATRIX * 1e-9).condition == pytest.approx(Mixing(MATRIX).condition)
    assert Mixing(MATRIX * [1e-6, 1.0, 1e6]).condition == pytest.approx(Mixing(MATRIX).condition)


def test_photographs_that_do_not_fit_are_refused():
    with pytest.raises(InputError, match="1 channel; the mixing is for 3"):
        UnmixedStack(MemoryStack(np.ones((1, 4, 4, 1))), Mixing(MATRIX))
    with pytest.raises(InputError, match=r"dark image has the shape \(4, 4, 1\)"):
        UnmixedStack(MemoryStack(np.ones((1, 4, 4, 3))), Mixing(MATRIX), dark=np.zeros((4, 4, 1)))
