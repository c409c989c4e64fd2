import cv2
import numpy as np
import pytest

from psstereo.errors import InputError
from psstereo.io import read_capture, recognise


def build(folder, names, size=(4, 5)):
    for i, name in enumerate(names):
        cv2.imencode(".pgm", np.full(size, 10 + i, np.uint8))[1].tofile(folder / name)


NAMES = ["yaleB01_P00A+035E+00.pgm", "yaleB01_P00A-035E+00.pgm", "yaleB01_P00A+000E+45.pgm", "yaleB01_P00A+120E-20.pgm"]


def test_positive_azimuth_lights_the_left_and_positive_elevation_the_top(tmp_path):
    build(tmp_path, [*NAMES, "yaleB01_P00_Ambient.pgm"])
    assert recognise(tmp_path)[0].format == "yale"
    capture, _ = read_capture(tmp_path)
    light = dict(zip(capture.stack.names, capture.rig.directions, strict=True))
    np.testing.assert_allclose(light[NAMES[0]], [-np.sin(np.deg2rad(35)), 0, np.cos(np.deg2rad(35))])
    assert light[NAMES[1]][0] > 0
    np.testing.assert_allclose(light[NAMES[2]], [0, np.sqrt(0.5), np.sqrt(0.5)], atol=1e-12)
    assert light[NAMES[3]][2] < 0
    assert (capture.dark == 14).all()
    assert any("1 of 4 lights" in note for note in capture.notes)
    assert any("Ambient.pgm is subtracted" in note for note in capture.notes)


def test_files_that_are_no_images_of_the_series(tmp_path):
    """The extended set marks damaged images with another ending and brings text files."""
    build(tmp_path, NAMES)
    (tmp_path / "yaleB01_P00A+050E-40.pgm.bad").write_bytes(b"P5")
    (tmp_path / "yaleB01_P00.info").write_text("")
    capture, _ = read_capture(tmp_path)
    assert len(capture.stack) == 4
    assert capture.dark is None
    assert any("no yaleB01_P00_Ambient.pgm" in note for note in capture.notes)


def test_several_subjects_or_poses_are_refused(tmp_path):
    build(tmp_path, [*NAMES, "yaleB01_P03A+000E+00.pgm"])
    with pytest.raises(InputError, match="2 subjects or poses: yaleB01_P00, yaleB01_P03"):
        read_capture(tmp_path)


def test_an_ambient_image_of_another_size_is_refused(tmp_path):
    build(tmp_path, NAMES)
    build(tmp_path, ["yaleB01_P00_Ambient.pgm"], (9, 9))
    with pytest.raises(InputError, match="dark image"):
        read_capture(tmp_path)
