"""The sun and the sky over a rounded thing: what solver and search give back, and what they refuse."""

import math
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from psstereo.calibrate.sun import Place, SkyOptions, calibrate_sun, estimate_sky, rotation_from_heading
from psstereo.capture import Capture
from psstereo.errors import InputError, OptionError, RigError
from psstereo.flags import Flag
from psstereo.lights import Harmonics, Rig
from psstereo.lights.sphere_rule import sphere_rule
from psstereo.normals import LeastSquares, estimate_normals
from psstereo.normals.sky import SkyLeastSquares, even_sky
from psstereo.normals.sky_fit import sky_terms
from psstereo.normals.solver import Samples
from psstereo.stack import MemoryStack
from psstereo.verdict import Verdict

ROTATION = rotation_from_heading(math.radians(10.0), math.radians(-15.0))
UP = ROTATION.T @ [0.0, 0.0, 1.0]
SUNS = calibrate_sun(
    [datetime(2026, 6, 21, 5, tzinfo=UTC) + timedelta(hours=h) for h in range(14)],
    Place(latitude=math.radians(51.3), longitude=math.radians(9.5)),
    ROTATION,
)


def ball(size=23, radius=10.0):
    rows, columns = np.mgrid[:size, :size]
    x, y = (columns - size // 2) / radius, (size // 2 - rows) / radius
    inside = x * x + y * y < 0.93
    z = np.sqrt(np.where(inside, 1 - x * x - y * y, 1.0))
    return np.stack([x, y, z], axis=-1)[inside], inside


NORMALS, INSIDE = ball()
PAINT = np.random.default_rng(0).uniform(0.3, 0.9, len(NORMALS))


def angle(found, truth=NORMALS):
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(found, truth), axis=-1), (found * truth).sum(axis=-1)))


def smooth_sky(seed):
    """Return nine positive-on-the-whole coefficients an image, (14, 9)."""
    rng = np.random.default_rng(seed)
    spread = np.array([0.0, *[0.06] * 3, *[0.03] * 5])
    return 0.15 + 0 * spread + np.where(spread > 0, -0.15, 0.0) + spread * rng.normal(size=(14, 9))


def shown(sky, noise=0.0):
    """Return brightness over the suns' strengths, the sky's part by the light Harmonics."""
    sun = np.maximum(SUNS.rig.directions @ NORMALS.T, 0.0)
    part = np.array([Harmonics(coefficients=c, allow_negative=True).irradiance(NORMALS, NORMALS)[:, 0] for c in sky])
    return PAINT * (sun + part) + noise * np.random.default_rng(1).normal(size=sun.shape)


def test_polynomials_are_the_irradiance_of_the_light_harmonics():
    sky = smooth_sky(3)
    terms = sky_terms(sky)
    expected = [Harmonics(coefficients=c, allow_negative=True).irradiance(NORMALS, NORMALS)[:, 0] for c in sky]
    bent = np.einsum("pi,mij,pj->mp", NORMALS, terms.curve, NORMALS)
    np.testing.assert_allclose(terms.level[:, None] + terms.slope @ NORMALS.T + bent, expected, atol=1e-14)
    assert np.abs(np.trace(terms.curve, axis1=1, axis2=2)).max() < 1e-15


@pytest.mark.parametrize("terms", [4, 9])
def test_under_a_known_sky_normals_are_exact(terms):
    sky = smooth_sky(5)[:, :terms]
    full = np.concatenate([sky, np.zeros((14, 9 - terms))], axis=1)
    solver = SkyLeastSquares(sky=tuple(map(tuple, sky.tolist())))
    found = solver.solve(solver.prepare(SUNS.rig), Samples(shown(full), verdicts=True, covariance=True))
    off = angle(found.scaled / np.linalg.norm(found.scaled, axis=1, keepdims=True))
    assert np.isfinite(off).mean() > 0.93
    assert np.nanquantile(off, 0.98) < 1e-9
    assert (found.flags[np.isnan(off)] & Flag.TOO_FEW_LIGHTS).all()
    exact = off < 1e-9
    np.testing.assert_allclose(np.linalg.norm(found.scaled, axis=1)[exact], PAINT[exact], rtol=1e-9)
    lit = SUNS.rig.directions @ NORMALS.T > 0.05
    assert (found.verdicts[lit & exact] == Verdict.USED).mean() > 0.99
    dark = SUNS.rig.directions @ NORMALS.T < 0
    assert (found.verdicts[dark & exact] == Verdict.SHADOW).all()
    assert np.nanmax(found.uncertainty[exact]) < 1e-6
    np.testing.assert_allclose(
        found.covariance[exact][:, [0, 2, 5]].sum(axis=1), found.uncertainty[exact] ** 2, rtol=1e-9, atol=1e-30
    )


def test_any_split_of_the_pixels_gives_the_same_numbers():
    solver = SkyLeastSquares(sky=tuple(map(tuple, smooth_sky(5).tolist())))
    state, values = solver.prepare(SUNS.rig), shown(smooth_sky(5), 0.01)
    whole = solver.solve(state, Samples(values)).scaled
    parts = [solver.solve(state, Samples(values[:, a:b])).scaled for a, b in ((0, 100), (100, values.shape[1]))]
    np.testing.assert_allclose(np.concatenate(parts), whole, rtol=1e-9, atol=1e-12, equal_nan=True)


def test_expected_errors_are_those_that_noise_makes():
    solver = SkyLeastSquares(sky=tuple(map(tuple, smooth_sky(5).tolist())))
    found = solver.solve(solver.prepare(SUNS.rig), Samples(shown(smooth_sky(5), 0.003)))
    off = np.radians(angle(found.scaled / np.linalg.norm(found.scaled, axis=1, keepdims=True)))
    ratio = off / found.uncertainty
    assert 0.5 < np.nanmedian(ratio) < 1.2


