import numpy as np
import pytest

from psstereo.capture import Capture
from psstereo.errors import InputError, OptionError, RigError
from psstereo.flags import Flag
from psstereo.lights import Rig
from psstereo.normals import GATES, LeastSquares, estimate_normals
from psstereo.results import Outcome
from psstereo.stack import MemoryStack
from psstereo_synth import checker, hills, lambertian_capture, ring, spiral


def hilly(lights=8, *, size=24, **options):
    surface = hills(size, size, steepness=0.6)
    return lambertian_capture(surface, checker((size, size)), spiral(lights, max_tilt=0.6), bits=None, **options)[0]


def changed(capture, images):
    return Capture(stack=MemoryStack(images), rig=capture.rig, mask=capture.mask)


@pytest.mark.parametrize("level", [0.0, -1.0])
def test_a_black_image_is_named(level):
    capture = hilly()
    images = capture.stack.read()
    images[4][capture.mask] = level
    with pytest.raises(InputError, match="image 5 is black everywhere under the mask") as caught:
        estimate_normals(changed(capture, images))
    assert "more" not in caught.value.given
    images[6] = level
    with pytest.raises(InputError, match=r"image 5 is black .* and 1 more"):
        estimate_normals(changed(capture, images))


@pytest.mark.parametrize("dtype", [np.uint8, np.float32])
def test_all_black(dtype):
    capture = hilly()
    with pytest.raises(InputError, match="All images are black"):
        estimate_normals(changed(capture, np.zeros(capture.stack.shape, dtype)))


def test_nothing_but_nan_cannot_be_solved():
    capture = hilly()
    with pytest.raises(InputError, match="No pixel under the mask could be solved"):
        estimate_normals(changed(capture, np.full(capture.stack.shape, np.nan)))


def test_an_image_of_nan_only_is_left_out():
    capture = hilly()
    images = capture.stack.read()
    images[3] = np.nan
    kept = np.arange(8) != 3
    expected = estimate_normals(
        Capture(stack=MemoryStack(images[kept]), rig=capture.rig.select(kept), mask=capture.mask)
    )
    result = estimate_normals(changed(capture, images))
    np.testing.assert_allclose(result.normals, expected.normals, rtol=0, atol=1e-13)
    assert ((result.flags[capture.mask] & Flag.UNUSABLE_SAMPLE) != 0).all()


@pytest.mark.parametrize(
    "weights",
    [
        np.ones((8, 24, 23)),
        np.ones((7, 24, 24)),
        np.ones((24, 24)),
        np.full((8, 24, 24), -1.0),
        np.where(np.arange(8 * 24 * 24).reshape(8, 24, 24) == 99, np.nan, 1.0),
        np.where(np.arange(8 * 24 * 24).reshape(8, 24, 24) == 99, np.inf, 1.0),
    ],
)
def test_weights_that_mean_nothing_are_refused(weights):
    with pytest.raises(InputError, match="The weights have the shape"):
        estimate_normals(hilly(), weights=weights)


@pytest.mark.parametrize("kind", [bool, np.int64, np.float32])
def test_weights_of_any_type(kind):
    capture = hilly(noise=0.01)
    weights = np.random.default_rng(0).integers(0, 2, (8, 24, 24)).astype(kind)
    weights[:4] = 1
    first = estimate_normals(capture, weights=weights)
    second = estimate_normals(capture, weights=weights.astype(float))
    assert first.normals.tobytes() == second.normals.tobytes()


def test_strengths_of_other_channels_are_refused():
    images = np.ones((4, 5, 5, 3))
    with pytest.raises(RigError, match="Light 1 has strengths for 2 channels; the images, 3"):
        estimate_normals(Capture(stack=MemoryStack(images), rig=Rig.distant(spiral(4), np.ones((4, 2)))))


@pytest.mark.parametrize("valid", [(0.9, 0.1), (0.5, 0.5), (np.nan, 1.0)])
def test_a_valid_range_that_is_none_is_refused(valid):
    with pytest.raises(InputError, match="valid range"):
        estimate_normals(hilly(), valid_range=valid)


def test_unknown_gray_is_refused():
    with pytest.raises(OptionError, match="gray value 'grey'"):
        estimate_normals(hilly(), gray="grey")


