import numpy as np
import pytest

from psstereo.capture import Capture
from psstereo.errors import InputError
from psstereo.io.reading_options import in_linear_light
from psstereo.lights import Rig
from psstereo.normals import LeastSquares, estimate_normals
from psstereo.stack import Conversion, FlatField, ImageStack, MemoryStack, MemoryStore, PixelSet, Response, gather
from psstereo.stack.flat import flat_gain
from psstereo_synth import checker, hills, lambertian_capture, spiral

SHAPE = (9, 12)
MASK = np.random.default_rng(0).random(SHAPE) < 0.5


class Turned(ImageStack):
    """Frames as OpenCV leaves them: B, G, R in memory."""

    def __init__(self, images):
        plain = MemoryStack(images)
        self.shape, self.dtype, self.white = plain.shape, plain.dtype, plain.white
        self.saturates, self.names = plain.saturates, plain.names
        self._images = np.ascontiguousarray(images[..., ::-1])

    def frame(self, index):
        return self._images[index][..., ::-1]


def gathered(stack, **how):
    pixels = PixelSet.from_mask(MASK)
    factors = np.full((len(stack), 1, 3), 1 / 3) * np.arange(1, len(stack) + 1)[:, None, None]
    with MemoryStore((1, len(stack), len(pixels)), np.dtype(np.float32)) as store:
        gather(stack, pixels, Conversion(factors=factors, **how), store)
        return store.read(0, len(pixels))[0].copy()


@pytest.mark.parametrize("kind", [MemoryStack, Turned])
@pytest.mark.parametrize("per_light", [False, True])
@pytest.mark.parametrize("with_dark", [False, True])
@pytest.mark.parametrize("response", [Response(), Response("gamma", 2.2)])
def test_samples_are_those_of_the_formula(kind, per_light, with_dark, response):
    rng = np.random.default_rng(1)
    images = rng.integers(0, 255, (4, *SHAPE, 3), np.uint8)
    gain = rng.uniform(0.5, 2, (4, *SHAPE, 3) if per_light else (*SHAPE, 3))
    dark = rng.uniform(0, 30, (*SHAPE, 3)) if with_dark else None
    found = gathered(kind(images), response=response, dark=dark, flat=FlatField(gain))
    light = (images / 255.0) ** response.exponent * 255.0 - (0 if dark is None else dark)
    wanted = (light * gain).mean(axis=3)[:, MASK] * np.arange(1, 5)[:, None]
    np.testing.assert_allclose(found, wanted, rtol=2e-6, atol=2e-4)


def test_a_dead_pixel_is_nan_in_its_channel_alone():
    images = np.full((3, *SHAPE, 3), 100, np.uint8)
    gain = np.ones((*SHAPE, 3))
    row, column = np.argwhere(MASK)[3]
    gain[row, column, 1] = np.nan
    pixels = PixelSet.from_mask(MASK)
    with MemoryStore((2, 3, len(pixels)), np.dtype(np.float32)) as store:
        factors = np.broadcast_to(np.array([[1.0, 0, 0], [0, 1.0, 0]]), (3, 2, 3))
        gather(MemoryStack(images), pixels, Conversion(factors=factors, flat=FlatField(gain)), store)
        samples = store.read(0, len(pixels))
        assert np.isfinite(samples[0]).all()
        assert np.argwhere(np.isnan(samples[1])).tolist() == [[i, 3] for i in range(3)]


def test_a_vignette_is_removed():
    # cos⁴ to a quarter of the light in the corners, and unequal pixels of 2 %
    surface = hills(64, 64)
    made, truth = lambertian_capture(surface, checker((64, 64)), spiral(8), bits=None)
    rows, columns = np.indices((64, 64)) - 31.5
    fall = np.cos(np.arctan(np.hypot(rows, columns) / 45.0)) ** 4
    fall = fall * (1 + 0.02 * np.random.default_rng(2).standard_normal((64, 64)))
    images = np.stack([made.stack.frame(i) for i in range(len(made.stack))]).astype(np.float64)
    seen = images * fall[..., None]

    def error(capture):
        found = estimate_normals(in_linear_light(capture), LeastSquares()).normals
        across = np.linalg.norm(np.cross(found, truth.normals), axis=2)
        return np.degrees(np.nanmean(np.arctan2(across, (found * truth.normals).sum(axis=2))))

    rig = made.rig
    flat = FlatField(flat_gain(np.broadcast_to(fall[..., None], seen.shape[1:])))
    # A vignette alone changes the albedo, and normals only where the gain differs from light to light
    lamps = np.stack([fall ** (0.2 * i) / np.median(fall ** (0.2 * i)) for i in range(len(images))])
    without = Capture(stack=MemoryStack(images * lamps[..., None]), rig=rig, mask=made.mask)
    each = FlatField(np.stack([flat_gain(one[..., None]) for one in lamps]))
    corrected = Capture(stack=MemoryStack(images * lamps[..., None]), rig=rig, mask=made.mask, flat=each)
    assert error(corrected) < 0.05 * error(without)
    plain = in_linear_light(Capture(stack=MemoryStack(seen), rig=rig, mask=made.mask, flat=flat))
    ideal = Capture(stack=MemoryStack(images), rig=rig, mask=made.mask)
    plain, ideal = (estimate_normals(one, LeastSquares()) for one in (plain, ideal))
    ratio = (plain.albedo / ideal.albedo)[np.isfinite(ideal.albedo)]
    np.testing.assert_allclose(ratio, np.median(ratio), rtol=1e-5)


@pytest.mark.parametrize(
    "gain", [np.ones((3, 4)), np.zeros((3, 4, 1)), np.full((3, 4, 1), np.nan), -np.ones((3, 4, 1))]
)
def test_hostile_gains_are_refused(gain):
    with pytest.raises(InputError, match="flat field"):
        FlatField(gain)


def test_gains_of_another_size_are_refused():
    with pytest.raises(InputError, match="flat field has the shape"):
        Capture(stack=MemoryStack(np.ones((3, 4, 5))), rig=Rig.distant(np.eye(3)), flat=FlatField(np.ones((4, 6, 1))))


def test_a_black_frame_is_no_flat_frame():
    with pytest.raises(InputError, match="shows light in 0%"):
        flat_gain(np.zeros((4, 5, 3)))


def test_linear_frame_of_a_capture():
    images = np.full((3, 4, 5, 1), 100, np.uint8)
    capture = Capture(
        stack=MemoryStack(images),
        rig=Rig.distant(np.eye(3)),
        dark=np.full((4, 5, 1), 20.0),
        flat=FlatField(np.full((4, 5, 1), 2.0)),
    )
    np.testing.assert_array_equal(capture.linear(1), np.full((4, 5, 1), 160.0, np.float32))
