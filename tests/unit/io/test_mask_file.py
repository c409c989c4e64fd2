import cv2
import numpy as np
import pytest

from psstereo.errors import InputError, UnreadableFileError
from psstereo.io import read_mask

SOFT = np.array([[0, 100, 127], [128, 200, 255]], np.uint8)
HARD = [[False, False, False], [True, True, True]]


def save(path, image):
    cv2.imencode(path.suffix, image)[1].tofile(path)
    return path


def test_soft_edges_are_cut_at_half(tmp_path):
    assert read_mask(save(tmp_path / "m é.png", SOFT)).tolist() == HARD
    assert read_mask(save(tmp_path / "m.png", SOFT.astype(np.uint16) * 257)).tolist() == HARD


def test_colour_alpha_and_small_values(tmp_path):
    colour = np.zeros((2, 3, 3), np.uint8)
    colour[..., 2] = SOFT
    assert read_mask(save(tmp_path / "m.png", colour)).tolist() == HARD
    alpha = np.dstack([np.full((2, 3, 3), 77, np.uint8), SOFT])
    assert read_mask(save(tmp_path / "m.png", alpha)).tolist() == HARD
    opaque = np.dstack([colour, np.full((2, 3), 255, np.uint8)])
    assert read_mask(save(tmp_path / "m.png", opaque)).tolist() == HARD
    assert read_mask(save(tmp_path / "m.png", (SOFT > 127).astype(np.uint8))).tolist() == HARD


def test_what_is_no_mask(tmp_path):
    with pytest.raises(InputError, match="empty"):
        read_mask(save(tmp_path / "m.png", SOFT * 0))
    with pytest.raises(InputError, match="3 × 2 pixels"):
        read_mask(save(tmp_path / "m.png", SOFT), (3, 3))
    (tmp_path / "m.png").write_bytes(b"\x89PNG nothing more")
    with pytest.raises(UnreadableFileError, match=r"m\.png"):
        read_mask(tmp_path / "m.png")
