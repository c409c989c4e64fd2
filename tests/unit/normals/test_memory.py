"""The bound on memory, measured rather than predicted."""

import tracemalloc
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
import pytest

from psstereo.capture import Capture
from psstereo.errors import InputError
from psstereo.lights import Rig
from psstereo.normals import LeastSquares, Robust, Samples, estimate_normals
from psstereo.normals.memory import BLOCK, plan_memory
from psstereo.stack import ImageStack, MemoryStack, PixelSet, Response
from psstereo_synth import hills, spiral

HEIGHT, WIDTH, LIGHTS = 512, 612, 96


class Sun(ImageStack):
    """Frames that are made when they are asked for, as a decoder would, from shading that nobody counts."""

    def __init__(self, shading, channels=1):
        self.shading = shading
        self.shape = (*shading.shape, channels)
        self.dtype = np.dtype(np.uint16)
        self.white = 65535.0
        self.saturates = True
        self.names = tuple(f"{i}" for i in range(len(shading)))

    def frame(self, index):
        return np.repeat(self.shading[index][..., None], self.shape[3], axis=2)


class Surface(NamedTuple):
    """The mask of hills, and their shading under each light, 16 bits, (m, h, w)."""

    mask: np.ndarray
    shading: np.ndarray


@pytest.fixture(scope="module")
def surface():
    found = hills(WIDTH, HEIGHT, steepness=1.0)
    normals, shading = found.normals.astype(np.float32), np.zeros((LIGHTS, HEIGHT, WIDTH), np.uint16)
    for image, direction in zip(shading, spiral(LIGHTS).astype(np.float32), strict=True):
        image[:] = np.maximum(normals @ direction, 0) * (0.8 * 65535)
    return Surface(found.mask, shading)


def capture_of(surface, channels=1, **options):
    return Capture(stack=Sun(surface.shading, channels), rig=Rig.distant(spiral(LIGHTS)), mask=surface.mask, **options)


def peak(capture, **options):
    """Result and largest memory that Python and NumPy held beyond what they held before."""
    workers = options.get("workers", 1)
    estimate_normals(small(), options.get("solver"), workers=workers)  # imports and their caches
    load_kernels()
    with ThreadPoolExecutor(workers) as pool:
        tracemalloc.start()
        try:
            result = estimate_normals(capture, over=pool.map if workers > 1 else map, **options)
            return result, tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()


def small():
    return Capture(stack=MemoryStack(np.ones((4, 3, 3), np.uint16) * 99), rig=Rig.distant(spiral(4)))


def load_kernels():
    """Compile or load the default solver's machine code, which is no part of the bound."""
    rig = Rig.distant(spiral(LIGHTS))
    robust = Robust()
    values = np.ones((LIGHTS, 2), np.float32)
    for weights in (None, np.ones((LIGHTS, 2))):
        robust.solve(robust.prepare(rig, 10**7), Samples(values, weights, True, True))


@pytest.fixture(scope="module")
def unbounded(surface):
    return peak(capture_of(surface))


def same(first, second):
    return all(
        getattr(first, name).tobytes() == getattr(second, name).tobytes()
        for name in ("normals", "albedo", "uncertainty", "flags")
    )


def test_thirty_megabytes_are_thirty_megabytes(surface, unbounded):
    expected, _ = unbounded
    result, held = peak(capture_of(surface), max_memory=30_000_000, workers=2)
    assert result.facts["samples_in"] == "temporary file"
    assert held < 30_000_000
    assert same(result, expected)


@pytest.mark.parametrize(("megabytes", "workers"), [(50, 3), (60, 1)])
def test_larger_tiles_keep_to_their_bound_too(surface, unbounded, megabytes, workers):
    result, held = peak(capture_of(surface), max_memory=megabytes * 1_000_000, workers=workers)
    assert result.facts["samples_in"] == "temporary file"
    assert held < megabytes * 1_000_000
    assert same(result, unbounded[0])


