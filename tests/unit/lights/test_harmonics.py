import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from scipy.special import sph_harm_y

from psstereo.errors import InputError, OptionError, RigError, UnsupportedError
from psstereo.lights import Ambient, Environment, Harmonics, lat_long_directions, real_harmonics

FIELD = np.array([1.0, 0.15, 0.2, -0.1, 0.1, 0.1, -0.1, 0.1, 0.05])
INDICES = [(0, 0), (1, -1), (1, 0), (1, 1), (2, -2), (2, -1), (2, 0), (2, 1), (2, 2)]


def unit(count, seed=0):
    vectors = np.random.default_rng(seed).normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def frame(normal):
    side = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    side /= np.linalg.norm(side)
    return np.stack([side, np.cross(normal, side), normal], axis=1)


def hemisphere_integral(radiance, normal):
    """∫ L (n·ω) dω above the horizon, Gauss over the cosine times equal steps in azimuth, exact for polynomials."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    cosine, shares = 0.5 + 0.5 * nodes, 0.5 * weights
    turns = 2 * np.pi * np.arange(24) / 24
    sine = np.sqrt(1 - cosine**2)[:, None]
    own = np.stack(np.broadcast_arrays(sine * np.cos(turns), sine * np.sin(turns), cosine[:, None]), axis=-1)
    values = radiance(own @ frame(normal).T)
    return np.einsum("i,ij...->...", shares * cosine, values) * 2 * np.pi / 24


@pytest.mark.parametrize(("index", "order"), list(enumerate(INDICES)))
def test_functions_agree_with_scipy(index, order):
    degree, m = order
    directions = unit(200)
    x, y, z = directions.T
    complex_ones = sph_harm_y(degree, abs(m), np.arctan2(np.hypot(x, y), z), np.arctan2(y, x))
    part = complex_ones.imag if m < 0 else complex_ones.real
    expected = part * (-1) ** abs(m) * (np.sqrt(2) if m else 1.0)  # SciPy's have the sign of Condon and Shortley
    np.testing.assert_allclose(real_harmonics(directions)[:, index], expected, rtol=0, atol=1e-15)


def test_axes_and_constants_are_as_stated():
    x, y, z = real_harmonics(np.eye(3))
    linear = np.sqrt(3 / (4 * np.pi))
    np.testing.assert_allclose(x[:4], [0.5 / np.sqrt(np.pi), 0, 0, linear], rtol=1e-15)
    np.testing.assert_allclose(y[:4], [0.5 / np.sqrt(np.pi), linear, 0, 0], rtol=1e-15)
    np.testing.assert_allclose(z[:4], [0.5 / np.sqrt(np.pi), 0, linear, 0], rtol=1e-15)
    assert z[6] == pytest.approx(0.5 * np.sqrt(5 / np.pi), rel=1e-15)
    assert x[8] == pytest.approx(0.25 * np.sqrt(15 / np.pi), rel=1e-15)
    with pytest.raises(InputError, match="shape"):
        real_harmonics([1.0, 2.0])


@given(
    st.lists(st.floats(-1, 1), min_size=8, max_size=8),
    st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 1e-3),
)
def test_irradiance_is_the_integral_over_the_hemisphere(rest, normal):
    light = Harmonics(coefficients=np.array([1.0, *rest]), allow_negative=True)
    n = np.array(normal) / np.linalg.norm(normal)
    expected = hemisphere_integral(light.radiance_from, n)
    np.testing.assert_allclose(light.irradiance(n, n), expected, rtol=0, atol=3e-15 * 9)


def test_a_constant_field_is_ambient():
    normals = unit(20)
    light = Harmonics(coefficients=np.array([2 * np.sqrt(np.pi) * 3.0, *np.zeros(8)]))
    expected = Ambient(radiance=3.0).irradiance(normals, normals)
    np.testing.assert_allclose(light.irradiance(normals, normals), expected, rtol=1e-15)


def test_fields_that_go_below_zero_are_refused_by_their_minimum():
    # 1 + 2z has its least at −z: 1 − 2 = −1, its largest 3.
    coefficients = np.array([2 * np.sqrt(np.pi), 0, 2 * np.sqrt(4 * np.pi / 3), *np.zeros(6)])
    with pytest.raises(RigError, match=r"falls to -0\.999.*largest is 3"):
        Harmonics(coefficients=coefficients)
    with pytest.raises(RigError, match="channel 2"):
        Harmonics(coefficients=np.stack([FIELD, coefficients], axis=1))
    fitted = Harmonics(coefficients=coefficients, allow_negative=True)
    down = np.array([0, 0, -1.0])
    assert fitted.irradiance(down, down) == pytest.approx([np.pi * (1 - 4 / 3)], rel=1e-14)


def test_a_field_that_just_touches_zero_is_fine():
    coefficients = np.array([2 * np.sqrt(np.pi), 0, np.sqrt(4 * np.pi / 3), *np.zeros(6)])
    assert Harmonics(coefficients=coefficients).radiance_from([0, 0, -1.0]) == pytest.approx([0.0], abs=1e-15)


@pytest.mark.parametrize(
    "bad",
    [np.zeros(9), -FIELD, FIELD[:8], FIELD * np.nan, FIELD * np.inf, np.zeros((9, 0)), np.ones((9, 1, 1)), 1.0],
    ids=str,
)
@pytest.mark.parametrize("allow", [False, True])
def test_coefficients_that_mean_nothing_are_refused(bad, allow):
    with np.errstate(invalid="ignore"), pytest.raises(RigError):
        Harmonics(coefficients=bad, allow_negative=allow)


@pytest.mark.parametrize("seed", range(4))
def test_moved_turns_the_field(seed):
    turn = Rotation.random(random_state=seed).as_matrix()
    light = Harmonics(coefficients=np.stack([FIELD, 2 * FIELD], axis=1))
    directions = unit(50)
    moved = light.moved(turn, np.ones(3))
    np.testing.assert_allclose(
        moved.radiance_from(directions @ turn.T), light.radiance_from(directions), rtol=0, atol=4e-15
    )
    with pytest.raises(InputError):
        light.moved(-turn, np.ones(3))


@pytest.mark.parametrize(("count", "rms"), [(64, 3e-3), (256, 5e-4), (1024, 1e-4)])
def test_beams_add_up_to_it(count, rms):
    normals = unit(2000)
    light = Harmonics(coefficients=np.stack([FIELD, FIELD * [1, -1, 1, 0, 0, 1, 1, 0, 1]], axis=1))
    total = sum(
        np.maximum(normals @ beam.directions, 0.0)[:, None] * beam.irradiance for beam in light.beams(normals, count)
    )
    error = total / light.irradiance(normals, normals) - 1
    assert np.sqrt(np.mean(error**2)) < rms
    assert np.abs(error).max() < 8 * rms


def test_beams_keep_flux_and_vector_irradiance():
    light = Harmonics(coefficients=FIELD)
    beams = list(light.beams(np.zeros(3), 100))
    vector = sum(beam.irradiance[0] * beam.directions for beam in beams)
    along = np.sqrt(4 * np.pi / 3) * FIELD[[3, 1, 2]]
    np.testing.assert_allclose(vector, along, rtol=0, atol=1e-13)
    assert sum(beam.irradiance[0] for beam in beams) == pytest.approx(2 * np.sqrt(np.pi), rel=1e-13)


def test_projection_returns_what_was_put_in():
    table = np.stack([FIELD, 3 * FIELD], axis=1)
    light = Harmonics.projected(Harmonics(coefficients=table).radiance_from, degree=4)
    np.testing.assert_allclose(light.coefficients, table, rtol=0, atol=1e-14)
    alone = Harmonics.projected(lambda w: 1.0 + 0.5 * w[:, 2])
    assert alone.channels == 1
    with pytest.raises(OptionError, match="3"):
        Harmonics.projected(lambda w: w[:, 0], degree=3)


def test_a_narrow_source_keeps_all_but_a_hundredth():
    """Nine numbers hold 99.2 % of the mean square of the irradiance from a narrow source, but go below zero."""
    narrow = lambda w: np.exp(400.0 * (w[:, 2] - 1.0))  # noqa: E731
    with pytest.raises(RigError, match="negative"):
        Harmonics.projected(narrow)
    fitted = Harmonics.projected(narrow, allow_negative=True)
    flux = 2 * np.pi / 400
    normals = unit(20000)
    true = flux * np.maximum(normals[:, 2], 0.0)
    gap = fitted.irradiance(normals, normals)[:, 0] - true
    assert (gap**2).sum() / (true**2).sum() == pytest.approx(0.0078, abs=0.001)


def test_projection_of_a_map():
    table = np.stack([FIELD, 2 * FIELD, 3 * FIELD], axis=1)
    whole = Harmonics(coefficients=table)
    errors = []
    for rows in (16, 32, 64):
        made = Environment(radiance=whole.radiance_from(lat_long_directions(rows, 2 * rows)))
        back = Harmonics.projected(made.radiance_from, degree=20 * rows)
        errors.append(np.abs(back.coefficients - table).max())
    assert errors[-1] < 2e-3
    assert errors[0] > 4 * errors[-1]


def test_what_every_light_promises():
    light = Harmonics(coefficients=FIELD)
    again = pickle.loads(pickle.dumps(light))
    normals = unit(5)
    np.testing.assert_array_equal(again.irradiance(normals, normals), light.irradiance(normals, normals))
    with pytest.raises(ValueError, match="read-only"):
        light.coefficients[0] = 1
    assert np.isnan(light.directions(np.zeros((2, 3)))).all()
    assert np.isnan(light.irradiance(normals, normals * np.nan)).all()
    with pytest.raises(UnsupportedError, match="harmonics"):
        light.idealised()
