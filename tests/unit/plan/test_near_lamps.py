"""What plans say about near lamps, and what a run makes of it."""

from dataclasses import replace

import numpy as np
import pytest

from psstereo.errors import InputError, UnsupportedError
from psstereo.near import fit, reflectance
from psstereo.normals import LeastSquares
from psstereo.normals.exemplar import Exemplar
from psstereo.normals.response_bend import ResponseBend
from psstereo.plan.costs import COSTS
from psstereo.plan.near_run import run_near, takes_near
from psstereo.plan.options import Options
from psstereo.plan.plan import make_plan
from psstereo.plan.run import follow
from psstereo.plan.stage import Decision, Skip, Use
from psstereo.plan.stages.near_lamps import NearLamps
from psstereo.plan.survey import describe
from tests.unit.near.near_scenes import pinhole_sphere, ring, shoot
from tests.unit.plan.test_choice import MATTE

LAMPS = replace(MATTE, lamps=True, images=24)


def test_the_stage_says_what_the_surface_is_taken_for():
    stage, few = NearLamps(), replace(LAMPS, images=7)
    assert isinstance(stage.decide(MATTE), Skip)
    auto = stage.decide(LAMPS)
    assert isinstance(auto, Use)
    assert auto.options == {"reflectance": "auto"}
    assert auto.figure == "24 lamps"
    matte = stage.decide(few)
    assert isinstance(matte, Use)
    assert matte.options == {"reflectance": "lambert"}
    assert "need 16" in matte.reason
    assert stage.whole(LAMPS).options == {"reflectance": "exemplar"}
    assert stage.whole(few).options == {"reflectance": "lambert"}
    assert isinstance(stage.whole(MATTE), Skip)


def test_what_was_asked_for_goes_first():
    stage = NearLamps()
    assert stage.asked(Options(), LAMPS) is None
    assert stage.asked(Options(solver=Exemplar()), MATTE) is None
    named = stage.asked(Options(solver=Exemplar(), distance=300.0), LAMPS)
    assert named.options == {"reflectance": "exemplar", "distance": 300.0}
    assert stage.asked(Options(distance=300.0), LAMPS).options == {"reflectance": "auto", "distance": 300.0}
    whole = stage.asked(Options(distance=300.0, nothing_left_out=True), LAMPS)
    assert whole.options == {"reflectance": "exemplar", "distance": 300.0}
    assert isinstance(stage.asked(Options(solver=LeastSquares()), LAMPS), Skip)


@pytest.fixture(scope="module")
def capture():
    return shoot(*pinhole_sphere(12), ring(18))


def test_only_solvers_for_distant_lights_leave_it_out(capture):
    assert takes_near(capture, Options())
    assert takes_near(capture, Options(solver=Exemplar()))
    assert not takes_near(capture, Options(solver=LeastSquares()))


def test_an_edited_plan_must_make_sense(capture):
    stage = NearLamps()
    for options in ({"reflectance": "glass"}, {"distance": "far"}, {"distance": True}):
        with pytest.raises(InputError):
            stage.apply(Decision(stage="near lamps", use=True, options=options), capture, Options())
    _, settled = stage.apply(Decision(stage="near lamps", use=True, options={"distance": 5.0}), capture, Options())
    assert settled.distance == 5.0


def ran(capture, options):
    plan = make_plan(describe(capture, options), options)
    settled_capture, settled = follow(plan, capture, options)
    return run_near(plan, settled_capture, settled, light_steps=(), over=map, progress=lambda *_: None)


def test_a_run_says_whether_materials_were_fitted_and_why(capture, monkeypatch):
    monkeypatch.setattr(fit, "BREAK_EVEN", 0.0)
    monkeypatch.setattr(reflectance, "_FITS", 1e5)
    found = ran(capture, Options(integrator=None))
    steps = {step.name: step for step in found.steps}
    assert not steps["non-Lambertian solving"].done
    assert "Lambert's law stands" in steps["non-Lambertian solving"].reason
    asked = ran(capture, Options(solver=Exemplar(shared=0), integrator=None))
    step = next(step for step in asked.steps if step.name == "non-Lambertian solving")
    assert step.done
    assert "asked for" in step.reason
    assert "materials of its own" in step.reason
    assert asked.normals.facts["materials"] == 0
    np.testing.assert_allclose(asked.normals.normals, found.normals.normals, atol=5e-3)


def test_another_solver_is_not_passed_over(capture):
    plan = make_plan(describe(capture, Options()), Options())
    with pytest.raises(UnsupportedError, match="response-bend"):
        run_near(plan, capture, Options(solver=ResponseBend()), light_steps=(), over=map, progress=lambda *_: None)


def test_much_work_under_lamps_is_no_contradiction():
    """Which loops are compiled is the near method's own affair, however many samples there are."""
    large = shoot(*pinhole_sphere(72), ring(18))
    options = Options(solver=Exemplar())
    plan = make_plan(describe(large, options), options)
    assert np.count_nonzero(large.effective_mask) * 18 > COSTS["exemplar"].break_even
    assert not plan["compiled kernels"].use
    _, settled = follow(plan, large, options)
    assert settled.solver is not None
