"""The camera matrix from files and from words."""

import numpy as np
import pytest

from psstereo.camera import Pinhole
from psstereo.errors import InputError, MissingFileError, UnreadableFileError
from psstereo.io.camera_file import parse_camera, read_camera
from psstereo.io.mat_file import write_mat

K = np.array([[1200.5, 0.25, 320.0], [0.0, 1210.0, 240.5], [0.0, 0.0, 1.0]])
CAMERA = Pinhole(fx=1200.5, fy=1210.0, cx=320.0, cy=240.5, skew=0.25)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("K.txt", "1200.5 0.25 320\n0 1210 240.5\n0 0 1\n"),
        ("K é.csv", "# K of the camera\n1200.5,0.25,320\n0,1210,240.5\n0,0,1\n"),
        ("comma.txt", "1200,5; 0,25; 320,0\r\n0; 1210,0; 240,5\r\n0; 0; 1\r\n"),
        ("half.txt", "2401 0.5 640\n0 2420 481\n0 0 2"),
        ("numbers.txt", "1200.5 1210 320 240.5 0.25"),
        ("column.txt", "1200.5\n1210\n320\n240.5\n0.25\n"),
    ],
)
def test_text(tmp_path, name, content):
    (tmp_path / name).write_text(content, encoding="utf-8")
    assert read_camera(tmp_path / name) == CAMERA
    assert parse_camera(str(tmp_path / name)) == CAMERA


def test_arrays(tmp_path):
    np.save(tmp_path / "a.npy", K)
    np.savez(tmp_path / "alone.npz", mine=K, image=np.zeros((5, 7)))
    np.savez(tmp_path / "named.npz", K=K, R=np.eye(3))
    write_mat(tmp_path / "camera.mat", {"K": K, "R": np.eye(3), "Normal_gt": np.zeros((4, 4, 3))})
    for path in tmp_path.iterdir():
        assert read_camera(path) == CAMERA, path.name


def test_words():
    assert parse_camera("1200.5,1210,320,240.5,0.25") == CAMERA
    assert parse_camera("1200,5; 1210,0; 320,0; 240,5; 0,25") == CAMERA
    assert parse_camera(" 1200.5 1210 320 240.5 ").skew == 0.0


@pytest.mark.parametrize(
    ("matrix", "words"),
    [
        (K[:2], r"shape \(2, 3\)"),
        (np.zeros((5, 7)), r"shape \(5, 7\)"),
        (np.zeros(9), "shape"),
        (np.zeros((3, 3)), "camera matrix is"),
        (np.diag([1200.0, 0.0, 1.0]), "focal lengths are 1200.0 and 0.0"),
        (np.diag([-1200.0, 1200.0, 1.0]), "focal lengths"),
        (np.where(K == 320, np.nan, K), "nan"),
        (np.where(K == 320, np.inf, K), "inf"),
        (K.T, "last row"),
        (K * 1j, "complex"),
    ],
)
def test_what_is_no_camera(tmp_path, matrix, words):
    np.save(tmp_path / "K.npy", matrix)
    with pytest.raises(InputError, match=words if words != "shape" else "holds 9 numbers"):
        read_camera(tmp_path / "K.npy")


def test_words_that_are_no_camera(tmp_path):
    for words in ("1,2,3", "1,2,3,4,5,6", "0,1,2,3", "nan,1,2,3", "1000,1000,inf,0"):
        with pytest.raises(InputError):
            parse_camera(words)
    for words in ("none", "camera.txt", ""):
        with pytest.raises(MissingFileError):
            parse_camera(words if words != "camera.txt" else str(tmp_path / words))


def test_damaged_files(tmp_path):
    np.savez(tmp_path / "K.npz", K=K)
    np.save(tmp_path / "K.npy", K)
    write_mat(tmp_path / "K.mat", {"K": K})
    (tmp_path / "K.txt").write_text("1200 0 320\n0 1210\n0 0 1\n")
    for path in list(tmp_path.iterdir()):
        if path.suffix != ".txt":
            path.write_bytes(path.read_bytes()[:120])
        with pytest.raises(UnreadableFileError):
            read_camera(path)
    np.savez(tmp_path / "two.npz", a=K, b=K)
    with pytest.raises(InputError, match=r"a \(3, 3\), b \(3, 3\)"):
        read_camera(tmp_path / "two.npz")
