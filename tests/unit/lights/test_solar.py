import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from psstereo.errors import InputError
from psstereo.lights import Directional, from_azimuth, solar_declination, sun_path


def almanac_declination(days_since_2000):
    """Low-precision formula of the Astronomical Almanac, good to 0.01°; days from 2000 January 1, 12h."""
    n = days_since_2000
    mean_longitude, anomaly = math.radians(280.460 + 0.9856474 * n), math.radians(357.528 + 0.9856003 * n)
    longitude = mean_longitude + math.radians(1.915 * math.sin(anomaly) + 0.020 * math.sin(2 * anomaly))
    return math.asin(math.sin(math.radians(23.439 - 4e-7 * n)) * math.sin(longitude))


def test_declination_against_the_almanac():
    errors = []
    for year in range(1990, 2036):
        days_before = 365 * (year - 2000) + math.ceil((year - 2000) / 4)
        length = 366 if year % 4 == 0 else 365
        errors += [float(solar_declination(d)) - almanac_declination(days_before + d - 1) for d in range(1, length + 1)]
    assert np.abs(errors).max() < 0.01
    assert math.sqrt(np.square(errors).mean()) < 0.005


def test_declination_at_the_solstices_and_equinoxes():
    assert np.degrees(solar_declination(172)) == pytest.approx(23.44, abs=0.05)
    assert np.degrees(solar_declination(355)) == pytest.approx(-23.44, abs=0.05)
    assert abs(np.degrees(solar_declination([80, 266]))).max() < 0.6


@given(st.floats(-math.pi / 2, math.pi / 2), st.floats(1, 366), st.floats(0, 24))
def test_directions_are_of_unit_length_and_the_pole_keeps_its_angle(latitude, day, hour):
    (toward,) = sun_path(latitude, day, hour)
    assert np.linalg.norm(toward) == pytest.approx(1.0, rel=1e-15)
    pole = np.array([0.0, math.cos(latitude), math.sin(latitude)])
    assert toward @ pole == pytest.approx(math.sin(solar_declination(day)), rel=0, abs=1e-15)


@given(st.floats(-math.pi / 2, math.pi / 2), st.floats(1, 366), st.floats(0, 12))
def test_morning_and_evening_mirror_each_other(latitude, day, hours):
    before, after = sun_path(latitude, day, [12 - hours, 12 + hours])
    np.testing.assert_allclose(after, before * [-1, 1, 1], rtol=0, atol=1e-15)


def test_it_turns_about_the_pole_by_fifteen_degrees_an_hour():
    """The same by turning the noon's direction about the pole with Rodrigues' formula, westward."""
    latitude, day = 0.8, 200.0
    pole = np.array([0.0, math.cos(latitude), math.sin(latitude)])
    noon = sun_path(latitude, day, 12.0)[0]
    for hour, toward in zip(np.arange(25.0), sun_path(latitude, day, np.arange(25.0)), strict=True):
        t = math.radians(15 * (12 - hour))
        turned = math.cos(t) * noon + math.sin(t) * np.cross(pole, noon) + (1 - math.cos(t)) * (pole @ noon) * pole
        np.testing.assert_allclose(toward, turned, rtol=0, atol=1e-15)


def test_what_everyone_knows_of_the_sun():
    north = math.radians(50.0)
    morning, noon, evening, night = sun_path(north, 172.0, [8.0, 12.0, 16.0, 0.0])
    assert morning[0] > 0 > evening[0]  # from east to west
    assert noon[1] < 0  # in the south
    assert math.degrees(math.asin(noon[2])) == pytest.approx(90 - 50 + 23.44, abs=0.05)
    assert night[2] < 0
    assert sun_path(-north, 172.0, 12.0)[0, 1] > 0  # in the north, seen from the south
    assert (sun_path(math.radians(70), 172.0, np.arange(24))[:, 2] > 0).all()  # it does not set
    assert (sun_path(math.radians(70), 355.0, np.arange(24))[:, 2] < 0).all()
    equinox = sun_path(0.0, 80.5, [6.0, 12.0])
    assert abs(equinox - [[1, 0, 0], [0, 0, 1]]).max() < 0.01


def test_azimuths_run_clockwise_from_the_north():
    half = math.pi / 2
    got = from_azimuth([0, half, 2 * half, 3 * half, 0.3], [0, 0, 0, 0, half])
    np.testing.assert_allclose(got, [[0, 1, 0], [1, 0, 0], [0, -1, 0], [-1, 0, 0], [0, 0, 1]], rtol=0, atol=1e-15)
    assert from_azimuth(np.zeros((4, 1)), np.zeros(3)).shape == (4, 3, 3)
    assert Directional(direction=from_azimuth(1.0, 0.5), strength=1.0).direction[2] == pytest.approx(math.sin(0.5))


@given(st.floats(-10, 10), st.floats(-1.5, 1.5))
def test_azimuth_and_elevation_come_back(azimuth, elevation):
    x, y, z = from_azimuth(azimuth, elevation)
    assert math.remainder(math.atan2(x, y) - azimuth, 2 * math.pi) == pytest.approx(0.0, abs=1e-13)
    assert math.atan2(z, math.hypot(x, y)) == pytest.approx(elevation, abs=1e-14)


@pytest.mark.parametrize("day", [0.99, 367.0, -1.0, np.nan, np.inf])
def test_days_that_are_not_are_refused(day):
    with pytest.raises(InputError, match="day"):
        solar_declination(day)
    with pytest.raises(InputError, match="day"):
        sun_path(0.5, day, 12.0)


def test_angles_and_hours_that_mean_nothing_are_refused():
    for latitude, hours in [(1.6, 12.0), (np.nan, 12.0), (0.5, 25.0), (0.5, [-1.0]), (0.5, np.nan)]:
        with pytest.raises(InputError):
            sun_path(latitude, 100.0, hours)
    for azimuth, elevation in [(np.inf, 0.0), (np.nan, 0.0), (0.0, 1.6), (0.0, np.nan)]:
        with pytest.raises(InputError):
            from_azimuth(azimuth, elevation)
    assert np.isnan(from_azimuth([np.nan], 0.0)[0, :2]).all()
