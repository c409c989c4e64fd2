import cv2
import numpy as np
import pytest
from PIL import Image

from psstereo.errors import InputError
from psstereo.stack import FileStack


def npy(folder, array):
    path = folder / "x.npy"
    np.save(path, array)
    return FileStack((path,))


@pytest.mark.parametrize(
    ("stored", "expected"),
    [
        (">u2", np.uint16),
        ("<u2", np.uint16),
        (">f4", np.float32),
        (">f8", np.float64),
        ("<f2", np.float32),
        ("<u4", np.float64),
        (">u4", np.float64),
        ("u1", np.uint8),
    ],
)
def test_npy_of_any_byte_order_and_width_keeps_its_values(tmp_path, stored, expected):
    values = np.arange(12).reshape(3, 4)
    stack = npy(tmp_path, values.astype(stored))
    assert stack.dtype == expected
    np.testing.assert_array_equal(stack.frame(0)[..., 0], values)
    assert stack.white == {"uint8": 255, "uint16": 65535}.get(stack.dtype.name, 1.0)


def test_float64_of_the_other_byte_order_loses_nothing(tmp_path):
    values = np.random.default_rng(0).random((3, 4))
    np.testing.assert_array_equal(npy(tmp_path, values.astype(">f8")).frame(0)[..., 0], values)


@pytest.mark.parametrize(
    "array",
    [
        np.zeros((3, 4), np.int16),
        np.zeros((3, 4), bool),
        np.zeros((3, 4), complex),
        np.zeros((3, 4), np.longdouble),
        np.zeros((3, 4, 5)),
        np.zeros(4),
        np.zeros((2, 3, 4, 3)),
    ],
)
def test_npy_that_holds_no_image_is_refused(tmp_path, array):
    with pytest.raises(InputError, match=r"x\.npy holds an array of shape"):
        npy(tmp_path, array)


@pytest.mark.parametrize("channels", [2, 4])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_alpha_is_left_out(tmp_path, channels, dtype):
    image = np.random.default_rng(0).integers(0, 255, (5, 6, channels), dtype)
    path = tmp_path / "x.png"
    if channels == 4:
        cv2.imencode(".png", image[..., [2, 1, 0, 3]])[1].tofile(path)
    elif dtype is np.uint8:
        Image.merge("LA", [Image.fromarray(image[..., c]) for c in (0, 1)]).save(path)
    else:
        np.save(path := tmp_path / "x.npy", image)
    frame = FileStack((path,)).frame(0)
    colours = image[..., :3] if channels == 4 else image[..., :1]
    np.testing.assert_array_equal(frame, np.broadcast_to(colours, frame.shape))


def test_white_can_be_given(tmp_path):
    path = tmp_path / "x.npy"
    np.save(path, np.ones((2, 2), np.float32))
    assert FileStack((path,), white=4095).white == 4095.0
    assert FileStack((path,), white=4095).saturates
    assert not FileStack((path,)).saturates
