"""Pictures to look at."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from psstereo.errors import InputError
from psstereo.io.pictures import albedo_picture, depth_picture, write_png


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("shape", [(5, 7), (5, 7, 3)])
def test_png_holds_what_was_written(tmp_path, dtype, shape):
    image = np.random.default_rng(0).integers(0, np.iinfo(dtype).max, shape, dtype, endpoint=True)
    path = tmp_path / "Bild mit Ä.png"
    write_png(path, image)
    read = cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_UNCHANGED)
    assert read.dtype == dtype
    assert np.array_equal(read[..., ::-1] if image.ndim == 3 else read, image)


def test_a_picture_that_cannot_be_coded_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr(cv2, "imencode", lambda *_arguments: (False, None))
    with pytest.raises(InputError, match=r"\(2, 2\)"):
        write_png(tmp_path / "x.png", np.zeros((2, 2), np.uint8))
    assert not list(tmp_path.iterdir())


def test_albedo_has_the_srgb_curve_and_ignores_highlights():
    albedo = np.full((100, 100), 0.5)
    albedo[0, 0], albedo[0, 1], albedo[0, 2] = 40.0, np.nan, -1.0
    albedo[50] = 0.5 * 0.21404114  # what sRGB shows as one half
    albedo[51] = 0.5 * 0.001  # on its straight part
    picture = albedo_picture(albedo)
    assert picture.dtype == np.uint8
    assert picture[10, 10] == picture[0, 0] == 255
    assert picture[0, 1] == picture[0, 2] == 0
    assert picture[50, 3] in (127, 128)
    assert picture[51, 3] == round(12.92 * 0.001 * 255)


def test_albedo_of_colours_keeps_their_ratio():
    picture = albedo_picture(np.full((9, 9, 3), [0.8, 0.4, np.nan]))
    assert picture.shape == (9, 9, 3)
    assert picture[0, 0, 0] == 255
    assert picture[0, 0, 1] == 188  # half the light in sRGB
    assert picture[0, 0, 2] == 0


@pytest.mark.parametrize("value", [np.nan, 0.0, -3.0])
def test_albedo_without_any_light_is_black(value):
    assert (albedo_picture(np.full((3, 4), value)) == 0).all()


@settings(max_examples=60, deadline=None)
@given(arrays(np.float64, (4, 5), elements=st.floats(-1e6, 1e6) | st.just(np.nan)), st.booleans())
def test_depth_is_bright_where_near(depth, near_is_small):
    picture = depth_picture(depth, near_is_small=near_is_small)
    known = np.isfinite(depth)
    assert picture.dtype == np.uint16
    assert np.array_equal(picture > 0, known)
    if known.any():
        order = np.argsort(-depth[known] if near_is_small else depth[known], kind="stable")
        assert (np.diff(picture[known][order].astype(int)) >= 0).all()
        assert picture.max() == 65535
        if depth[known].min() < depth[known].max():
            assert picture[known].min() == 1
