import numpy as np
import pytest

from psstereo.errors import OptionError
from psstereo.stack import COLOUR_CHOICES, GRAY, PROJECTIONS, colour_reading, gray_weights

TINT = np.array([0.8, 0.3, 0.1])


def samples(tint=TINT, *, lights=20, count=500, noise=0.0, strengths=None, highlights=0.0, seed=0):
    """Values (c, m, p) after division by the strengths, the shading (m, p), and the strengths (m, c)."""
    rng = np.random.default_rng(seed)
    shading = rng.uniform(0.0, 1.0, (lights, count))
    power = np.ones((lights, 3)) if strengths is None else strengths
    tints = np.broadcast_to(tint, (count, 3))
    light = shading[None] * tints.T[:, None] + highlights * (rng.random(shading.shape) < 0.1)
    raw = light * power.T[:, :, None] + noise * rng.normal(size=light.shape)
    return raw / power.T[:, :, None], shading, power


@pytest.mark.parametrize("name", sorted(PROJECTIONS))
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_without_noise_it_is_the_mean_of_the_channels(name, dtype):
    tints = np.random.default_rng(1).uniform(0.05, 1.0, (500, 3))
    values, shading, power = samples(tints)
    found = PROJECTIONS[name](values.astype(dtype), power)
    assert found.dtype == np.float64
    known = np.isfinite(found).all(axis=0)
    assert known.all() if name == "chroma" else known.mean() > 0.95
    expected = shading * tints.mean(axis=1)
    tolerance = 1e-12 if dtype is np.float64 else 1e-5
    np.testing.assert_allclose(found[:, known], expected[:, known], rtol=0, atol=tolerance)


@pytest.mark.parametrize("tint", [TINT, np.ones(3), np.array([0.0, 0.0, 0.4])])
def test_the_noise_is_the_least_that_weights_can_reach(tint):
    """Var(s) = σ² / Σ ρ²; the mean has σ² · 3 / (Σ ρ)², Cauchy and Schwarz say which is less."""
    values, shading, power = samples(tint, lights=60, count=2000, noise=0.01)
    scale = tint.mean()
    for name, expected in (
        ("chroma", 0.01 / np.sqrt((tint * tint).sum())),
        ("mean", 0.01 * np.sqrt(3) / tint.sum()),
        ("bt601", 0.01 * np.linalg.norm(GRAY["bt601"]) / (np.array(GRAY["bt601"]) @ tint)),
    ):
        if name == "chroma":
            found = PROJECTIONS[name](values, power) / scale
        else:
            weights = np.array(GRAY[name])
            found = np.einsum("c,cmp->mp", weights, values) / (weights @ tint)
        spread = np.sqrt(((found - shading) ** 2).mean())
        # the colour is known only to within the noise over the root of the number of lights
        assert spread == pytest.approx(expected, rel=0.02)


def test_unequal_strengths_make_unequal_noise_which_is_weighted():
    strengths = np.tile([1.0, 0.5, 0.1], (60, 1))
    values, shading, power = samples(np.array([0.3, 0.3, 0.3]), lights=60, noise=0.01, strengths=strengths)
    found = PROJECTIONS["chroma"](values, power)
    found *= (shading * found).sum(axis=0) / (found * found).sum(axis=0)  # the common factor is the albedo's
    best = 0.01 / 0.3 / np.sqrt((strengths[0] ** 2).sum())
    equal = 0.01 / 0.3 / 3 * np.sqrt((strengths[0] ** -2.0).sum())
    spread = np.sqrt(((found - shading) ** 2).mean())
    assert spread == pytest.approx(best, rel=0.02)
    assert spread < 0.35 * equal


def test_specular_free_drops_what_has_the_lights_colour():
    strengths = np.random.default_rng(2).uniform(0.8, 1.2, (30, 1)) * np.array([1.0, 0.9, 0.6])
    values, shading, power = samples(lights=30, strengths=strengths, highlights=0.5)
    shines = PROJECTIONS["specular-free"](values, power)
    slope = (shines * shading).sum(axis=0) / (shading * shading).sum(axis=0)
    np.testing.assert_allclose(shines, shading * slope, rtol=0, atol=1e-12)
    kept = PROJECTIONS["chroma"](values, power)
    slope = (kept * shading).sum(axis=0) / (shading * shading).sum(axis=0)
    assert np.abs(kept - shading * slope).max() > 0.1


def test_gray_surfaces_are_lost_without_the_lights_colour_and_say_so():
    values, _, power = samples(np.array([0.5, 0.51, 0.5]), noise=1e-4)
    assert np.isnan(PROJECTIONS["specular-free"](values, power)).all()
    assert np.isfinite(PROJECTIONS["chroma"](values, power)).all()


@pytest.mark.parametrize("name", sorted(PROJECTIONS))
def test_an_observation_without_a_channel_is_not_usable(name):
    values, _, power = samples()
    whole = PROJECTIONS[name](values, power)
    spoiled = values.copy()
    spoiled[1, 3, 7], spoiled[0, 5, 7], spoiled[2, :, 9] = np.nan, np.inf, np.nan
    found = PROJECTIONS[name](spoiled, power)
    lost = np.zeros(whole.shape, np.bool_)
    lost[3, 7], lost[5, 7], lost[:, 9] = True, True, True
    np.testing.assert_array_equal(np.isnan(found), lost)
    np.testing.assert_allclose(found[~lost], whole[~lost], rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", sorted(PROJECTIONS))
@pytest.mark.parametrize("scale", [1e-150, 1e-20, 1e20, 1e150])
def test_any_brightness_and_any_split(name, scale):
    values, _, power = samples(noise=0.01)
    whole = PROJECTIONS[name](values, power)
    np.testing.assert_allclose(PROJECTIONS[name](values * scale, power) / scale, whole, rtol=0, atol=1e-12)
    parts = [PROJECTIONS[name](part, power) for part in (values[..., :77], values[..., 77:])]
    np.testing.assert_allclose(np.concatenate(parts, axis=1), whole, rtol=0, atol=1e-12)


def test_black_pixels_stay_black_and_input_is_left_alone():
    values = np.zeros((3, 5, 4))
    values.setflags(write=False)
    found = PROJECTIONS["chroma"](values, np.ones((5, 3)))
    assert (found == 0).all()


def test_choices_by_name():
    for name in GRAY:
        reading = colour_reading(name, 3)
        assert reading.projection is None
        assert reading.name == name
        np.testing.assert_array_equal(reading.weights.matrix, gray_weights(name, 3).matrix)
    assert colour_reading("per-channel", 3).values == 3
    assert colour_reading([1.0, 2.0, 0.0], 3).name == "1,2,0"
    for name, projection in PROJECTIONS.items():
        reading = colour_reading(name, 3)
        assert (reading.name, reading.projection, reading.values) == (name, projection, 1)
        np.testing.assert_array_equal(reading.weights.matrix, np.eye(3))
    gray = colour_reading("chroma", 1)
    assert gray.projection is None
    assert gray.weights.matrix.tolist() == [[1.0]]
    assert set(COLOUR_CHOICES) == {*GRAY, *PROJECTIONS, "per-channel"}


def test_what_does_not_fit_is_refused():
    with pytest.raises(OptionError, match="'grey' is unknown") as caught:
        colour_reading("grey", 3)
    assert "specular-free" in caught.value.needed
    with pytest.raises(OptionError, match="one channel"):
        colour_reading("specular-free", 1)
    with pytest.raises(OptionError):
        colour_reading([0.3, 0.7], 3)
