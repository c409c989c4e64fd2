"""The compiled sweeps against their reference."""

import numpy as np
import pytest

from psstereo.kernels import sweeping, sweeping_compiled
from psstereo.kernels.sweeping_conic import BIG, GIVEN, OPEN, OUTSIDE, PATIENCE

LIGHT = np.array([0.48, -0.36, 0.8])
CASES = {
    "parallel": [1, 1, 0, 0, 0, *LIGHT, 1, 0, 0],
    "hollow": [1, 1, 0, 0, 0, *LIGHT, -1, 0, 0],
    "central": [40, 44, 9, 12, 1.5, *LIGHT, 1, 1, 0],
    "lamp": [40, 44, 9, 12, 1.5, 0, 0, 1, 1, 1, 1],
}


def run(module, case):
    rng = np.random.default_rng(4)
    shape, frame = (21, 18), np.array(CASES[case], np.float64)
    bright = rng.uniform(0.15, 1.0, shape)
    bright[3, 4] = 1.0
    state = np.where(rng.random(shape) < 0.08, OUTSIDE, OPEN).astype(np.uint8)
    state[[3, 15, 15, 16], [4, 12, 13, 13]] = GIVEN
    u = np.full((25, 22), BIG)
    inner = u[2:-2, 2:-2]
    if case == "lamp":
        bright = 30.0 / bright
        inner[state == OPEN] = 0.5 * np.log(bright)[state == OPEN]
    inner[state == GIVEN] = 0.5
    active = np.ones(u.shape, np.uint8)
    code, tired = np.zeros((2, *shape), np.uint8)
    tired[5:9, 5:9] = PATIENCE - 2
    windows = [np.array([0, 11, 0, 18]), np.array([11, 21, 0, 18])]
    orders = [(True, True), (False, False), (True, False), (False, True)]
    record = []
    for down, right in orders:
        record += [module.first_order(u, state, active, code, bright, frame, w, down, right, 1e-9) for w in windows]
    first, origin = u.copy(), code.copy()
    for step in (
        lambda w: module.pieces(u, state, bright, frame, w, code),
        lambda w: module.widen(u, state, frame, w, code),
    ):
        for window in windows:
            step(window)
    codes = code.copy()
    for again in range(2):
        active[:] = 1
        for down, right in orders:
            record += [
                module.second_order(u, active, code, tired, bright, frame, w, down, right, 1e-6)
                if again == 0
                else module.refine(u, state, active, code, bright, frame, w, down, right, 1e-6)
                for w in windows
            ]
    n = np.zeros((*shape, 3))
    for window in windows:
        module.normals(u, code, frame, window, n)
    return first, origin, codes, u, code, n, record


@pytest.mark.parametrize("case", CASES)
def test_twins_agree(case):
    one, two = run(sweeping, case), run(sweeping_compiled, case)
    for a, b in zip(one[:6], two[:6], strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9)
    assert one[6] == two[6]
    assert (one[2] >= 16).any()
    assert (one[0] != one[3]).any()
