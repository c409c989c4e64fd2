import pickle
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import numpy as np

from psstereo.scratch import Scratch


def test_the_same_request_gives_the_same_array():
    scratch = Scratch()
    first = scratch.array("a", (3, 4), np.float64)
    assert first.flags.c_contiguous
    assert scratch.array("a", (3, 4), np.float64) is first
    assert not np.shares_memory(first, scratch.array("b", (3, 4), np.float64))


def test_another_shape_or_type_gives_another_array():
    scratch = Scratch()
    first = scratch.array("a", (3, 4), np.float64)
    for shape, dtype in [((4, 3), np.float64), ((4, 3), np.float32), ((2,), np.bool_)]:
        other = scratch.array("a", shape, dtype)
        assert other.shape == shape
        assert other.dtype == dtype
        assert not np.shares_memory(first, other)


def test_a_copy_is_a_copy():
    scratch = Scratch()
    source = np.arange(6, dtype=np.float32).reshape(2, 3)[:, ::2]
    out = scratch.copy("a", source)
    np.testing.assert_array_equal(out, source)
    assert out.dtype == np.float64
    out[:] = 9
    assert source[0, 0] == 0


def test_threads_do_not_share():
    scratch, meet = Scratch(), Barrier(4)

    def use(value):
        mine = scratch.array("a", (100,), np.float64)
        mine[:] = value
        meet.wait(timeout=10)  # all have written now
        return bool((mine == value).all()) and scratch.array("a", (100,), np.float64) is mine

    with ThreadPoolExecutor(4) as pool:
        assert all(pool.map(use, range(4)))


def test_it_pickles_without_its_arrays():
    scratch = Scratch()
    scratch.array("a", (1000, 1000), np.float64)
    data = pickle.dumps(scratch)
    assert len(data) < 1000
    assert pickle.loads(data).array("a", (2,), np.int64).shape == (2,)
