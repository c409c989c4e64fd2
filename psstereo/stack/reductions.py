"""Reductions over the images of a stack: fed one at a time, so that the stack is never held."""

from threading import Lock

import numpy as np

from psstereo.stack.stack import ImageStack
from psstereo.types import Array, Map, Progress, no_progress

__all__ = ["Brightest", "feed_all"]


class Brightest:
    """Largest value of every pixel over the images and channels, (h, w), in the images' own numbers."""

    def __init__(self) -> None:
        self._value: Array | None = None
        self._lock = Lock()

    def feed(self, image: Array) -> None:
        """Take one image (h, w, c)."""
        top = image.max(axis=2)
        with self._lock:
            self._value = top if self._value is None else np.fmax(self._value, top)

    @property
    def value(self) -> Array:
        """The result so far; zeros of no size before the first image."""
        return np.zeros((0, 0)) if self._value is None else self._value


def feed_all(stack: ImageStack, reduction: Brightest, *, over: Map = map, progress: Progress = no_progress) -> Array:
    """Feed every image to a reduction and return its value; each image is decoded once."""
    for done, _ in enumerate(over(lambda i: reduction.feed(stack.frame(i)), range(len(stack))), start=1):
        progress("looking at images", done, len(stack))
    return reduction.value