def test_missing_observations_are_left_out_and_dark_pixels_flagged():
    values = shown(smooth_sky(5))
    values[::3, :50] = np.nan
    values[:, 60] = 0.0
    values[2:, 61] = np.nan
    solver = SkyLeastSquares(sky=tuple(map(tuple, smooth_sky(5).tolist())))
    found = solver.solve(solver.prepare(SUNS.rig), Samples(values))
    assert (found.flags[:50] & Flag.UNUSABLE_SAMPLE).all()
    assert np.nanmedian(angle(found.scaled[:50], NORMALS[:50])) < 1e-6
    assert found.flags[60] & Flag.NO_SIGNAL
    assert found.flags[61] & Flag.TOO_FEW_LIGHTS
    assert np.isnan(found.scaled[[60, 61]]).all()


def test_an_even_sky_is_half_above_the_horizon():
    """Against quadrature of a half sphere of radiance 1/π over a ground of a fifth of that."""
    around, weights = sphere_rule(1 << 14)
    radiance = np.where(around @ UP > 0, 1.0, 0.2) / np.pi
    normals = np.array([UP, -UP, [0, 0, 1.0], [1.0, 0, 0], [0.6, 0, 0.8]])
    expected = (np.maximum(normals @ around.T, 0.0) * weights * radiance).sum(axis=1)
    light = Harmonics(coefficients=even_sky(UP), allow_negative=True)
    np.testing.assert_allclose(light.irradiance(normals, normals)[:, 0], expected, atol=2e-3)


def real_day(share, noise=0.002):
    """Return a capture under a sky that is bright about the sun and at the horizon, by quadrature."""
    around, weights = sphere_rule(1000)
    strength = SUNS.rig.strengths(1)[:, 0]
    images = np.zeros((14, *INSIDE.shape))
    for k, sun in enumerate(SUNS.rig.directions):
        height, near = around @ UP, np.exp(-np.arccos(np.clip(around @ sun, -1, 1)) / 0.5)
        radiance = np.where(height > 0, 1.0 + 2.0 * near + 0.5 * (1.0 - height), 0.2)
        ground = (np.maximum(height, 0.0) * weights * radiance).sum()
        sky = (np.maximum(NORMALS @ around.T, 0.0) * (weights * radiance)).sum(axis=1) * share / ground
        images[k, INSIDE] = PAINT * (strength[k] * np.maximum(NORMALS @ sun, 0.0) + strength.max() * sky)
    images += noise * np.random.default_rng(2).normal(size=images.shape)
    return Capture(stack=MemoryStack(np.maximum(images, 0.0)[..., None]), rig=SUNS.rig, mask=INSIDE)


def test_the_sky_lowers_the_error_of_a_day():
    capture = real_day(0.15)
    without = angle(estimate_normals(capture, LeastSquares()).normals[INSIDE])
    sky = estimate_sky(capture, UP, SkyOptions(rounds=2))
    result = estimate_normals(capture, sky.solver()).normals[INSIDE]
    with_sky = angle(result)
    assert np.isfinite(with_sky).mean() > 0.92
    assert np.nanmedian(with_sky) < 3.5
    assert np.nanmean(with_sky) < 0.25 * np.nanmean(without)
    assert sky.even == pytest.approx(0.15, abs=0.05)
    assert sky.coefficients.shape == (14, 4)
    assert sky.residual_after < 0.5 * sky.residual_before
    assert 0.2 < sky.shade < 0.5
    assert "level ground" in sky.verdict


def test_an_even_sky_in_words_does_nearly_as_well():
    capture = real_day(0.15)
    words = SkyLeastSquares(even=0.15, zenith=",".join(f"{x:.4f}" for x in UP))
    told = angle(estimate_normals(capture, words).normals[INSIDE])
    assert np.nanmedian(told) < 4.0
    assert np.nanmean(told) < 0.5 * np.nanmean(angle(estimate_normals(capture, SkyLeastSquares()).normals[INSIDE]))


def test_where_nothing_is_in_the_shade_the_sky_is_not_told():
    turn = np.arange(12) * 0.5
    directions = np.stack([0.2 * np.cos(turn), 0.2 * np.sin(turn), np.full(12, 0.98)], axis=1)
    images = np.full((12, 8, 8, 1), 0.3)
    capture = Capture(stack=MemoryStack(images), rig=Rig.distant(directions))
    with pytest.raises(InputError, match="in the shade"):
        estimate_sky(capture, [0.0, 1.0, 0.0], SkyOptions(rounds=1))


def test_what_cannot_be_is_refused():
    for sky in ((), ((1.0, 2.0),), ((1.0,), (1.0, 0.0, 0.0, 0.0)), ((math.nan,),)):
        with pytest.raises(OptionError):
            SkyLeastSquares(sky=sky)
    with pytest.raises(RigError, match="14 suns"):
        SkyLeastSquares(sky=((0.1,),)).prepare(SUNS.rig)
    for options in ({"even": -0.1}, {"even": math.nan}, {"ground": 2.0}, {"zenith": "up"}, {"zenith": "0,0,0"}):
        with pytest.raises(OptionError):
            SkyLeastSquares(**options)
    for options in ({"terms": 2}, {"ground": -1.0}, {"rounds": -1}, {"ground": math.nan}):
        with pytest.raises(OptionError):
            SkyOptions(**options)
    with pytest.raises(RigError):
        even_sky([0.0, 0.0, 0.0])
    capture = real_day(0.1)
    few = Capture(stack=MemoryStack(capture.stack.read()[:3]), rig=SUNS.rig.select([0, 1, 2]), mask=INSIDE)
    with pytest.raises(InputError, match="Four or more"):
        estimate_sky(few, UP)
