import math

import numpy as np
import pytest

from psstereo.errors import RigError
from psstereo.lights import Led


@pytest.mark.parametrize("mu", [0.0, 0.5, 1.0, 3.0])
def test_irradiance_by_the_formula(mu):
    rng = np.random.default_rng(0)
    points, normals = rng.uniform(-1, 1, (60, 3)), rng.normal(size=(60, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    lamp = Led(position=[0.3, -0.2, 1.1], axis=[1.0, 2.0, -2.0], mu=mu, flux=[2.0, 7.0])
    irradiance = lamp.irradiance(points, normals)
    dark = 0
    for x, n, e in zip(points, normals, irradiance, strict=True):
        v = x - [0.3, -0.2, 1.1]
        r = math.sqrt(v @ v)
        lobe = max(0.0, (v / r) @ [1 / 3, 2 / 3, -2 / 3])
        expected = 2.0 * lobe**mu * max(0.0, -(v / r) @ n) / r**2
        dark += expected == 0.0
        np.testing.assert_allclose(e, [expected, 3.5 * expected], rtol=1e-13, atol=0)
    assert 10 < dark < 55


def test_the_flux_through_a_sphere_around_it():
    """∫ E dA over a sphere is 2π flux / (mu + 1), and 4π flux for mu = 0, whatever its radius."""
    nodes, weights = np.polynomial.legendre.leggauss(60)
    turn = 2 * np.pi * np.arange(4) / 4
    for mu, expected in [(0.0, 4 * np.pi), (2.0, 2 * np.pi / 3)]:
        lamp = Led(position=[1.0, 2.0, 3.0], axis=[0.0, 0.0, -1.0], mu=mu, flux=1.0)
        for radius in (0.1, 20.0):
            total = 0.0
            for lower, upper in [(-1.0, 0.0), (0.0, 1.0)]:  # the lobe has an edge at the equator
                z = (upper + lower) / 2 + nodes * (upper - lower) / 2
                s = np.sqrt(1 - z * z)
                out = np.stack([np.outer(s, np.cos(turn)), np.outer(s, np.sin(turn)), np.outer(z, np.ones(4))], -1)
                e = lamp.irradiance(lamp.position + radius * out, -out)[..., 0]
                total += radius**2 * (weights * (upper - lower) / 2) @ e.sum(axis=1) * np.pi / 2
            assert total == pytest.approx(expected, rel=1e-12)


def test_at_the_lamp_itself_nothing_is_known():
    lamp = Led(position=[1.0, 2.0, 3.0], axis=[0.0, 0.0, -1.0], mu=0.0, flux=1.0)
    assert np.isnan(lamp.directions(lamp.position)).all()
    assert np.isnan(lamp.irradiance(lamp.position, np.array([0.0, 0.0, 1.0]))).all()


@pytest.mark.parametrize(
    "change",
    [
        {"position": [0.0, np.nan, 1.0]},
        {"position": [0.0, 1.0]},
        {"mu": -0.1},
        {"mu": np.nan},
        {"mu": np.inf},
        {"axis": [0.0, 0.0, 0.0]},
        {"flux": 0.0},
        {"flux": [1.0, -1.0]},
    ],
)
def test_numbers_that_mean_nothing_are_refused(change):
    with pytest.raises(RigError):
        Led(**({"position": [0, 0, 1], "axis": [0, 0, -1], "mu": 1.0, "flux": 1.0} | change))
