import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from psstereo.errors import OptionError, RigError, UnsupportedError
from psstereo.flags import Flag, fatal_mask
from psstereo.lights import Led, Rig
from psstereo.method_options import configure
from psstereo.metrics import coverage
from psstereo.normals import GATES, LeastSquares, Samples
from psstereo.normals.ambient import AmbientLeastSquares
from psstereo.verdict import Verdict
from psstereo_synth import ring, spiral

EXACT = np.radians(1e-6)
RING_AND_TOP = np.concatenate([ring(5), [[0.0, 0.0, 1.0]]])


def angle(a, b):
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(-1))


def random_normals(rng, count, *, tilt):
    z = rng.uniform(np.cos(np.radians(tilt)), 1.0, count)
    turn, r = rng.uniform(0, 2 * np.pi, count), np.sqrt(1 - z * z)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1)


def scene(directions, count=1500, *, tilt=80.0, noise=0.0, seed=0):
    """Samples (m, p), normals, albedo and level of random pixels."""
    rng = np.random.default_rng(seed)
    normals = random_normals(rng, count, tilt=tilt)
    albedo, level = rng.uniform(0.2, 0.9, count), rng.uniform(0.0, 0.5, count)
    values = np.maximum(directions @ normals.T, 0.0) * albedo + level
    return values + noise * rng.normal(size=values.shape), normals, albedo, level


def solve(directions, values, weights=None, *, verdicts=False, **options):
    solver = AmbientLeastSquares(**options)
    samples = Samples(values, weights, verdicts, covariance=True)
    return solver.solve(solver.prepare(Rig.distant(directions)), samples)


@pytest.mark.parametrize("directions", [spiral(5), RING_AND_TOP, spiral(12, max_tilt=1.3), spiral(40)], ids=len)
def test_exact_with_four_lit_lights(directions):
    values, normals, albedo, level = scene(directions)
    found = solve(directions, values)
    lit = (directions @ normals.T > 0).sum(axis=0)
    clear = lit >= 4
    known = np.isfinite(found.scaled).all(axis=1)
    assert known[clear].mean() > 0.99  # four lit lights may stand on a circle
    assert clear.sum() > 500
    good = clear & known
    assert angle(found.scaled, normals)[good].max() < EXACT
    np.testing.assert_allclose(np.linalg.norm(found.scaled, axis=1)[good], albedo[good], rtol=1e-8)
    np.testing.assert_allclose(found.ambient[good], level[good], rtol=0, atol=1e-9)
    np.testing.assert_array_equal(known, ~fatal_mask(found.flags))
    assert not (found.flags & Flag.NOT_CONVERGED).any()
    np.testing.assert_array_equal(np.isnan(found.ambient), ~known)


def test_shadows_tell_the_level_where_three_lights_reach():
    directions = spiral(12, max_tilt=1.3)
    values, normals, _, level = scene(directions, 20_000, tilt=170.0, seed=4)
    lit = directions @ normals.T > 0
    three = lit.sum(axis=0) == 3
    spread = np.array([np.linalg.cond(directions[one]) for one in lit[:, three].T])
    found = solve(directions, values)
    assert three.sum() > 500
    assert angle(found.scaled, normals)[three][spread < 1e3].max() < EXACT
    np.testing.assert_allclose(found.ambient[three][spread < 1e3], level[three][spread < 1e3], rtol=0, atol=1e-8)
    few = lit.sum(axis=0) < 3
    assert few.sum() > 100
    assert (found.flags[few] & Flag.TOO_FEW_LIGHTS).all()
    assert np.isnan(found.scaled[few]).all()


def test_without_gate_it_is_the_fit_with_a_column_of_ones():
    directions = spiral(9)
    values = scene(directions, 300, noise=0.02)[0]
    weights = np.random.default_rng(1).uniform(0.5, 2.0, values.shape)
    design = np.column_stack([directions, np.ones(9)])
    for given_weights in (None, weights):
        found = solve(directions, values, given_weights, gate=GATES["none"])
        w = np.ones_like(values) if given_weights is None else weights
        for j in range(300):
            root = np.sqrt(w[:, j])
            expected, squares, *_ = np.linalg.lstsq(root[:, None] * design, root * values[:, j], rcond=None)
            np.testing.assert_allclose([*found.scaled[j], found.ambient[j]], expected, rtol=0, atol=1e-12)
            inverse = np.linalg.inv(design.T @ (w[:, j, None] * design))[:3, :3] * squares[0] / 5
            albedo = np.linalg.norm(expected[:3])
            n = expected[:3] / albedo
            across = np.eye(3) - np.outer(n, n)
            covariance = across @ inverse @ across / albedo**2
            np.testing.assert_allclose(found.uncertainty[j], np.sqrt(np.trace(covariance)), rtol=1e-9)
            entries = covariance[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]
            np.testing.assert_allclose(found.covariance[j], entries, rtol=0, atol=1e-9 * np.abs(entries).max())
    assert (found.used == 8).all()


