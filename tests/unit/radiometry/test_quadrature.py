import math

import numpy as np
import pytest

from psstereo.radiometry.quadrature import disc_rule, triangle_rule


@pytest.mark.parametrize("count", [3, 4, 5, 16, 64, 256, 1000])
def test_moments_of_the_disc(count):
    squares, turns, weights = disc_rule(count)
    assert abs(len(weights) - count) <= 0.25 * count
    assert (weights > 0).all()
    x, y = np.sqrt(squares) * np.cos(turns), np.sqrt(squares) * np.sin(turns)
    assert weights.sum() == pytest.approx(1.0, rel=1e-14)
    np.testing.assert_allclose([weights @ x, weights @ y, weights @ (x * y)], 0.0, rtol=0, atol=1e-15)
    assert weights @ (x * x + y * y) == pytest.approx(0.5, rel=1e-14)
    if count >= 16:
        assert weights @ (x * x + y * y) ** 3 == pytest.approx(0.25, rel=1e-14)
        assert weights @ x**4 == pytest.approx(0.125, rel=1e-13)


def test_one_or_two_points_of_the_disc_are_its_centre():
    assert [a.tolist() for a in disc_rule(1)] == [a.tolist() for a in disc_rule(2)] == [[0.0], [0.0], [1.0]]


@pytest.mark.parametrize("order", [1, 2, 3, 4, 9])
def test_moments_of_the_triangle(order):
    """The mean of the product of powers of barycentric coordinates is 2 i! j! k! / (i + j + k + 2)!."""
    places, weights = triangle_rule(order)
    assert len(weights) == order**2
    assert (weights > 0).all()
    np.testing.assert_allclose(places.sum(axis=1), 1.0, rtol=1e-15)
    for i in range(2 * order):
        for j in range(2 * order - i):
            k = 2 * order - 1 - i - j
            want = 2.0 * math.factorial(i) * math.factorial(j) * math.factorial(k) / math.factorial(i + j + k + 2)
            assert weights @ (places ** [i, j, k]).prod(axis=1) == pytest.approx(want, rel=1e-12)


def test_rules_cannot_be_changed():
    for array in (*disc_rule(16), *triangle_rule(2)):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0
