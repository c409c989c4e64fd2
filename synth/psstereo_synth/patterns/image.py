"""A picture painted onto a surface."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

import numpy as np

from psstereo.errors import OptionError, UnreadableFileError
from psstereo.stack.decode import decode_image
from psstereo.types import FloatArray
from psstereo_synth.patterns.pattern import Pattern, require_points
from psstereo_synth.shapes.checks import positive

__all__ = ["ImagePattern"]

_CURVES = ("srgb", "linear")


@dataclass(frozen=True, kw_only=True)
class ImagePattern(Pattern):
    """An image file of 8 or 16 bits, projected along z; full scale is the albedo 1.

    The picture is stretched to fill −half_width ≤ x, y ≤ half_width. Between the centres of its pixels albedo is
    bilinear, beyond the outermost ones constant. Transparency is not used. Pictures are read when the pattern is made.

    Attributes
    ----------
    path : Path
        The file.
    curve : str
        ``"srgb"`` for pictures made to be looked at, ``"linear"`` for values proportional to albedo.
    half_width : float
        Half the side of the square that it fills [length].

    Raises
    ------
    OptionError
        If the curve is another.
    MissingFileError
        If the file is not there.
    UnreadableFileError
        If it is damaged, or not of 8 or 16 bits.
    """

    name: ClassVar[str] = "image"
    summary: ClassVar[str] = "A picture from a file, projected along z."
    path: Path
    curve: str = "srgb"
    half_width: float = 1.0
    _albedo: FloatArray = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        positive("picture", half_width=self.half_width)
        if self.curve not in _CURVES:
            raise OptionError(
                given=f"The curve {self.curve!r} of a picture is unknown.",
                needed=f"Known are {', '.join(_CURVES)}.",
                remedy="Take srgb for pictures made to be looked at.",
            )
        object.__setattr__(self, "path", Path(self.path))
        image = decode_image(self.path)
        if image.dtype not in (np.uint8, np.uint16) or image.ndim not in (2, 3) or not image.size:
            raise UnreadableFileError(
                given=f"The picture {self.path.name} has the shape {image.shape} and type {image.dtype}.",
                needed="Gray or R, G, B of 8 or 16 bits: integers say what full scale is.",
                remedy="Convert it to PNG.",
            )
        image = image[..., None] if image.ndim == 2 else image[..., : 3 if image.shape[2] >= 3 else 1]
        values = image / float(np.iinfo(image.dtype).max)
        if self.curve == "srgb":
            values = np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
        values.flags.writeable = False
        object.__setattr__(self, "_albedo", values)

    @property
    def channels(self) -> int:
        """See :attr:`Pattern.channels`."""
        return int(self._albedo.shape[2])

    def evaluate(self, points: FloatArray) -> FloatArray:
        """Return the albedo at points; see :meth:`Pattern.evaluate`."""
        p = require_points(points)
        known = np.isfinite(p).all(axis=1)
        rows, columns = self._albedo.shape[:2]
        across, down = 0.5 + 0.5 * p[known, 0] / self.half_width, 0.5 - 0.5 * p[known, 1] / self.half_width
        column, row = np.clip(across * columns - 0.5, 0, columns - 1), np.clip(down * rows - 0.5, 0, rows - 1)
        left, top = np.floor(column).astype(np.intp), np.floor(row).astype(np.intp)
        right, low = np.minimum(left + 1, columns - 1), np.minimum(top + 1, rows - 1)
        u, v = (column - left)[:, None], (row - top)[:, None]
        a = self._albedo
        upper = (1.0 - u) * a[top, left] + u * a[top, right]
        lower = (1.0 - u) * a[low, left] + u * a[low, right]
        out = np.full((len(p), self.channels), np.nan)
        out[known] = (1.0 - v) * upper + v * lower
        return out
