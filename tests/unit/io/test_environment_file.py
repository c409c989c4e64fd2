import numpy as np
import OpenEXR
import pytest

from psstereo.errors import InputError, MissingFileError, OptionError, RigError, UnreadableFileError
from psstereo.io.environment_file import read_environment, write_environment


def some_map(rows=16, channels=3, seed=0):
    return np.exp(np.random.default_rng(seed).normal(size=(rows, 2 * rows, channels)) * 3)


def write_exr(path, channels):
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, channels) as file:
        file.write(str(path))


def flat_hdr(pixels, header=b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n"):
    """An HDR file by the letter: a resolution line, then mantissas and a common exponent, pixel by pixel."""
    rows, columns, _ = pixels.shape
    return header + f"-Y {rows} +X {columns}\n".encode() + pixels.astype(np.uint8).tobytes()


@pytest.mark.parametrize("channels", [1, 3])
def test_exr_there_and_back(tmp_path, channels):
    values = some_map(channels=channels)
    write_environment(tmp_path / "sky.exr", values)
    np.testing.assert_array_equal(read_environment(tmp_path / "sky.exr").radiance, values.astype(np.float32))
    assert [path.name for path in tmp_path.iterdir()] == ["sky.exr"]


def test_hdr_there_and_back_without_getting_darker(tmp_path):
    values = some_map(rows=64)
    write_environment(tmp_path / "sky.HDR", values)
    back = read_environment(tmp_path / "sky.HDR").radiance
    brightest = values.max(axis=-1, keepdims=True)
    assert np.abs((back - values) / brightest).max() < 1 / 254
    assert np.abs(np.mean((back - values) / brightest)) < 1e-4


def test_hdr_of_one_channel_holds_three_equal_ones(tmp_path):
    values = some_map(channels=1)
    write_environment(tmp_path / "sky.hdr", values[..., 0])
    back = read_environment(tmp_path / "sky.hdr").radiance
    np.testing.assert_array_equal(back[..., 0], back[..., 2])
    np.testing.assert_allclose(back[..., :1], values, rtol=1 / 254)


def test_a_hand_made_hdr_red_first_top_row_first(tmp_path):
    """Mantissas over 256 times two to the exponent less 128; 136 leaves mantissas as they are."""
    pixels = np.tile([1, 2, 3, 136], (4, 8, 1))
    pixels[0, 1] = [200, 100, 50, 137]
    (tmp_path / "a.hdr").write_bytes(flat_hdr(pixels))
    light = read_environment(tmp_path / "a.hdr")
    np.testing.assert_array_equal(light.radiance[0, 1], [400, 200, 100])
    np.testing.assert_array_equal(light.radiance[3, 7], [1, 2, 3])
    np.testing.assert_array_equal(light.rotation, np.eye(3))


def test_exposures_in_the_header_are_divided_out(tmp_path):
    pixels = np.tile([1, 2, 3, 136], (4, 8, 1))
    header = b"#?RADIANCE\nEXPOSURE=2.0\nFORMAT=32-bit_rle_rgbe\nEXPOSURE= 0.25\n\n"
    (tmp_path / "a.hdr").write_bytes(flat_hdr(pixels, header))
    np.testing.assert_array_equal(read_environment(tmp_path / "a.hdr").radiance[0, 0], [2, 4, 6])


@pytest.mark.parametrize("exposure", [b"0", b"-1", b"bright", b"nan"])
def test_exposures_that_mean_nothing(tmp_path, exposure):
    header = b"#?RADIANCE\nEXPOSURE=" + exposure + b"\nFORMAT=32-bit_rle_rgbe\n\n"
    (tmp_path / "a.hdr").write_bytes(flat_hdr(np.full((4, 8, 4), 130), header))
    with pytest.raises(UnreadableFileError, match="exposure"):
        read_environment(tmp_path / "a.hdr")


def test_xyz_is_not_taken_for_rgb(tmp_path):
    header = b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n"
    (tmp_path / "a.hdr").write_bytes(flat_hdr(np.full((4, 8, 4), 130), header))
    with pytest.raises(UnreadableFileError, match="X, Y, Z"):
        read_environment(tmp_path / "a.hdr")


@pytest.mark.parametrize("suffix", [".exr", ".hdr"])
@pytest.mark.parametrize("share", [0.001, 0.01, 0.3, 0.7, 0.999])
def test_truncated_files_are_refused(tmp_path, suffix, share):
    path = tmp_path / f"sky{suffix}"
    write_environment(path, some_map())
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(UnreadableFileError, match="sky"):
        read_environment(path)


@pytest.mark.parametrize("suffix", [".exr", ".hdr"])
@pytest.mark.parametrize("content", [b"", b"not a map\n" * 200])
def test_other_files_are_refused(tmp_path, suffix, content):
    path = tmp_path / f"sky{suffix}"
    path.write_bytes(content)
    with pytest.raises(UnreadableFileError, match="sky"):
        read_environment(path)


@pytest.mark.parametrize("seed", range(10))
def test_garbled_rows_are_refused(tmp_path, seed):
    path = tmp_path / "sky.hdr"
    write_environment(path, some_map())
    data = bytearray(path.read_bytes())
    data[300:400] = bytes(np.random.default_rng(seed).integers(0, 255, 100, dtype=np.uint8))
    path.write_bytes(bytes(data))
    with pytest.raises(UnreadableFileError, match="sky"):
        read_environment(path)


@pytest.mark.parametrize("bad", [-1.0, np.nan, np.inf])
def test_radiances_that_mean_nothing_are_refused_by_the_files_name(tmp_path, bad):
    values = some_map().astype(np.float32)
    values[3, 4, 1] = bad
    write_exr(tmp_path / "sky.exr", {"RGB": values})
    with pytest.raises(RigError, match=r"sky\.exr"):
        read_environment(tmp_path / "sky.exr")
    with pytest.raises(RigError):
        write_environment(tmp_path / "other.exr", values)
    assert not (tmp_path / "other.exr").exists()


def test_transparency_is_left_out_and_half_floats_are_read(tmp_path):
    values = some_map(channels=4).clip(0, 1000).astype(np.float16)
    write_exr(tmp_path / "sky.exr", {"RGBA": values})
    np.testing.assert_array_equal(read_environment(tmp_path / "sky.exr").radiance, values[..., :3])


@pytest.mark.parametrize("shape", [(16, 16, 3), (16, 31, 3), (8, 32, 3), (32, 16, 3)])
def test_other_panoramas_are_refused(tmp_path, shape):
    write_exr(tmp_path / "sky.exr", {"RGB": np.ones(shape, np.float32)})
    with pytest.raises(InputError, match="twice as wide"):
        read_environment(tmp_path / "sky.exr")
    with pytest.raises(InputError, match="twice as wide"):
        write_environment(tmp_path / "other.exr", np.ones(shape))


@pytest.mark.parametrize("name", ["sky.png", "sky.jpg", "sky"])
def test_images_in_8_bits_are_refused_with_the_reason(tmp_path, name):
    (tmp_path / name).write_bytes(b"x")
    with pytest.raises(OptionError, match="8 bits"):
        read_environment(tmp_path / name)
    with pytest.raises(OptionError, match="linear"):
        write_environment(tmp_path / name, some_map())


def test_what_cannot_be_written_leaves_the_old_file_alone(tmp_path):
    path = tmp_path / "sky.exr"
    write_environment(path, some_map())
    before = path.read_bytes()
    with pytest.raises(InputError, match="1e38"):
        write_environment(path, some_map() + 1e39)
    with pytest.raises(InputError, match="channels"):
        write_environment(path, some_map(channels=5))
    assert path.read_bytes() == before
    write_environment(path, np.ones((2, 4)))
    assert read_environment(path).channels == 1


def test_missing_files_and_folders(tmp_path):
    for name in ("none.exr", "none.hdr"):
        with pytest.raises(MissingFileError):
            read_environment(tmp_path / name)
        with pytest.raises(MissingFileError):
            write_environment(tmp_path / "nowhere" / name, some_map())
