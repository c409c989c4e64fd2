import cv2
import numpy as np
import pytest

from psstereo.errors import InputError, MissingFileError
from psstereo.io import Choices, read_capture, recognise

L = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, 0.6, 0.8], [-0.6, 0.0, 0.8]])


@pytest.fixture
def folder(tmp_path):
    for i, name in enumerate(("DSC9.png", "DSC10.png", "DSC11.png", "DSC100.png", "dark.png", "mask.png")):
        cv2.imencode(".png", np.full((3, 4), 20 * i + 9, np.uint8))[1].tofile(tmp_path / name)
    np.savetxt(tmp_path / "lights.txt", L)
    return tmp_path


def test_photographs_in_natural_order_with_dark_image_and_mask(folder):
    assert recognise(folder)[0].format == "images"
    capture, truth = read_capture(folder)
    assert truth is None
    assert capture.stack.names == ("DSC9.png", "DSC10.png", "DSC11.png", "DSC100.png")
    np.testing.assert_allclose(capture.rig.directions, L)
    assert (capture.dark == 89).all()
    assert capture.mask.all()
    assert "DSC9.png to DSC100.png" in capture.notes[0]


def test_several_files_of_lights_need_a_choice(folder):
    np.save(folder / "lights.npy", L[::-1])
    with pytest.raises(InputError, match=r"lights\.txt, lights\.npy"):
        read_capture(folder)
    capture, _ = read_capture(folder, choices=Choices(lights=folder / "lights.npy"))
    np.testing.assert_allclose(capture.rig.directions, L[::-1])


def test_says_what_is_missing(folder):
    (folder / "lights.txt").unlink()
    with pytest.raises(MissingFileError, match="4 images and no file of light directions"):
        read_capture(folder, layout="images")
    with pytest.raises(InputError, match="no layout that is known"):
        read_capture(folder)
