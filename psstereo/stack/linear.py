"""Images as linear light, with what belongs to the sensor's pixels undone, so that they may be moved and averaged."""

from typing import Any

import numpy as np

from psstereo.errors import InputError
from psstereo.stack.flat import FlatField
from psstereo.stack.response import LINEAR, Response
from psstereo.stack.stack import ImageStack
from psstereo.types import Array, FloatArray

__all__ = ["LinearStack", "linear_frame"]

_NEARLY_WHITE = 0.98
"""Share of full scale from which a value counts as saturated; sensors bend before they clip."""


def linear_frame(
    stack: ImageStack, index: int, *, response: Response, dark: FloatArray | None, flat: FlatField | None
) -> FloatArray:
    """Return one image as linear light in the stack's scale, (h, w, c); float32, float64 if the images are.

    Parameters
    ----------
    stack : ImageStack
        The images.
    index : int
        Which, from 0.
    response : Response
        Camera response to undo.
    dark : float array (h, w, c) or None
        Level without the light, in linear pixel values.
    flat : FlatField or None
        Gains.

    Returns
    -------
    float array (h, w, c)
        A new array; saturated values are not marked.
    """
    return _undone(stack.frame(index), stack.white, index, response=response, dark=dark, flat=flat)


class LinearStack(ImageStack):
    """A stack of linear light, for whatever moves or averages pixels.

    Response, dark level and gains belong to the sensor's pixels and to single values, so they come first; the capture
    that holds this stack has none of them any more. Where any channel is saturated all of them become NaN, whatever
    the solver's gate says, since an average hides it. Not for reading alone: there the same is done in less memory
    while samples are gathered.

    Parameters
    ----------
    source : ImageStack
        The images.
    response : Response
        Camera response to undo.
    dark : float array (h, w, c), optional
        Level without the light, in linear pixel values.
    flat : FlatField, optional
        Gains.

    Raises
    ------
    InputError
        If dark level or gains have another size.
    """

    def __init__(
        self,
        source: ImageStack,
        *,
        response: Response = LINEAR,
        dark: FloatArray | None = None,
        flat: FlatField | None = None,
    ) -> None:
        if dark is not None and dark.shape != source.shape[1:]:
            raise InputError(
                given=f"The dark image has the shape {dark.shape}; the images, {source.shape[1:]}.",
                needed="It must have the images' size and channels.",
                remedy="Take it with the same camera settings, or leave it out.",
            )
        if flat is not None:
            flat.require(source.shape)
        self.source, self.response, self.dark, self.flat = source, response, dark, flat
        self.shape = source.shape
        self.dtype: np.dtype[Any] = _light_dtype(source.dtype)
        self.white = source.white
        self.saturates = False
        self.names = source.names

    def frame(self, index: int) -> Array:
        """Return one image of light; see :meth:`ImageStack.frame`."""
        raw = self.source.frame(index)
        light = _undone(raw, self.source.white, index, response=self.response, dark=self.dark, flat=self.flat)
        if self.source.saturates:
            light[(raw >= _NEARLY_WHITE * self.source.white).any(axis=2)] = np.nan
        return light


def _light_dtype(dtype: np.dtype[Any]) -> np.dtype[Any]:
    return np.dtype(np.float64 if dtype == np.float64 else np.float32)


def _undone(
    raw: Array, white: float, index: int, *, response: Response, dark: FloatArray | None, flat: FlatField | None
) -> FloatArray:
    dtype = _light_dtype(raw.dtype)
    light = np.array(raw if response.is_linear else response.linearise(raw, white), dtype)
    if dark is not None:
        np.subtract(light, dark, out=light, casting="same_kind")
    if flat is not None:
        np.multiply(light, flat.of(index), out=light, casting="same_kind")
    return light
