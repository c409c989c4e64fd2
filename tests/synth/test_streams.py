"""Random numbers by purpose: the same again, and unrelated between purposes."""

import numpy as np
import pytest

from psstereo.errors import OptionError
from psstereo_synth.streams import Stream, generator


def test_the_same_purpose_gives_the_same_numbers():
    first = generator(3, Stream.FAULT, 1, 2).random(100)
    np.testing.assert_array_equal(generator(3, Stream.FAULT, 1, 2).random(100), first)
    np.testing.assert_array_equal(generator(np.int64(3), Stream.FAULT, np.int32(1), 2).random(100), first)


def test_other_purposes_give_unrelated_numbers():
    keys = [(0, Stream.FAULT, 1, 2), (1, Stream.FAULT, 1, 2), (0, Stream.EXPOSURE, 1, 2), (0, Stream.FAULT, 2, 1)]
    keys += [(0, Stream.FAULT, 1), (0, Stream.FAULT, 1, 2, 0), (0, Stream.PIXELS), (2**40, Stream.FAULT, 1, 2)]
    draws = np.stack([generator(*key).standard_normal(20000) for key in keys])
    related = np.corrcoef(draws) - np.eye(len(keys))
    assert np.abs(related).max() < 0.03


@pytest.mark.parametrize("bad", [-1, 0.5, np.nan, "1", None, True])
def test_seeds_that_are_no_counts_are_refused(bad):
    with pytest.raises(OptionError, match="zero or more"):
        generator(bad, Stream.FAULT)
    with pytest.raises(OptionError, match="zero or more"):
        generator(0, Stream.FAULT, bad)
