import numpy as np
import pytest

from psstereo.camera import Pinhole
from psstereo.errors import InputError
from psstereo.matching import Noise, ViewImages, brightness_constancy, compare_values, pair_constancy, rectified_views
from tests.unit.matching.pairs import shifted_pair, views


def test_noise_alone_is_explained_as_often_as_it_should_be():
    rng = np.random.default_rng(0)
    noise = Noise(read=0.003, electrons=8000)
    truth = rng.uniform(0.1, 0.9, (4, 1, 80, 80))
    one, two = (truth + noise.sigma(truth) * rng.standard_normal(truth.shape) for _ in range(2))
    found = compare_values(one, two, np.ones((80, 80), bool), (noise, noise))
    # 6400 points: three standard deviations of a share of 0.99 are 0.0037
    assert found.share_explained == pytest.approx(0.99, abs=0.004)
    assert np.nanmean(found.chi_squared) == pytest.approx(1, abs=0.03)
    assert [light for light, _, _ in found.per_light()] == [0, 1, 2, 3]


def test_a_highlight_fails_and_nothing_else_does():
    truth = np.full((1, 1, 20, 20), 0.5)
    other = truth.copy()
    other[0, 0, 5:8, 5:9] += 0.1
    noise = Noise(step=1 / 65535)
    found = compare_values(truth, other, np.ones((20, 20), bool), (noise, noise))
    assert found.failing.sum() == 12
    assert found.failing[5:8, 5:9].all()
    assert found.within_rounding == pytest.approx(1 - 12 / 400)
    picture = found.picture()
    assert picture[6, 6].tolist() == [0, 0, 255]  # the second view is brighter
    assert picture[0, 0].tolist() == [255, 255, 255]


def test_a_rectified_pair_of_whole_disparities_agrees_exactly():
    left, right = shifted_pair(disparity=5)
    found = pair_constancy(*views(left, right, noise=Noise(step=1 / 255)), np.full(left.shape, 5.0))
    assert found.count == left.size - 5 * left.shape[0] or found.count > 0.8 * left.size
    assert np.nanmax(found.absolute) < 1e-6


def test_depth_and_cameras_say_the_same_as_disparity():
    left, right = shifted_pair(disparity=5)
    pair = rectified_views(Pinhole(fx=100, fy=100, cx=30, cy=20), 2.0)
    depth = np.full(left.shape, 100 * 2.0 / 5)
    found = brightness_constancy(*views(left, right, noise=Noise(step=1 / 255)), depth, pair)
    assert found.count > 0.8 * left.size
    assert np.nanmax(found.absolute) < 1e-5
    wrong = brightness_constancy(*views(left, right, noise=Noise(step=1 / 255)), depth * 1.2, pair)
    assert np.nanmedian(wrong.absolute) > 0.01


def test_saturated_values_are_not_compared():
    left, right = (np.full((6, 12), 200, np.uint8) for _ in range(2))
    right[2, 4] = 255
    found = pair_constancy(*views(left, right), np.zeros((6, 12)))
    assert not found.compared[2, 4]
    assert found.share_explained == 1


def test_what_does_not_fit_is_refused():
    left, right = shifted_pair()
    one, two = views(left, right)
    with pytest.raises(InputError, match="both views"):
        pair_constancy(one, two, np.full(left.shape, 500.0))
    with pytest.raises(InputError, match="same lights"):
        pair_constancy(one, ViewImages.from_arrays([right, right]), np.zeros(left.shape))
    pair = rectified_views(Pinhole(fx=100, fy=100, cx=30, cy=20), 2.0)
    with pytest.raises(InputError, match="first view"):
        brightness_constancy(one, two, np.ones((3, 3)), pair)
