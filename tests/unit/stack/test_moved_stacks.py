"""Stacks over stacks: linear light, crops, coarser pixels, frames moved, a lens undone."""

import pickle

import cv2
import numpy as np
import pytest

from psstereo.camera import Lens, Pinhole, Undistortion
from psstereo.errors import InputError, OptionError
from psstereo.stack import BinnedStack, CroppedStack, FlatField, LinearStack, MemoryStack, Response, WarpedStack
from psstereo.stack.warped import warp_mask

SHAPE = (120, 150)
Y, X = np.indices(SHAPE).astype(np.float64)
CAMERA = Pinhole(fx=200, fy=206, cx=72, cy=61)
LENS = Lens((-0.2, 0.05, 0.001, -0.002, 0.01))


def pattern(x, y, scale=3.0):
    return 2.0 + np.sin(x / scale) + np.cos(y / (scale + 1) + x / 11)


def test_linear_light_by_the_formula_and_nan_where_saturated():
    rng = np.random.default_rng(0)
    images = rng.integers(0, 240, (2, 5, 6, 3), np.uint8)
    images[1, 2, 3, 0] = 255
    dark, gain = rng.uniform(0, 9, (5, 6, 3)), rng.uniform(0.5, 2, (5, 6, 3))
    stack = LinearStack(MemoryStack(images), response=Response("gamma", 2.0), dark=dark, flat=FlatField(gain))
    wanted = ((images / 255.0) ** 2 * 255 - dark) * gain
    wanted[1, 2, 3] = np.nan
    np.testing.assert_allclose(stack.read(), wanted, rtol=1e-5, atol=1e-4)
    assert stack.dtype == np.float32
    assert not stack.saturates


@pytest.mark.parametrize("shift", [0.01, 0.1, 0.25, 0.5, 0.77, 3.3])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_shifts_are_exact_to_a_hundredth_of_a_pixel(shift, dtype):
    image = pattern(X, Y)[None].astype(dtype)
    moved = WarpedStack(LinearStack(MemoryStack(image)), affines=[[[1, 0, shift], [0, 1, -shift]]]).frame(0)[..., 0]
    assert moved.dtype == dtype
    inside = np.s_[6:-6, 6:-6]
    wrong = (moved - pattern(X + shift, Y - shift))[inside]
    slope = np.hypot(*np.gradient(pattern(X, Y)))[inside]
    assert np.sqrt((wrong**2).mean()) < 0.005 * np.sqrt((slope**2).mean())


def test_nan_spreads_to_what_would_be_mixed_with_it_and_not_further():
    image = pattern(X, Y)
    image[50, 60] = np.nan
    moved = WarpedStack(LinearStack(MemoryStack(image[None])), affines=[[[1, 0, 0.4], [0, 1, 0.4]]]).frame(0)[..., 0]
    rows, columns = np.nonzero(np.isnan(moved[:-2, :-2]))
    assert rows.min() >= 48
    assert rows.max() <= 51
    assert columns.min() >= 58
    assert columns.max() <= 61
    assert len(rows) >= 4
    assert np.isnan(moved[-1]).all()  # from below the last row


def photograph(coefficients=LENS.coefficients):
    seen = cv2.undistortPoints(
        np.stack([X.ravel(), Y.ravel()], 1)[:, None], CAMERA.matrix, np.array(coefficients), P=CAMERA.matrix
    ).reshape(-1, 2)
    return pattern(seen[:, 0], seen[:, 1]).reshape(SHAPE)


def test_a_lens_is_undone_and_a_move_with_it_in_one_step():
    glass = Undistortion(lens=LENS, camera=CAMERA)
    source = LinearStack(MemoryStack(photograph()[None]))
    straight = WarpedStack(source, lens=glass).frame(0)[..., 0]
    inside = np.s_[8:-8, 8:-8]
    assert np.nanmax(np.abs(straight - pattern(X, Y))[inside]) < 0.02  # of slopes up to 0.5 a pixel
    move = np.array([[1.002, 0.001, 0.6], [-0.001, 0.999, -0.4]])
    both = WarpedStack(source, lens=glass, affines=move[None]).frame(0)[..., 0]
    x, y = move @ np.stack([X, Y, np.ones(SHAPE)]).reshape(3, -1)
    assert np.nanmax(np.abs(both - pattern(x, y).reshape(SHAPE))[inside]) < 0.02
    again = pickle.loads(pickle.dumps(WarpedStack(source, lens=glass)))
    np.testing.assert_array_equal(again.frame(0)[..., 0], straight)


