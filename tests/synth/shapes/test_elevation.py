"""Elevation models from files, and files that are none."""

import numpy as np
import pytest
import tifffile
from scipy.integrate import quad

from psstereo.errors import InputError, MissingFileError, UnreadableFileError
from psstereo_synth.shapes import read_elevation
from psstereo_synth.shapes.elevation import metres_per_degree

HEIGHTS = np.arange(30.0).reshape(5, 6)
STEP = 3 / 3600


def npz(folder, **arrays):
    path = folder / "model.npz"
    np.savez(path, **arrays)
    return path


def tiff(folder, array, *tags):
    path = folder / "model.tif"
    tifffile.imwrite(path, array, extratags=list(tags))
    return path


def pixel_scale(dx, dy):
    return (33550, 12, 3, (dx, dy, 0.0), True)


def tie_point(longitude, latitude):
    return (33922, 12, 6, (0.0, 0.0, 0.0, longitude, latitude, 0.0), True)


def geo_keys(**keys):
    codes = {"model": 1024, "angle": 2054, "length": 3076}
    rows = [1, 1, 0, len(keys)]
    for name, value in keys.items():
        rows += [codes[name], 0, 1, value]
    return (34735, 3, len(rows), tuple(rows), True)


def missing(text):
    return (42113, 2, len(text) + 1, text, True)


def asc(folder, header, rows):
    path = folder / "model.asc"
    path.write_text(header + "\n".join(" ".join(f"{v:g}" for v in row) for row in rows) + "\n")
    return path


HEADER = "ncols 6\nnrows 5\nxllcorner 0\nyllcorner 0\ncellsize 10\n"


def test_metres_per_degree_against_the_arc_of_the_meridian():
    """An ellipse's arc by quadrature over the parametric latitude, and its radius at a latitude."""
    a, b = 6378137.0, 6378137.0 * (1 - 1 / 298.257223563)
    for latitude in (0.0, 36.6, -52.0, 80.0):
        ends = [
            np.arctan2(b * np.sin(np.radians(t)), a * np.cos(np.radians(t))) for t in (latitude - 0.5, latitude + 0.5)
        ]
        arc = quad(lambda u: np.hypot(a * np.sin(u), b * np.cos(u)), *ends, epsabs=1e-9)[0]
        u = np.arctan2(b * np.sin(np.radians(latitude)), a * np.cos(np.radians(latitude)))
        east, north = metres_per_degree(latitude)
        assert north == pytest.approx(arc, rel=1e-6)  # a degree is not infinitely short
        assert east == pytest.approx(np.radians(1) * a * np.cos(u), rel=1e-13)


def test_npz_in_degrees_has_cells_that_are_not_square(tmp_path):
    array = HEIGHTS.astype(np.int16)
    array[1, 1] = -32768
    for rows in (4, 5):  # from centre to centre, or from edge to edge
        path = npz(
            tmp_path, elevation=array, dx=STEP, dy=STEP, ymin=36.6 + rows * STEP / 2, ymax=36.6 - rows * STEP / 2
        )
        grid = read_elevation(path)
        east, north = metres_per_degree(36.6)
        assert grid.spacing == pytest.approx((STEP * east, STEP * north), rel=1e-12)
        assert grid.spacing == pytest.approx((74.6, 92.5), rel=1e-3)
        assert np.isnan(grid.heights[1, 1])
        assert grid.heights[0, 0] == 0.0


def test_npz_without_latitudes_is_in_lengths(tmp_path):
    grid = read_elevation(npz(tmp_path, elevation=HEIGHTS, dx=2.0, dy=-3.0))
    assert grid.spacing == (2.0, 3.0)
    np.testing.assert_array_equal(grid.heights, HEIGHTS)


