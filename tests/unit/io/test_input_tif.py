import cv2
import numpy as np
import pytest

from psstereo.errors import InputError, MissingFileError
from psstereo.io import Choices, read_capture

S = np.array([[0.1, -0.4, -0.9], [0.5, 0.2, -0.85], [-0.3, 0.3, -0.8], [0.0, 0.0, -0.84]])


@pytest.fixture
def folder(tmp_path):
    for i in (1, 2, 3, 10):
        image = np.full((4, 5, 3), [100 * i, 200 * i, 300 * i], np.uint16)
        cv2.imencode(".tif", image)[1].tofile(tmp_path / f"input_{i}.tif")
    np.save(tmp_path / "sources.npy", S)
    return tmp_path


def test_y_and_z_are_negated(folder):
    capture, _ = read_capture(folder)
    np.testing.assert_allclose(capture.rig.directions, S * [1, -1, -1] / np.linalg.norm(S, axis=1)[:, None])
    assert capture.stack.names[-1] == "input_10.tif"
    assert capture.stack.dtype == np.uint16
    assert capture.stack.frame(0)[0, 0].tolist() == [300, 200, 100]  # R, G, B of OpenCV's B, G, R
    assert any("y and z were negated" in note for note in capture.notes)


def test_lights_in_the_right_frame_already_would_be_behind(folder):
    np.save(folder / "sources.npy", S * [1, -1, -1])
    capture, _ = read_capture(folder)
    assert any("4 of 4 lights come from the side or from behind" in note for note in capture.notes)


def test_transposed_and_ambiguous(folder):
    np.save(folder / "sources.npy", S.T)
    assert len(read_capture(folder)[0].rig) == 4
    (folder / "input_10.tif").unlink()
    np.save(folder / "sources.npy", S[:3])
    with pytest.raises(InputError, match="3 × 3"):
        read_capture(folder)
    capture, _ = read_capture(folder, choices=Choices(lights_layout="rows"))
    assert capture.rig.directions[0, 1] > 0


def test_nothing_there(tmp_path):
    with pytest.raises(MissingFileError, match="input_1"):
        read_capture(tmp_path, layout="face16")
