import pickle
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

from psstereo.errors import InputError, RigError, UnsupportedError
from psstereo.lights import Directional, Environment, Harmonics, Sun, lat_long_directions
from psstereo.lights.lat_long import cell_solid_angles, cell_squares, cell_vectors

FIELD = np.array([1.0, 0.15, 0.2, -0.1, 0.1, 0.1, -0.1, 0.1, 0.05])
AXES = np.concatenate([np.eye(3), -np.eye(3)])
NEARLY = np.array([[1e-9, 1, 0], [1, 1e-9, 0], [0, -1e-300, 1], [0.6, -0.0, 0.8], [1e-160, -1, 0], [0.6, 1e-12, -0.8]])


def unit(count, seed=0):
    vectors = np.random.default_rng(seed).normal(size=(count, 3))
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.concatenate([vectors, AXES, NEARLY])


def rough(height, width, channels=1, seed=0):
    return np.random.default_rng(seed).uniform(0, 1, (height, width, channels)) ** 4


def by_pixels(radiance, normals, finer):
    """Σ L max(0, n·V) over small pieces of pixels, right but for those that the horizon cuts."""
    pieces = radiance.repeat(finer, axis=0).repeat(finer, axis=1)
    vectors = cell_vectors(*pieces.shape[:2]).reshape(-1, 3)
    return np.stack([np.maximum(vectors @ n, 0.0) @ pieces.reshape(len(vectors), -1) for n in normals])


def test_where_the_pixels_of_a_map_look():
    """Row 0 to +y; middle to +z, left half +x, right half −x, both sides −z."""
    look = lat_long_directions(2, 4)
    s = np.sqrt(0.5)
    np.testing.assert_allclose(look[0, :, 1], s, rtol=1e-15)
    np.testing.assert_allclose(look[1, :, 1], -s, rtol=1e-15)
    np.testing.assert_allclose(look[0, :, 0], [0.5, 0.5, -0.5, -0.5], rtol=1e-15)
    np.testing.assert_allclose(look[0, :, 2], [-0.5, 0.5, 0.5, -0.5], rtol=1e-15)


@pytest.mark.parametrize(
    ("row", "column", "toward"),
    [
        (0, 17, [0, 1, 0]),
        (59, 3, [0, -1, 0]),
        (30, 60, [0, 0, 1]),
        (30, 30, [1, 0, 0]),
        (30, 90, [-1, 0, 0]),
        (30, 0, [0, 0, -1]),
        (29, 119, [0, 0, -1]),
        (20, 50, [np.sin(np.pi / 3) * 0.5, 0.5, np.sin(np.pi / 3) ** 2]),
    ],
)
def test_one_bright_pixel_shines_from_there(row, column, toward):
    table = np.zeros((60, 120))
    table[row, column] = 5.0
    light = Environment(radiance=table)
    toward = np.array(toward, float)
    largest = light.irradiance(toward, toward)[0]
    assert largest == pytest.approx(5.0 * light.solid_angles[row], rel=4e-3)
    assert light.irradiance(-toward, -toward) == pytest.approx([0.0], abs=1e-30)
    assert light.radiance_from(lat_long_directions(60, 120)[row, column]) == 5.0


@pytest.mark.parametrize("shape", [(2, 4), (3, 7), (16, 32), (512, 1024)])
def test_a_constant_map_gives_pi_times_radiance(shape):
    normals = unit(30)
    light = Environment(radiance=np.full((*shape, 2), [1.0, 3.0]))
    expected = np.tile([np.pi, 3 * np.pi], (len(normals), 1))
    np.testing.assert_allclose(light.irradiance(normals, normals), expected, rtol=2e-14)


