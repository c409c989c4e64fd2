import numpy as np
import pytest

from psstereo.stack import Conversion, MemoryStack, MemoryStore, PixelSet, gather


@pytest.mark.parametrize("values", [1, 3])
def test_the_share_below_the_dark_level_is_counted(values):
    rng = np.random.default_rng(0)
    images = rng.uniform(0.5, 1.0, (4, 10, 10, 3))
    dark = np.full((10, 10, 3), 0.1)
    images[2, :4] = 0.05  # 40 of 100 pixels lie clearly below
    images[3, :4] = 0.095  # within a fiftieth of the brightest: noise
    pixels = PixelSet.from_mask(np.ones((10, 10), np.bool_))
    below = np.full(4, np.nan)
    factors = np.full((4, 1, 3), 1 / 3) if values == 1 else np.broadcast_to(np.eye(3), (4, 3, 3))
    with MemoryStore((values, 4, 100), np.dtype(np.float64)) as store:
        largest = gather(MemoryStack(images), pixels, Conversion(factors=factors, dark=dark), store, below=below)
        again = gather(MemoryStack(images), pixels, Conversion(factors=factors, dark=dark), store)
    np.testing.assert_allclose(below, [0.0, 0.0, 0.4, 0.0])
    np.testing.assert_array_equal(largest, again)
