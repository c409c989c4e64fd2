import numpy as np
import pytest

from psstereo.errors import InputError
from psstereo.radiometry import (
    apparent_radiance,
    disc_etendue,
    field_radius,
    radiance_from_power,
    sphere_solid_angle,
    tube_power,
)


def test_constant_while_the_source_fills_the_field_then_as_the_square():
    distance = np.geomspace(1.0, 1e6, 25)
    source = sphere_solid_angle(0.1, distance)
    reading = apparent_radiance(7.0, source, 1e-6)
    filled = source >= 1e-6
    assert 0 < filled.sum() < 25
    assert (reading[filled] == 7.0).all()
    np.testing.assert_allclose(reading[~filled] * distance[~filled] ** 2, 7.0 * np.pi * 0.01 / 1e-6, rtol=1e-6)


def test_reading_of_a_filled_field_is_the_radiance():
    assert radiance_from_power(tube_power(3.0, 1e-4, 1e-3), 1e-7) == pytest.approx(3.0)


@pytest.mark.parametrize("distance", [0.0, 0.5, 20.0])
def test_the_field_is_what_the_two_openings_let_through(distance):
    a, b, t = 0.02, 0.05, 0.3
    far = np.linspace(-3, 3, 601) * float(field_radius(a, b, t, distance))
    at_stop = far[:, None] + (np.linspace(-a, a, 41) - far[:, None]) * distance / (distance + t)
    passes = (np.abs(at_stop) <= b * (1 + 1e-12)).any(axis=1)
    assert np.abs(far[passes]).max() == pytest.approx(float(field_radius(a, b, t, distance)), rel=1e-2, abs=0.0)


def test_one_way_or_the_other_a_uniform_source_gives_its_radiance():
    assert radiance_from_power(4.0 * disc_etendue(0.02, 0.05, 0.3), disc_etendue(0.02, 0.05, 0.3)) == pytest.approx(4.0)


def test_wrong_input_raises():
    with pytest.raises(InputError, match="étendue"):
        radiance_from_power(1.0, 0.0)
    with pytest.raises(InputError, match="field's"):
        apparent_radiance(1.0, 1.0, 0.0)
    with pytest.raises(InputError, match="stop's"):
        field_radius(1.0, -1.0, 1.0, 1.0)
