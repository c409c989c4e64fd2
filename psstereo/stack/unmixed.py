"""One colour photograph under several coloured lights at once, as one image a light.

Lights of different colours shine together from different directions, red, green and blue for instance. Each adds to
all channels of the camera, so with the mixing matrix M (c, k), column j what light j alone makes of the surface that
faces it, a pixel is ``p = M s`` with s_j = max(0, n · l_j) times the albedo. Three channels tell three lights: s = M⁻¹
p. One exposure is enough, so that things that move can be measured.
"""

from dataclasses import dataclass
from threading import Lock

import numpy as np
import numpy.typing as npt

from psstereo.errors import InputError, OptionError
from psstereo.stack.response import LINEAR, Response
from psstereo.stack.stack import ImageStack
from psstereo.types import Array, FloatArray

__all__ = ["Mixing", "UnmixedStack"]

_SINGULAR = 1e3
"""Condition of the mixing with columns of length one, from which three colours count as two."""

_NEARLY_WHITE = 0.98
"""Share of full scale from which a value counts as saturated; sensors bend before they clip."""


@dataclass(frozen=True, eq=False)
class Mixing:
    """What each of several lights that shine together adds to the channels of the camera.

    Attributes
    ----------
    matrix : float64 array (c, c)
        Column j: the pixel's channels, as shares of full scale, that light j alone makes of the calibration's surface
        facing it; light's colour times camera's response times the surface's colour. Any common scale.

    Raises
    ------
    OptionError
        If it is not square, not finite, or two lights (or three) have the same colour for this camera.
    """

    matrix: FloatArray

    def __post_init__(self) -> None:
        given = np.asarray(self.matrix, np.float64)
        if given.ndim != 2 or given.shape[0] != given.shape[1] or len(given) < 2 or not np.isfinite(given).all():
            raise OptionError(
                given=f"The mixing matrix has the shape {given.shape}"
                + (" and entries that are no numbers." if given.size and not np.isfinite(given).all() else "."),
                needed="One row a channel and one column a light, as many of both, all finite: 3 × 3 for R, G, B.",
                remedy="Photograph a white surface under each light alone; its channels make a column.",
            )
        object.__setattr__(self, "matrix", given)
        condition = self.condition
        if not condition < _SINGULAR:
            raise OptionError(
                given=f"The mixing matrix is singular: for this camera the lights share a colour "
                f"(condition {condition:.3g}).",
                needed="Each light needs a colour that no mixture of the others has.",
                remedy="Use filters that overlap less, or take one image a light.",
            )

    @property
    def condition(self) -> float:
        """Condition number of the matrix with columns of length one."""
        length = np.sqrt((self.matrix * self.matrix).sum(axis=0))
        if not (length > 0).all():
            return float("inf")
        singular = np.linalg.svd(self.matrix / length, compute_uv=False)
        return float(singular[0] / singular[-1]) if singular[-1] > 0 else float("inf")

    @property
    def noise_gain(self) -> FloatArray:
        """Noise of each light's image relative to that of a photograph under this light alone, all channels used [1].

        The lengths of a row of M⁻¹ and a column of M, multiplied; 1 where each light has a channel of its own.
        """
        inverse = np.linalg.inv(self.matrix)
        return np.asarray(np.sqrt((inverse**2).sum(axis=1) * (self.matrix**2).sum(axis=0)))


class UnmixedStack(ImageStack):
    """A stack of one gray image a light, from photographs under as many lights as they have channels.

    The surface has one chromaticity, that of the surface on which the mixing was measured: albedo may vary, colour may
    not, or it is taken for shape. Not for colourful objects, nor where more than one photograph can be taken.

    Values are floats without a full scale, shares of the source's white. Where any channel is saturated nothing is
    known of any of the lights, and all become NaN, whatever the solver's gate says. Response and dark level are undone
    here, since mixing is linear in light.

    Parameters
    ----------
    source : ImageStack
        Photographs with as many channels as the mixing has rows; several give lights image after image.
    mixing : Mixing
        What each light adds to the channels.
    response : Response
        Camera response to undo.
    dark : float array (h, w, c), optional
        What the camera shows without the lights, as linear pixel values.

    Raises
    ------
    InputError
        If the photographs have another number of channels, or the dark image another shape.
    """

    def __init__(
        self,
        source: ImageStack,
        mixing: Mixing,
        *,
        response: Response = LINEAR,
        dark: npt.ArrayLike | None = None,
    ) -> None:
        count, height, width, channels = source.shape
        lights = len(mixing.matrix)
        if channels != lights:
            raise InputError(
                given=f"The photographs have {channels} channel{'s' if channels > 1 else ''}; "
                f"the mixing is for {lights}.",
                needed="Each row of the mixing is a channel.",
                remedy="Give colour photographs, unconverted, and a mixing of as many rows.",
            )
        self.source, self.mixing, self.response = source, mixing, response
        self.dark = None if dark is None else np.asarray(dark)
        if self.dark is not None and self.dark.shape != source.shape[1:]:
            raise InputError(
                given=f"The dark image has the shape {self.dark.shape}; the photographs, {source.shape[1:]}.",
                needed="It must have the photographs' size and channels.",
                remedy="Take it with the same camera settings, or leave it out.",
            )
        self.shape = (count * lights, height, width, 1)
        self.dtype = np.dtype(np.float64 if source.dtype == np.float64 else np.float32)
        self.white = 1.0
        self.saturates = False
        self.names = tuple(f"{name}, light {j + 1}" for name in source.names for j in range(lights))
        self._inverse = np.linalg.inv(mixing.matrix) / source.white
        self._lock = Lock()
        self._last: tuple[int, Array] | None = None

    def __getstate__(self) -> dict[str, object]:
        return {name: value for name, value in vars(self).items() if name not in ("_lock", "_last")}

    def __setstate__(self, state: dict[str, object]) -> None:
        vars(self).update(state)
        self._lock, self._last = Lock(), None

    def frame(self, index: int) -> Array:
        """Return what one light alone would show, (h, w, 1); see :meth:`ImageStack.frame`."""
        image, light = divmod(range(len(self))[index], len(self.mixing.matrix))
        with self._lock:  # its neighbours come from the same photograph, which is unmixed once
            if self._last is None or self._last[0] != image:
                self._last = (image, self._unmixed(image))
            return np.asarray(self._last[1][light][..., None])

    def _unmixed(self, image: int) -> Array:
        raw = self.source.frame(image)
        linear = raw if self.response.is_linear else self.response.linearise(raw, self.source.white)
        values = np.asarray(linear, np.float64)
        if self.dark is not None:
            values = values - self.dark
        planes = np.einsum("jc,hwc->jhw", self._inverse, values)
        if self.source.saturates:
            planes[:, (raw >= _NEARLY_WHITE * self.source.white).any(axis=2)] = np.nan
        return np.asarray(planes, self.dtype)
