"""The exemplar loop and its compiled twin: lobes as the forward model has them, exact on its own model, one result."""

import numpy as np
import pytest
from scipy.optimize import nnls as reference_nnls

from psstereo.brdf import Ggx, Lambert, OrenNayar
from psstereo.kernels import exemplar, exemplar_compiled, exemplar_steps_compiled
from psstereo.kernels.exemplar import FAILED, SETTLED, SHORT, Dictionary
from psstereo.kernels.exemplar_lobes import (
    CONSTANT,
    FACETED,
    GGX,
    GLAZE,
    LAMBERT,
    POWER,
    ROUGH,
    lights_table,
    lobes,
    slopes,
    tangents,
)
from psstereo.kernels.exemplar_nnls import nnls
from psstereo.lights import Rig
from psstereo.normals.exemplar import LOBES, Exemplar
from psstereo_synth import spiral

DIRECTIONS = spiral(60, max_tilt=np.radians(55))
STATE = Exemplar().prepare(Rig.distant(DIRECTIONS))
NONE = np.zeros((0, 0))
EYE = np.array([0.0, 0.0, 1.0])
TWINS = (exemplar.fit_pixels, exemplar_compiled.fit_pixels)
ALL = np.array([LAMBERT, GLAZE, POWER, ROUGH, GGX, GGX, CONSTANT, FACETED, POWER])
RATIO = 0.45 * 0.25 / (0.25 + 0.09) / (1 - 0.125 / (0.25 + 0.33))
SHAPES = np.array([0.0, 0.0, 1.7, 0.8, 0.15, 0.5, 0.0, RATIO, 3.0])


def tilted(count, seed, most=60.0):
    rng = np.random.default_rng(seed)
    z, turn = rng.uniform(np.cos(np.radians(most)), 1.0, count), rng.uniform(0, 2 * np.pi, count)
    side = np.sqrt(1 - z * z)
    return np.stack([side * np.cos(turn), side * np.sin(turn), z], axis=1)


def amounts_of(**named):
    return np.array([named.get(lobe.name.replace("-", "_").replace(".", "_"), 0.0) for lobe in LOBES])


PLASTIC = amounts_of(glazed=0.6, gloss_0_25=0.5)


def shown(normals, amounts):
    d = STATE.dictionary
    return np.einsum("...k,pkm->pm", amounts, lobes(normals, STATE.table, d.kinds, d.shapes))


def angle(a, b):
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1)))


def pixels(count=90, seed=0):
    """Plastic with noise, shadows, missing values; starts some degrees off, (values, starts, normals)."""
    rng = np.random.default_rng(seed)
    normals = tilted(count, seed)
    values = shown(normals, PLASTIC) * rng.uniform(0.2, 2.0, (count, 1))
    values += 0.002 * rng.normal(size=values.shape) + 0.3 * (rng.random(values.shape) < 0.05)
    values[rng.random(values.shape) < 0.05] = np.nan
    start = normals + 0.05 * rng.normal(size=(count, 3))
    return values, start * np.nanquantile(values, 0.9, axis=1)[:, None], normals