def test_strengths_divide_what_they_multiply():
    capture = hilly()
    images, factors = capture.stack.read(), np.random.default_rng(1).uniform(1e-3, 1e3, 8)
    rig = Rig.distant(capture.rig.directions, factors * 1000)
    lit = Capture(stack=MemoryStack(images * factors[:, None, None, None]), rig=rig, mask=capture.mask)
    np.testing.assert_allclose(estimate_normals(lit).normals, estimate_normals(capture).normals, rtol=0, atol=1e-13)


def test_clip_bounds_brightness_over_strength():
    """As if the images had been cut before."""
    capture = hilly()
    images = capture.stack.read()
    bound = float(np.median(images[:, capture.mask]))
    found = estimate_normals(capture, clip=bound / 1000)  # the strengths
    expected = estimate_normals(changed(capture, np.minimum(images, bound)))
    np.testing.assert_allclose(found.normals, expected.normals, rtol=0, atol=1e-13)
    assert np.abs(found.normals - estimate_normals(capture).normals)[capture.mask].max() > 0.01


def test_the_valid_range_leaves_raw_values_out():
    capture = hilly()
    images = capture.stack.read()
    low, high = np.quantile(images[:, capture.mask], [0.1, 0.8])
    result = estimate_normals(capture, valid_range=(low, high))
    out = (images <= low) | (images >= high)
    expected = estimate_normals(changed(capture, np.where(out, np.nan, images)))
    assert result.normals.tobytes() == expected.normals.tobytes()
    assert (result.flags & Flag.UNUSABLE_SAMPLE).any()
    assert result.facts["valid_range"] == pytest.approx([low, high])
    assert result.outcome is (Outcome.PARTIAL if result.facts["pixels_lost"] else Outcome.SOLVED)


def test_a_dark_image_is_taken_off():
    capture = hilly()
    images = capture.stack.read()
    dark = np.random.default_rng(2).uniform(0, 0.3, images.shape[1:])
    lit = Capture(stack=MemoryStack(images + dark), rig=capture.rig, mask=capture.mask, dark=dark)
    np.testing.assert_allclose(estimate_normals(lit).normals, estimate_normals(capture).normals, rtol=0, atol=1e-12)


def test_lost_pixels_are_counted():
    capture = hilly()
    images = capture.stack.read()
    images[:, 10:12, 10:14] = 0.0
    result = estimate_normals(changed(capture, images))
    assert result.facts["pixels_lost"] == 8
    assert result.outcome is Outcome.PARTIAL
    assert ((result.flags[10:12, 10:14] & Flag.NO_SIGNAL) != 0).all()


def test_facts_are_true():
    capture = hilly()
    facts = estimate_normals(capture, LeastSquares(gate=GATES["shadow"]), gray="bt601", clip=9.0).facts
    assert facts["solver"] == "least-squares"
    assert facts["gate"] == "shadow"
    assert facts["gray"] == "bt601"
    assert facts["clip"] == 9.0
    assert facts["valid_range"] is None
    assert facts["lights"] == 8
    assert facts["pixels"] == capture.mask.sum()
    assert facts["light_condition"] == pytest.approx(np.linalg.cond(capture.rig.directions))
    assert facts["sample_bytes"] == 8 * 8 * capture.mask.sum()


def test_the_input_is_left_alone():
    capture = hilly()
    images = capture.stack.read()
    images.setflags(write=False)
    mask = capture.mask.copy()
    mask.setflags(write=False)
    estimate_normals(Capture(stack=MemoryStack(images), rig=Rig.distant(spiral(8, max_tilt=0.6)), mask=mask))


def test_one_channel_black_everywhere():
    images = np.zeros((5, 4, 4, 3))
    normal = np.array([0.1, 0.2, np.sqrt(0.95)])
    images[..., :2] = (ring(5) @ normal)[:, None, None, None] * [0.5, 0.25]
    result = estimate_normals(Capture(stack=MemoryStack(images), rig=Rig.distant(ring(5))), gray="per-channel")
    np.testing.assert_allclose(result.normals, np.broadcast_to(normal, (4, 4, 3)), rtol=0, atol=1e-14)
    np.testing.assert_allclose(result.albedo[..., :2], np.broadcast_to([0.5, 0.25], (4, 4, 2)), rtol=1e-14)
    assert np.isnan(result.albedo[..., 2]).all()