@pytest.mark.parametrize("shape", [(2, 4), (8, 16), (6, 20)])
def test_half_a_sphere_in_closed_form(shape):
    """A hemisphere about h gives π (1 + n·h) / 2, whatever the normal."""
    normals = unit(200)
    look = lat_long_directions(*shape)
    for axis in range(3):
        irradiance = Environment(radiance=look[..., axis] > 0).irradiance(normals, normals)[:, 0]
        np.testing.assert_allclose(irradiance, 0.5 * np.pi * (1 + normals[:, axis]), rtol=0, atol=2e-14)


@pytest.mark.parametrize("height", [8, 17])
def test_a_polar_cap_is_a_sun(height):
    normals = unit(300)
    table = np.zeros((height, 4))
    table[0] = 2.0
    cap = Sun(direction=[0, 1, 0], radiance=2.0, angular_radius=np.pi / height)
    expected = cap.irradiance(normals, normals)
    np.testing.assert_allclose(Environment(radiance=table).irradiance(normals, normals), expected, rtol=0, atol=1e-14)


@pytest.mark.parametrize("normal", [[0.0, 0.3, 1.0], [0.5, -0.4, -0.3], [0.0, 0.0, 1.0], [1.0, 0.05, 0.2]])
def test_irradiance_is_the_integral_over_each_pixel(normal):
    """By quadrature over θ of the closed integral over φ of max(0, A + B cos(φ − φₙ)), pixel by pixel."""
    n = np.array(normal) / np.linalg.norm(normal)
    table = rough(3, 5)[..., 0]
    azimuth, side = np.arctan2(-n[0], n[2]), np.hypot(n[0], n[2])

    def ring(theta, start, stop):
        level, swing = n[1] * np.cos(theta), side * np.sin(theta)
        reach = np.arccos(np.clip(-level / swing, -1, 1)) if swing > 0 else np.pi * (level > 0)
        total = 0.0
        for turn in (-2 * np.pi, 0.0, 2 * np.pi):
            a, b = max(start, azimuth + turn - reach), min(stop, azimuth + turn + reach)
            if b > a:
                total += level * (b - a) + swing * (np.sin(b - azimuth) - np.sin(a - azimuth))
        return total * np.sin(theta)

    expected = 0.0
    for i in range(3):
        ends = np.pi * i / 3, np.pi * (i + 1) / 3
        meridians = 2 * np.pi * np.arange(5) / 5 - np.pi - azimuth
        turning = np.concatenate(
            [[np.arctan2(side, n[1]), np.arctan2(side, -n[1])], np.arctan2(n[1], -side * np.cos(meridians)) % np.pi]
        )
        inside = sorted({np.pi / 2 + s * (t - np.pi / 2) for t in turning for s in (1, -1)})
        nodes = [ends[0], *[t for t in inside if ends[0] < t < ends[1]], ends[1]]
        for j in range(5):
            borders = 2 * np.pi * j / 5 - np.pi, 2 * np.pi * (j + 1) / 5 - np.pi
            for a, b in pairwise(nodes):
                expected += table[i, j] * quad(ring, a, b, args=borders, epsabs=1e-13, epsrel=1e-12, limit=200)[0]
    np.testing.assert_allclose(Environment(radiance=table).irradiance(n, n), [expected], rtol=2e-11)


@pytest.mark.parametrize("shape", [(2, 4), (3, 7), (8, 16)])
def test_sums_over_pieces_of_pixels_tend_to_it(shape):
    normals = unit(40)
    table = rough(*shape, channels=2)
    exact = Environment(radiance=table).irradiance(normals, normals)
    gaps = [np.abs(by_pixels(table, normals, finer) - exact).max() for finer in (8, 16, 32)]
    orders = -np.diff(np.log2(gaps))
    assert gaps[-1] < 2e-3
    np.testing.assert_allclose(orders, 2.0, rtol=0, atol=0.6)


