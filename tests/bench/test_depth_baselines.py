"""What integrators are measured against solves the same problem."""

import numpy as np
import pytest

from psstereo.bench.depth_baselines import algebraic_multigrid, sparse_direct
from psstereo.camera import Orthographic
from psstereo.depth import Poisson
from psstereo.errors import OptionError
from psstereo_synth.reliefs import RELIEFS, relieved


@pytest.mark.parametrize("baseline", [sparse_direct, algebraic_multigrid])
def test_baselines_find_the_plain_quadratic_solution(baseline):
    surface = relieved("cliff", 40, 36)
    found = baseline(surface.normals, surface.mask)
    plain = Poisson(turn=None, slant_exponent=0.0)  # all edges alike
    ours = plain.integrate(surface.normals, Orthographic(), mask=surface.mask).depth
    np.testing.assert_allclose(found - np.nanmean(found), ours, rtol=0, atol=1e-5)


@pytest.mark.parametrize("kind", RELIEFS)
def test_normals_are_those_of_the_heights(kind):
    surface = relieved(kind, 200, 160)
    down, across = np.gradient(surface.height)
    error = np.hypot(
        across + surface.normals[..., 0] / surface.normals[..., 2],
        down - surface.normals[..., 1] / surface.normals[..., 2],
    )
    # All but the pixels at a jump, and those at the kink of the dome's outline.
    assert np.quantile(error[surface.mask], 0.95) < 0.02


def test_unknown_reliefs_are_refused():
    with pytest.raises(OptionError, match="Known are smooth"):
        relieved("spiky", 10, 10)