def assert_same(plain, fast, part=slice(None)):
    np.testing.assert_array_equal(plain.outcome, fast.outcome)
    assert (plain.outcome[part] == SETTLED).mean() > 0.95
    np.testing.assert_allclose(plain.normal, fast.normal, rtol=0, atol=1e-8)
    np.testing.assert_allclose(plain.spread, fast.spread, rtol=1e-4, atol=1e-12)
    np.testing.assert_allclose(plain.scale, fast.scale, rtol=1e-6)
    np.testing.assert_allclose(plain.evidence, fast.evidence, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(plain.share, fast.share, rtol=0, atol=1e-6)


def test_lobes_are_those_of_the_forward_model():
    normals = tilted(40, 1)
    found = lobes(normals, lights_table(DIRECTIONS), ALL, SHAPES)
    cosine = np.maximum(normals @ DIRECTIONS.T, 0.0)[..., None]

    def brightness(brdf):
        return (brdf.evaluate(normals[:, None], DIRECTIONS[None], EYE) * cosine)[..., 0]

    np.testing.assert_allclose(found[:, 0] / np.pi, brightness(Lambert(albedo=np.ones(1))), atol=1e-14)
    glaze = [brightness(Ggx(albedo=np.full(1, a), f0=np.zeros(1), roughness=np.ones(1))) for a in (1.0, 0.0)]
    seen = 1.0 - (1.0 - normals[:, 2:]) ** 5
    np.testing.assert_allclose(found[:, 1] * seen / np.pi, glaze[0] - glaze[1], atol=1e-14)
    facets = OrenNayar(albedo=np.ones(1), roughness=np.full(1, 0.5))
    np.testing.assert_allclose(found[:, 7] * facets.diffuse_albedo / np.pi, brightness(facets), atol=1e-14)
    for k in (4, 5):
        mirrors = Ggx(albedo=np.zeros(1), f0=np.ones(1), roughness=np.sqrt(SHAPES[k : k + 1]))
        facing = mirrors.evaluate(EYE[None], EYE[None], EYE)[..., 0]
        np.testing.assert_allclose(found[:, k] * facing, brightness(mirrors), rtol=1e-10, atol=1e-14)


def test_slopes_are_the_lobes_differences():
    normals, table = tilted(30, 2, most=80.0), lights_table(DIRECTIONS)
    amounts = np.random.default_rng(3).uniform(0.1, 1.0, (30, len(ALL)))
    across, by = tangents(normals), slopes(normals, table, ALL, SHAPES, amounts)
    for e in range(2):
        t = across[:, e]
        told = (t @ table[:3]) * by[:, 0] + (t @ table[3:6]) * by[:, 1] + t[:, 2:] * by[:, 2]
        ends = [lobes(normals + h * t, table, ALL, SHAPES) for h in (1e-6, -1e-6)]
        change = np.einsum("pk,pkm->pm", amounts, ends[0] - ends[1]) / 2e-6
        clear = np.abs(normals @ DIRECTIONS.T) > 1e-4
        np.testing.assert_allclose(told[clear], change[clear], rtol=1e-5, atol=1e-7)


def test_compiled_lobes_and_slopes_are_the_same():
    normals, table = tilted(5, 4, most=100.0), lights_table(DIRECTIONS)
    amounts = np.random.default_rng(5).uniform(0.1, 1.0, len(ALL))
    plain, by = lobes(normals, table, ALL, SHAPES), slopes(normals, table, ALL, SHAPES, np.tile(amounts, (5, 1)))
    cosine, half, out, turned = np.zeros(60), np.zeros(60), np.zeros((len(ALL), 60)), np.zeros((3, 60))
    for j, n in enumerate(normals):
        exemplar_steps_compiled.fill_lobes(n, table, ALL, SHAPES, NONE, amounts, cosine, half, out, turned)
        np.testing.assert_allclose(out, plain[j], rtol=1e-11, atol=1e-14)
        np.testing.assert_allclose(turned, by[j], rtol=1e-10, atol=1e-12)


def test_amounts_are_those_of_lawson_and_hanson():
    rng = np.random.default_rng(6)
    columns, y = rng.normal(size=(40, 30, 6)), rng.normal(size=(40, 30))
    found = nnls(
        columns.transpose(0, 2, 1) @ columns, np.einsum("pmk,pm->pk", columns, y), 0, np.zeros((40, 6)), np.ones(40)
    )
    expected = np.array([reference_nnls(a, b)[0] for a, b in zip(columns, y, strict=True)])
    np.testing.assert_allclose(found, expected, atol=1e-10)
    assert 40 < (expected == 0).sum() < 200  # some are held, some are not


@pytest.mark.parametrize("kind", ["plain", "weighted", "mixed"])
def test_the_twins_agree(kind):
    values, start, _ = pixels()
    values[0], values[1, 8:], start[2], start[3] = np.nan, 0.0, np.nan, 0.0
    weights = np.random.default_rng(5).uniform(0.2, 3.0, values.shape) if kind == "weighted" else NONE
    given = STATE.dictionary
    if kind == "mixed":
        mix = np.array([PLASTIC, amounts_of(lambert=0.5, rough=0.2), amounts_of(surroundings=1.0)])
        given = Dictionary(given.kinds, given.shapes, mix, np.array([0.0, 0.0, 0.01]), np.array([0.0, 1.0, 0.0]))
    plain, fast = (f(values, weights, start, STATE.table, given, STATE.settings) for f in TWINS)
    assert (plain.outcome[:4] == SHORT).all()
    assert_same(plain, fast, slice(4, None))


def near_lamps(normals, seed=20):
    """Lights that differ from pixel to pixel, and what plastic shows under them; some lamps do not reach a pixel."""
    rng = np.random.default_rng(seed)
    directions = DIRECTIONS + 0.2 * rng.normal(size=(len(normals), 1, 3)) * [1.0, 1.0, 0.0]
    directions /= np.linalg.norm(directions, axis=2, keepdims=True)
    gone = rng.random(directions.shape[:2]) < 0.1
    directions[gone] = 0.0
    table = lights_table(directions)
    d = STATE.dictionary
    values = np.einsum("k,pkm->pm", PLASTIC, lobes(normals, table, d.kinds, d.shapes))
    values[gone] = np.nan
    return table, values


def test_the_twins_agree_on_a_table_for_each_pixel():
    normals = tilted(60, 21, most=40.0)
    table, values = near_lamps(normals)
    rng = np.random.default_rng(22)
    values += 0.002 * rng.normal(size=values.shape)
    start = normals + 0.03 * rng.normal(size=normals.shape)
    plain, fast = (f(values, NONE, start, table, STATE.dictionary, STATE.settings) for f in TWINS)
    assert_same(plain, fast)
    assert np.median(angle(fast.normal, normals)) < 0.3
    other = exemplar_compiled.fit_pixels(values, NONE, start, table[0], STATE.dictionary, STATE.settings)
    assert np.median(angle(other.normal, normals)) > 3.0  # the tables do matter


def test_one_table_for_all_is_as_many_alike():
    values, start, _ = pixels(40, 23)
    many = np.repeat(STATE.table[None], 40, axis=0)
    for fit in TWINS:
        one, same = (fit(values, NONE, start, table, STATE.dictionary, STATE.settings) for table in (STATE.table, many))
        np.testing.assert_allclose(one.normal, same.normal, rtol=0, atol=1e-8)
    np.testing.assert_allclose(lights_table(np.repeat(DIRECTIONS[None], 40, axis=0)), many, rtol=1e-15)


@pytest.mark.parametrize("fit", TWINS)
@pytest.mark.parametrize("amounts", [PLASTIC, amounts_of(rough=0.5, gloss_0_6=0.3), amounts_of(gloss_0_25=1.0)])
def test_a_surface_like_the_model_is_found_exactly(fit, amounts):
    normals = tilted(40, 7, most=30.0)
    off = normals + 0.03 * np.random.default_rng(8).normal(size=normals.shape)
    found = fit(shown(normals, amounts), NONE, off, STATE.table, STATE.dictionary, STATE.settings)
    assert (found.outcome < FAILED).all()
    assert angle(found.normal, normals).max() < 0.02  # what the ties and the end of the steps leave
    assert (found.scale <= STATE.settings.floor).all()


def test_shadows_and_light_from_neighbours_do_not_matter():
    normals = tilted(60, 9, most=40.0)
    values = shown(normals, PLASTIC)
    rng = np.random.default_rng(10)
    spoilt = rng.random(values.shape) < 0.25
    values[spoilt] *= rng.uniform(0.0, 0.3, spoilt.sum())
    off = normals + 0.03 * rng.normal(size=normals.shape)
    found = exemplar_compiled.fit_pixels(values, NONE, off, STATE.table, STATE.dictionary, STATE.settings)
    assert np.median(angle(found.normal, normals)) < 0.1
    lit = values > 0.2 * values.max(axis=1, keepdims=True)
    assert np.abs(found.share[spoilt & lit]).mean() < 0.2


def test_a_metal_is_found_from_anywhere():
    normals = tilted(60, 11, most=25.0)
    values = shown(normals, amounts_of(gloss_0_25=1.0))
    wrong = tilted(60, 12)
    found = exemplar_compiled.fit_pixels(values, NONE, wrong, STATE.table, STATE.dictionary, STATE.settings)
    assert (angle(found.normal, normals) < 0.1).mean() > 0.9


def test_the_spread_is_that_of_many_trials():
    normal = np.array([[0.3, -0.2, 0.933]]) / np.linalg.norm([0.3, -0.2, 0.933])
    clean = shown(normal, PLASTIC + amounts_of(surroundings=0.02))
    rng = np.random.default_rng(13)
    values = clean + 0.01 * rng.normal(size=(3000, 60))
    start = np.repeat(normal, 3000, axis=0)
    found = exemplar_compiled.fit_pixels(values, NONE, start, STATE.table, STATE.dictionary, STATE.settings)
    off = np.einsum("pek,pk->pe", tangents(start), found.normal)
    measured, told = (off**2).mean(axis=0), np.nanmean(found.spread, axis=0)
    assert 0.55 < np.sqrt(told[0] / measured[0]) < 1.6
    assert 0.55 < np.sqrt(told[2] / measured[1]) < 1.6


def test_noise_alone_is_little_evidence():
    rng, normals = np.random.default_rng(14), tilted(400, 15, most=40.0)
    values = np.maximum(normals @ DIRECTIONS.T, 0.0) + 0.01 * rng.normal(size=(400, 60))
    fit = exemplar_compiled.fit_pixels
    matte = fit(values, NONE, normals, STATE.table, STATE.dictionary, STATE.settings)
    assert np.quantile(matte.evidence, 0.95) < 6.0
    glossy = fit(shown(normals, PLASTIC), NONE, normals, STATE.table, STATE.dictionary, STATE.settings)
    assert np.median(glossy.evidence) > 8.0