@example(6, 4, 0, (0.5, 0.5, 0.75))  # the horizon's lowest point lies between two meridians, just past a circle
@given(
    st.integers(2, 9), st.integers(4, 15), st.integers(0, 99),
    st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 1e-3),
)  # fmt: skip
def test_front_and_back_differ_by_the_vector_irradiance(height, width, seed, normal):
    table = rough(height, width, seed=seed)
    n = np.array(normal) / np.linalg.norm(normal)
    light = Environment(radiance=table)
    vector = np.einsum("ijc,ijk->k", table, cell_vectors(height, width))
    gap = light.irradiance(n, n) - light.irradiance(-n, -n)
    np.testing.assert_allclose(gap, [n @ vector], rtol=0, atol=1e-13)


def test_irradiance_is_smooth_across_pixels_borders():
    """Nothing jumps as the horizon passes corners and borders: steps of 1e-7 rad change it by as little."""
    light = Environment(radiance=rough(4, 8))
    turns = np.linspace(0, 2 * np.pi, 33)[:, None] + 1e-7 * np.array([-1, 0, 1])
    for normals in (
        np.stack([np.sin(turns), 0 * turns, np.cos(turns)], axis=-1),
        np.stack([0 * turns, np.sin(turns), np.cos(turns)], axis=-1),
        np.stack([np.sin(turns), np.cos(turns), 0 * turns], axis=-1),
    ):
        irradiance = light.irradiance(normals, normals)[..., 0]
        assert np.abs(np.diff(irradiance, axis=1)).max() < 1e-6


def test_a_smooth_field_is_met_to_second_order():
    normals = unit(300)
    field = Harmonics(coefficients=FIELD)
    exact = field.irradiance(normals, normals)
    gaps = []
    for rows in (8, 16, 32, 64):
        light = Environment(radiance=field.radiance_from(lat_long_directions(rows, 2 * rows)))
        gaps.append(np.abs(light.irradiance(normals, normals) / exact - 1).max())
    np.testing.assert_allclose(-np.diff(np.log2(gaps)), 2.0, rtol=0, atol=0.15)
    assert gaps[-1] < 5e-4


def test_one_small_pixel_is_a_sun():
    normals = unit(300)
    gaps = []
    for rows in (15, 45, 135):
        table = np.zeros((rows, 2 * rows, 3))
        row, column = rows // 3, (5 * rows) // 3
        table[row, column] = [3.0, 2.0, 1.0]
        light = Environment(radiance=table)
        strength = table[row, column] * light.solid_angles[row]
        sun = Directional(direction=lat_long_directions(rows, 2 * rows)[row, column], strength=strength)
        gap = light.irradiance(normals, normals) - sun.irradiance(normals, normals)
        gaps.append(np.abs(gap / strength).max())
    assert gaps[0] < 0.1
    assert gaps[2] < 0.012
    assert gaps[0] > 2 * gaps[1] > 4 * gaps[2]


def test_what_is_wholly_below_the_horizon_gives_nothing_at_all():
    table = np.zeros((12, 24))
    table[:3, 5:9] = 1.0
    normals = np.array([[0.3, -1, 0.2], [0.0, -1, 0.0], [0.1, -0.9, -0.3]])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    np.testing.assert_array_equal(Environment(radiance=table).irradiance(normals, normals), 0.0)


