import numpy as np
import pytest
from PIL import Image

from psstereo.errors import InputError, MissingFileError, UnreadableFileError
from psstereo.io import read_capture, recognise

L = np.random.default_rng(3).normal(size=(12, 3)) * 0.3 + [0, 0, 1]
LIGHTS = "12\n" + "".join("{} {} {}\n".format(*row) for row in L)


def build(root, ending="png"):
    home = root / "Hibou é"
    home.mkdir()
    for i in range(12):
        Image.fromarray(np.full((3, 4, 3), 10 * i + 5, np.uint8)).save(home / f"Hibou é.{i}.{ending}")
    soft = np.array([[0, 120, 127, 128], [129, 255, 255, 200], [0, 0, 0, 0]], np.uint8)
    Image.fromarray(np.repeat(soft[..., None], 3, axis=2)).save(home / f"Hibou é.mask.{ending}")
    (root / "lights.txt").write_text(LIGHTS)
    return home


@pytest.mark.parametrize("ending", ["png", "tga"])
def test_natural_order_soft_mask_and_lights_one_folder_up(tmp_path, ending):
    home = build(tmp_path, ending)
    (tmp_path / "lights_other_copy.txt").write_text(LIGHTS.replace("0.", "0.9"))
    assert recognise(home)[0].format == "psm"
    capture, truth = read_capture(home)
    assert truth is None
    assert [int(capture.stack.frame(i)[0, 0, 0]) for i in range(12)] == [10 * i + 5 for i in range(12)]
    assert capture.mask.tolist() == [[False, False, False, True], [True] * 4, [False] * 4]
    assert capture.rig.source == "lights.txt"
    np.testing.assert_allclose(capture.rig.directions, L / np.linalg.norm(L, axis=1)[:, None])
    assert any("lights_other_copy.txt" in note for note in capture.notes)


def test_lights_beside_the_images_come_first(tmp_path):
    home = build(tmp_path)
    (home / "lights.txt").write_text(LIGHTS.replace("12\n", "12\n", 1).replace("-", ""))
    capture, _ = read_capture(home)
    np.testing.assert_array_equal(capture.rig.directions >= 0, True)


def test_a_renamed_folder_and_a_missing_mask(tmp_path):
    home = build(tmp_path).rename(tmp_path / "copy")
    (home / "Hibou é.mask.png").unlink()
    capture, _ = read_capture(home)
    assert len(capture.stack) == 12
    assert capture.mask is None
    assert any("every pixel counts" in note for note in capture.notes)


def test_two_objects_or_two_kinds_in_a_folder_are_refused(tmp_path):
    home = build(tmp_path)
    Image.fromarray(np.zeros((3, 4), np.uint8)).save(home / "Hibou é.3.tga")
    with pytest.raises(InputError, match="same number"):
        read_capture(home)
    home = home.rename(tmp_path / "other")
    Image.fromarray(np.zeros((3, 4), np.uint8)).save(home / "cat.3.tga")
    with pytest.raises(InputError, match="2 names"):
        read_capture(home, layout="psm")


def test_counts_that_disagree(tmp_path):
    home = build(tmp_path)
    (tmp_path / "lights.txt").write_text(LIGHTS.replace("12\n", "11\n", 1))
    with pytest.raises(UnreadableFileError, match="says 11 lights"):
        read_capture(home)
    (tmp_path / "lights.txt").unlink()
    with pytest.raises(MissingFileError, match=r"lights\.txt"):
        read_capture(home, layout="psm")


def build_list(root, names):
    home = build(root, "tga")
    (root / "owl.txt").write_text("\r\n".join(["12", *names]) + "\r\n", encoding="utf-8")
    return home


def test_the_list_of_the_original_archive(tmp_path):
    """Count, one path a line in another computer's folders, mask last; TGA; CRLF."""
    names = [f"C:\\psmImages\\Hibou é\\Hibou é.{i}.tga" for i in (*range(1, 12), 0)]
    home = build_list(tmp_path, [*names, "C:\\psmImages\\Hibou é\\Hibou é.mask.tga"])
    assert recognise(tmp_path / "owl.txt")[0].format == "psm"
    capture, _ = read_capture(tmp_path / "owl.txt")
    assert capture.stack.names[0] == "Hibou é.1.tga"
    assert capture.stack.names[-1] == "Hibou é.0.tga"
    assert capture.mask.sum() == 5
    (home / "Hibou é.4.tga").unlink()
    with pytest.raises(MissingFileError, match=r"Hibou é\.4\.tga"):
        read_capture(tmp_path / "owl.txt")


def test_a_list_without_mask_and_a_list_of_another_length(tmp_path):
    build_list(tmp_path, [f"Hibou é/Hibou é.{i}.tga" for i in range(12)])
    capture, _ = read_capture(tmp_path / "owl.txt")
    assert capture.mask is None
    text = (tmp_path / "owl.txt").read_text(encoding="utf-8")
    (tmp_path / "owl.txt").write_text(text.replace("12\n", "14\n", 1), encoding="utf-8")
    with pytest.raises(UnreadableFileError, match="12 names below the number 14"):
        read_capture(tmp_path / "owl.txt")


def test_lights_txt_is_no_list_of_images(tmp_path):
    build(tmp_path)
    assert recognise(tmp_path / "lights.txt") == []
    (tmp_path / "empty.txt").write_text("")
    assert recognise(tmp_path / "empty.txt") == []
