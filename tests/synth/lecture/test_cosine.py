import numpy as np
import pytest

from psstereo.errors import InputError
from psstereo_synth.lecture import LECTURE
from psstereo_synth.lecture.cosine import footprint_area


@pytest.fixture(scope="module")
def rows():
    return np.array(LECTURE["cosine"]().rows)


def test_the_irradiance_is_the_sine_of_the_elevation(rows):
    sine = np.sin(np.deg2rad(rows[:, 0]))
    assert rows[:, 1] == pytest.approx(sine, rel=1e-14)
    assert rows[:, 4] == pytest.approx(1000 * sine, rel=1e-12)
    assert dict(rows[:, [0, 4]])[30.0] == pytest.approx(500.0, rel=1e-14)


def test_the_power_lands_on_the_footprint(rows):
    assert rows[:, 2] * rows[:, 4] == pytest.approx(1000.0, rel=1e-12)
    assert rows[:, 0].min() < 1e-5


@pytest.mark.parametrize("elevation", [1.5, 0.7, 0.05, 1e-7])
@pytest.mark.parametrize("azimuth", [0.0, 1.0, 4.0])
def test_the_footprint_is_an_ellipse(elevation, azimuth):
    way = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    across, footprint = footprint_area(way, 0.3)
    # Circle of radius r and ellipse of half-axes r and r / sin e, each as its inscribed 360-gon.
    inscribed = 360 / 2 * np.sin(2 * np.pi / 360)
    assert across == pytest.approx(inscribed * 0.3**2, rel=1e-13)
    assert footprint == pytest.approx(inscribed * 0.3**2 / np.sin(elevation), rel=1e-14 + 2e-15 / elevation)


@pytest.mark.parametrize("direction", [[1.0, 0.0, 0.0], [0.6, 0.0, -0.8], [0.0, 0.0, np.nan]])
def test_light_from_below_has_no_footprint(direction):
    with pytest.raises(InputError, match="from above"):
        footprint_area(np.array(direction), 1.0)
