import numpy as np
import pytest

from psstereo.errors import InputError, MissingFileError, UnreadableFileError
from psstereo.matching import read_disparity, read_pair_calibration, read_view_list

LINE = "a.png 100 0 32 0 110 24 0 0 1 1 0 0 0 1 0 0 0 1 0.5 -0.25 2"


def write(tmp_path, text, name="list.txt"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def test_a_list_of_views_projects_as_its_matrices_say(tmp_path):
    angle = 0.3
    turn = f"{np.cos(angle)} 0 {np.sin(angle)} 0 1 0 {-np.sin(angle)} 0 {np.cos(angle)}"
    path = write(tmp_path, f"2\n{LINE}\nb.png 90 0 30 0 95 20 0 0 1 {turn} 0.1 0.2 3\n")
    views = read_view_list(path)
    assert [view.name for view in views] == ["a.png", "b.png"]
    numbers = np.array([float(v) for v in path.read_text().splitlines()[2].split()[1:]])
    k, r, t = numbers[:9].reshape(3, 3), numbers[9:18].reshape(3, 3), numbers[18:]
    point = np.array([0.2, -0.1, 1.5])
    u, v, w = k @ (r @ point + t)
    column, row, distance = views[1].project(point)
    np.testing.assert_allclose([column, row, distance], [u / w, v / w, w], rtol=1e-12)


@pytest.mark.parametrize(
    "text",
    ["", "two\n", f"3\n{LINE}\n", "1\na.png 1 2 3\n", f"1\n{LINE.replace('110', 'x')}\n", f"1\n{LINE[:-1]}nan\n"],
)
def test_lists_that_are_none_are_refused(tmp_path, text):
    with pytest.raises(UnreadableFileError):
        read_view_list(write(tmp_path, text))


def test_a_rotation_that_is_none_is_refused(tmp_path):
    with pytest.raises(UnreadableFileError, match="rotation"):
        read_view_list(write(tmp_path, "1\n" + LINE.replace(" 1 0 0 0 1 0 0 0 1 ", " 2 0 0 0 1 0 0 0 1 ")))


def test_a_calibration_of_a_pair(tmp_path):
    path = write(tmp_path, "cam0=[100 0 31; 0 100 24; 0 0 1]\ncam1=[1 0 0]\ndoffs=12.5\nbaseline=193\nndisp=70\n")
    found = read_pair_calibration(path)
    assert (found.camera.fx, found.camera.cx, found.baseline, found.shift, found.disparities) == (
        100,
        31,
        193,
        12.5,
        70,
    )


@pytest.mark.parametrize("text", ["", "cam0=[1 0 0; 0 1 0; 0 0 1]\n", "cam0=[a]\nbaseline=2\n"])
def test_calibrations_that_are_none_are_refused(tmp_path, text):
    with pytest.raises(UnreadableFileError):
        read_pair_calibration(write(tmp_path, text))


def test_disparities_of_every_kind_of_file(tmp_path):
    values = np.array([[4, 0, 8], [12, 16, 20]], np.uint8)
    (tmp_path / "d.pgm").write_bytes(b"P5\n3 2\n255\n" + values.tobytes())
    wanted = np.where(values > 0, values / 4.0, np.nan)
    np.testing.assert_array_equal(read_disparity(tmp_path / "d.pgm", scale=4), wanted)
    floats = np.where(values > 0, values / 4.0, np.inf).astype(np.float32)
    np.save(tmp_path / "d.npy", floats)
    np.testing.assert_array_equal(read_disparity(tmp_path / "d.npy"), wanted)
    for order, sign in (("<f4", "-1.0"), (">f4", "1.0")):
        (tmp_path / "d.pfm").write_bytes(f"Pf\n3 2\n{sign}\n".encode() + floats[::-1].astype(order).tobytes())
        np.testing.assert_array_equal(read_disparity(tmp_path / "d.pfm"), wanted)


def test_disparities_that_are_none_are_refused(tmp_path):
    with pytest.raises(MissingFileError):
        read_disparity(tmp_path / "none.pgm")
    for name, content in (("a.pfm", b"PF\n3 2\n-1\n"), ("b.pfm", b"Pf\n3 2\n-1\n1234"), ("c.pgm", b"P5\n3")):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(UnreadableFileError):
            read_disparity(tmp_path / name)
    np.save(tmp_path / "d.npy", np.zeros((2, 2, 3)))
    with pytest.raises(InputError, match="one number"):
        read_disparity(tmp_path / "d.npy")
    with pytest.raises(InputError, match="scale"):
        read_disparity(tmp_path / "d.npy", scale=0)