@pytest.mark.parametrize(
    "arrays",
    [
        {"dx": 1.0, "dy": 1.0},
        {"elevation": HEIGHTS, "dy": 1.0},
        {"elevation": HEIGHTS, "dx": 1.0},
        {"elevation": HEIGHTS, "dx": 1.0, "dy": 1.0, "ymin": 3.0},
        {"elevation": HEIGHTS, "dx": np.ones(2), "dy": 1.0},
        {"elevation": HEIGHTS, "dx": "wide", "dy": 1.0},
        {"elevation": HEIGHTS, "dx": STEP, "dy": STEP, "ymin": 36.0, "ymax": 37.0},
        {"elevation": HEIGHTS, "dx": 1.0, "dy": 1.0, "ymin": 86.0, "ymax": 92.0},
        {"elevation": HEIGHTS, "dx": 30.0, "dy": 30.0, "ymin": 4e6, "ymax": 4e6 + 150},
        {"elevation": np.zeros((5, 6, 2)), "dx": 1.0, "dy": 1.0},
        {"elevation": np.zeros((5, 6), complex), "dx": 1.0, "dy": 1.0},
        {"elevation": np.full((5, 6), "a"), "dx": 1.0, "dy": 1.0},
    ],
)
def test_npz_that_does_not_say_what_it_must_is_refused(tmp_path, arrays):
    with pytest.raises(UnreadableFileError, match=r"model\.npz"):
        read_elevation(npz(tmp_path, **arrays))


def test_npy_has_cells_of_one(tmp_path):
    np.save(tmp_path / "a.npy", HEIGHTS.astype(np.float32))
    grid = read_elevation(tmp_path / "a.npy")
    assert grid.spacing == (1.0, 1.0)
    np.testing.assert_array_equal(grid.heights, HEIGHTS)


def test_spacing_can_be_given(tmp_path):
    np.save(tmp_path / "a.npy", HEIGHTS)
    assert read_elevation(tmp_path / "a.npy", spacing=(3.0, 4.0)).spacing == (3.0, 4.0)
    path = npz(tmp_path, elevation=HEIGHTS, dx=1.0, dy=1.0, ymin=89.0, ymax=84.0)
    assert read_elevation(path, spacing=(5.0, 6.0)).spacing == (5.0, 6.0)


@pytest.mark.parametrize("kind", [np.int16, np.uint16, np.int32, np.float32, np.float64])
def test_plain_tiff(tmp_path, kind):
    grid = read_elevation(tiff(tmp_path, HEIGHTS.astype(kind)))
    np.testing.assert_array_equal(grid.heights, HEIGHTS)
    assert grid.spacing == (1.0, 1.0)


def test_geotiff_in_metres(tmp_path):
    array = HEIGHTS.astype(np.float32)
    array[0, 0] = np.float32(-3.4028234663852886e38)
    for keys in ([], [geo_keys(model=1)], [geo_keys(model=1, length=9001)]):
        text = missing("-3.4028234663852886e+38")
        grid = read_elevation(tiff(tmp_path, array, pixel_scale(30.0, 25.0), tie_point(5e5, 4e6), text, *keys))
        assert grid.spacing == (30.0, 25.0)
        np.testing.assert_array_equal(np.isnan(grid.heights), array < 0)


def test_a_missing_value_that_float32_rounds(tmp_path):
    array = HEIGHTS.astype(np.float32)
    array[2, 2] = np.float32(-9999.9)
    assert np.isnan(read_elevation(tiff(tmp_path, array, missing("-9999.9"))).heights[2, 2])


def test_geotiff_in_degrees(tmp_path):
    keys = geo_keys(model=2, angle=9102)
    grid = read_elevation(
        tiff(tmp_path, HEIGHTS.astype(np.int16), pixel_scale(STEP, STEP), tie_point(-84.0, 36.6 + 2.5 * STEP), keys)
    )
    east, north = metres_per_degree(36.6)
    assert grid.spacing == pytest.approx((STEP * east, STEP * north), rel=1e-12)


@pytest.mark.parametrize(
    ("array", "tags"),
    [
        (HEIGHTS.astype(np.uint8), []),
        (np.zeros((5, 6, 3), np.uint16), []),
        (HEIGHTS.astype(np.float32), [missing("none")]),
        (HEIGHTS.astype(np.float32), [pixel_scale(1.0, 1.0), geo_keys(model=1, length=9002)]),
        (HEIGHTS.astype(np.float32), [pixel_scale(STEP, STEP), geo_keys(model=2)]),
        (HEIGHTS.astype(np.float32), [pixel_scale(STEP, STEP), geo_keys(model=2, angle=9101), tie_point(0, 1)]),
        (HEIGHTS.astype(np.float32), [(34264, 12, 16, tuple(np.eye(4).ravel()), True)]),
    ],
)
def test_tiff_that_is_no_model_is_refused(tmp_path, array, tags):
    with pytest.raises(UnreadableFileError, match=r"model\.tif"):
        read_elevation(tiff(tmp_path, array, *tags))


