import numpy as np
import pytest

from psstereo.kernels.near import GEMAN_MCCLURE, TUKEY, fit_near, lamp_vectors
from psstereo.kernels.near_compiled import fit_near as compiled
from psstereo.lights import Led


def rig(rng, lamps):
    position = rng.normal(0, 2, (lamps, 3)) * [1, 1, 0.3] + [0, 0, -1]
    axis = np.array([0, 0, -1]) + rng.normal(0, 0.3, (lamps, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    return np.concatenate([position, axis, rng.choice([0.0, 1.0, 2.5], (lamps, 1))], axis=1)


def pixels(seed, count=300, lamps=9, *, noise=0.0, spoilt=0.0, missing=0.0):
    """Return values (m, p), points, lamps and scaled normals."""
    rng = np.random.default_rng(seed)
    points = rng.normal(0, 1, (count, 3)) * [1, 1, 0.2] + [0, 0, -6]
    array = rig(rng, lamps)
    normals = np.array([0, 0, 1]) + rng.normal(0, 0.3, (count, 3))
    scaled = normals / np.linalg.norm(normals, axis=1, keepdims=True) * rng.uniform(0.2, 0.9, (count, 1))
    a, _ = lamp_vectors(points, points, array)
    values = np.maximum((a * scaled.T[:, None]).sum(axis=0), 0.0)
    values += noise * values.mean() * rng.normal(size=values.shape)
    values[rng.random(values.shape) < spoilt] *= 3.0
    values[rng.random(values.shape) < missing] = np.nan
    return values, points, array, scaled


def start(count):
    return np.full((count, 3), np.nan)


def test_light_vectors_are_those_of_the_lamp():
    values, points, array, scaled = pixels(1)
    a, _ = lamp_vectors(points, points, array)
    for i, lamp in enumerate(array):
        led = Led(position=lamp[:3], axis=lamp[3:6], mu=lamp[6], flux=np.ones(1))
        length = np.linalg.norm(scaled, axis=1)
        irradiance = led.irradiance(points, scaled / length[:, None])[:, 0] * length
        np.testing.assert_allclose(np.maximum((a[:, i] * scaled.T).sum(axis=0), 0), irradiance, rtol=1e-12, atol=1e-15)
        np.testing.assert_allclose(values[i], irradiance, rtol=1e-12, atol=1e-15)


def test_derivative_of_light_vectors_is_that_of_differences():
    _, points, array, _ = pixels(2)
    motion = np.random.default_rng(3).normal(size=points.shape)
    _, change = lamp_vectors(points, motion, array)
    step = 1e-6
    ahead, _ = lamp_vectors(points + step * motion, motion, array)
    back, _ = lamp_vectors(points - step * motion, motion, array)
    np.testing.assert_allclose(change, (ahead - back) / (2 * step), rtol=0, atol=1e-8 * np.abs(change).max())


@pytest.mark.parametrize("fit", [fit_near, compiled])
@pytest.mark.parametrize("loss", [GEMAN_MCCLURE, TUKEY])
def test_clean_pixels_are_exact(fit, loss):
    values, points, array, scaled = pixels(4)
    scale = 0.1 * np.maximum(values.mean(axis=0), 1e-6 * values.mean())
    found = fit(values, points, points, array, start(300), scale, 6, loss)
    lit = (values > 0.05 * values.max(axis=0)).sum(axis=0) >= 5
    assert lit.sum() > 200
    np.testing.assert_allclose(found.scaled[lit], scaled[lit], rtol=0, atol=1e-9)
    assert found.energy[lit].max() < 1e-12


@pytest.mark.parametrize("fit", [fit_near, compiled])
def test_pull_is_the_gradient_of_the_energy_with_the_normal_free(fit):
    values, points, array, _ = pixels(5, lamps=12, noise=0.01)
    scale = 0.1 * values.mean(axis=0)

    def at(shift):
        moved = points * np.exp(shift)
        return fit(values, moved, moved, array, start(300), scale, 60, GEMAN_MCCLURE)

    step = 1e-5
    here = at(0.03)
    slope = (at(0.03 + step).energy - at(0.03 - step).energy) / (2 * step)
    quiet = (values > 0.1 * values.max(axis=0)).all(
        axis=0
    )  # lamps that sink below the surface fade in weight, not cost
    assert quiet.sum() > 100
    np.testing.assert_allclose(-2 * here.pull[quiet], slope[quiet], rtol=1e-3, atol=1e-4 * np.abs(slope[quiet]).max())


@pytest.mark.parametrize("fit", [fit_near, compiled])
def test_one_step_finds_the_distance_of_clean_pixels(fit):
    values, points, array, _ = pixels(6)
    moved = points * np.exp(0.01)
    found = fit(values, moved, moved, array, start(300), 0.1 * values.mean(axis=0), 8, GEMAN_MCCLURE)
    step = np.nansum(found.pull) / np.nansum(found.stiffness)
    assert step == pytest.approx(-0.01, rel=0.05)


@pytest.mark.parametrize("loss", [GEMAN_MCCLURE, TUKEY])
@pytest.mark.parametrize("begun", [True, False])
def test_both_kernels_give_the_same_numbers(loss, begun):
    values, points, array, scaled = pixels(7, noise=0.02, spoilt=0.1, missing=0.05)
    values[:, 0], values[:, 1], values[2:, 2] = np.nan, 0.0, np.nan
    first = 1.1 * scaled if begun else start(300)
    scale = 0.1 * np.fmax(np.nan_to_num(np.nanmean(values[:, 1:], axis=0)).mean(), np.zeros(300))
    slow, fast = (f(values, points, points, array, first, scale, 5, loss) for f in (fit_near, compiled))
    for name, a, b in zip(slow._fields, slow, fast, strict=True):
        np.testing.assert_allclose(b, a, rtol=1e-7, atol=1e-9 * np.nanmax(np.abs(a)), err_msg=name)


@pytest.mark.parametrize("fit", [fit_near, compiled])
def test_a_fit_is_never_worse_than_where_it_began(fit):
    values, points, array, _ = pixels(8, noise=0.3, spoilt=0.3)
    scale = 0.1 * values.mean(axis=0)
    found = fit(values, points, points, array, start(300), scale, 3, GEMAN_MCCLURE)
    for _ in range(4):
        again = fit(values, points, points, array, found.scaled, scale, 3, GEMAN_MCCLURE)
        assert (again.energy <= found.energy + 1e-12).all()
        found = again


@pytest.mark.parametrize("fit", [fit_near, compiled])
def test_a_point_at_a_lamp_and_behind_all_lamps_is_not_a_number_but_no_crash(fit):
    values, points, array, _ = pixels(9)
    points[0] = array[0, :3]
    points[1] = [0.0, 0.0, 50.0]
    array[:, 6] = 1.0
    found = fit(values, points, points, array, start(300), 0.1 * values.mean(axis=0), 3, GEMAN_MCCLURE)
    assert np.isnan(found.scaled[1]).all()
    assert np.isfinite(found.scaled[2:]).any()
    assert not np.isinf(found.scaled).any()
