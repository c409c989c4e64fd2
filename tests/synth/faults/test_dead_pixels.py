"""Pixels that do not see the light."""

import numpy as np
import pytest

from psstereo.errors import OptionError
from psstereo_synth.faults import DeadPixels, Draws


@pytest.mark.parametrize(("dtype", "white"), [(np.uint8, 255), (np.uint16, 4095), (np.uint16, 65535), (np.float64, 1)])
def test_as_many_as_asked_for_and_the_same_in_all_images(dtype, white):
    fault, draws = DeadPixels(dead=0.01, hot=0.02), Draws(3)
    dead, hot = fault.masks(50, 40, draws)
    assert (dead.sum(), hot.sum()) == (20, 40)
    assert not (dead & hot).any()
    for index in (0, 1, 9):
        image = np.full((50, 40, 3), white // 2 + 0.25 * (white == 1)).astype(dtype)
        spoilt = fault.values(image, index, float(white), draws)
        assert (spoilt[dead] == 0).all()
        assert (spoilt[hot] == white).all()
        np.testing.assert_array_equal(spoilt[~dead & ~hot], image[~dead & ~hot])


def test_places_are_spread_evenly():
    hits = np.zeros((8, 8))
    for seed in range(600):
        hits += DeadPixels(dead=0.1, hot=0.1).masks(8, 8, Draws(seed))[0]
    assert np.abs(hits / (600 * 6 / 64) - 1).max() < 0.6
    assert hits.sum() == 600 * 6


def test_all_of_them_can_be_spoilt():
    dead, hot = DeadPixels(dead=0.5, hot=0.5).masks(3, 5, Draws(0))
    assert (dead ^ hot).all()
    dead, hot = DeadPixels(dead=0.0, hot=0.999).masks(2, 2, Draws(0))
    assert hot.all()
    assert not dead.any()


@pytest.mark.parametrize("options", [{"dead": 1.0}, {"hot": 1.5}, {"dead": 0.6, "hot": 0.6}], ids=str)
def test_bad_shares_are_refused(options):
    with pytest.raises(OptionError):
        DeadPixels(**options)