@pytest.mark.parametrize("shape", [(2, 4), (5, 9), (40, 80)])
def test_integrals_over_cells(shape):
    """Solid angles add up to 4π; vectors and squares are those of many small pieces."""
    solid = cell_solid_angles(*shape)
    assert solid.sum() * shape[1] == pytest.approx(4 * np.pi, rel=1e-14)
    edges = np.cos(np.linspace(0, np.pi, shape[0] + 1))
    np.testing.assert_allclose(solid, 2 * np.pi / shape[1] * (edges[:-1] - edges[1:]), rtol=1e-11)
    look = lat_long_directions(shape[0] * 20, shape[1] * 20)
    weights = cell_solid_angles(shape[0] * 20, shape[1] * 20)[:, None, None]
    pieces = (look * weights).reshape(shape[0], 20, shape[1], 20, 3).sum(axis=(1, 3))
    np.testing.assert_allclose(cell_vectors(*shape), pieces, rtol=0, atol=2e-3 * solid.max())
    np.testing.assert_allclose(cell_vectors(*shape).sum(axis=(0, 1)), 0.0, rtol=0, atol=1e-14)
    whole = cell_squares(*shape)(np.ones(shape), 0, shape[0], 0, shape[1])
    np.testing.assert_allclose(whole, 4 * np.pi / 3 * np.eye(3), rtol=0, atol=1e-13)
    one = cell_squares(*shape)(rough(*shape)[..., 0], 0, 2, 1, 3)
    assert np.trace(one) == pytest.approx((solid[:2, None] * rough(*shape)[:2, 1:3, 0]).sum(), rel=1e-13)


MAPS = {
    "constant": np.ones((16, 32, 1)),
    "smooth": Harmonics(coefficients=np.stack([FIELD, FIELD**2 + FIELD], axis=1)).radiance_from(
        lat_long_directions(32, 64)
    ),
    "sun": 0.5 + 300.0 * (np.sum(lat_long_directions(64, 128) * [0.6, 0.64, 0.48], axis=-1) > 0.998)[..., None],
    "sky": 0.2 + (lat_long_directions(32, 64)[..., 1:2] > 0),
    "rough": 0.1 + rough(64, 128, 3),
}


@pytest.mark.parametrize("name", MAPS)
@pytest.mark.parametrize(("count", "rms"), [(64, 1.2e-2), (256, 1.6e-3), (1024, 4e-4)])
def test_beams_add_up_to_it(name, count, rms):
    normals = unit(1000)
    light = Environment(radiance=MAPS[name])
    rms *= 2.5 if name == "rough" else 1.0  # every pixel another radiance
    beams = list(light.beams(normals, count))
    assert count <= len(beams) <= 2 * count
    total = sum(np.maximum(normals @ beam.directions, 0.0)[:, None] * beam.irradiance for beam in beams)
    error = total / light.irradiance(normals, normals) - 1
    assert np.sqrt(np.mean(error**2)) < rms
    assert np.abs(error).max() < 6 * rms


@pytest.mark.parametrize("name", MAPS)
@pytest.mark.parametrize("count", [1, 40, 500])
def test_beams_keep_flux_and_vector_irradiance(name, count):
    table = MAPS[name] / MAPS[name].mean(axis=(0, 1))  # so that the sum of channels is that of which it holds
    light = Environment(radiance=table, rotation=Rotation.random(random_state=1).as_matrix())
    beams = list(light.beams(np.zeros(3), count))
    fluxes = np.array([beam.irradiance for beam in beams])
    directions = np.array([beam.directions for beam in beams])
    np.testing.assert_allclose(fluxes.sum(axis=0), np.einsum("i,ijc->c", light.solid_angles, table), rtol=1e-12)
    vector = light.rotation @ np.einsum("ijc,ijk->k", table, cell_vectors(*table.shape[:2]))
    np.testing.assert_allclose(fluxes.sum(axis=1) @ directions, vector, rtol=0, atol=1e-11)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, rtol=0, atol=1e-15)
    assert (fluxes >= 0).all()


def test_dark_parts_send_no_beams_and_a_lamp_gets_its_own():
    table = np.zeros((32, 64))
    table[10, 20], table[25, 50] = 100.0, 1.0
    light = Environment(radiance=table)
    beams = list(light.beams(np.zeros(3), 64))
    look = lat_long_directions(32, 64)
    for beam in beams:
        assert max(beam.directions @ look[10, 20], beam.directions @ look[25, 50]) > np.cos(np.pi / 32)
    assert len({tuple(beam.directions) for beam in beams}) == len(beams) == 8


