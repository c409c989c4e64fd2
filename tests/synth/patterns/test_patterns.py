"""What every albedo pattern promises, and each one in closed form."""

import pickle

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from psstereo.errors import InputError, MissingFileError, OptionError, UnreadableFileError
from psstereo_synth.patterns import PATTERNS, Checker, Constant, Gradient, ImagePattern


def at(*places):
    return np.array([[x, y, 0.3] for x, y in places], float)


def save(folder, image, name="picture.png"):
    path = folder / name
    assert cv2.imwrite(str(path), image[..., ::-1] if image.ndim == 3 else image)
    return path


@pytest.fixture(params=sorted(PATTERNS))
def pattern(request, tmp_path):
    if request.param != "image":
        return PATTERNS[request.param]()
    return ImagePattern(path=save(tmp_path, np.random.default_rng(0).integers(0, 256, (7, 9, 3), np.uint8)))


def test_albedo_has_a_row_a_point_and_lies_between_0_and_1(pattern):
    points = np.random.default_rng(1).uniform(-1.5, 1.5, (500, 3))
    albedo = pattern.evaluate(points)
    assert albedo.shape == (500, pattern.channels)
    assert albedo.dtype == np.float64
    assert ((albedo >= 0) & (albedo <= 1)).all()
    assert pattern.evaluate(points.astype(np.float32)).dtype == np.float64
    assert pattern.evaluate(points[:0]).shape == (0, pattern.channels)
    assert PATTERNS[pattern.name] is type(pattern)
    assert pattern.summary.endswith(".")


def test_albedo_is_projected_along_z(pattern):
    points = np.random.default_rng(1).uniform(-1, 1, (50, 3))
    np.testing.assert_array_equal(pattern.evaluate(points), pattern.evaluate(points * [1, 1, 0] + [0, 0, 7]))


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_unknown_points_have_no_albedo(pattern, axis, value):
    points = at((0.1, 0.2), (0.3, 0.4))
    points[0, axis] = value
    albedo = pattern.evaluate(points)
    assert np.isnan(albedo[0]).all()
    assert np.isfinite(albedo[1]).all()


@pytest.mark.parametrize("shape", [(3,), (5, 2), (2, 2, 3), ()])
def test_points_of_another_shape_are_refused(pattern, shape):
    with pytest.raises(InputError, match="shape"):
        pattern.evaluate(np.zeros(shape))


def test_patterns_are_values(pattern):
    copy = pickle.loads(pickle.dumps(pattern))
    assert copy == pattern
    assert hash(copy) == hash(pattern)
    points = np.random.default_rng(2).uniform(-1, 1, (20, 3))
    assert copy.evaluate(points).tobytes() == pattern.evaluate(points).tobytes()


@pytest.mark.parametrize("bad", [-1e-9, 1.0 + 1e-9, np.nan, np.inf, [], [0.5, -0.1], [[0.5]]])
@pytest.mark.parametrize(
    ("kind", "name"),
    [(Constant, "albedo"), (Gradient, "start"), (Gradient, "end"), (Checker, "low"), (Checker, "high")],
)
def test_albedos_that_are_none_are_refused(kind, name, bad):
    with pytest.raises(InputError) as caught:
        kind(**{name: bad})
    assert caught.value.given
    assert "0, black" in caught.value.needed
    assert caught.value.remedy


@pytest.mark.parametrize(
    ("kind", "options"),
    [
        (Gradient, {"direction": np.nan}),
        (Gradient, {"half_width": 0.0}),
        (Gradient, {"start": [0.1, 0.2], "end": [0.1, 0.2, 0.3]}),
        (Checker, {"cells": 0}),
        (Checker, {"cells": 2.5}),
        (Checker, {"half_width": np.nan}),
        (Checker, {"low": [0.1, 0.2], "high": [0.1, 0.2, 0.3]}),
    ],
)
def test_other_numbers_that_mean_nothing_are_refused(kind, options):
    with pytest.raises(InputError):
        kind(**options)


def test_constant():
    assert Constant(albedo=[0.7]).evaluate(at((0, 0), (9, 9))).tolist() == [[0.7], [0.7]]
    assert Constant(albedo=np.array([0.1, 0.2, 0.3])).evaluate(at((0, 0))).tolist() == [[0.1, 0.2, 0.3]]
    assert Constant(albedo=0.0).channels == 1
    assert Constant(albedo=[0.5]) == Constant(albedo=0.5)


def test_gradient():
    gradient = Gradient(start=0.2, end=0.6)
    albedo = gradient.evaluate(at((-2, 0), (-1, 0), (0, 5), (0.5, 0), (1, 0), (3, 0)))[:, 0]
    np.testing.assert_allclose(albedo, [0.2, 0.2, 0.4, 0.5, 0.6, 0.6], rtol=1e-15)
    up = Gradient(start=0.2, end=[0.2, 0.4, 0.6], direction=np.pi / 2, half_width=2.0)
    np.testing.assert_allclose(up.evaluate(at((7, 1)))[0], [0.2, 0.35, 0.5], rtol=1e-14)
    assert up.channels == 3


