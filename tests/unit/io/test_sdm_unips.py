import cv2
import numpy as np
import pytest

from psstereo.errors import MissingFileError
from psstereo.io import Choices, read_capture, recognise, write_normal_map

L = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, 0.6, 0.8]])
NORMALS = np.broadcast_to([0.6, 0.0, 0.8], (3, 4, 3)).copy()


def picture(path, value):
    cv2.imencode(".png", np.full((3, 4, 3), value, np.uint8))[1].tofile(path)


@pytest.fixture
def folder(tmp_path):
    home = tmp_path / "cat.data"
    home.mkdir()
    for i in (1, 2, 10):
        picture(home / f"L ({i}).png", i)
    return home


def test_lights_beside_and_chosen(folder):
    picture(folder / "mask.png", 255)
    np.savetxt(folder / "light_directions.txt", L)
    capture, truth = read_capture(folder)
    assert recognise(folder)[0].format == "sdm-unips"
    np.testing.assert_allclose(capture.rig.directions, L, rtol=0, atol=2e-16)
    assert capture.stack.names == ("L (1).png", "L (2).png", "L (10).png")
    assert capture.name == "cat"
    assert truth is None
    (folder / "light_directions.txt").rename(folder.parent / "l.txt")
    with pytest.raises(MissingFileError, match="has no lights"):
        read_capture(folder)
    choices = Choices(lights=folder.parent / "l.txt", lights_layout="columns")
    columns = L.T / np.linalg.norm(L.T, axis=1, keepdims=True)
    np.testing.assert_allclose(read_capture(folder, choices=choices)[0].rig.directions, columns, atol=1e-15)


@pytest.mark.parametrize("name", ["Normal_gt.png", "normal.tif"])
def test_the_truth_has_two_names(folder, name):
    write_normal_map(NORMALS, folder / name)
    np.savetxt(folder / "light_directions.txt", L)
    truth = read_capture(folder)[1]
    assert truth.source == name
    np.testing.assert_allclose(truth.normals, NORMALS, atol=3e-5)
    assert read_capture(folder, choices=Choices(truth=False))[1] is None


def test_other_folders_are_left_to_others(folder):
    np.savetxt(folder / "light_directions.txt", L)
    picture(folder / "photo.png", 3)
    assert recognise(folder)[0].format == "diligent"
    (folder / "photo.png").unlink()
    (folder / "filenames.txt").write_text("L (1).png\n")
    assert recognise(folder)[0].format == "diligent"
    (folder / "filenames.txt").unlink()
    (folder / "light_directions.txt").rename(folder / "lights.txt")
    plain = folder.rename(folder.with_name("cat"))
    assert [found.format for found in recognise(plain)] == ["images"]
