import numpy as np
import pytest

from psstereo.lights import Rig
from psstereo.plan.sample import SAMPLE_PIXELS, Sample, WatchedStack, sample_pixels
from psstereo.stack import MemoryStack


def disc(side):
    y, x = np.mgrid[:side, :side]
    return (x - side / 2) ** 2 + (y - side / 2) ** 2 < (0.45 * side) ** 2


def test_small_masks_are_taken_whole():
    mask = disc(60)
    found = sample_pixels(mask)
    assert (found.mask(mask.shape) == mask).all()
    assert len(found) == mask.sum()


def test_large_masks_give_full_blocks_spread_over_them():
    mask = disc(400)
    found = sample_pixels(mask)
    assert 0.8 * SAMPLE_PIXELS < len(found) <= SAMPLE_PIXELS
    assert mask[tuple(found.pixels.T)].all()
    assert np.abs(found.pixels.mean(axis=0) - 200).max() < 20
    assert np.ptp(found.pixels, axis=0).min() > 250
    # Blocks of 16 lack neighbours at two of their four sides only.
    assert (found.neighbours >= 0).mean() > 0.85


@pytest.mark.parametrize("share", [0.1, 0.9])
def test_neighbours_are_neighbours(share):
    mask = np.random.default_rng(3).random((200, 170)) < share
    found = sample_pixels(mask)
    for column, step in ((0, (0, 1)), (1, (1, 0))):
        has = found.neighbours[:, column] >= 0
        apart = found.pixels[found.neighbours[has, column]] - found.pixels[has]
        assert (apart == step).all()
    assert len(np.unique(found.pixels, axis=0)) == len(found) <= SAMPLE_PIXELS


def test_one_pixel():
    mask = np.zeros((5, 7), np.bool_)
    mask[4, 6] = True
    found = sample_pixels(mask)
    assert found.pixels.tolist() == [[4, 6]]
    assert found.neighbours.tolist() == [[-1, -1]]


def test_raw_values_are_picked_as_images_go_by():
    images = np.random.default_rng(0).integers(0, 255, (3, 20, 30, 3), dtype=np.uint8)
    where = sample_pixels(np.ones((20, 30), np.bool_))
    stack = WatchedStack(MemoryStack(images), where)
    for i in (2, 0, 1):
        assert (stack.frame(i) == images[i]).all()
    assert (stack.raw == images[:, where.pixels[:, 0], where.pixels[:, 1]]).all()
    assert (stack.seconds > 0).all()


def test_the_fit_is_exact_on_matte_samples():
    rig = Rig.distant([[0, 0, 1], [0.5, 0, 1], [0, 0.5, 1], [-0.4, -0.3, 1]])
    normal = np.array([0.1, -0.2, 1.0]) / np.sqrt(1.05)
    mask = np.ones((4, 5), np.bool_)
    values = np.repeat(0.7 * rig.directions @ normal, mask.sum()).reshape(4, -1)
    sample = Sample.fitted(values, sample_pixels(mask), MemoryStack(np.zeros((4, 4, 5), np.uint16)), rig)
    np.testing.assert_allclose(sample.normals, np.broadcast_to(normal, (20, 3)), atol=1e-12)
    np.testing.assert_allclose(sample.albedo, 0.7, rtol=1e-12)
    np.testing.assert_allclose(sample.residual, 0, atol=1e-12)
    assert (sample.bits, sample.white, len(sample)) == (16, 65535, 20)
