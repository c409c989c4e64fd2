"""From colour to one value: channel weights with names."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from psstereo.errors import OptionError
from psstereo.types import FloatArray

__all__ = ["GRAY", "PER_CHANNEL", "GrayWeights", "gray_weights"]

PER_CHANNEL = "per-channel"
"""Name of the choice to keep the channels apart."""

GRAY: dict[str, tuple[float, float, float]] = {
    "mean": (1 / 3, 1 / 3, 1 / 3),
    # ITU-R BT.601 luma with the digits that published baselines use.
    "bt601": (0.2989, 0.5870, 0.1140),
    # ITU-R BT.709, the luminance of linear values with sRGB's primaries.
    "bt709": (0.2126, 0.7152, 0.0722),
    "r": (1.0, 0.0, 0.0),
    "g": (0.0, 1.0, 0.0),
    "b": (0.0, 0.0, 1.0),
}
"""Weights of R, G, B by name."""


@dataclass(frozen=True, eq=False)
class GrayWeights:
    """Rows of channel weights; each row makes one value of a pixel.

    Attributes
    ----------
    name : str
        Name, or the numbers as given.
    matrix : float64 array (k, c)
        k = 1 for a gray value, k = c when the channels are kept apart.
    """

    name: str
    matrix: FloatArray


def gray_weights(choice: str | Sequence[float], channels: int) -> GrayWeights:
    """Look a choice of gray up.

    Parameters
    ----------
    choice : str or sequence of float
        A name in `GRAY`, ``"per-channel"``, or one weight a channel.
    channels : int
        Channels of the images. With one channel a named gray is that channel.

    Returns
    -------
    GrayWeights
        The weights.

    Raises
    ------
    OptionError
        If the name is unknown or the numbers do not fit the channels.

    Examples
    --------
    >>> gray_weights("bt601", 3).matrix
    array([[0.2989, 0.587 , 0.114 ]])
    """
    if choice == PER_CHANNEL:
        return GrayWeights(PER_CHANNEL, np.eye(channels))
    if isinstance(choice, str):
        if choice not in GRAY:
            raise OptionError(
                given=f"The gray value {choice!r} is unknown.",
                needed=f"Known are {', '.join(GRAY)}, {PER_CHANNEL}, or one weight a channel such as 0.3,0.6,0.1.",
                remedy="Choose one of them.",
            )
        if choice == "mean" or channels == 1:
            return GrayWeights(choice, np.full((1, channels), 1 / channels))
        if channels != 3:
            raise OptionError(
                given=f"The gray value {choice!r} is for R, G, B; the images have {channels} channels.",
                needed=f"Without R, G, B choose mean, {PER_CHANNEL}, or one weight a channel.",
                remedy="Choose one of them.",
            )
        return GrayWeights(choice, np.array([GRAY[choice]]))
    weights = np.asarray(choice, np.float64)
    if weights.shape != (channels,) or not np.isfinite(weights).all() or not weights.any():
        raise OptionError(
            given=f"The gray weights are {list(choice)}; the images have {channels} channels.",
            needed="One finite weight a channel is needed, not all zero.",
            remedy="Give as many weights as the images have channels.",
        )
    return GrayWeights(",".join(f"{w:g}" for w in weights), weights[None])
