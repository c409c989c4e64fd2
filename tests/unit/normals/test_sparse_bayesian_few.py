"""The sparse Bayesian solver where shadows leave so few observations that none can be told to err."""

import numpy as np
import pytest

from psstereo.capture import Capture
from psstereo.flags import Flag
from psstereo.lights import Rig
from psstereo.normals import NORMAL_SOLVERS, estimate_normals
from psstereo.stack import MemoryStack
from psstereo_synth import spiral


@pytest.mark.parametrize("lit", [3, 4])
def test_a_few_lit_lights_among_many_shadows_give_the_normal_of_these(lit):
    rng = np.random.default_rng(lit)
    directions, count = spiral(12, max_tilt=np.radians(45.0)), 600
    tilt = np.column_stack([rng.uniform(-0.3, 0.3, (count, 2)), np.ones(count)])
    normals = tilt / np.linalg.norm(tilt, axis=1, keepdims=True)
    values = 0.7 * directions @ normals.T
    for pixel in range(count - 1):
        while True:
            chosen = rng.choice(12, lit, replace=False)
            if np.linalg.cond(directions[chosen]) < 30:
                break
        values[np.setdiff1d(np.arange(12), chosen), pixel] = 0.0
    capture = Capture(stack=MemoryStack(values[:, None]), rig=Rig.distant(directions))
    found = estimate_normals(capture, NORMAL_SOLVERS["sparse-bayesian"]())
    told = (found.flags[0] & Flag.NOT_CONVERGED) != 0
    assert told.mean() < 0.01
    np.testing.assert_allclose(found.normals[0][~told], normals[~told], atol=1e-6)
