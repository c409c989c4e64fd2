import numpy as np
import pytest
from scipy.integrate import dblquad, quad

from psstereo_synth.lecture import LECTURE

L, R = 1000.0, 1.0


@pytest.fixture(scope="module")
def rows():
    return LECTURE["skylight"]().rows


def by_area(offset, depth):
    # L cosθ cosθ' / ρ² over the skylight.
    def piece(turn, radius):
        square = radius**2 + offset**2 - 2 * radius * offset * np.cos(turn) + depth**2
        return radius * depth**2 / square**2

    return L * 2 * dblquad(piece, 0, R, 0, np.pi, epsabs=0, epsrel=1e-11)[0]


def test_the_irradiance_by_quadrature_over_the_skylight(rows):
    for row in rows:
        assert row[2] == pytest.approx(by_area(row[0], row[1]), rel=1e-9)
        assert row[3] == pytest.approx(row[2], rel=1e-12)


def test_on_the_axis_by_quadrature_over_directions(rows):
    on_axis = [row for row in rows if row[0] == 0.0]
    assert len(on_axis) == 4
    for row in on_axis:
        rim = np.arctan(R / row[1])
        expected = quad(lambda a: 2 * np.pi * L * np.cos(a) * np.sin(a), 0, rim, epsabs=0)[0]
        assert row[4] == pytest.approx(expected, rel=1e-12)
        assert row[2] == pytest.approx(L * np.pi * R**2 / (R**2 + row[1] ** 2), rel=1e-13)
    assert all(row[4] == "" for row in rows if row[0] != 0.0)


def test_from_far_away_it_is_narrow(rows):
    ratio = {row[:2]: row[6] for row in rows}
    assert ratio[0.0, 1.0] == pytest.approx(4 - 2 * np.sqrt(2), rel=1e-13)  # 2 (1 − cos 45°) / sin² 45°
    for depth in (10.0, 100.0):
        assert ratio[0.0, depth] - 1 == pytest.approx(0.25 / depth**2, rel=0.01)
    assert abs(ratio[20.0, 2.0] - 1) < 0.003
    assert abs(ratio[5.0, 2.0] - 1) > 0.02


def test_it_falls_off_across_the_floor(rows):
    level = [row[2] for row in rows if row[1] == 2.0]
    assert len(level) == 5
    assert np.all(np.diff(level) < 0)
    assert level[-1] == pytest.approx(L * np.pi * R**2 * 2.0**2 / (20.0**2 + 2.0**2) ** 2, rel=0.01)