def test_asc(tmp_path):
    rows = HEIGHTS.copy()
    rows[3, 4] = -9999
    grid = read_elevation(asc(tmp_path, HEADER, rows))
    assert grid.spacing == (10.0, 10.0)
    assert np.isnan(grid.heights[3, 4])
    assert np.isfinite(grid.heights).sum() == 29
    other = read_elevation(asc(tmp_path, HEADER.upper() + "NODATA_value 7\n", HEIGHTS))
    assert np.argwhere(np.isnan(other.heights)).tolist() == [[1, 1]]
    oblong = read_elevation(asc(tmp_path, "ncols 6\nnrows 5\ndx 10\ndy 20\n", HEIGHTS))
    assert oblong.spacing == (10.0, 20.0)


def test_asc_that_may_be_in_degrees_asks_for_the_spacing(tmp_path):
    path = asc(tmp_path, f"ncols 6\nnrows 5\nxllcorner -84.4\nyllcorner 36.4\ncellsize {STEP}\n", HEIGHTS)
    with pytest.raises(UnreadableFileError, match="whether they are degrees"):
        read_elevation(path)
    assert read_elevation(path, spacing=(74.6, 92.5)).spacing == (74.6, 92.5)


@pytest.mark.parametrize(
    ("header", "rows"),
    [
        (HEADER, HEIGHTS[:-1]),
        (HEADER.replace("cellsize 10", ""), HEIGHTS),
        (HEADER.replace("cellsize 10", "cellsize 0"), HEIGHTS),
        (HEADER.replace("cellsize 10", "cellsize nan"), HEIGHTS),
        (HEADER.replace("ncols 6", "ncols 2.5").replace("nrows 5", "nrows 12"), HEIGHTS),
        (HEADER.replace("ncols 6", "ncols six"), HEIGHTS),
        ("", HEIGHTS),
        ("", []),
    ],
)
def test_asc_with_a_wrong_header_is_refused(tmp_path, header, rows):
    with pytest.raises(UnreadableFileError, match=r"model\.asc"):
        read_elevation(asc(tmp_path, header, rows))


@pytest.mark.parametrize("suffix", [".npz", ".npy", ".tif", ".asc"])
@pytest.mark.parametrize(
    "content", [b"", b"\x93NUMPY nonsense", b"II*\0 nonsense", b"hello \xff there", b"PK\x03\x04 x"]
)
def test_damaged_files_are_refused(tmp_path, suffix, content):
    path = tmp_path / f"bad{suffix}"
    path.write_bytes(content)
    with pytest.raises(UnreadableFileError, match="bad") as caught:
        read_elevation(path)
    assert caught.value.needed
    assert caught.value.remedy


def test_a_truncated_tiff_is_refused(tmp_path):
    path = tiff(tmp_path, np.random.default_rng(0).normal(size=(50, 60)).astype(np.float32))
    path.write_bytes(path.read_bytes()[:-5000])
    with pytest.raises(UnreadableFileError):
        read_elevation(path)


def test_other_kinds_and_absent_files_are_refused(tmp_path):
    (tmp_path / "a.hgt").write_bytes(b"0")
    with pytest.raises(UnreadableFileError, match=r"\.npz, \.npy, \.tif, \.tiff, \.asc"):
        read_elevation(tmp_path / "a.hgt")
    with pytest.raises(MissingFileError):
        read_elevation(tmp_path / "b.npy")
    with pytest.raises(MissingFileError):
        read_elevation(tmp_path)


def test_heights_that_make_no_surface_are_refused_with_the_file_name(tmp_path):
    np.save(tmp_path / "void.npy", np.full((5, 5), np.nan))
    with pytest.raises(InputError, match=r"void\.npy"):
        read_elevation(tmp_path / "void.npy")


@pytest.mark.data
def test_the_jacksboro_fault(data_dir):
    path = data_dir / "terrain" / "jacksboro_fault_dem.npz"
    if not path.is_file():
        pytest.skip("the elevation model is not among the captures")
    grid = read_elevation(path)
    assert grid.heights.shape == (344, 403)
    assert (grid.heights.min(), grid.heights.max()) == (236, 1076)
    assert grid.spacing == pytest.approx((74.57, 92.47), abs=0.01)
    low, high = grid.bounds
    x, y = np.meshgrid(*(np.linspace(-half, half, 1201) for half in grid.extent))
    z = grid.evaluate(x, y).height
    assert low <= z.min() < 236
    assert 1076 < z.max() <= high
    assert (z.min() - low) + (high - z.max()) < 0.02 * (high - low)
