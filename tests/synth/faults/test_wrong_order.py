"""Rows of the light file in a wrong order."""

import numpy as np
import pytest

from psstereo.errors import InputError, OptionError
from psstereo.lights import Rig
from psstereo_synth import spiral
from psstereo_synth.faults import Draws, WrongOrder

RIG = Rig.distant(spiral(7), np.arange(1.0, 8.0))


def written(fault, seed=0):
    return fault.rig(RIG, Draws(seed)).strengths(1)[:, 0].astype(int).tolist()


def test_a_swap_of_named_rows():
    assert written(WrongOrder(rows=(1, 4))) == [1, 5, 3, 4, 2, 6, 7]
    assert written(WrongOrder(rows=(4, 1)), seed=9) == [1, 5, 3, 4, 2, 6, 7]


def test_a_drawn_swap_changes_two_rows():
    seen = set()
    for seed in range(200):
        moved = np.flatnonzero(np.array(written(WrongOrder(), seed)) != np.arange(1, 8))
        assert len(moved) == 2
        seen.add(tuple(moved))
    assert len(seen) == 21  # all pairs of seven


@pytest.mark.parametrize(("by", "expected"), [(None, [7, 1, 2, 3, 4, 5, 6]), (-2, [3, 4, 5, 6, 7, 1, 2])])
def test_a_cycle(by, expected):
    assert written(WrongOrder(kind="cycle", by=by)) == expected


def test_a_shuffle_is_any_other_order():
    orders = {tuple(WrongOrder(kind="shuffle").permutation(3, Draws(seed)).tolist()) for seed in range(200)}
    assert len(orders) == 5  # of six, all but the right one
    assert (0, 1, 2) not in orders
    assert WrongOrder(kind="shuffle").permutation(2, Draws(0)).tolist() == [1, 0]


def test_directions_and_strengths_move_together():
    rig = WrongOrder(kind="shuffle").rig(RIG, Draws(1))
    order = WrongOrder(kind="shuffle").permutation(7, Draws(1))
    np.testing.assert_array_equal(rig.directions, RIG.directions[order])
    np.testing.assert_array_equal(rig.strengths(1), RIG.strengths(1)[order])


@pytest.mark.parametrize(
    "options",
    [
        {"kind": "mirror"},
        {"rows": (1, 1)},
        {"rows": (-1, 1)},
        {"rows": (1, 2, 3)},
        {"kind": "cycle", "rows": (0, 1)},
        {"kind": "swap", "by": 1},
        {"kind": "cycle", "by": 0},
    ],
    ids=str,
)
def test_options_that_do_not_fit_are_refused(options):
    with pytest.raises(OptionError):
        WrongOrder(**options)


@pytest.mark.parametrize(
    ("fault", "count"),
    [
        (WrongOrder(), 1),
        (WrongOrder(kind="shuffle"), 0),
        (WrongOrder(rows=(0, 7)), 7),
        (WrongOrder(kind="cycle", by=14), 7),
    ],
)
def test_rigs_that_it_cannot_befall_are_refused(fault, count):
    with pytest.raises(InputError, match="wrong order"):
        fault.permutation(count, Draws(0))