def test_the_gated_fit_has_zeros_for_lights_behind_the_surface():
    """The answer is the least-squares solution of the rows that its own verdicts name."""
    directions = spiral(24)
    values = scene(directions, 200, noise=0.01)[0]
    found = solve(directions, values, verdicts=True)
    for j in range(200):
        lit = (found.verdicts[:, j] == Verdict.USED)[:, None]
        expected = np.linalg.lstsq(np.column_stack([directions * lit, np.ones(24)]), values[:, j], rcond=None)[0]
        np.testing.assert_allclose([*found.scaled[j], found.ambient[j]], expected, rtol=0, atol=1e-11)
        behind = directions @ found.scaled[j] < -0.03  # three times the noise
        assert not (lit[:, 0] & behind).any()


def test_least_squares_is_wrong_by_degrees_where_this_is_not():
    directions = spiral(24)
    values, normals, *_ = scene(directions, noise=0.005)
    plain = LeastSquares()
    naive = plain.solve(plain.prepare(Rig.distant(directions)), Samples(values))
    assert np.degrees(np.nanmean(angle(naive.scaled, normals))) > 10
    assert np.degrees(np.nanmean(angle(solve(directions, values).scaled, normals))) < 0.6


@pytest.mark.parametrize("lights", [6, 12, 48])
def test_error_bars_hold(lights):
    directions = spiral(lights)
    values, normals, *_ = scene(directions, 4000, tilt=25.0, noise=0.003, seed=lights)
    found = solve(directions, values)
    error = angle(found.scaled, normals)
    spread = np.sqrt((error**2).mean() / (found.uncertainty**2).mean())
    assert spread == pytest.approx(1.0, abs=0.05)
    unit = found.scaled / np.linalg.norm(found.scaled, axis=1, keepdims=True)
    assert 0.93 <= coverage(unit, found.covariance, normals, found.used).share <= 0.97


@pytest.mark.parametrize("loss", ["huber", "cauchy"])
def test_a_robust_loss_outvotes_highlights(loss):
    directions = spiral(48)
    values, normals, *_ = scene(directions, 600, tilt=40.0, noise=0.002, seed=2)
    shines = np.random.default_rng(3).random(values.shape) < 0.1
    glossy = values + shines * 0.5
    plain, robust = (solve(directions, glossy, loss=one, verdicts=True) for one in ("none", loss))
    wrong = np.degrees(np.nanmean(angle(plain.scaled, normals)))
    right = np.degrees(np.nanmean(angle(robust.scaled, normals)))
    assert right < (0.5 if loss == "cauchy" else 1.2) < wrong / 4
    if loss == "cauchy":
        assert (robust.verdicts[shines] == Verdict.HIGHLIGHT).mean() > 0.98
    assert not (robust.flags & Flag.NOT_CONVERGED).any()


@pytest.mark.parametrize("loss", ["huber", "cauchy"])
def test_a_robust_loss_changes_nothing_on_clean_data_and_its_bars_hold(loss):
    directions = spiral(48)
    values, normals, *_ = scene(directions, 1500, tilt=25.0)
    clean = solve(directions, values, loss=loss)
    assert angle(clean.scaled, normals).max() < EXACT
    noisy = values + 0.003 * np.random.default_rng(5).normal(size=values.shape)
    found = solve(directions, noisy, loss=loss)
    error = angle(found.scaled, normals)
    assert np.sqrt((error**2).mean() / (found.uncertainty**2).mean()) == pytest.approx(1.0, abs=0.08)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), offset=st.floats(-10, 10), power=st.integers(-30, 30))
def test_a_constant_moves_the_level_and_nothing_else(seed, offset, power):
    directions = spiral(10)
    values = scene(directions, 40, tilt=50.0, noise=0.01, seed=seed)[0]
    first, second = solve(directions, values), solve(directions, (values + offset) * 2.0**power)
    np.testing.assert_allclose(second.scaled / 2.0**power, first.scaled, rtol=0, atol=1e-10)
    np.testing.assert_allclose(second.ambient / 2.0**power - offset, first.ambient, rtol=0, atol=1e-10)


