"""Materials that an object's pixels share, and the map of them."""

import numpy as np
import pytest

from psstereo.brdf import Ggx
from psstereo.capture import Capture
from psstereo.errors import InputError, OptionError
from psstereo.lights import Rig
from psstereo.metrics import angular_error
from psstereo.normals import estimate_normals
from psstereo.normals.exemplar import LOBES, Exemplar
from psstereo.normals.exemplar_materials import material_map
from psstereo.normals.exemplar_shared import share_materials
from psstereo.normals.solver import Samples
from psstereo.stack import MemoryStack
from psstereo_synth import spiral

DIRECTIONS = spiral(48, max_tilt=0.9)
RIG = Rig.distant(DIRECTIONS)
EYE = np.array([0.0, 0.0, 1.0])


def object_of(count, seed=0, noise=0.01, varies=0.3):
    """Plastic whose albedo may vary under one gloss, (normals, samples (m, p), albedo)."""
    rng = np.random.default_rng(seed)
    normals = np.column_stack([rng.normal(0, 0.35, (count, 2)), np.ones(count)])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    albedo = 0.5 + varies * rng.uniform(-1.0, 1.0, (count, 1, 1))
    brdf = Ggx(albedo=albedo, f0=np.full(1, 0.05), roughness=np.full(1, 0.55))
    shown = (
        brdf.evaluate(normals[:, None], DIRECTIONS[None], EYE)[..., 0] * np.maximum(normals @ DIRECTIONS.T, 0) * np.pi
    )
    return normals, shown.T + noise * rng.normal(size=(len(DIRECTIONS), count)), albedo[:, 0, 0]


def error(solver, values, normals):
    found = solver.solve(solver.prepare(RIG, 10**7), Samples(values)).scaled
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(found, normals), axis=1), (found * normals).sum(axis=1)))


def test_shared_materials_lessen_the_error_of_noise():
    normals, values, _ = object_of(1500, varies=0.0)
    shared = share_materials(RIG, Samples(values), solver=Exemplar(rounds=30), materials=1, pixels=600)
    assert (shared.rounds, len(shared.materials)) == (30, 1)
    assert shared.materials[0][-1] == 0.0  # light from the surroundings is no material
    assert np.median(error(shared, values, normals)) < 0.93 * np.median(error(Exemplar(), values, normals))


def test_two_materials_serve_where_the_albedo_varies():
    normals, values, _ = object_of(1500, noise=0.002)
    shared = share_materials(RIG, Samples(values), pixels=600)
    assert len(shared.materials) == 2
    assert np.median(error(shared, values, normals)) < 0.5


def test_the_map_tells_matte_from_gloss():
    _, values, albedo = object_of(400, noise=0.001)
    told = material_map(RIG, Samples(values))
    assert told.names == tuple(lobe.name for lobe in LOBES)
    matte = told.amounts[:, [lobe.matte for lobe in LOBES]].sum(axis=1)
    assert np.corrcoef(matte, albedo)[0, 1] > 0.97
    assert np.nanmedian(told.residual) < 0.01
    values[:, 3] = np.nan
    assert np.isnan(material_map(RIG, Samples(values)).amounts[3]).all()


def test_the_map_in_shared_materials():
    _, values, _ = object_of(400)
    shared = share_materials(RIG, Samples(values, np.ones_like(values)), materials=2, pixels=400)
    told = material_map(RIG, Samples(values), solver=shared)
    assert told.names == ("material-1", "material-2", "surroundings")
    assert (told.amounts >= 0).all()


def test_black_pixels_have_no_materials():
    with pytest.raises(InputError, match="can be fitted"):
        share_materials(RIG, Samples(np.zeros((len(DIRECTIONS), 200))))


@pytest.mark.parametrize("options", [{"materials": 0}, {"materials": 7}, {"pixels": 10}])
def test_hostile_options_are_refused(options):
    with pytest.raises(OptionError, match="materials from"):
        share_materials(RIG, Samples(np.ones((len(DIRECTIONS), 200))), **options)


@pytest.mark.parametrize("amounts", [(1.0, 2.0), (0.0,) * len(LOBES), (-1.0,) * len(LOBES), (np.nan,) * len(LOBES)])
def test_hostile_materials_are_refused(amounts):
    with pytest.raises(OptionError, match="1 materials with"):
        Exemplar(materials=(amounts,))


def capture_of(values, shape):
    stack = MemoryStack(np.ascontiguousarray(values.reshape(len(values), *shape, 1), np.float32), white=2.0)
    return Capture(stack=stack, rig=RIG)


def test_a_capture_is_learnt_from_before_it_is_solved():
    """The same materials whatever the tiles, so the same bytes; and the record says what was learnt."""
    normals, values, _ = object_of(600, varies=0.0)
    capture = capture_of(values, (20, 30))
    whole = estimate_normals(capture, solver=Exemplar(shared=1))
    assert whole.facts["learnt"] == "1 materials were found and stand for the lobes in every pixel."
    alone = estimate_normals(capture, solver=Exemplar(shared=0))
    assert alone.facts["learnt"] is None
    apart = [np.median(angular_error(found.normals.reshape(-1, 3), normals)) for found in (whole, alone)]
    assert apart[0] < 0.95 * apart[1]
    tiled = estimate_normals(capture, solver=Exemplar(shared=1), max_memory=6_300_000)
    np.testing.assert_array_equal(tiled.normals, whole.normals)


def test_an_object_too_small_to_learn_from_is_solved_all_the_same():
    _, values, _ = object_of(30)
    found = estimate_normals(capture_of(values, (5, 6)), solver=Exemplar())
    assert found.facts["learnt"].startswith("Every pixel has materials of its own: At ")
    assert np.isfinite(found.normals).all()
