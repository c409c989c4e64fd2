"""Maps of one number a pixel from all kinds of files."""

import re

import cv2
import numpy as np
import pytest
import tifffile

from psstereo.errors import InputError, MissingFileError, UnreadableFileError
from psstereo.io.mat_file import write_mat
from psstereo.io.value_map import read_value_map

SHAPE = (4, 6)
VALUES = np.linspace(-2.0, 3.0, 24, dtype=np.float32).reshape(SHAPE)
STEPS = np.arange(24, dtype=np.uint16).reshape(SHAPE) * 1000


def write_exr(path, channels):
    import OpenEXR

    with OpenEXR.File({"type": OpenEXR.scanlineimage}, channels) as file:
        file.write(str(path))


WRITE = {
    "plain.npy": lambda path: np.save(path, VALUES),
    "one channel.npy": lambda path: np.save(path, VALUES[..., None]),
    "first axis.npy": lambda path: np.save(path, VALUES[None]),
    "alone.npz": lambda path: np.savez(path, anything=VALUES),
    "named.npz": lambda path: np.savez_compressed(path, depth=VALUES, other=VALUES * 2, n=np.zeros((2, 3, 3))),
    "a é.mat": lambda path: write_mat(path, {"depth": VALUES, "other": VALUES * 2}),
    "gray.tif": lambda path: tifffile.imwrite(path, VALUES),
    "packed.tiff": cv2.imencode(".tiff", VALUES)[1].tofile,  # LZW
    "z.exr": lambda path: write_exr(path, {"Depth.Z": VALUES}),
    "gray.exr": lambda path: write_exr(path, {"RGB": np.dstack([VALUES] * 3)}),
}


@pytest.mark.parametrize("name", WRITE)
def test_every_kind_gives_the_same(tmp_path, name):
    WRITE[name](tmp_path / name)
    found = read_value_map(tmp_path / name, SHAPE, what="prior", names=("depth",))
    assert found.values.dtype == np.float32
    assert np.array_equal(found.values, VALUES)
    assert not found.no_data.any()
    assert name in found.source


def test_whole_numbers_stay_whole(tmp_path):
    cv2.imencode(".png", STEPS)[1].tofile(tmp_path / "d.png")
    found = read_value_map(tmp_path / "d.png", SHAPE, what="prior")
    assert found.values.dtype == np.uint16
    assert np.array_equal(found.values, STEPS)


def test_a_geotiff_says_where_there_is_nothing(tmp_path):
    holes = VALUES.copy()
    holes[1, 2:4] = -9999
    tifffile.imwrite(tmp_path / "dem.tif", holes, extratags=[(42113, "s", 0, "-9999", True)])
    found = read_value_map(tmp_path / "dem.tif", SHAPE, what="prior")
    assert np.array_equal(np.argwhere(found.no_data), [[1, 2], [1, 3]])
    tifffile.imwrite(tmp_path / "dem.tif", holes)
    assert not read_value_map(tmp_path / "dem.tif", SHAPE, what="prior").no_data.any()


@pytest.mark.parametrize("name", [name for name in WRITE if name != "packed.tiff"])
def test_what_is_cut_short_is_refused(tmp_path, name):
    path = tmp_path / name
    WRITE[name](path)
    path.write_bytes(path.read_bytes()[: int(0.6 * path.stat().st_size)])
    with pytest.raises(UnreadableFileError, match=re.escape(name)):
        read_value_map(path, SHAPE, what="prior")


def test_what_is_no_map_is_refused(tmp_path):
    bad = tmp_path / "bad.npy"
    for array, words in (
        (VALUES.T, "4 × 6 pixels"),
        (np.dstack([VALUES, VALUES, VALUES + 1]), r"shape \(4, 6, 3\)"),
        (VALUES > 0, "bool"),
        (VALUES * 1j, "complex"),
        (VALUES.ravel(), r"shape \(24,\)"),
    ):
        np.save(bad, array)
        with pytest.raises(InputError, match=words):
            read_value_map(bad, SHAPE, what="prior")
    np.savez(tmp_path / "two.npz", a=VALUES, b=VALUES)
    with pytest.raises(InputError, match=r"a \(4, 6\), b \(4, 6\)"):
        read_value_map(tmp_path / "two.npz", SHAPE, what="prior", names=("depth",))
    write_exr(tmp_path / "two.exr", {"A": VALUES, "Z": VALUES})
    with pytest.raises(InputError, match="channels A, Z"):
        read_value_map(tmp_path / "two.exr", SHAPE, what="prior")
    (tmp_path / "d.xls").write_bytes(b"x")
    with pytest.raises(InputError, match="xls"):
        read_value_map(tmp_path / "d.xls", SHAPE, what="prior")
    (tmp_path / "e.tif").write_bytes(b"")
    with pytest.raises(UnreadableFileError, match="empty"):
        read_value_map(tmp_path / "e.tif", SHAPE, what="prior")
    with pytest.raises(MissingFileError):
        read_value_map(tmp_path / "none.npy", SHAPE, what="prior")
