import numpy as np
import pytest
import scipy.io

from psstereo.errors import InputError, MissingFileError, UnreadableFileError
from psstereo.io import Choices, read_capture, recognise

S = np.array([[0.1, 0.4, 0.9], [0.5, -0.2, 0.85], [-0.3, -0.3, 1.1]])  # down, right, toward the camera
IMAGES = np.random.default_rng(0).integers(0, 255, (6, 7, 3)).astype(np.uint8)


def save(path, **changes):
    scipy.io.savemat(path, {"I": IMAGES, "S": S, "mask": np.pad(np.ones((4, 5), np.uint8), 1), **changes})
    return path


def test_down_right_near_becomes_right_up_near(tmp_path):
    capture, truth = read_capture(save(tmp_path / "b é.mat"))
    expected = np.stack([S[:, 1], -S[:, 0], S[:, 2]], axis=1)
    np.testing.assert_allclose(capture.rig.directions, expected / np.linalg.norm(expected, axis=1)[:, None])
    assert truth is None
    assert capture.stack.dtype == np.uint8
    assert capture.stack.shape == (3, 6, 7, 1)
    assert (capture.stack.frame(1)[..., 0] == IMAGES[..., 1]).all()
    assert capture.mask.sum() == 20
    assert any("(down, right, toward the camera), one light a row" in note for note in capture.notes)
    assert any("lengths" in note for note in capture.notes)


def test_one_light_a_column_if_it_is_said(tmp_path):
    capture, _ = read_capture(save(tmp_path / "b.mat", S=S.T), choices=Choices(lights_layout="columns"))
    expected = np.stack([S[:, 1], -S[:, 0], S[:, 2]], axis=1)
    np.testing.assert_allclose(capture.rig.directions, expected / np.linalg.norm(expected, axis=1)[:, None])


def test_of_several_the_first_is_read_and_the_others_named(tmp_path):
    for name in ("b10.mat", "b9.mat"):
        save(tmp_path / name)
    scipy.io.savemat(tmp_path / "a.mat", {"x": np.eye(3)})
    capture, _ = read_capture(tmp_path)
    assert capture.name == "b9"
    assert any("b10.mat was left out" in note for note in capture.notes)


def test_colour_planes(tmp_path):
    colour = np.random.default_rng(1).integers(0, 255, (6, 7, 3, 3)).astype(np.uint8)
    capture, _ = read_capture(save(tmp_path / "c.mat", I=colour))
    assert capture.stack.shape == (3, 6, 7, 3)
    assert (capture.stack.frame(2) == colour[..., 2]).all()


def test_other_contents_are_refused(tmp_path):
    with pytest.raises(InputError, match="there are 3 images"):
        read_capture(save(tmp_path / "b.mat", S=S[:2]))
    with pytest.raises(InputError, match="mask has the shape"):
        read_capture(save(tmp_path / "b.mat", mask=np.ones((3, 3))))
    with pytest.raises(InputError, match="type int16"):
        read_capture(save(tmp_path / "b.mat", I=IMAGES.astype(np.int16)))
    scipy.io.savemat(tmp_path / "n.mat", {"Normal_gt": np.zeros((3, 3, 3))})
    with pytest.raises(InputError, match="holds Normal_gt"):
        read_capture(tmp_path / "n.mat", layout="mat-stack")
    (tmp_path / "e").mkdir()
    with pytest.raises(MissingFileError, match="holds no"):
        read_capture(tmp_path / "e", layout="mat-stack")


def test_damaged_and_hdf5_files_are_told_apart(tmp_path):
    file = save(tmp_path / "b.mat")
    file.write_bytes(file.read_bytes()[:300])
    assert recognise(file) == []
    with pytest.raises(UnreadableFileError, match="cannot be decoded"):
        read_capture(file, layout="mat-stack")
    file.write_bytes(b"MATLAB 7.3 MAT-file, Platform: GLNXA64" + bytes(600))
    assert recognise(file)[0].format == "mat-stack"
    with pytest.raises(UnreadableFileError, match="-v7"):
        read_capture(file)
