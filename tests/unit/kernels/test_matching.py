import numpy as np
import pytest

from psstereo.kernels import matching, matching_compiled


def encoded(rng, shape=(7, 3, 19)):
    height, channels, width = shape
    value = rng.integers(-200, 200, (height, channels, 1, width))
    low, high = value - rng.integers(0, 30, value.shape), value + rng.integers(0, 30, value.shape)
    return np.concatenate([value, low, high], axis=2).astype(np.int16)


def costs(module, left, right, tops, *, first, count):
    cost = np.zeros((left.shape[0], left.shape[3], count), np.uint8)
    multiplier = np.uint32(240 * 65536 // int(tops.sum()))
    module.pair_costs(left, right, first, tops, multiplier, (0, left.shape[0]), cost)
    return cost


@pytest.mark.parametrize(("first", "count"), [(0, 12), (-6, 9), (4, 30), (17, 3)])
def test_both_kernels_give_the_same_costs(first, count):
    rng = np.random.default_rng(1)
    left, right, tops = encoded(rng), encoded(rng), np.array([60, 20, 90], np.int16)
    slow, fast = (costs(m, left, right, tops, first=first, count=count) for m in (matching, matching_compiled))
    np.testing.assert_array_equal(slow, fast)
    assert slow.max() > 0


@pytest.mark.parametrize("diagonal", [True, False])
@pytest.mark.parametrize("forward", [True, False])
def test_both_kernels_smooth_alike(forward, diagonal):
    rng = np.random.default_rng(2)
    cost = rng.integers(0, 241, (8, 11, 7)).astype(np.uint8)
    across, along = (rng.integers(20, 200, (8, 11)).astype(np.uint16) for _ in range(2))
    slow, fast = np.zeros(cost.shape, np.uint16), np.zeros(cost.shape, np.uint16)
    matching.aggregate(cost, 9, across, along, forward, diagonal, slow)
    matching_compiled.aggregate(cost, 9, across, along, forward, diagonal, fast)
    np.testing.assert_array_equal(slow, fast)


@pytest.mark.parametrize("paired", [True, False])
@pytest.mark.parametrize("first", [0, -4, 3])
def test_both_kernels_choose_alike(first, paired):
    rng = np.random.default_rng(3)
    one, two = (rng.integers(0, 900, (5, 13, 8)).astype(np.uint16) for _ in range(2))
    results = []
    for module in (matching, matching_compiled):
        out = [np.full((5, 13), np.nan, np.float32) for _ in range(3)]
        module.winners(one, two, first, paired, (0, 5), *out)
        results.append(out)
    for slow, fast in zip(*results, strict=True):
        np.testing.assert_allclose(slow, fast, rtol=1e-6)


def exhaustive(cost, small, large):
    """Return the least cost of a row's labels by trying all of them."""
    import itertools

    width, count = cost.shape
    best = np.inf
    for labels in itertools.product(range(count), repeat=width):
        total = sum(int(cost[x, d]) for x, d in enumerate(labels))
        for a, b in itertools.pairwise(labels):
            total += 0 if a == b else small if abs(a - b) == 1 else large
        best = min(best, total)
    return best


@pytest.mark.parametrize("module", [matching, matching_compiled])
def test_a_path_is_the_best_of_all_labellings(module):
    rng = np.random.default_rng(4)
    cost = rng.integers(0, 50, (1, 5, 4)).astype(np.uint8)
    total = np.zeros(cost.shape, np.uint16)
    penalty = np.full((1, 5), 17, np.uint16)
    # One row: the path along it is exact, and the two or three that come from above see no row before.
    module.aggregate(cost, 6, penalty, penalty, True, False, total)
    path = total[0].astype(int) - cost[0]  # the path from above is the cost itself
    # Subtracting the lowest of each step keeps numbers small; what was subtracted adds up again.
    subtracted = sum(path[x].min() for x in range(4))
    assert path[4].min() + subtracted == exhaustive(cost[0], 6, 17)


@pytest.mark.parametrize("module", [matching, matching_compiled])
def test_equal_slopes_meet_between_labels(module):
    # |d − 2.3| at the labels 0 … 4
    cost = np.rint(100 * np.abs(np.arange(5) - 2.3)).astype(np.uint16)[None, None]
    out = [np.zeros((1, 1), np.float32) for _ in range(3)]
    module.winners(cost, np.zeros_like(cost), 0, False, (0, 1), *out)
    assert out[0][0, 0] == pytest.approx(2.3, abs=0.01)
