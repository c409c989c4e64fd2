"""Random numbers whose values depend on what they are for, not on the order in which they are asked for."""

from enum import IntEnum

import numpy as np

from psstereo.errors import OptionError

__all__ = ["Stream", "generator"]


class Stream(IntEnum):
    """What random numbers are for; the same seed gives unrelated numbers in different streams."""

    EXPOSURE = 1
    PIXELS = 2
    FAULT = 3


def generator(seed: int, stream: Stream, *key: int) -> np.random.Generator:
    """Return a new generator for one purpose.

    Parameters
    ----------
    seed : int
        Of the whole capture, zero or more.
    stream : Stream
        What the numbers are for.
    *key : int
        Which of them, such as the index of an image; each zero or more.

    Returns
    -------
    numpy Generator
        At its beginning. Two of the same arguments give the same numbers, all others are independent.

    Raises
    ------
    OptionError
        If the seed or a part of the key is negative or no integer.
    """
    numbers = (seed, *key)
    if any(isinstance(n, bool) or not isinstance(n, int | np.integer) or n < 0 for n in numbers):
        raise OptionError(
            given=f"Random numbers are seeded by {', '.join(map(str, numbers))}.",
            needed="Seeds and indices are integers of zero or more.",
            remedy="Give such a seed, for instance 0, and count images from 0.",
        )
    words = [int(n) for n in key]
    return np.random.default_rng(np.random.SeedSequence(int(seed), spawn_key=(int(stream), *words)))
