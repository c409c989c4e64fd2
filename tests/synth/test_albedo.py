"""The checkerboard."""

import numpy as np
import pytest

from psstereo_synth import checker


def test_cells_alternate_between_two_values_under_a_gradient():
    board = checker((80, 80), cells=8, low=0.2, high=0.6)
    gradient = 1 - 0.2 * np.arange(80) / 79
    flat = board / gradient[:, None]
    assert np.allclose(np.unique(flat.round(9)), [0.2, 0.6])
    assert board[0, 0] == pytest.approx(0.6)
    assert board[0, 10] == pytest.approx(0.2)
    assert board[10, 10] == pytest.approx(0.6 * gradient[10])
    assert flat[0, :10].std() < 1e-12
    assert board[-1].max() == pytest.approx(0.6 * 0.8)


def test_albedo_lies_between_its_bounds():
    board = checker((33, 57))
    assert board.shape == (33, 57)
    assert 0.8 * 0.25 <= board.min() < board.max() <= 0.75


def test_tint_adds_two_weaker_channels():
    gray, colour = checker((20, 30)), checker((20, 30), tint=True)
    assert colour.shape == (20, 30, 3)
    assert np.allclose(colour, gray[..., None] * [1.0, 0.85, 0.7])


def test_one_row_has_no_gradient():
    assert np.isfinite(checker((1, 6))).all()
    assert checker((1, 6)).max() == pytest.approx(0.75)
