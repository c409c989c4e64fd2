import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from psstereo.errors import InputError, RigError, UnsupportedError
from psstereo.lights import Ambient
from psstereo.lights.sphere_rule import product_rule, sphere_rule


def unit(count, seed=0):
    vectors = np.random.default_rng(seed).normal(size=(count, 3))
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.concatenate([vectors, np.eye(3), -np.eye(3)])


def beam_sum(light, normals, count):
    beams = light.beams(np.zeros_like(normals), count)
    return sum(np.maximum(normals @ beam.directions, 0.0)[:, None] * beam.irradiance for beam in beams)


def test_irradiance_is_pi_times_radiance_for_every_normal():
    normals = unit(50)
    irradiance = Ambient(radiance=[2.0, 0.5]).irradiance(normals, normals)
    np.testing.assert_array_equal(irradiance, np.tile([2.0 * np.pi, 0.5 * np.pi], (56, 1)))


def test_a_normal_that_is_unknown_gets_nothing_known():
    normals = np.array([[0, 0, 1.0], [np.nan, 0, 1]])
    np.testing.assert_array_equal(np.isnan(Ambient(radiance=[1.0, 2.0]).irradiance(normals, normals)[:, 0]), [0, 1])


@pytest.mark.parametrize(("count", "rms", "worst"), [(64, 2e-3, 8e-3), (256, 3e-4, 1.5e-3), (1024, 6e-5, 3e-4)])
def test_beams_add_up_to_it(count, rms, worst):
    normals = unit(3000)
    light = Ambient(radiance=1.0)
    error = beam_sum(light, normals, count) / light.irradiance(normals, normals) - 1
    assert np.sqrt(np.mean(error**2)) < rms
    assert np.abs(error).max() < worst


def test_beams_are_the_same_each_time_and_come_from_all_around():
    beams = list(Ambient(radiance=3.0).beams(np.zeros(3), 256))
    again = list(Ambient(radiance=3.0).beams(np.ones((7, 3)), 256))
    assert len(beams) == len(again) == 512
    for one, two in zip(beams, again, strict=True):
        assert one.parallel
        np.testing.assert_array_equal(one.directions, two.directions)
        np.testing.assert_array_equal(one.irradiance, two.irradiance)
    assert sum(beam.irradiance[0] for beam in beams) == pytest.approx(12 * np.pi, rel=1e-14)


@given(count=st.integers(-5, 700))
def test_the_sphere_rule_has_positive_weights_and_is_exact_for_cubics(count):
    directions, weights = sphere_rule(count)
    x, y, z = directions.T
    assert len(weights) == max(count, 32)
    assert (weights > 0).all()
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, rtol=0, atol=4e-16)
    np.testing.assert_allclose(weights.sum(), 4 * np.pi, rtol=1e-12)
    np.testing.assert_allclose([(weights * v * v).sum() for v in (x, y, z)], 4 * np.pi / 3, rtol=1e-12)
    odd = [x, y, z, x * y, y * z, x * z, x * y * z, x**3, x * y * y, z**3, z * x * x]
    np.testing.assert_allclose([(weights * v).sum() for v in odd], 0.0, rtol=0, atol=1e-12)


@pytest.mark.parametrize("degree", [0, 1, 4, 5, 20])
def test_the_product_rule_is_exact_up_to_its_degree(degree):
    directions, weights = product_rule(degree)
    for axis in range(3):
        for power in range(degree + 1):
            exact = 0.0 if power % 2 else 4 * np.pi / (power + 1)
            np.testing.assert_allclose((weights * directions[:, axis] ** power).sum(), exact, rtol=0, atol=1e-13)
    if degree % 2 == 0:  # and no further
        x, y, z = directions.T
        turning = ((x + 1j * y) ** (degree + 1)).real
        assert abs((weights * (z ** (degree + 2) + turning)).sum() - 4 * np.pi / (degree + 3)) > 1e-9


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf, [1.0, 0.0], [[1.0]]])
def test_radiances_that_mean_nothing_are_refused(bad):
    with pytest.raises(RigError, match="ambient radiance"):
        Ambient(radiance=bad)


def test_it_looks_the_same_in_every_frame():
    light = pickle.loads(pickle.dumps(Ambient(radiance=[1.0, 2.0])))
    quarter = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
    np.testing.assert_array_equal(light.moved(quarter, np.ones(3)).radiance, [1.0, 2.0])
    with pytest.raises(InputError, match="rotation"):
        light.moved(2 * quarter, np.ones(3))


def test_no_light_file_holds_it():
    with pytest.raises(UnsupportedError, match="ambient"):
        Ambient(radiance=1.0).idealised()
    assert np.isnan(Ambient(radiance=1.0).directions(np.zeros((4, 3)))).all()
