import cv2
import numpy as np
import pytest

from psstereo.errors import InputError, MissingFileError
from psstereo.io import Choices, read_capture, recognise

L = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, 0.6, 0.8], [-0.6, 0.0, 0.8]])
STRENGTHS = np.array([0.97, 1.03, 1.0, 0.99])


def build(root, count=4):
    (root / "Objects").mkdir(parents=True)
    for i in range(count):
        data = cv2.imencode(".png", np.full((4, 5), 40 * i + 9, np.uint8))[1]
        data.tofile(root / "Objects" / f"Image_{i + 1:02d}.png")
    (root / "LightProbe-1").mkdir()
    np.savetxt(root / "light_directions.txt", L[:count].T)
    return root


def test_columns_without_strengths(tmp_path):
    folder = build(tmp_path / "chat é")
    assert recognise(folder)[0].format == "psbox"
    capture, _ = read_capture(folder)
    np.testing.assert_allclose(capture.rig.directions, L)
    assert capture.rig.strengths(1).ravel().tolist() == [1, 1, 1, 1]
    assert any("--mask auto" in note for note in capture.notes)
    assert any("equally strong" in note for note in capture.notes)


def test_refined_lights_come_first_and_carry_strengths(tmp_path):
    folder = build(tmp_path / "x")
    turned = L[[0, 2, 1, 3]]
    np.savetxt(folder / "refined_light.txt", (turned * STRENGTHS[:, None]).T, delimiter=", ")
    capture, _ = read_capture(folder)
    np.testing.assert_allclose(capture.rig.directions, turned)
    np.testing.assert_allclose(capture.rig.strengths(1).ravel(), STRENGTHS)
    assert any("refined_light.txt was used instead of light_directions.txt" in note for note in capture.notes)
    np.savetxt(tmp_path / "mine.txt", L)
    capture, _ = read_capture(folder, choices=Choices(lights=tmp_path / "mine.txt"))
    assert capture.rig.strengths(1).ravel().tolist() == [1, 1, 1, 1]


def test_strengths_of_psbox(tmp_path):
    folder = build(tmp_path / "x")
    np.savetxt(folder / "light_strength.txt", STRENGTHS[None])
    np.testing.assert_allclose(read_capture(folder)[0].rig.strengths(1).ravel(), STRENGTHS)
    np.savetxt(folder / "light_strength.txt", STRENGTHS[:3])
    with pytest.raises(InputError, match="3 numbers; there are 4 images"):
        read_capture(folder)


def test_three_lights_are_columns_in_this_layout(tmp_path):
    folder = build(tmp_path / "x", 3)
    np.testing.assert_allclose(read_capture(folder)[0].rig.directions, L[:3])
    np.savetxt(folder / "light_directions.txt", L[:3])
    np.testing.assert_allclose(read_capture(folder, choices=Choices(lights_layout="rows"))[0].rig.directions, L[:3])


def test_no_images(tmp_path):
    with pytest.raises(MissingFileError, match="Objects"):
        read_capture(tmp_path, layout="psbox")