def test_a_mask_goes_with_the_lens():
    glass = Undistortion(lens=LENS, camera=CAMERA)
    disc = np.hypot(X - 20, Y - 30) < 12  # where the lens shows it
    found = warp_mask(disc, glass)
    rows, columns = np.nonzero(found)
    seen = LENS.distorted([[columns.mean(), rows.mean()]], CAMERA)[0]
    assert np.hypot(seen[0] - 20, seen[1] - 30) < 0.7
    assert abs(found.sum() - disc.sum()) < 0.35 * disc.sum()


def test_the_lens_by_its_formula():
    ray = np.array([0.3, -0.2])
    camera = Pinhole(fx=100, fy=110, cx=5, cy=7, skew=2.0)
    k1, k2, p1, p2, k3 = LENS.coefficients
    x, y = ray
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    seen = (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y)
    wanted = camera.matrix @ np.array([*seen, 1.0])
    ideal = camera.matrix @ np.array([*ray, 1.0])
    np.testing.assert_allclose(LENS.distorted(ideal[None, :2], camera)[0], wanted[:2], atol=1e-9)


@pytest.mark.parametrize("numbers", [(), (1.0, 2.0, 3.0), (np.nan, 0, 0, 0)])
def test_hostile_lenses_are_refused(numbers):
    with pytest.raises(InputError, match="lens"):
        Lens(numbers)


def test_crops_and_bins():
    images = np.random.default_rng(3).uniform(0, 1, (2, 11, 14, 3)).astype(np.float32)
    stack = MemoryStack(images)
    part = CroppedStack(stack, rows=(2, 9), columns=(1, 13))
    np.testing.assert_array_equal(part.read(), images[:, 2:9, 1:13])
    coarse = BinnedStack(stack, size=3)
    assert coarse.shape == (2, 3, 4, 3)
    wanted = [[images[:, 3 * i : 3 * i + 3, 3 * j : 3 * j + 3].mean(axis=(1, 2)) for j in range(4)] for i in range(3)]
    np.testing.assert_allclose(coarse.read(), np.array(wanted).transpose(2, 0, 1, 3), rtol=1e-6)


def test_a_square_with_an_unknown_pixel_is_unknown():
    image = np.ones((1, 6, 6, 1))
    image[0, 1, 4] = np.nan
    assert np.argwhere(np.isnan(BinnedStack(MemoryStack(image), size=3).frame(0))).tolist() == [[0, 1, 0]]


@pytest.mark.parametrize(
    ("rows", "columns"), [((3, 3), (0, 4)), ((-1, 3), (0, 4)), ((0, 12), (0, 4)), ((0, 3), (9, 15))]
)
def test_rectangles_outside_are_refused(rows, columns):
    with pytest.raises(OptionError, match="rectangle"):
        CroppedStack(MemoryStack(np.ones((1, 11, 14, 1))), rows=rows, columns=columns)


@pytest.mark.parametrize("size", [0, -1, 12])
def test_impossible_squares_are_refused(size):
    with pytest.raises(OptionError, match="Squares"):
        BinnedStack(MemoryStack(np.ones((1, 11, 14, 1))), size=size)


def test_whole_numbers_are_neither_moved_nor_averaged():
    stack = MemoryStack(np.ones((1, 11, 14, 1), np.uint8))
    with pytest.raises(InputError, match="uint8"):
        WarpedStack(stack)
    with pytest.raises(OptionError, match="uint8"):
        BinnedStack(stack, size=2)


@pytest.mark.parametrize("affines", [np.zeros((1, 2, 3)), np.ones((2, 2, 3)), np.full((1, 2, 3), np.nan)])
def test_impossible_moves_are_refused(affines):
    with pytest.raises(InputError, match="moves"):
        WarpedStack(LinearStack(MemoryStack(np.ones((1, 11, 14)))), affines=affines)