@settings(max_examples=60, deadline=None)
@given(st.floats(0, 1), st.floats(0, 1), st.floats(-10, 10), st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=2))
def test_a_gradient_stays_between_its_ends(start, end, direction, place):
    albedo = Gradient(start=start, end=end, direction=direction).evaluate(at(place))[0, 0]
    assert min(start, end) * (1 - 1e-15) <= albedo <= max(start, end) * (1 + 1e-15)


def test_checker():
    checker = Checker(cells=4, low=0.1, high=[0.8, 0.9])
    albedo = checker.evaluate(
        at((-0.99, -0.99), (-0.49, -0.99), (-0.49, -0.49), (0.99, 0.99), (1.01, 0.99), (-0.5, -0.6))
    )
    low, high = [0.1, 0.1], [0.8, 0.9]
    assert albedo.tolist() == [low, high, low, low, high, high]


def test_half_of_a_checkerboard_is_dark():
    axis = (np.arange(400) + 0.5) / 200 - 1
    points = np.stack([*np.meshgrid(axis, axis), np.zeros((400, 400))], axis=-1).reshape(-1, 3)
    albedo = Checker(cells=8).evaluate(points)
    assert (albedo == 0.25).sum() == (albedo == 0.75).sum() == 80000


def test_pixels_have_their_albedo_at_their_centres(tmp_path):
    for kind in (np.uint8, np.uint16):
        image = np.random.default_rng(0).integers(0, np.iinfo(kind).max, (4, 5, 3), kind, endpoint=True)
        pattern = ImagePattern(path=save(tmp_path, image), curve="linear")
        x, y = np.meshgrid((np.arange(5) + 0.5) / 2.5 - 1, 1 - (np.arange(4) + 0.5) / 2)
        albedo = pattern.evaluate(np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3))
        np.testing.assert_allclose(albedo.reshape(4, 5, 3), image / np.iinfo(kind).max, rtol=0, atol=1e-15)


def test_between_pixels_it_is_bilinear_and_beyond_them_constant(tmp_path):
    path = save(tmp_path, np.array([[0, 255], [51, 102]], np.uint8))
    pattern = ImagePattern(path=path, curve="linear", half_width=2.0)
    albedo = pattern.evaluate(at((0, 0), (0, 1), (-1, 0), (0.5, 0.5), (-2, 2), (-9, 9), (9, -9)))[:, 0]
    expected = [0.4, 0.5, 0.1, (0.0 + 0.75 * 0.75 + 0.2 / 16 + 3 * 0.4 / 16), 0.0, 0.0, 0.4]
    np.testing.assert_allclose(albedo, expected, rtol=1e-14)
    assert pattern.channels == 1


def test_the_curve_of_srgb(tmp_path):
    path = save(tmp_path, np.array([[0, 10, 128, 255]], np.uint8))
    pattern = ImagePattern(path=path)
    albedo = pattern.evaluate(at((-0.75, 0), (-0.25, 0), (0.25, 0), (0.75, 0)))[:, 0]
    # 10/255 lies on the straight part; 128/255 is 0.2158605 in IEC 61966-2-1.
    np.testing.assert_allclose(albedo, [0.0, 10 / 255 / 12.92, 0.21586050, 1.0], rtol=1e-7)


def test_transparency_is_left_out(tmp_path):
    image = np.zeros((3, 4, 4), np.uint8)
    image[..., 3] = 128
    assert cv2.imwrite(str(tmp_path / "a.png"), image)
    pattern = ImagePattern(path=tmp_path / "a.png")
    assert pattern.channels == 3
    assert (pattern.evaluate(at((0, 0))) == 0).all()


def test_the_picture_is_read_once(tmp_path):
    path = save(tmp_path, np.full((3, 4), 255, np.uint8))
    pattern = ImagePattern(path=path)
    path.unlink()
    assert pattern.evaluate(at((0, 0))) == 1.0
    with pytest.raises(MissingFileError):
        ImagePattern(path=path)


def test_pictures_that_are_none_are_refused(tmp_path):
    path = save(tmp_path, np.full((3, 4), 255, np.uint8))
    with pytest.raises(OptionError, match="srgb, linear"):
        ImagePattern(path=path, curve="gamma")
    with pytest.raises(InputError):
        ImagePattern(path=path, half_width=-1.0)
    np.save(tmp_path / "a.npy", np.zeros((3, 4)))
    with pytest.raises(UnreadableFileError, match="float64"):
        ImagePattern(path=tmp_path / "a.npy")
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(UnreadableFileError):
        ImagePattern(path=path)
