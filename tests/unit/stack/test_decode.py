import cv2
import numpy as np
import OpenEXR
import pytest

from psstereo.errors import MissingFileError, UnreadableFileError
from psstereo.stack.decode import IMAGE_SUFFIXES, decode_image, read_bytes


@pytest.mark.parametrize("suffix", sorted(IMAGE_SUFFIXES))
def test_whatever_cannot_be_an_image_is_refused_by_name(tmp_path, suffix):
    path = tmp_path / f"odd{suffix}"
    with pytest.raises(MissingFileError, match=path.name):
        decode_image(path)
    for content, says in [(b"", "is empty"), (b"not an image at all" * 20, path.name), (b"\0" * 999, path.name)]:
        path.write_bytes(content)
        with pytest.raises(UnreadableFileError, match=says):
            decode_image(path)
    folder = tmp_path / f"folder{suffix}"
    folder.mkdir()
    with pytest.raises(UnreadableFileError, match=folder.name):
        decode_image(folder)


def test_bytes_are_those_of_the_file(tmp_path):
    path = tmp_path / "x"
    path.write_bytes(bytes(range(256)))
    assert read_bytes(path).tobytes() == bytes(range(256))


def noise_image():
    return np.random.default_rng(0).integers(0, 255, (120, 160, 3), np.uint8)


def test_a_jpeg_is_decoded_in_its_order_of_channels(tmp_path):
    image = np.zeros((16, 16, 3), np.uint8)
    image[..., 0] = 200
    path = tmp_path / "red.JPEG"
    cv2.imencode(".jpg", image[..., ::-1])[1].tofile(path)
    red = decode_image(path)[8, 8].astype(int)
    assert abs(red[0] - 200) <= 2
    assert red[1:].max() <= 3


@pytest.mark.parametrize("share", [0.99, 0.6, 0.3])
def test_a_truncated_jpeg_with_a_whole_thumbnail_is_refused(tmp_path, share):
    """The preview inside the header brings an end marker of its own."""
    whole = cv2.imencode(".jpg", noise_image())[1].tobytes()
    thumbnail = cv2.imencode(".jpg", noise_image()[:16, :16])[1].tobytes()
    segment = b"\xff\xe1" + (len(thumbnail) + 2).to_bytes(2, "big") + thumbnail
    data = whole[:2] + segment + whole[2:]
    path = tmp_path / "camera.jpg"
    path.write_bytes(data)
    np.testing.assert_array_equal(decode_image(path), cv2.imdecode(np.frombuffer(whole, np.uint8), 1)[..., ::-1])
    path.write_bytes(data[: int(len(data) * share)])
    with pytest.raises(UnreadableFileError, match=r"camera\.jpg"):
        decode_image(path)


@pytest.mark.parametrize("kind", [".png", ".jpg"])
def test_bytes_after_the_end_do_no_harm(tmp_path, kind):
    data = cv2.imencode(kind, noise_image())[1].tobytes()
    path = tmp_path / f"trailer{kind}"
    path.write_bytes(data)
    plain = decode_image(path).copy()
    path.write_bytes(data + bytes(1000))
    np.testing.assert_array_equal(decode_image(path), plain)


def test_a_damaged_png_is_refused(tmp_path):
    data = bytearray(cv2.imencode(".png", noise_image())[1].tobytes())
    data[len(data) // 2] ^= 0xFF
    path = tmp_path / "bit.png"
    path.write_bytes(bytes(data))
    with pytest.raises(UnreadableFileError, match=r"bit\.png"):
        decode_image(path)


@pytest.mark.parametrize("names", ["RGBA", "RGB", "BGR", "GRAB", "Y"])
def test_exr_channels_by_name(tmp_path, names):
    path = tmp_path / "x.exr"
    values = {"R": 1.0, "G": 2.0, "B": 3.0, "A": 0.5, "Y": 7.0}
    channels = {name: np.full((3, 4), values[name], np.float16) for name in names}
    OpenEXR.File({"type": OpenEXR.scanlineimage}, channels).write(str(path))
    image = decode_image(path)
    assert image.dtype == np.float32
    colours = image[..., :3] if image.ndim == 3 else image[..., None]
    assert colours[0, 0].tolist() == ([7.0] if names == "Y" else [1.0, 2.0, 3.0])


def test_exr_of_other_channels_is_refused(tmp_path):
    path = tmp_path / "depth.exr"
    OpenEXR.File({"type": OpenEXR.scanlineimage}, {"Z": np.ones((3, 4), np.float32)}).write(str(path))
    with pytest.raises(UnreadableFileError, match="holds the channels Z"):
        decode_image(path)