def test_beams_are_the_same_each_time():
    one, two = (list(Environment(radiance=MAPS["rough"]).beams(np.zeros(3), 100)) for _ in range(2))
    for a, b in zip(one, two, strict=True):
        np.testing.assert_array_equal(a.directions, b.directions)
        np.testing.assert_array_equal(a.irradiance, b.irradiance)


def test_moved_turns_map_and_beams():
    light = Environment(radiance=rough(6, 12, 2), rotation=Rotation.random(random_state=3).as_matrix())
    turn = Rotation.random(random_state=4).as_matrix()
    moved = light.moved(turn, np.ones(3))
    normals = unit(50)
    turned = normals @ turn.T
    np.testing.assert_allclose(moved.irradiance(turned, turned), light.irradiance(normals, normals), rtol=1e-12)
    look = lat_long_directions(6, 12) @ light.rotation.T @ turn.T
    np.testing.assert_array_equal(moved.radiance_from(look), light.radiance)
    for a, b in zip(moved.beams(normals, 20), light.beams(normals, 20), strict=True):
        np.testing.assert_allclose(a.directions, turn @ b.directions, rtol=0, atol=1e-14)


def test_a_debevec_probe_by_its_rotation():
    table = np.zeros((8, 16))
    table[3:5, 7:9] = 1.0  # the middle
    light = Environment(radiance=table, rotation=np.diag([-1.0, 1.0, -1.0]))
    assert light.radiance_from([0.01, 0.01, -1.0]) == 1.0
    assert light.radiance_from([0.01, 0.01, 1.0]) == 0.0


def test_any_shape_of_normals_and_unknown_ones():
    light = Environment(radiance=rough(4, 8, 3))
    normals = unit(8)[:12].reshape(3, 4, 3).copy()
    whole = light.irradiance(normals, normals)
    assert whole.shape == (3, 4, 3)
    np.testing.assert_allclose(light.irradiance(normals[1, 2], normals[1, 2]), whole[1, 2], rtol=1e-13)
    normals[0, 0, 1] = np.nan
    part = light.irradiance(normals, normals)
    assert np.isnan(part[0, 0]).all()
    np.testing.assert_allclose(part[1:], whole[1:], rtol=1e-13)


@pytest.mark.parametrize(
    "bad",
    [
        np.zeros((4, 8)), -np.ones((4, 8)), np.full((4, 8), np.nan), np.full((4, 8), np.inf), np.ones((1, 2)),
        np.ones((4, 8, 0)), np.ones(8), 1.0, np.ones((4, 8, 2)) * [1, 0], np.ones((4, 8, 3, 1)),
        np.where(np.arange(32).reshape(4, 8) == 7, np.nan, 1.0),
    ],
)  # fmt: skip
def test_maps_that_mean_nothing_are_refused(bad):
    with pytest.raises(RigError):
        Environment(radiance=bad)


@pytest.mark.parametrize("bad", [np.zeros((3, 3)), -np.eye(3), 2 * np.eye(3), np.eye(2), np.full((3, 3), np.nan)])
def test_rotations_that_are_none_are_refused(bad):
    with pytest.raises(InputError):
        Environment(radiance=np.ones((2, 4)), rotation=bad)


def test_what_every_light_promises():
    given_map = rough(4, 8)
    light = Environment(radiance=given_map)
    normals = unit(5)
    before = light.irradiance(normals, normals)
    given_map[:] = 9.0  # the caller's own
    copy = pickle.dumps(light)
    assert len(copy) < 3000  # without the tables that are made from the map
    np.testing.assert_array_equal(pickle.loads(copy).irradiance(normals, normals), before)
    with pytest.raises(ValueError, match="read-only"):
        light.radiance[0] = 1
    assert np.isnan(light.directions(np.zeros((2, 3)))).all()
    with pytest.raises(UnsupportedError, match="environment"):
        light.idealised()
    with pytest.raises(InputError):
        light.radiance_from([0.0, np.nan, 1.0])
