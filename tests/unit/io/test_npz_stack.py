import numpy as np
import pytest

from psstereo.errors import InputError, UnreadableFileError
from psstereo.io import read_capture, recognise

L = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, 0.6, 0.8], [-0.6, 0.0, 0.8]])
IMAGES = np.random.default_rng(0).random((4, 5, 6), np.float32) * 3


@pytest.fixture
def folder(tmp_path):
    for name in ("b10.npz", "b9.npz"):
        np.savez_compressed(tmp_path / name, images=IMAGES * (2 if name == "b10.npz" else 1))
    np.savez(tmp_path / "a.npz", depth=np.zeros(3))
    np.save(tmp_path / "lights.npy", L)
    return tmp_path


def test_the_first_is_read_and_the_others_named(folder):
    assert recognise(folder)[0].format == "npz"
    capture, truth = read_capture(folder)
    assert truth is None
    assert capture.name == "b9"
    assert not capture.stack.saturates
    assert (capture.stack.frame(2)[..., 0] == IMAGES[2]).all()
    assert any("b10.npz was left out" in note for note in capture.notes)


def test_the_file_itself_chooses(folder):
    capture, _ = read_capture(folder / "b10.npz")
    assert capture.name == "b10"
    assert not any("left out" in note for note in capture.notes)
    assert recognise(folder / "a.npz") == []


def test_truth_beside_it(folder):
    normals = np.zeros((5, 6, 3), np.float32)
    normals[1:4] = [0, 0.6, 0.8]
    np.save(folder / "gt_normal.npy", normals)
    _, truth = read_capture(folder)
    assert np.isnan(truth.normals[0]).all()
    np.testing.assert_allclose(truth.normals[2, 2], [0, 0.6, 0.8], atol=1e-6)
    np.save(folder / "gt_normal.npy", np.tile([0, 0.6, 0.8], (3, 6, 1)))
    with pytest.raises(InputError, match=r"gt_normal\.npy are 6 × 3"):
        read_capture(folder)


def test_colour_damage_and_other_types(folder):
    np.savez(folder / "b9.npz", images=np.repeat((IMAGES * 80).astype(np.uint8)[..., None], 3, axis=-1))
    assert read_capture(folder)[0].stack.shape == (4, 5, 6, 3)
    np.savez(folder / "b9.npz", images=IMAGES.astype(np.int32))
    with pytest.raises(InputError, match=r"b9\.npz: .*int32"):
        read_capture(folder)
    file = folder / "b10.npz"
    file.write_bytes(file.read_bytes()[:-200])
    with pytest.raises(UnreadableFileError, match=r"b10\.npz cannot be decoded"):
        read_capture(file, layout="npz")
    assert recognise(file) == []
