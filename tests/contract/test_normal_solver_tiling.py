"""Tiles and threads change no byte of any normal solver."""

import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from psstereo.errors import InputError
from psstereo.normals import NORMAL_SOLVERS, LeastSquares, blocks, estimate_normals, memory, robust
from psstereo.normals.memory import plan_memory
from psstereo.stack import PixelSet
from psstereo_synth import spiral
from tests.contract.normal_trials import (
    flexible,
    hilly,
    trial,
)

SHORT_BLOCK = 260
"""Pixels of a block in the tests of tiling; the readable loops go on in parts of 256."""


@pytest.fixture(scope="module", params=sorted(NORMAL_SOLVERS))
def method(request):
    return NORMAL_SOLVERS[request.param]


def least_memory(capture, values, workers=1):
    """The smallest bound that is accepted."""
    pixels = PixelSet.from_mask(capture.effective_mask)
    low, high = 0, 1 << 40
    while high - low > 1:
        middle = (low + high) // 2
        try:
            plan_memory(capture.stack, pixels, values, middle, workers)
            high = middle
        except InputError:
            low = middle
    return high


def smaller_blocks(monkeypatch, method, *, compiled):
    """Make blocks and groups short, so that a small image is shared by threads, and choose the loop all the same."""
    monkeypatch.setattr(memory, "BLOCK", SHORT_BLOCK)
    monkeypatch.setattr(blocks, "BLOCK", SHORT_BLOCK)
    monkeypatch.setattr(blocks, "_GROUP", 2)
    for module in {sys.modules[method.__module__], robust}:
        if hasattr(module, "_BREAK_EVEN"):
            monkeypatch.setattr(module, "_BREAK_EVEN", 0.0 if compiled else np.inf)


def assert_tiling_changes_no_byte(method, capture, gray):
    values = 3 if gray != "mean" else 1
    limit = least_memory(capture, values)
    tile = plan_memory(capture.stack, PixelSet.from_mask(capture.mask), values, limit, 1).tile
    assert capture.mask.sum() > 3 * tile  # several tiles, the last of them short
    assert capture.mask.sum() % SHORT_BLOCK
    expected = estimate_normals(capture, method(), gray=gray)
    answers = [estimate_normals(capture, method(), gray=gray)]
    for workers in (3,) if flexible(method) else (1, 2, 3):  # those take long
        with ThreadPoolExecutor(workers) as pool:
            answers.append(estimate_normals(capture, method(), gray=gray, over=pool.map))
            answers.append(estimate_normals(capture, method(), gray=gray, over=pool.map, max_memory=limit))
    answers.append(estimate_normals(capture, method(), gray=gray, max_memory=limit))
    assert [a.facts["samples_in"] for a in answers[-2:]] == ["temporary file"] * 2
    assert expected.facts["samples_in"] == "memory"
    for answer in answers:
        for name in ("normals", "albedo", "uncertainty", "flags"):
            assert getattr(answer, name).tobytes() == getattr(expected, name).tobytes(), name


@pytest.mark.parametrize(("gray", "bits", "compiled"), [("mean", None, False), ("per-channel", 16, True)])
def test_any_tiling_and_any_number_of_threads_gives_the_same_bytes(method, gray, bits, compiled, monkeypatch):
    smaller_blocks(monkeypatch, method, compiled=compiled)
    capture = trial(method, 12, 42, many=16, max_tilt=1.2, noise=0.01, steepness=2.0, bits=bits, tint=gray != "mean")
    assert_tiling_changes_no_byte(method, capture, gray)


@pytest.mark.parametrize(("gray", "bits"), [("mean", 16), ("per-channel", None)])
def test_tiling_changes_no_byte_with_the_other_kinds_of_samples(gray, bits, monkeypatch):
    """How samples wait between reads does not depend on the method; the one of all that is soonest done will do."""
    smaller_blocks(monkeypatch, LeastSquares, compiled=False)
    capture, _ = hilly(spiral(12, max_tilt=1.2), 42, noise=0.01, steepness=2.0, bits=bits, tint=gray != "mean")
    assert_tiling_changes_no_byte(LeastSquares, capture, gray)
