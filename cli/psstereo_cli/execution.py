"""How the work is executed: threads, and sizes of memory as people write them."""

import os
import platform
import re
from collections.abc import Iterator
from contextlib import contextmanager

from psstereo.errors import OptionError
from psstereo.types import Map

__all__ = ["available_threads", "keep_freed_memory", "parse_floats", "parse_image_size", "parse_size", "threaded"]

_KEPT = 2**25
"""Largest piece of memory that is kept, glibc's own upper bound [byte]."""

_UNITS = {"": 1, "k": 10**3, "m": 10**6, "g": 10**9, "ki": 2**10, "mi": 2**20, "gi": 2**30}


def available_threads() -> int:
    """Return the number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def keep_freed_memory() -> None:
    """Ask the C library to keep freed memory of the size of an image for the next one.

    By default glibc returns it to the system after each image and fetches it back, zeroed page by page, for the next,
    which takes as long as a tenth of the decoding. The command owns its process and may decide this; the library may
    not. Other C libraries are left as they are.
    """
    if platform.libc_ver()[0] != "glibc":
        return
    import ctypes

    trim_threshold, mmap_threshold = -1, -3  # M_TRIM_THRESHOLD, M_MMAP_THRESHOLD of malloc.h
    libc = ctypes.CDLL(None)
    libc.mallopt(mmap_threshold, _KEPT)
    libc.mallopt(trim_threshold, 4 * _KEPT)


@contextmanager
def threaded(threads: int) -> Iterator[Map]:
    """Give a ``map`` that runs on so many threads."""
    if threads == 1:
        yield map
        return
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(threads) as pool:
        try:
            yield pool.map
        except BaseException:
            pool.shutdown(cancel_futures=True)  # an error is told at once, not after all that was queued
            raise


def parse_size(text: str | None) -> int | None:
    """Read a size of memory.

    Examples
    --------
    >>> parse_size("30MB"), parse_size("1.5GiB"), parse_size(None)
    (30000000, 1610612736, None)
    """
    if text is None:
        return None
    match = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*([kmg]i?)?b?\s*", text.lower())
    if match is None or float(match[1]) == 0:
        raise OptionError(
            given=f"The memory limit is {text!r}.",
            needed="A size such as 500MB, 2GB or 1.5GiB.",
            remedy="Write a number and a unit.",
        )
    return int(float(match[1]) * _UNITS[match[2] or ""])


def parse_floats(text: str, count: int | None, what: str) -> tuple[float, ...]:
    """Read numbers parted by commas.

    Examples
    --------
    >>> parse_floats("0.01,0.98", 2, "range")
    (0.01, 0.98)
    """
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if not values or (count is not None and len(values) != count):
        raise OptionError(
            given=f"The {what} is {text!r}.",
            needed="One number is needed." if count == 1 else f"{count or 'Some'} numbers parted by commas are needed.",
            remedy="Write decimal points, and commas only between the numbers.",
        )
    return values


def parse_image_size(text: str) -> tuple[int, int]:
    """Read the size of an image, width before height, and return rows and columns.

    Examples
    --------
    >>> parse_image_size("256"), parse_image_size("612x512")
    ((256, 256), (512, 612))
    """
    match = re.fullmatch(r"\s*(\d{1,9})(?:\s*[x×]\s*(\d{1,9}))?\s*", text.lower())
    if match is None:
        raise OptionError(
            given=f"The size of the images is {text!r}.",
            needed="One number for a square, or width x height, such as 256 or 612x512.",
            remedy="Write whole numbers of pixels.",
        )
    width = int(match[1])
    return (int(match[2]) if match[2] else width), width
