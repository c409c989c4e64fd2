from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from psstereo.stack import (
    LINEAR,
    Conversion,
    ImageStack,
    MemoryStack,
    MemoryStore,
    PixelSet,
    Response,
    SpillStore,
    gather,
)

SHAPE = (11, 14)
MASK = np.random.default_rng(0).random(SHAPE) < 0.4
MASK[:2], MASK[:, -3:] = False, False
WEIGHTS = np.array([[0.2, 0.5, 0.3], [0.0, 1.0, 0.0]])


class Reversed(ImageStack):
    """Frames as OpenCV leaves them: B, G, R in memory, seen through a reversed view."""

    def __init__(self, images, **options):
        plain = MemoryStack(images, **options)
        self.shape, self.dtype, self.white = plain.shape, plain.dtype, plain.white
        self.saturates, self.names = plain.saturates, plain.names
        self._images = np.ascontiguousarray(images[..., ::-1])

    def frame(self, index):
        return self._images[index][..., ::-1]


def images_of(dtype, channels=3, count=5):
    rng = np.random.default_rng(1)
    if np.dtype(dtype).kind == "f":
        return rng.uniform(0, 1, (count, *SHAPE, channels)).astype(dtype)
    return rng.integers(0, np.iinfo(dtype).max, (count, *SHAPE, channels), dtype, endpoint=True)


def run(stack, conversion, kind=MemoryStore, over=map):
    pixels = PixelSet.from_mask(MASK)
    shape = (conversion.factors.shape[1], len(stack), len(pixels))
    dtype = np.dtype(np.float64 if stack.dtype == np.float64 else np.float32)
    with kind(shape, dtype) as store:
        largest = gather(stack, pixels, conversion, store, over=over)
        return store.read(0, len(pixels)).copy(), largest


def loop(images, white, factors, *, response=LINEAR, dark=None, valid=None, clip=None):
    """The same, pixel by pixel, with the formulas of the standards."""
    out = np.zeros((factors.shape[1], len(images), int(MASK.sum())))
    for i in range(len(images)):
        for p, (y, x) in enumerate(np.argwhere(MASK)):
            v = images[i, y, x].astype(float) / white
            if response.name == "srgb":
                light = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in np.maximum(v, 0)]
            else:
                light = [c**response.exponent if response.name == "gamma" else c for c in v]
            light = np.array(light) * white - (0.0 if dark is None else dark[y, x])
            for k in range(factors.shape[1]):
                value = factors[i, k] @ light
                value = value if clip is None else min(value, clip)
                used = images[i, y, x][factors[i, k] != 0]
                out[k, i, p] = np.nan if valid and ((used >= valid[1]) | (used <= valid[0])).any() else value
    return out


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64])
@pytest.mark.parametrize("layout", [MemoryStack, Reversed])
@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("valid", [None, (0.1, 0.9), (-np.inf, 0.7)])
@pytest.mark.parametrize("response", [LINEAR, Response("srgb"), Response("gamma", 2.2)], ids=lambda r: r.name)
def test_against_a_loop(dtype, layout, dark, valid, response):
    images = images_of(dtype)
    stack = layout(images)
    strengths = np.random.default_rng(2).uniform(0.2, 2.0, (5, 3))
    conversion = Conversion(
        factors=WEIGHTS[None] / (strengths[:, None] * stack.white),
        response=response,
        dark=np.random.default_rng(3).uniform(0, 0.2, (*SHAPE, 3)) * stack.white if dark else None,
        valid=None if valid is None else (valid[0] * stack.white, valid[1] * stack.white),
        clip=0.8 if dark else None,
    )
    found, largest = run(stack, conversion)
    options = {name: getattr(conversion, name) for name in ("response", "dark", "valid", "clip")}
    expected = loop(images, stack.white, conversion.factors, **options)
    # float32: three products and sums of numbers up to 5, each rounded to 2⁻²⁴
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14 if dtype is np.float64 else 3e-6)
    assert np.isnan(expected).any() == (valid is not None)
    np.testing.assert_array_equal(largest, np.nanmax(found, axis=(0, 2)))


