import time
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier, Event

import numpy as np
import pytest
import scipy.io
from hypothesis import given
from hypothesis import strategies as st

from psstereo.errors import OptionError
from psstereo.io.layout_writer import _for_each, numbers, sixteen_bits, whole_type
from psstereo.io.lp_file import write_lp
from psstereo.io.mat_file import write_mat
from psstereo.stack import MemoryStack
from psstereo.types import no_progress


def test_nothing_runs_any_more_when_a_failure_is_told():
    """A thread that is in the middle of its image is waited for; images behind it are not begun."""
    begun, ended, all_at_work = [], [], Barrier(3)

    def job(index):
        begun.append(index)
        all_at_work.wait(timeout=60)
        if index == 0:
            raise ValueError("first")
        time.sleep(0.1)  # so that the failure is known before any thread looks for its next image
        ended.append(index)

    with ThreadPoolExecutor(3) as pool:
        with pytest.raises(ValueError, match="first"):
            _for_each(50, job, pool.map, no_progress)
        assert sorted(begun) == sorted([0, *ended])
    assert sorted(begun) == [0, 1, 2]


def test_nothing_runs_any_more_after_an_interruption():
    begun, ended, interrupted = [], [], Event()

    def job(index):
        begun.append(index)
        if index > 0:
            assert interrupted.wait(timeout=60)
            time.sleep(0.1)
        ended.append(index)

    def interrupt(_stage, _done, _total):
        interrupted.set()
        raise KeyboardInterrupt

    with ThreadPoolExecutor(3) as pool:
        with pytest.raises(KeyboardInterrupt):
            _for_each(50, job, pool.map, interrupt)
        assert sorted(begun) == sorted(ended)
    assert len(begun) < 50


def test_the_first_of_several_failures_is_told():
    """The first by number, that is, though the others failed before it."""
    all_at_work, failed = Barrier(3), [Event() for _ in range(4)]
    failed[3].set()

    def job(index):
        all_at_work.wait(timeout=60)
        assert failed[index + 1].wait(timeout=60)
        failed[index].set()
        raise ValueError(f"image {index}")

    with ThreadPoolExecutor(3) as pool, pytest.raises(ValueError, match="image 0"):
        _for_each(3, job, pool.map, no_progress)


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1))
def test_numbers_come_back_to_the_last_bit(values):
    assert [float(word) for word in numbers(np.array(values)).split(" ")] == values


@pytest.mark.parametrize("white", [1023, 4095, 16383, 60000, 65535])
def test_stretching_keeps_every_value_apart(white):
    values = np.arange(65536, dtype=np.uint16).reshape(1, 256, 256)
    stack = MemoryStack(values, white=white)
    stretched = whole_type(stack)(stack.frame(0)).ravel().astype(float)
    assert (np.rint(stretched[: white + 1] * white / 65535) == np.arange(white + 1)).all()
    assert (stretched[white:] == 65535).all()


def test_eight_bits_stay_or_are_multiplied():
    stack = MemoryStack(np.arange(256, dtype=np.uint8).reshape(1, 16, 16))
    frame = stack.frame(0)
    assert whole_type(stack)(frame) is frame
    assert (sixteen_bits(stack)(frame) == frame.astype(np.uint16) * 257).all()


def test_a_mat_file_has_no_date_in_it(tmp_path):
    values = {"a": np.arange(6.0).reshape(2, 3)}
    write_mat(tmp_path / "x.mat", values)
    assert b"Created" not in (tmp_path / "x.mat").read_bytes()
    np.testing.assert_array_equal(scipy.io.loadmat(tmp_path / "x.mat")["a"], values["a"])


def test_digits_of_an_lp_file(tmp_path):
    write_lp(tmp_path / "x.lp", ["a"], [[1, 2, 3]], digits=17)
    third = (tmp_path / "x.lp").read_text().split()[-1]
    assert float(third) == pytest.approx(3 / np.sqrt(14), rel=2e-16)
    for digits in (0, 18):
        with pytest.raises(OptionError, match="digits"):
            write_lp(tmp_path / "x.lp", ["a"], [[1, 2, 3]], digits=digits)