def test_without_a_bound_it_is_the_samples_and_little_more(surface, unbounded):
    result, held = unbounded
    assert result.facts["samples_in"] == "memory"
    samples = LIGHTS * int(surface.mask.sum()) * 4
    assert result.facts["sample_bytes"] == samples
    assert held < 1.3 * samples


def test_least_squares_takes_no_more(surface):
    result, held = peak(capture_of(surface), solver=LeastSquares())
    assert held < 1.3 * result.facts["sample_bytes"]


@pytest.mark.parametrize(
    "extra", ["dark", "response", "colour", "weights", "covariance", "mask", "coloured covariance"]
)
def test_the_bound_holds_with_everything_on(surface, extra):
    limit = 60_000_000
    dark = np.full((HEIGHT, WIDTH, 1), 3.0) if extra == "dark" else None
    response = Response("srgb") if extra == "response" else Response()
    channels = 3 if extra.startswith("colour") else 1
    weights = np.broadcast_to(np.float32(1.0), (LIGHTS, HEIGHT, WIDTH)).copy() if extra == "weights" else None
    capture = capture_of(surface, channels, dark=dark, response=response)
    options = {"gray": "per-channel"} if extra.startswith("colour") else {"weights": weights}
    if extra == "mask":
        options["observation_mask"] = np.broadcast_to(True, (LIGHTS, HEIGHT, WIDTH))
    options["covariance"] = extra.endswith("covariance")
    result, held = peak(capture, max_memory=limit, workers=2, **options)
    assert result.facts["samples_in"] == "temporary file"
    assert held < limit


@pytest.mark.parametrize("workers", [1, 2])
def test_the_bound_holds_with_verdicts(surface, workers):
    """They are one byte an observation of the whole image, and fill their images at once."""
    limit = LIGHTS * HEIGHT * WIDTH + 35_000_000
    result, held = peak(capture_of(surface), max_memory=limit, workers=workers, verdicts=True)
    assert result.facts["samples_in"] == "temporary file"
    assert result.verdicts.nbytes == LIGHTS * HEIGHT * WIDTH
    assert held < limit
    with pytest.raises(InputError, match="memory limit is 30 MB"):
        estimate_normals(capture_of(surface), max_memory=30_000_000, verdicts=True)


def test_a_bound_that_cannot_be_met_is_refused(surface):
    with pytest.raises(InputError, match="memory limit is 5 MB") as caught:
        estimate_normals(capture_of(surface), max_memory=5_000_000)
    assert "612 × 512 pixels under 96 lights take" in caught.value.needed


def test_the_least_that_is_asked_for_is_enough(surface):
    """The figure in the refusal, given as the bound, is accepted; a megabyte less is not."""
    stack, pixels = capture_of(surface).stack, PixelSet.from_mask(surface.mask)
    with pytest.raises(InputError) as caught:
        plan_memory(stack, pixels, 1, 1, 1)
    megabytes = int(caught.value.needed.split(" take ")[1].split()[0])
    assert plan_memory(stack, pixels, 1, (megabytes + 1) * 1_000_000, 1).tile >= BLOCK
    with pytest.raises(InputError):
        plan_memory(stack, pixels, 1, (megabytes - 1) * 1_000_000, 1)


def test_more_memory_means_larger_tiles_of_whole_blocks(surface):
    stack, pixels = capture_of(surface).stack, PixelSet.from_mask(surface.mask)
    tiles = []
    for limit in (25_000_000, 40_000_000, 60_000_000):
        plan = plan_memory(stack, pixels, 1, limit, 1)
        assert not plan.in_memory
        assert plan.tile % BLOCK == 0
        tiles.append(plan.tile)
    assert tiles == sorted(set(tiles))
    assert plan_memory(stack, pixels, 1, 10**9, 1).in_memory
    assert plan_memory(stack, pixels, 1, None, 1).in_memory
