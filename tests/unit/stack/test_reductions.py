from concurrent.futures import ThreadPoolExecutor

import numpy as np

from psstereo.stack import MemoryStack
from psstereo.stack.reductions import Brightest, feed_all


def test_the_brightest_value_of_every_pixel():
    images = np.random.default_rng(0).normal(size=(9, 20, 30, 3))
    images[3, 4, 5] = np.nan
    expected = np.nanmax(images, axis=(0, 3))
    seen = []
    for workers in (1, 3):
        with ThreadPoolExecutor(workers) as pool:
            found = feed_all(MemoryStack(images), Brightest(), over=pool.map, progress=lambda *step: seen.append(step))
        np.testing.assert_array_equal(found, expected)
    assert seen[:9] == [("looking at images", i, 9) for i in range(1, 10)]


def test_nothing_seen_yet():
    assert Brightest().value.size == 0
