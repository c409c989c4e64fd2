import numpy as np
import pytest

from psstereo import radiometry
from psstereo.radiometry import (
    FULL_SPHERE,
    HEMISPHERE,
    SOLAR_CONSTANT,
    SUN_ANGULAR_RADIUS,
    SUN_RADIANCE,
    SUN_SOLID_ANGLE,
    cap_solid_angle,
)


def test_sun_agrees_with_itself():
    assert cap_solid_angle(SUN_ANGULAR_RADIUS) == pytest.approx(SUN_SOLID_ANGLE, rel=2e-3, abs=0.0)
    assert pytest.approx(SOLAR_CONSTANT) == SUN_RADIANCE * SUN_SOLID_ANGLE
    assert pytest.approx(2.0e7, rel=1e-2, abs=0.0) == SUN_RADIANCE


def test_whole_and_half():
    assert pytest.approx(4 * np.pi, rel=1e-16, abs=0.0) == FULL_SPHERE == 2 * HEMISPHERE


def test_public_names_exist_and_are_listed_once():
    assert len(set(radiometry.__all__)) == len(radiometry.__all__)
    assert all(hasattr(radiometry, name) for name in radiometry.__all__)
