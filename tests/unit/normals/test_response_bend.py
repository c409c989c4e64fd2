"""The bent response on data that obey its model, on data that obey Lambert's law, and on photographs."""

from dataclasses import replace

import numpy as np
import pytest

from psstereo.errors import OptionError, RigError
from psstereo.flags import Flag
from psstereo.io import read_capture
from psstereo.lights import Rig
from psstereo.metrics import summarise_angles
from psstereo.normals import estimate_normals
from psstereo.normals.response_bend import ResponseBend
from psstereo.normals.robust import Robust
from psstereo.normals.solver import Samples
from psstereo.normals.verdict import Verdict
from psstereo_synth import spiral


def some_normals(count, seed=0, spread=0.3):
    slopes = np.random.default_rng(seed).normal(0, spread, (count, 2))
    normals = np.column_stack([-slopes, np.ones(count)])
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def angles(found, normals):
    found = found / np.linalg.norm(found, axis=1, keepdims=True)
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(found, normals), axis=1), (found * normals).sum(axis=1)))


def solve(solver, directions, values, pixels=None, **asked):
    return solver.solve(solver.prepare(Rig.distant(directions), pixels), Samples(values, **asked))


def bent_values(directions, normals, knots, offset):
    """Brightness whose inverse response is piecewise linear: 0 and 1 stay, the knots at 1/3 and 2/3 move; + offset."""
    shade = np.maximum(directions @ normals.T, 0.0)
    top = np.sort(shade, axis=0)[int(0.95 * (len(directions) - 1) + 0.5)]
    x = np.array([0.0, 1 / 3, 2 / 3, 1.0, 2.0])
    left = x + np.array([0.0, *knots, 0.0, -3.0 * knots[1]])  # the last piece goes on as it is
    lifted = np.interp(shade / top * (1.0 - offset) + offset, left, x)
    return np.where(shade > 0, lifted, 0.0)


@pytest.mark.parametrize("knots", [(0.06, 0.04), (-0.08, -0.05), (-0.12, 0.05)])
@pytest.mark.parametrize("offset", [0.0, 0.05])
@pytest.mark.parametrize("pixels", [None, 1_000_000])
def test_exact_where_the_response_is_of_its_form(knots, offset, pixels):
    directions = spiral(60, max_tilt=0.9)
    normals = some_normals(300, spread=0.25)
    values = bent_values(directions, normals, knots, offset) * np.random.default_rng(1).uniform(0.1, 50.0, 300)
    solver = ResponseBend(tie=1e-9, offset_tie=1e-9, rounds=60)
    state = solver.prepare(Rig.distant(directions), pixels)
    rig = state.matte.rig
    patient = replace(state, settings=state.settings._replace(tolerance=1e-6))
    fit = patient.fit(values, None, rig.q, rig.r_inverse, state.pairs, patient.settings)
    assert (fit.share > 0).all()
    # Knots lie at shares of a quantile that is found to one part in 4096, so the curve's own knots are missed by that.
    assert angles(fit.solution[:, -3:] @ rig.r_inverse.T, normals).max() < 3e-3
    robust = angles(solve(Robust(), directions, values).scaled, normals)
    whole = fit.share == 1  # elsewhere the robust answer still has a part in it
    assert whole.mean() > 0.7
    assert robust[whole].mean() > 0.15
    for asked, bound in ((patient, 3e-3), (state, 0.05)):  # by default it stops sooner
        found = angles(solver.solve(asked, Samples(values)).scaled, normals)
        assert found[whole].max() < bound
        assert (found[~whole] < robust[~whole]).all()


@pytest.mark.parametrize("power", [1 / 1.3, 1.3])
@pytest.mark.parametrize("ambient", [0.0, 0.05])
def test_a_smooth_curve_and_ambient_light_with_default_ties(power, ambient):
    directions, normals = spiral(96), some_normals(500)
    values = np.maximum(directions @ normals.T, 0.0) ** power + ambient
    robust = angles(solve(Robust(), directions, values).scaled, normals).mean()
    bent = angles(solve(ResponseBend(), directions, values).scaled, normals).mean()
    assert bent < 0.5 * robust
    assert bent < 0.8


def test_an_infinite_tie_is_lamberts_law():
    directions, normals = spiral(60), some_normals(100)
    values = np.maximum(directions @ normals.T, 0.0) ** 1.3
    solver = ResponseBend(tie=np.inf, offset_tie=np.inf, rounds=100)
    state = solver.prepare(Rig.distant(directions))
    rig = state.matte.rig
    fit = state.fit(values, None, rig.q, rig.r_inverse, state.pairs, state.settings)
    assert (fit.share == 1).sum() > 90
    np.testing.assert_allclose(fit.solution[fit.share > 0, :3], 0.0, atol=1e-11)
    robust = solve(Robust(loss="geman-mcclure", rounds=100), directions, values).scaled
    assert np.median(angles(solver.solve(state, Samples(values)).scaled, robust)) < 0.5
    stiff, soft = (
        angles(solve(ResponseBend(tie=tie, offset_tie=tie), directions, values).scaled, normals).mean()
        for tie in (1e6, 1e-4)
    )
    assert soft < 0.5 * stiff