def test_what_is_left_out_does_not_matter_and_weights_count_as_repeats():
    directions = spiral(12)
    values = scene(directions, 200, tilt=40.0, noise=0.01)[0]
    weights = np.ones_like(values)
    spoiled, lost = values.copy(), values.copy()
    spoiled[3], lost[3], weights[3] = 99.0, np.nan, 0.0
    kept = np.arange(12) != 3
    expected = solve(directions[kept], values[kept])
    for found in (solve(directions, spoiled, weights), solve(directions, lost)):
        np.testing.assert_allclose(found.scaled, expected.scaled, rtol=0, atol=1e-12)
        assert (found.flags & Flag.UNUSABLE_SAMPLE).all()
    double = np.ones_like(values)
    double[5] = 2.0
    order = [*range(12), 5]
    twice = solve(directions[order], values[order], gate=GATES["none"])
    weighted = solve(directions, values, double, gate=GATES["none"])
    np.testing.assert_allclose(weighted.scaled, twice.scaled, rtol=0, atol=1e-12)


def test_pixels_without_an_answer_say_why():
    directions = spiral(8)
    values = np.repeat(scene(directions, 1, tilt=5.0)[0], 6, axis=1)
    values[:, 0] = 0.3  # the same under all lights
    values[3:, 1] = np.nan  # three observations
    values[4:, 2] = np.nan  # four
    values[:, 3] = 0.0
    values[:, 4] = np.nan
    flags = solve(directions, values).flags
    assert flags[0] & Flag.NO_SIGNAL
    assert flags[1] & Flag.TOO_FEW_LIGHTS
    assert flags[2] == Flag.NO_REDUNDANCY | Flag.UNUSABLE_SAMPLE
    assert flags[3] & Flag.NO_SIGNAL
    assert flags[4] & Flag.TOO_FEW_LIGHTS
    assert flags[5] == 0
    circle = np.concatenate([ring(4), [[0.0, 0.0, 1.0]]])
    values = scene(circle, 1, tilt=1.0)[0]
    values[4] = np.nan
    assert solve(circle, values).flags[0] & Flag.RANK_DEFICIENT


def test_a_flat_board_under_a_ring_and_a_light_above():
    """Four equal values and a brighter one are no shadows."""
    directions = np.concatenate([ring(4, tilt=0.5), [[0.0, 0.0, 1.0]]])
    values = (directions @ [0.0, 0.0, 0.6])[:, None] + 0.1
    for stored in (values, np.rint(values * 255) / 255):
        found = solve(directions, stored)
        assert angle(found.scaled[0], np.array([0.0, 0.0, 1.0])) < EXACT
        assert found.flags[0] == 0


@pytest.mark.parametrize("turn", [0.0, 0.7])
@pytest.mark.parametrize("jitter", [0.0, 1e-4])
def test_lights_on_one_circle_are_refused(turn, jitter):
    c, s = np.cos(turn), np.sin(turn)
    directions = ring(7) @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]]).T
    directions = directions + jitter * np.random.default_rng(0).normal(size=directions.shape)
    with pytest.raises(RigError, match="on one circle") as caught:
        AmbientLeastSquares().prepare(Rig.distant(directions))
    assert "dark image" in caught.value.remedy


def test_too_few_or_near_lights_are_refused():
    with pytest.raises(RigError, match="There are 3 lights"):
        AmbientLeastSquares().prepare(Rig.distant(ring(3)))
    with pytest.raises(RigError, match="one plane"):
        AmbientLeastSquares().prepare(Rig.distant([[1, 0, 1], [0, 1, 1], [-1, 2, 1], [2, -1, 1]]))
    lamp = Led(position=(0, 0, 9), axis=(0, 0, -1), mu=1.0, flux=1.0)
    with pytest.raises(UnsupportedError, match="led"):
        AmbientLeastSquares().prepare(Rig((*Rig.distant(spiral(4)).lights, lamp)))


def test_options_by_word():
    assert configure(AmbientLeastSquares, {"loss": "cauchy"}).loss == "cauchy"
    with pytest.raises(OptionError):
        configure(AmbientLeastSquares, {"loss": "l7"})
    with pytest.raises(OptionError, match="loss"):
        AmbientLeastSquares(loss="tukey")


def test_any_split_gives_the_same_numbers():
    directions = spiral(12, max_tilt=1.2)
    values = scene(directions, 700, noise=0.01)[0]
    whole = solve(directions, values, loss="cauchy")
    parts = [solve(directions, part, loss="cauchy") for part in (values[:, :101], values[:, 101:])]
    np.testing.assert_allclose(np.concatenate([p.scaled for p in parts]), whole.scaled, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(np.concatenate([p.flags for p in parts]), whole.flags)
