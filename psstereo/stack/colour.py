"""From colour to one value by each pixel's own colour, found from its samples.

A matte pixel shows ``v_ic = ρ_c s_i``: under all lights the same colour ρ, times a shading s_i that is wanted. Fixed
weights such as the mean or the luma waste what a colour has in its strong channels. Knowing ρ, the sum of least
variance for equal noise in all channels is the projection ``Σ ρ_c v_ic / Σ ρ_c²``. The colour is the first eigenvector
of the pixel's 3 × 3 matrix of second moments over the lights, which equal noise does not turn.

Samples are divided by the lights' strengths, channel by channel, which makes their noise unequal; they are multiplied
by the channels' typical strength before the projection and divided after it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from psstereo.errors import OptionError
from psstereo.stack.gray import GRAY, PER_CHANNEL, GrayWeights, gray_weights
from psstereo.types import Array, FloatArray

__all__ = ["COLOUR_CHOICES", "PROJECTIONS", "ColourReading", "Projection", "colour_reading"]

_LEAST_CHROMA = 0.05
"""Sine of the angle between a pixel's colour and the light's, below which nothing but noise is left without it."""


@dataclass(frozen=True, kw_only=True)
class Projection:
    """A choice of one value a pixel that depends on the pixel's colour.

    Attributes
    ----------
    name : str
        Name at the command.
    summary : str
        What it does, for a person.
    without_light : bool
        Whether the light's own colour is taken out first. A highlight of a dielectric has that colour, so it goes; with
        it goes the signal of gray surfaces, whose samples become NaN. The albedo is then too large where highlights are
        many, since they make the pixel's colour look paler than it is.
    """

    name: str
    summary: str
    without_light: bool

    def __call__(self, values: FloatArray, strengths: FloatArray) -> FloatArray:
        """Project the samples of some pixels.

        Parameters
        ----------
        values : float array (c, m, p)
            Samples of each channel divided by the light's strength in it, so that light has the colour (1, 1, 1); NaN
            where one is not usable.
        strengths : float array (m, c)
            Those strengths.

        Returns
        -------
        float64 array (m, p)
            Shading, scaled to the mean of the channels; NaN where a channel is.
        """
        scale = np.sqrt((strengths * strengths).mean(axis=0))
        equal = values.astype(np.float64) * scale[:, None, None]
        usable = np.isfinite(equal).all(axis=0)
        known = np.where(usable, equal, 0.0)
        size = np.abs(known).max(axis=(0, 1))
        known /= np.where(size > 0, size, 1.0)  # squares of any brightness stay in range
        moments = np.einsum("cmp,dmp->pcd", known, known)
        colour = _first(moments)
        weights = colour
        if self.without_light:
            light = scale / np.sqrt((scale * scale).sum())
            across = np.eye(len(scale)) - np.outer(light, light)
            weights = _first(across @ moments @ across)
            weights = weights * np.sign(np.einsum("pc,pc->p", weights, colour))[:, None]
        shading = np.einsum("pc,cmp->mp", weights, known)
        chroma = np.einsum("pc,pc->p", weights, colour)
        chroma[~(chroma > (_LEAST_CHROMA if self.without_light else 0.0))] = np.nan
        # a unit vector of equal-noise channels, told as the mean of the samples' channels
        shading *= size * (colour / scale).mean(axis=1) / chroma
        return np.asarray(np.where(usable, shading, np.nan))


PROJECTIONS: dict[str, Projection] = {
    one.name: one
    for one in (
        Projection(name="chroma", summary="least noise for each pixel's own colour", without_light=False),
        Projection(
            name="specular-free",
            summary="what differs from the light's colour, without highlights; coloured surfaces only",
            without_light=True,
        ),
    )
}
"""Every projection, by name.

References
----------
The second is the separation of S. P. Mallick, T. E. Zickler, D. J. Kriegman, P. N. Belhumeur, "Beyond Lambert:
Reconstructing Specular Surfaces Using Color", IEEE CVPR 2005; they take the length of what is left, here it is
projected on its own direction, which has less noise and no bias where it is dark.
"""

COLOUR_CHOICES: tuple[str, ...] = (*GRAY, *PROJECTIONS, PER_CHANNEL)
"""Every name that :func:`colour_reading` knows."""


@dataclass(frozen=True, eq=False)
class ColourReading:
    """How the channels of an image become the values that are solved.

    Attributes
    ----------
    weights : GrayWeights
        Rows of channel weights, applied while images are read.
    projection : Projection or None
        What makes one value of them afterwards, pixel by pixel.
    """

    weights: GrayWeights
    projection: Projection | None = None

    @property
    def name(self) -> str:
        """Name of the choice."""
        return self.weights.name if self.projection is None else self.projection.name

    @property
    def values(self) -> int:
        """Values of an observation that are solved."""
        return len(self.weights.matrix) if self.projection is None else 1


def colour_reading(choice: str | Sequence[float], channels: int) -> ColourReading:
    """Look a choice up, weights or projection.

    Parameters
    ----------
    choice : str or sequence of float
        A name in `COLOUR_CHOICES`, or one weight a channel.
    channels : int
        Channels of the images. With one channel ``"chroma"`` is that channel.

    Returns
    -------
    ColourReading
        What to do.

    Raises
    ------
    OptionError
        If the name is unknown, the numbers do not fit the channels, or gray images have no colour to tell highlights
        by.

    Examples
    --------
    >>> colour_reading("chroma", 3).projection.name, colour_reading("g", 3).projection
    ('chroma', None)
    """
    projection = PROJECTIONS.get(choice) if isinstance(choice, str) else None
    if projection is None:
        if isinstance(choice, str) and choice not in COLOUR_CHOICES:
            raise OptionError(
                given=f"The gray value {choice!r} is unknown.",
                needed=f"Known are {', '.join(COLOUR_CHOICES)}, or one weight a channel such as 0.3,0.6,0.1.",
                remedy="Choose one of them.",
            )
        return ColourReading(gray_weights(choice, channels))
    if channels == 1 and not projection.without_light:
        return ColourReading(GrayWeights(projection.name, np.ones((1, 1))))
    if channels == 1:
        raise OptionError(
            given=f"The gray value {projection.name!r} was chosen, and the images have one channel.",
            needed="Highlights are told from the surface by colour.",
            remedy="Use colour images, or a robust solver against highlights.",
        )
    return ColourReading(GrayWeights(projection.name, np.eye(channels)), projection)


def _first(moments: Array) -> FloatArray:
    """Return the first eigenvectors of symmetric matrices (p, c, c), with a positive sum of entries."""
    vectors = np.linalg.eigh(moments)[1][..., -1]
    total = vectors.sum(axis=1, keepdims=True)
    return np.asarray(vectors * np.where(total < 0, -1.0, 1.0))
