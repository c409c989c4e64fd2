import numpy as np
import pytest

from psstereo.calibrate.registration import register_frames, registered
from psstereo.capture import Capture
from psstereo.errors import InputError, OptionError
from psstereo.lights import Rig
from psstereo.stack import MemoryStack

SIZE = 112


def frames_of(count, *, paint=True, seed=0, linear=None, size=SIZE, far=2.0, noise=0.003):
    """Frames of a curved surface under lights all around, evaluated exactly where each frame's pixels are."""
    rng = np.random.default_rng(seed)
    moves = np.repeat(np.eye(2, 3)[None], count, axis=0)
    moves[1:, :, 2] = rng.uniform(-far, far, (count - 1, 2))
    if linear is not None:
        moves[1:, :, :2] += rng.uniform(-linear, linear, (count - 1, 2, 2))
    turn, height = np.arange(count) * 2.39996, np.radians(35 + 40 * ((np.arange(count) * 0.618) % 1))
    lights = np.stack([np.cos(turn) * np.cos(height), np.sin(turn) * np.cos(height), np.sin(height)], 1)
    waves, phases = rng.uniform(0.15, 0.5, (12, 2)), rng.uniform(0, 6.28, 12)
    rows, columns = np.indices((size, size)).astype(float)
    frames = []
    for move, light in zip(moves, lights, strict=True):
        inverse = np.linalg.inv(move[:, :2])
        x, y = np.einsum("ij,jhw->ihw", inverse, np.stack([columns - move[0, 2], rows - move[1, 2]]))
        right = -(x - size / 2) / size * 1.8 + 0.3 * np.cos(x / 9 + 1) * np.cos(y / 13)
        down = -(y - size / 2) / size * 1.8 - 0.25 * np.sin(y / 11) * np.sin(x / 10)
        normals = np.stack([-right, down, np.ones_like(x)], -1)
        normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
        albedo = 0.6
        if paint:
            albedo = albedo + 0.1 * sum(np.sin(x * a + y * b + p) for (a, b), p in zip(waves, phases, strict=True))
        shown = np.clip(albedo, 0.1, 1) * np.maximum(normals @ light, 0)
        frames.append(shown + noise * rng.standard_normal(shown.shape))
    return np.round(np.clip(np.array(frames) * 0.6, 0, 1) * 4095) / 4095, lights, moves


def places(found, moves, size=SIZE):
    corners = np.array([[20, size - 20, 20, size - 20], [20, 20, size - 20, size - 20], [1, 1, 1, 1]])
    return np.linalg.norm((found - moves) @ corners, axis=1).max(axis=1)


@pytest.mark.parametrize(("count", "far"), [(6, 2.0), (10, 8.0)])
def test_painted_surfaces_to_a_twentieth_of_a_pixel_under_changing_light(count, far):
    frames, _, moves = frames_of(count, far=far)
    found = register_frames(frames)
    wrong = places(found.affines, moves)
    assert found.by == "paint"
    assert found.converged
    assert wrong.max() < 0.05
    assert np.sqrt((wrong**2).mean()) < 4 * np.sqrt((found.errors**2).mean())
    assert abs(found.moved - places(np.eye(2, 3), moves).max()) < 0.1


def test_shapes_without_paint_to_a_twentieth_of_a_pixel():
    frames, _, moves = frames_of(10, paint=False, seed=3, size=96, far=1.0)
    found = register_frames(frames)
    assert found.by == "shape"
    assert places(found.affines, moves, 96).max() < 0.05
    assert "paint" in found.quality.advice[-1]


def test_small_turns_and_scales():
    frames, _, moves = frames_of(6, linear=0.005)
    shift = places(register_frames(frames).affines, moves).max()
    found = places(register_frames(frames, model="affine").affines, moves).max()
    assert found < 0.15
    assert found < 0.3 * shift


def test_another_reference_and_unknown_pixels():
    frames, _, moves = frames_of(6)
    frames[2, 40:60, 50:65] = np.nan
    found = register_frames(frames, reference=4)
    whole = np.concatenate([moves, np.broadcast_to([[[0, 0, 1.0]]], (6, 1, 3))], axis=1)
    wanted = (whole @ np.linalg.inv(whole[4]))[:, :2]
    assert places(found.affines, wanted).max() < 0.06
    assert found.errors[4] == 0


def test_a_capture_is_read_with_its_frames_in_place():
    frames, lights, moves = frames_of(6)
    values = np.round(frames * 65535).astype(np.uint16)
    mask = np.zeros((SIZE, SIZE), np.bool_)
    mask[10:-14, 18:-9] = True
    capture = Capture(stack=MemoryStack(values), rig=Rig.distant(lights), mask=mask)
    moved, _ = registered(capture)
    assert places(moved.stack.affines, moves).max() < 0.06
    assert "registered" in moved.notes[-1]
    assert moved.mask is mask
    still, _, _ = frames_of(6, far=0.0)
    inside = np.s_[16:-20, 24:-16]
    left = np.abs(moved.stack.frame(3)[..., 0] / 65535 - still[3])[inside]
    before = np.abs(frames[3] - still[3])[inside]
    assert np.median(left) < 0.4 * np.median(before)


def test_frames_in_place_stay_as_they_are():
    frames, lights, _ = frames_of(6, far=0.0)
    capture = Capture(stack=MemoryStack(np.round(frames * 65535).astype(np.uint16)), rig=Rig.distant(lights))
    same, found = registered(capture)
    assert same.stack is capture.stack
    assert found.moved < 0.06
    assert "none is moved" in same.notes[-1]


def test_what_cannot_be_used_is_refused():
    frames, _, _ = frames_of(6)
    with pytest.raises(InputError, match="There are 4 frames"):
        register_frames(frames[:4])
    with pytest.raises(InputError, match="show nothing"):
        register_frames(np.concatenate([frames, np.zeros((1, SIZE, SIZE))]))
    with pytest.raises(InputError, match="pixels are to be compared"):
        register_frames(frames[:, :30, :30])
    with pytest.raises(InputError, match="mask has the shape"):
        register_frames(frames, mask=np.ones((3, 4), np.bool_))
    with pytest.raises(OptionError, match="model"):
        register_frames(frames, model="elastic")
    with pytest.raises(OptionError, match="reference"):
        register_frames(frames, reference=6)