@pytest.mark.parametrize(
    ("noise", "gloss", "bound"), [(0.0, 0.0, 1e-3), (0.01 / np.sqrt(3), 0.0, 0.5), (0.0, 0.5, 0.25)]
)
def test_matte_surfaces_lose_nothing(noise, gloss, bound):
    rng = np.random.default_rng(3)
    directions, normals = spiral(96), some_normals(1500, spread=0.45)
    half = directions + np.array([0.0, 0.0, 1.0])
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    shade = np.maximum(directions @ normals.T, 0.0)
    values = shade * rng.uniform(0.1, 0.9, 1500) + gloss * np.maximum(half @ normals.T, 0) ** 60 * (shade > 0)
    values = np.rint(np.clip(0.6 * values + rng.normal(0, 1, values.shape) * noise, 0, 1) * 65535) / 65535
    robust, bent = (angles(solve(s, directions, values).scaled, normals).mean() for s in (Robust(), ResponseBend()))
    assert bent < max(1.02 * robust, 1e-3)
    assert bent < bound


def test_error_bars_hold_where_the_model_does():
    """White noise on a bent response: predicted and true error agree within a fifth in the mean square."""
    rng = np.random.default_rng(4)
    directions, normals = spiral(96, max_tilt=0.9), some_normals(2000, spread=0.2)
    values = bent_values(directions, normals, (-0.12, -0.08), 0.0) + rng.normal(0, 0.004, (96, 2000))
    result = solve(ResponseBend(tie=1e-6, offset_tie=1e-6), directions, values, covariance=True)
    trace = result.covariance[:, [0, 2, 5]].sum(axis=1)
    np.testing.assert_allclose(np.sqrt(trace), result.uncertainty, rtol=1e-12)
    error = angles(result.scaled, normals)
    assert np.sqrt((error**2).mean()) == pytest.approx(np.degrees(np.sqrt(trace.mean())), rel=0.2)


def test_verdicts_name_shadows_and_highlights():
    rng = np.random.default_rng(5)
    directions, normals = spiral(96), some_normals(400, spread=0.5)
    shade = np.maximum(directions @ normals.T, 0.0)
    values = shade**1.4 + 1e-4 * rng.normal(size=shade.shape)
    bright = (rng.random(shade.shape) < 0.04) & (shade > 0.2)
    values[bright] += 0.6
    values[3, 7] = np.nan
    result = solve(ResponseBend(), directions, values, verdicts=True)
    assert (result.verdicts[bright] == Verdict.HIGHLIGHT).mean() > 0.97
    assert (result.verdicts[shade == 0] == Verdict.SHADOW).mean() > 0.97
    assert (result.verdicts[(shade > 0.2) & ~bright] == Verdict.USED).mean() > 0.8
    assert result.verdicts[3, 7] == Verdict.UNUSABLE
    assert result.flags[7] & Flag.UNUSABLE_SAMPLE


def test_too_few_rounds_are_flagged():
    directions, normals = spiral(96), some_normals(100)
    values = np.maximum(directions @ normals.T, 0.0) ** 1.5
    hasty, patient = (solve(ResponseBend(rounds=r), directions, values).flags for r in (1, 60))
    assert ((hasty & Flag.NOT_CONVERGED) > 0).mean() > 0.9
    assert ((patient & Flag.NOT_CONVERGED) > 0).mean() < 0.1


@pytest.mark.parametrize(
    "options", [{"tie": 0.0}, {"tie": np.nan}, {"offset_tie": -1.0}, {"segments": 1}, {"segments": 9}, {"rounds": 0}]
)
def test_hostile_options_are_refused(options):
    with pytest.raises(OptionError, match="response bend"):
        ResponseBend(**options)


def test_eleven_lights_are_refused():
    with pytest.raises(RigError, match="needs 12 or more"):
        ResponseBend().prepare(Rig.distant(spiral(11)))


@pytest.mark.data
@pytest.mark.slow
@pytest.mark.parametrize(("name", "bound"), [("ballPNG", 1.6), ("catPNG", 5.8)])
def test_photographs_of_the_benchmark(data_dir, name, bound):
    capture, truth = read_capture(data_dir / "diligent" / name)
    found = estimate_normals(capture, ResponseBend())
    assert summarise_angles(found.normals, truth.normals, capture.mask).mean_deg < bound


@pytest.mark.data
@pytest.mark.slow
@pytest.mark.parametrize(("name", "bound"), [("spot-lambert", 1.8), ("teapot-plastic", 4.6)])
def test_path_traced_captures(data_dir, name, bound):
    """The robust solver has 1.7° and 5.5°."""
    capture, truth = read_capture(data_dir / "rendered" / name)
    found = estimate_normals(capture, ResponseBend())
    assert summarise_angles(found.normals, truth.normals, capture.mask).mean_deg < bound
