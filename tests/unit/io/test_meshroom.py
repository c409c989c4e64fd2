import cv2
import numpy as np
import pytest

from psstereo.errors import InputError, MissingFileError
from psstereo.io import read_capture, recognise

L = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, 0.6, 0.8]])


def picture(path, value):
    cv2.imencode(".png", np.full((3, 4), value, np.uint8))[1].tofile(path)


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "PS_Pictures").mkdir()
    for i in range(3):
        picture(tmp_path / "PS_Pictures" / f"{i + 9:02d}.png", 100 + i)
    np.savetxt(tmp_path / "light_directions.txt", L * [1, -1, -1])
    np.savetxt(tmp_path / "light_intensities.txt", np.array([[1.0, 2, 3]] * 3))
    return tmp_path


def test_directions_are_in_meshrooms_frame_without_a_matrix(folder):
    assert recognise(folder)[0].format == "meshroom"
    capture, truth = read_capture(folder)
    assert truth is None
    np.testing.assert_allclose(capture.rig.directions, L, rtol=0, atol=2e-16)
    assert capture.rig.strengths(1).ravel().tolist() == [2, 2, 2]
    assert capture.stack.names == ("09.png", "10.png", "11.png")


def test_an_ambient_picture_is_subtracted(folder):
    picture(folder / "PS_Pictures" / "Ambient_1.png", 7)
    capture, _ = read_capture(folder)
    assert len(capture.stack) == 3
    assert (capture.dark == 7).all()
    assert "Ambient_1.png is subtracted." in capture.notes


def test_what_is_missing_or_wrong_is_named(folder):
    np.savetxt(folder / "convertionMatrix.txt", np.eye(3)[:2])
    with pytest.raises(InputError, match="2 rows of 3"):
        read_capture(folder)
    (folder / "light_directions.txt").unlink()
    assert "meshroom" not in [found.format for found in recognise(folder)]
    with pytest.raises(MissingFileError, match="--lights"):
        read_capture(folder, layout="meshroom")
