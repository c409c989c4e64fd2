"""Light that nobody wrote down."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.errors import InputError
from psstereo.types import FloatArray
from psstereo_synth.faults.checks import require_size
from psstereo_synth.faults.fault import Draws, Fault

__all__ = ["AmbientLeak"]


@dataclass(frozen=True, kw_only=True)
class AmbientLeak(Fault):
    """A constant is added to every image and recorded nowhere, as by stray light in the lens.

    It is the same all over the image. For light from the room that falls on the object, which follows the albedo and
    the shape, put an ambient light into the scene.

    Attributes
    ----------
    level : float or tuple of float
        What is added, one number or one a channel [W m⁻² sr⁻¹].

    Raises
    ------
    OptionError
        If a level is negative or not finite, or there is none.
    """

    name: ClassVar[str] = "ambient-leak"
    summary: ClassVar[str] = "Stray light adds the same amount to all pixels of all images."
    level: float | tuple[float, ...]

    def __post_init__(self) -> None:
        levels = self.level if isinstance(self.level, tuple) else (self.level,)
        for value in levels or (np.nan,):
            require_size("level of stray light", value)

    def radiance(self, image: FloatArray, index: int, draws: Draws) -> FloatArray:
        """Return the brighter image.

        Parameters
        ----------
        image : float array (h, w, c)
            What the scene sends to the camera [W m⁻² sr⁻¹].
        index : int
            Of the exposure.
        draws : Draws
            Random numbers.

        Returns
        -------
        float array (h, w, c)
            Brighter by the level [W m⁻² sr⁻¹].

        Raises
        ------
        InputError
            If there are as many levels as channels neither of the image nor one.
        """
        del index, draws
        level = np.atleast_1d(self.level)
        if level.size not in (1, image.shape[2]):
            raise InputError(
                given=f"There are {level.size} levels of stray light and {image.shape[2]} channels.",
                needed="One level serves all channels, or each has its own.",
                remedy="Give one level, or as many as the image has channels.",
            )
        return np.asarray(image + level) if level.any() else image
