"""RAW files: a mosaic written by tifffile as DNG, read by LibRaw."""

import sys

import numpy as np
import pytest
import tifffile

from psstereo.errors import MissingFileError, OptionError, UnreadableFileError
from psstereo.stack import FileStack
from psstereo.stack.raw import decode_raw

BLACK, WHITE = 64, 1023
LIGHT = np.array([300, 400, 200])


def write_dng(path, mosaic):
    tags = [
        (33421, "H", 2, (2, 2), True),  # CFARepeatPatternDim
        (33422, "B", 4, bytes([0, 1, 1, 2]), True),  # CFAPattern: R G / G B
        (50706, "B", 4, bytes([1, 4, 0, 0]), True),  # DNGVersion
        (50707, "B", 4, bytes([1, 1, 0, 0]), True),
        (50708, "s", 0, "synthetic", True),  # UniqueCameraModel
        (50714, "H", 1, BLACK, True),
        (50717, "H", 1, WHITE, True),
        (50721, "2i", 9, (1, 1, 0, 1, 0, 1, 0, 1, 1, 1, 0, 1, 0, 1, 0, 1, 1, 1), True),  # ColorMatrix1
    ]
    tifffile.imwrite(path, mosaic, photometric=32803, extratags=tags, metadata=None)


def mosaic(scale=1.0):
    values = np.zeros((40, 60), np.uint16)
    red, green, blue = (LIGHT * scale).astype(np.uint16)
    values[0::2, 0::2], values[0::2, 1::2], values[1::2, 0::2], values[1::2, 1::2] = red, green, green, blue
    return values + np.uint16(BLACK)


@pytest.fixture
def dng(tmp_path):
    pytest.importorskip("rawpy", reason="the extra raw is not installed")
    write_dng(tmp_path / "a.dng", mosaic())
    return tmp_path / "a.dng"


@pytest.mark.parametrize("half", [False, True])
def test_black_and_white_level_and_nothing_else(dng, half):
    image = decode_raw(dng, half=half)
    assert image.dtype == np.uint16
    assert image.shape == ((20, 30, 3) if half else (40, 60, 3))
    wanted = LIGHT / (WHITE - BLACK) * 65535
    assert np.abs(image[5:-5, 5:-5] - wanted).max() <= 1.0


def test_a_stack_of_them_is_linear(dng, tmp_path):
    write_dng(tmp_path / "b.dng", mosaic(0.5))
    stack = FileStack((dng, tmp_path / "b.dng"))
    assert stack.white == 65535
    first, second = (stack.frame(i)[10:-10, 10:-10].astype(float) for i in range(2))
    np.testing.assert_allclose(second, first / 2, atol=1.0)
    assert FileStack((dng, tmp_path / "b.dng"), half=True).frame(1).shape == (20, 30, 3)


def test_clipped_photosites_are_full_scale(dng, tmp_path):
    full = mosaic()
    full[10:20, 10:20] = WHITE
    write_dng(tmp_path / "c.dng", full)
    assert (decode_raw(tmp_path / "c.dng", half=True)[6:9, 6:9] == 65535).all()


def test_damaged_and_missing_files_are_refused(dng, tmp_path):
    whole = dng.read_bytes()
    (tmp_path / "cut.dng").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "text.nef").write_text("no photograph")
    for name in ("cut.dng", "text.nef"):
        with pytest.raises(UnreadableFileError, match=name):
            FileStack((tmp_path / name,))
    with pytest.raises(MissingFileError):
        decode_raw(tmp_path / "none.dng")


def test_without_rawpy_the_extra_is_named(tmp_path, monkeypatch):
    (tmp_path / "a.cr2").write_bytes(b"something")
    monkeypatch.setitem(sys.modules, "rawpy", None)
    with pytest.raises(OptionError, match="its extra 'raw'"):
        FileStack((tmp_path / "a.cr2",))
