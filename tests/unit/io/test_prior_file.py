"""Known depth from maps and from lists of points."""

import cv2
import numpy as np
import pytest

from psstereo.camera import Orthographic, Pinhole
from psstereo.errors import InputError, OptionError, UnreadableFileError
from psstereo.io.prior_file import read_known_depth

SHAPE = (4, 6)
MM = Orthographic(pixel_size=0.5, length_unit="mm")
PINHOLE = Pinhole(fx=800.0, fy=820.0, cx=3.0, cy=2.0)
DEPTH = np.linspace(390.0, 410.0, 24).reshape(SHAPE)


def test_nan_and_zero_are_unknown(tmp_path):
    depth = DEPTH.copy()
    depth[0, 0], depth[1, :2] = np.nan, 0.0
    np.save(tmp_path / "d.npy", depth)
    known = read_known_depth(tmp_path / "d.npy", SHAPE, PINHOLE)
    assert np.array_equal(np.isnan(known.depth), np.isin(np.arange(24), [0, 6, 7]).reshape(SHAPE))
    assert np.array_equal(known.depth[2:], depth[2:])
    assert known.unit == "mm"
    assert known.sigma == pytest.approx(np.nanmedian(known.depth) / 800.0)  # one pixel on the surface
    assert any("21 of 24" in note for note in known.notes)
    assert any("2 zeros" in note for note in known.notes)


def test_units_of_heights(tmp_path):
    np.save(tmp_path / "d.npy", DEPTH)
    heights = read_known_depth(tmp_path / "d.npy", SHAPE, MM)
    assert (heights.unit, heights.sigma) == ("mm", 0.5)
    metres = read_known_depth(tmp_path / "d.npy", SHAPE, MM, sigma=0.002, unit="m")
    assert (metres.unit, metres.sigma) == ("mm", pytest.approx(2.0))
    np.testing.assert_allclose(metres.depth, DEPTH * 1000, rtol=1e-15)
    assert any("from m into mm" in note for note in metres.notes)
    pixels = read_known_depth(tmp_path / "d.npy", SHAPE, Orthographic())
    assert (pixels.unit, pixels.sigma) == ("px", 1.0)
    assert np.array_equal(pixels.depth, DEPTH)
    with pytest.raises(InputError, match="in mm, the heights are in px"):
        read_known_depth(tmp_path / "d.npy", SHAPE, Orthographic(), unit="mm")


def test_whole_numbers_need_the_worth_of_a_step(tmp_path):
    steps = np.arange(24, dtype=np.uint16).reshape(SHAPE) * 100
    cv2.imencode(".png", steps)[1].tofile(tmp_path / "d.png")
    with pytest.raises(InputError, match=r"whole numbers \(uint16\)"):
        read_known_depth(tmp_path / "d.png", SHAPE, PINHOLE)
    for unit in ("0.2mm", " 0,2 mm", "2e-1mm"):
        known = read_known_depth(tmp_path / "d.png", SHAPE, PINHOLE, sigma=0.7, unit=unit)
        assert (known.unit, known.sigma) == ("mm", 0.7)
        np.testing.assert_allclose(known.depth.ravel()[1:], steps.ravel()[1:] * 0.2, rtol=1e-15)
    assert read_known_depth(tmp_path / "d.png", SHAPE, PINHOLE, unit="m").depth[0, 1] == 100.0


def test_a_list_of_points(tmp_path):
    (tmp_path / "p.txt").write_text("# surveyed\n0 0 400.5\n3 5 401\n2 2 399\n2 2 400\n")
    (tmp_path / "p.csv").write_text("row;column;depth\r\n0;0;400,5\r\n3;5;401,0\r\n1,6;2,4;399,5\r\n")
    for name, moved in (("p.txt", False), ("p.csv", True)):
        known = read_known_depth(tmp_path / name, SHAPE, PINHOLE)
        assert np.array_equal(np.argwhere(~np.isnan(known.depth)), [[0, 0], [2, 2], [3, 5]])
        assert known.depth[[0, 2, 3], [0, 2, 5]].tolist() == [400.5, 399.5, 401.0]
        assert any("nearest pixel" in note for note in known.notes) == moved
    (tmp_path / "p.txt").write_text("1 1 0\n")  # a height of 0 is a height
    assert read_known_depth(tmp_path / "p.txt", SHAPE, MM).depth[1, 1] == 0.0


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("0 0\n", "2 numbers a row"),
        ("4 0 400\n", "row 4, col. 0"),
        ("0 -1 400\n", "lie outside"),
        ("0 nan 400\n", "lie outside"),
        ("0 0 -400\n", "1 of them are negative"),
        ("0 0 inf\n", "1 of them are negative, zero or infinite"),
        ("0 0 nan\n", "knows 0 pixels"),
    ],
)
def test_lists_that_cannot_be_used(tmp_path, content, words):
    (tmp_path / "p.txt").write_text(content)
    with pytest.raises(InputError, match=words):
        read_known_depth(tmp_path / "p.txt", SHAPE, PINHOLE)


def test_what_makes_no_sense(tmp_path):
    np.save(tmp_path / "d.npy", DEPTH)
    for unit in ("", "3", "-1mm", "0mm", "mm2", "1.2.3mm", "nan mm", "1e999mm"):
        with pytest.raises(OptionError, match="unit of the prior"):
            read_known_depth(tmp_path / "d.npy", SHAPE, PINHOLE, unit=unit)
    for sigma in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(OptionError, match="standard error"):
            read_known_depth(tmp_path / "d.npy", SHAPE, PINHOLE, sigma=sigma)
    with pytest.raises(InputError, match="6 × 4 pixels"):
        read_known_depth(tmp_path / "d.npy", (4, 5), PINHOLE)
    np.save(tmp_path / "d.npy", -DEPTH)
    with pytest.raises(InputError, match="24 of them are negative"):
        read_known_depth(tmp_path / "d.npy", SHAPE, PINHOLE)
    assert read_known_depth(tmp_path / "d.npy", SHAPE, MM).depth.max() < 0  # heights may be
    np.save(tmp_path / "d.npy", 0 * DEPTH)
    with pytest.raises(InputError, match="knows 0 pixels"):
        read_known_depth(tmp_path / "d.npy", SHAPE, MM)
    (tmp_path / "p.csv").write_text("row,column,depth\nrow,column,depth\n")
    with pytest.raises(UnreadableFileError, match="Line 2"):
        read_known_depth(tmp_path / "p.csv", SHAPE, MM)
