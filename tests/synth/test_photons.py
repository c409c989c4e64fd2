"""Photon counting: exact for few, and for many as good as exact."""

import numpy as np
import pytest
from scipy import stats

from psstereo_synth.photons import MANY, poisson


class FixedNormals:
    """Stands for a generator that draws given normal numbers."""

    def __init__(self, z):
        self.z = z

    def standard_normal(self, shape):
        assert shape == self.z.shape
        return self.z


def probabilities(mean):
    """Return outcomes and their probabilities, from the normal numbers at which one outcome turns into the next."""
    outcomes = np.arange(int(mean - 9 * mean**0.5), int(mean + 9 * mean**0.5))
    low, high = np.full(outcomes.shape, -12.0), np.full(outcomes.shape, 12.0)
    for _ in range(60):
        middle = (low + high) / 2
        above = poisson(np.full(outcomes.shape, mean), FixedNormals(middle)) > outcomes
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return outcomes, np.diff(stats.norm.cdf(low), prepend=0.0)


@pytest.mark.parametrize(("mean", "distance"), [(MANY, 5e-6), (300.5, 4e-6), (1000.0, 1e-6), (12345.6, 1e-7)])
def test_large_numbers_have_the_probabilities_of_poisson(mean, distance):
    outcomes, p = probabilities(mean)
    assert 0.5 * np.abs(p - stats.poisson.pmf(outcomes, mean)).sum() < distance
    centre = (p * outcomes).sum()
    variance = (p * (outcomes - centre) ** 2).sum()
    assert centre == pytest.approx(mean, rel=1e-9)
    assert variance == pytest.approx(mean, rel=2e-7)
    assert (p * (outcomes - centre) ** 3).sum() / variance**1.5 == pytest.approx(mean**-0.5, rel=1e-3)


@pytest.mark.parametrize("mean", [0.05, 3.0, 60.0, 255.0, 257.0])
def test_drawn_numbers_pass_a_chi_square_test(mean):
    numbers = poisson(np.full(400_000, mean), np.random.default_rng(5))
    assert (numbers == np.rint(numbers)).all()
    edges = np.unique(stats.poisson.ppf(np.linspace(0.002, 0.998, 60), mean))
    expected = np.diff(np.concatenate([[0.0], stats.poisson.cdf(edges, mean), [1.0]])) * numbers.size
    found = np.bincount(np.searchsorted(edges, numbers), minlength=len(expected))
    keep = expected > 5
    assert found[~keep].sum() < 20
    assert stats.chisquare(found[keep], expected[keep] * found[keep].sum() / expected[keep].sum()).pvalue > 1e-3


def test_few_and_many_side_by_side():
    mean = np.tile([0.0, 5.0, MANY, 1e6], (50_000, 1))
    numbers = poisson(mean, np.random.default_rng(1))
    assert numbers.shape == mean.shape
    assert (numbers[:, 0] == 0).all()
    for column, mu in ((1, 5.0), (2, MANY), (3, 1e6)):
        assert numbers[:, column].mean() == pytest.approx(mu, abs=4 * (mu / 50_000) ** 0.5)
        assert numbers[:, column].var() == pytest.approx(mu, rel=0.03)
    related = np.corrcoef(numbers[:, 1:].T) - np.eye(3)
    assert np.abs(related).max() < 0.02


def test_huge_numbers_do_not_overflow():
    numbers = poisson(np.full(1000, 1e25), np.random.default_rng(0))
    assert np.isfinite(numbers).all()
    assert np.abs(numbers / 1e25 - 1).max() < 1e-11
