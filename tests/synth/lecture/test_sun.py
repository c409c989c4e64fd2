import numpy as np
import pytest
from scipy.integrate import quad

from psstereo_synth.lecture import LECTURE

A = np.arcsin(6.957e8 / 1.495978707e11)
L = 1361.0 / (2 * np.pi * (1 - np.cos(A)))


@pytest.fixture(scope="module")
def rows():
    return LECTURE["sun"]().rows


def by_slices(elevation):
    """Irradiance of level ground: for each circle around the disc's middle, its part above the horizon."""

    def circle(a):
        # Height on the circle: sin e cos a + cos e sin a cos b, positive for |b| < limit.
        mean, swing = np.sin(elevation) * np.cos(a), np.cos(elevation) * np.sin(a)
        limit = np.arccos(np.clip(-mean / swing, -1, 1)) if swing > 0 else np.pi * (mean > 0)
        return 2 * np.sin(a) * (mean * limit + swing * np.sin(limit))

    kink = [abs(elevation)] if 0 < abs(elevation) < A else None
    return L * quad(circle, 0, A, points=kink, epsabs=0, epsrel=1e-11, limit=200)[0]


def test_the_disc_by_circles(rows):
    assert len(rows) == 13
    for row in rows:
        assert row[3] == pytest.approx(by_slices(np.deg2rad(row[0])), rel=1e-9, abs=1e-9)


def test_the_direction(rows):
    for row in rows:
        assert row[2] == pytest.approx(1361.0 * max(0.0, np.sin(np.deg2rad(row[0]))), rel=1e-10)
        assert row[4] == pytest.approx(row[3] - row[2], abs=1e-15)


def test_half_a_disc_on_the_horizon(rows):
    half = next(row for row in rows if row[0] == 0.0)
    assert half[2] == 0.0
    assert half[3] == pytest.approx(2 / 3 * A**3 * L, rel=1e-5)


def test_a_rising_and_a_setting_disc_belong_together(rows):
    # max(0, c) − max(0, −c) = c: the two halves that the horizon cuts add up to the narrow law.
    disc = {row[0]: row[3] for row in rows}
    for elevation in (0.1, 0.2):
        whole = np.pi * L * np.sin(A) ** 2 * np.sin(np.deg2rad(elevation))
        assert disc[elevation] - disc[-elevation] == pytest.approx(whole, rel=1e-10)
    assert disc[-0.27] == 0.0


def test_the_narrow_law_is_too_large_by_the_square_of_half_the_disc(rows):
    above = [row for row in rows if np.deg2rad(row[0]) > A]
    assert len(above) == 7
    for row in above:
        assert row[2] / row[3] - 1 == pytest.approx(np.tan(A / 2) ** 2, rel=1e-4)


def test_the_figures_beside_the_table():
    notes = " ".join(LECTURE["sun"]().notes)
    assert f"{np.rad2deg(A):.4f}°" in notes
    assert "6.794e-05 sr" in notes
    assert "2.003e+07 W" in notes
