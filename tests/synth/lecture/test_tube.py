import numpy as np
import pytest
from scipy.integrate import quad

from psstereo_synth.lecture import LECTURE

L = 1000.0


@pytest.fixture(scope="module")
def found():
    return LECTURE["tube"]()


def exact_power(r, d):
    # Irradiance from a parallel disc at the distance p from its axis, added up over the near end.
    def ring(p):
        square = p * p + d * d
        root = np.sqrt((square + r * r) ** 2 - 4 * p * p * r * r)
        return 2 * np.pi * p * np.pi * L / 2 * (1 - (square - r * r) / root)

    return quad(ring, 0, r, epsabs=0, epsrel=1e-11)[0]


def test_the_exact_power_is_that_of_rings(found):
    for row in found.rows:
        # The ring's own form cancels (d/r)² digits.
        assert row[5] == pytest.approx(exact_power(row[0], row[1]), rel=1e-11 + 1e-15 * (row[1] / row[0]) ** 2)


def test_the_solid_angle_is_a_caps(found):
    for r, d, solid in (row[:3] for row in found.rows):
        assert solid == pytest.approx(2 * np.pi * (1 - d / np.hypot(r, d)), rel=1e-10)


def test_the_power_is_the_product(found):
    for row in found.rows:
        assert row[3] == pytest.approx(L * np.pi * row[0] ** 2 * row[2], rel=1e-14)


def test_thin_tubes_scale(found):
    power = {row[:2]: row[5] for row in found.rows}
    assert power[0.02, 1.0] / power[0.01, 1.0] == pytest.approx(16, rel=1e-3)
    assert power[0.01, 2.0] / power[0.01, 1.0] == pytest.approx(1 / 4, rel=1e-3)
    assert power[0.02, 4.0] / power[0.01, 1.0] == pytest.approx(1, rel=1e-3)


def test_the_excess_is_what_the_text_says(found):
    for row in found.rows:
        t = (row[0] / row[1]) ** 2
        if t < 0.011:
            assert row[6] == pytest.approx(1.25 * t, rel=2 * t)
    excess = {row[:2]: row[6] for row in found.rows}
    # r = d: G = π² r² (3 − √5) / 2 and Ω = 2π (1 − 1/√2).
    assert excess[1.0, 1.0] == pytest.approx(2 * (2 - np.sqrt(2)) / (3 - np.sqrt(5)) - 1, rel=1e-12)
    assert excess[1.0, 1.0] == pytest.approx(0.53, abs=0.005)
    assert 0.9 < excess[1.0, 0.1] < 1.0
