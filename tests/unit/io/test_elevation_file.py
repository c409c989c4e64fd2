import struct

import numpy as np
import pytest
import tifffile

from psstereo.errors import InputError, MissingFileError, OptionError, UnreadableFileError
from psstereo.io.elevation_file import read_elevation, write_elevation
from psstereo.results import DepthKind
from psstereo_synth.shapes.elevation import read_elevation as read_elevation_model


@pytest.fixture
def heights():
    rng = np.random.default_rng(8)
    heights = rng.normal(0.0, 3.0, (13, 21)).astype(np.float32)
    heights[4:6, 3:9] = np.nan
    heights[0, 0], heights[0, 1], heights[0, 2] = -0.0, np.finfo(np.float32).max, np.finfo(np.float32).tiny
    # A NaN with a message in it: it too comes back bit by bit.
    heights.view(np.uint32)[12, 20] = 0x7FC01234
    return heights


@pytest.mark.parametrize(("kind", "pixel_size"), [(DepthKind.HEIGHT, 0.037), (DepthKind.DISTANCE, None)])
def test_every_bit_comes_back(heights, tmp_path, kind, pixel_size):
    path = tmp_path / "a.tif"
    write_elevation(path, heights, unit="µm", pixel_size=pixel_size, kind=kind)
    back = read_elevation(path)
    assert back.depth.dtype == np.float32
    assert back.depth.tobytes() == heights.tobytes()
    assert (back.kind, back.unit, back.pixel_size) == (kind, "µm", pixel_size)
    write_elevation(tmp_path / "b.TIFF", back.depth, unit=back.unit, pixel_size=back.pixel_size, kind=back.kind)
    assert (tmp_path / "b.TIFF").read_bytes() == path.read_bytes()
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["a.tif", "b.TIFF"]


def test_other_programs_read_it(heights, tmp_path):
    import cv2

    heights = np.where(np.abs(heights) > 1e30, 0, heights)
    write_elevation(tmp_path / "a.tif", heights.astype(np.float64), unit="mm", pixel_size=0.25)
    np.testing.assert_array_equal(cv2.imread(str(tmp_path / "a.tif"), cv2.IMREAD_UNCHANGED), heights)
    model = read_elevation_model(tmp_path / "a.tif")
    np.testing.assert_array_equal(model.heights, heights)
    assert model.spacing == (0.25, 0.25)


@pytest.mark.parametrize("keep", [0, 5, 60, 400, 1200])
def test_cut_files_say_so(heights, tmp_path, keep):
    path = tmp_path / "a.tif"
    write_elevation(path, heights, unit="mm")
    content = path.read_bytes()
    path.write_bytes(content[: min(keep, len(content) - 1)])
    with pytest.raises(UnreadableFileError, match=r"The elevation a\.tif"):
        read_elevation(path)


def test_a_file_that_announces_too_much_is_refused_before_memory_is_taken(heights, tmp_path):
    path = tmp_path / "a.tif"
    write_elevation(path, heights, unit="mm")
    with tifffile.TiffFile(path) as file:
        tags = file.pages.first.tags
        where = {name: tags[name].valueoffset for name in ("ImageWidth", "ImageLength")}
    content = bytearray(path.read_bytes())
    for offset in where.values():
        content[offset : offset + 4] = struct.pack("<I", 60_000)
    path.write_bytes(content)
    with pytest.raises(UnreadableFileError, match="cut short"):
        read_elevation(path)


def test_files_of_another_kind_are_refused(heights, tmp_path):
    path = tmp_path / "a.tif"
    cases = {
        "type uint16": (np.zeros((5, 6), np.uint16), None),
        "5 pictures": (np.zeros((5, 6, 3), np.float32), None),
        "does not say its unit": (heights, "a photograph"),
        "version 2": (heights, '{"format": "psstereo elevation", "version": 2}'),
        "pixels of -1": (
            heights,
            '{"format": "psstereo elevation", "version": 1, "kind": "height", "unit": "mm", "pixel_size": -1}',
        ),
        "kind 'depth'": (heights, '{"format": "psstereo elevation", "version": 1, "kind": "depth", "unit": "mm"}'),
    }
    for message, (array, description) in cases.items():
        tifffile.imwrite(path, array, description=description, metadata=None, photometric="minisblack")
        with pytest.raises(UnreadableFileError, match=message):
            read_elevation(path)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))
    with pytest.raises(UnreadableFileError, match="cannot be decoded"):
        read_elevation(path)


def test_paths_are_checked(heights, tmp_path):
    with pytest.raises(MissingFileError, match="not there"):
        read_elevation(tmp_path / "a.tif")
    with pytest.raises(MissingFileError, match="does not exist"):
        write_elevation(tmp_path / "none" / "a.tif", heights, unit="mm")
    with pytest.raises(OptionError, match=r"'a\.png' ends in '\.png'"):
        write_elevation(tmp_path / "a.png", heights, unit="mm")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"depth": np.zeros((3, 4), np.int32)}, "type int32"),
        ({"depth": np.zeros((0, 4))}, "shape"),
        ({"depth": np.full((2, 2), np.inf)}, "infinite"),
        ({"depth": np.full((2, 2), 1e39)}, "beyond"),
        ({"unit": " "}, "unit"),
        ({"pixel_size": 0.0}, "size of a pixel 0.0"),
        ({"pixel_size": np.nan}, "size of a pixel nan"),
        ({"pixel_size": 0.1, "kind": DepthKind.DISTANCE}, "kind distance"),
    ],
)
def test_what_no_file_can_hold_is_refused(tmp_path, change, message):
    with pytest.raises(InputError, match=message):
        write_elevation(tmp_path / "a.tif", **{"depth": np.zeros((2, 3)), "unit": "mm", **change})
    assert not list(tmp_path.iterdir())