@pytest.mark.parametrize("channels", [1, 2, 3, 4, 7])
def test_any_number_of_channels(channels):
    images = images_of(np.uint16, channels)
    weights = np.random.default_rng(4).uniform(0.1, 1, (5, channels, channels)) / 65535
    found, _ = run(MemoryStack(images), Conversion(factors=weights))
    expected = np.einsum("mkc,mpc->kmp", weights, images[:, MASK].astype(float))
    np.testing.assert_allclose(found, expected, rtol=3e-6)


@pytest.mark.parametrize("dtype", [np.uint16, np.float64])
@pytest.mark.parametrize("workers", [1, 3])
def test_a_temporary_file_holds_the_same_bytes(dtype, workers):
    conversion = Conversion(factors=np.broadcast_to(np.eye(3), (5, 3, 3)), valid=(-np.inf, 60000.0))
    stack = Reversed(images_of(dtype))
    plain, _ = run(stack, conversion)
    with ThreadPoolExecutor(workers) as pool:
        for kind in (MemoryStore, SpillStore):
            again, _ = run(stack, conversion, kind, pool.map)
            assert again.tobytes() == plain.tobytes()


def test_a_dark_image_of_integers_does_not_wrap_round():
    images = np.full((1, *SHAPE, 1), 5, np.uint8)
    found, _ = run(MemoryStack(images), Conversion(factors=np.ones((1, 1, 1)), dark=np.full((*SHAPE, 1), 7, np.uint8)))
    assert (found == -2.0).all()


@pytest.mark.parametrize("bad", [np.nan, np.inf])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_channel_that_is_not_used_spoils_nothing(bad, dtype):
    images = images_of(dtype)
    clean, _ = run(MemoryStack(images), Conversion(factors=np.broadcast_to(WEIGHTS, (5, 2, 3))))
    images[:, ::2, :, 0] = bad
    found, _ = run(MemoryStack(images), Conversion(factors=np.broadcast_to(WEIGHTS, (5, 2, 3))))
    hit = np.isin(np.argwhere(MASK)[:, 0] % 2, 0)
    assert not np.isfinite(found[0][:, hit]).any()
    np.testing.assert_allclose(found[0][:, ~hit], clean[0][:, ~hit], rtol=1e-6)
    np.testing.assert_allclose(found[1], clean[1], rtol=1e-6)


def test_the_images_are_left_alone():
    for dtype in (np.uint16, np.float32, np.float64):
        images = images_of(dtype)
        images.setflags(write=False)
        run(MemoryStack(images), Conversion(factors=np.ones((5, 1, 3)), valid=(0.1, 0.5), clip=0.3))


def test_an_image_without_usable_values_has_no_largest():
    images = images_of(np.float64)
    images[2] = np.nan
    _, largest = run(MemoryStack(images), Conversion(factors=np.ones((5, 1, 3))))
    np.testing.assert_array_equal(np.isnan(largest), [False, False, True, False, False])


def test_pixels_are_listed_row_by_row_and_put_back():
    pixels = PixelSet.from_mask(MASK)
    assert len(pixels) == MASK.sum()
    np.testing.assert_array_equal(np.unravel_index(pixels.indices, SHAPE), np.nonzero(MASK))
    assert pixels.box[0].start >= 2
    assert pixels.box[1].stop <= SHAPE[1] - 3
    inside = MASK[pixels.box]
    np.testing.assert_array_equal(pixels.in_box, np.flatnonzero(inside))
    values = np.arange(2.0 * len(pixels)).reshape(-1, 2)
    image = pixels.scatter(values)
    np.testing.assert_array_equal(image[MASK], values)
    assert np.isnan(image[~MASK]).all()
    assert pixels.scatter(np.ones(len(pixels), np.uint16), 7)[~MASK].tolist() == [7] * int((~MASK).sum())
