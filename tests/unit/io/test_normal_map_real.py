"""Normal maps that others made: the real ones of two collections, read as their own notes describe them."""

import numpy as np
import pytest

from psstereo.io.normal_map import read_normal_map
from psstereo.metrics import summarise_angles


@pytest.mark.data
@pytest.mark.parametrize(("name", "pixels"), [("cat", 44319), ("cow", 25776), ("goblet", 24706), ("pot1", 56560)])
def test_real_maps(data_dir, name, pixels):
    """Sixteen bits, a white background, and the mask of the folder's own mask.png (pixel counts from its README)."""
    import cv2

    back = read_normal_map(data_dir / "normal_maps" / name / "normal_map.png")
    mask = cv2.imdecode(np.fromfile(data_dir / "normal_maps" / name / "mask.png", dtype=np.uint8), cv2.IMREAD_GRAYSCALE)
    assert np.array_equal(back.mask, mask > 0)
    assert np.count_nonzero(back.mask) == pixels
    assert "uint16" in back.notes[0]


@pytest.mark.data
def test_real_truth_and_picture_agree(data_dir):
    """BiNI's cat is DiLiGenT's Normal_gt, rounded down to 16 bits; ours is cropped out of row 50, column 187.

    The same object through two readers: this fixes the channels' order, the sign of y and the pixels' place.
    """
    truth = read_normal_map(data_dir / "diligent" / "catPNG" / "Normal_gt.mat")
    picture = read_normal_map(data_dir / "normal_maps" / "cat" / "normal_map.png").normals
    rows, columns = truth.mask.shape
    summary = summarise_angles(picture[50 : 50 + rows, 187 : 187 + columns], truth.normals)
    assert summary.max_deg < 0.003
    assert (summary.count, summary.missing) == (44319, 881)  # the picture's mask is one pixel smaller
