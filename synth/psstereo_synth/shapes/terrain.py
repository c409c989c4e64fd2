"""Random terrain: a finite sum of plane waves with the spectrum of a fractal."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from psstereo.errors import InputError
from psstereo.types import FloatArray
from psstereo_synth.shapes.checks import places, positive, whole
from psstereo_synth.shapes.extremes import smooth_bounds
from psstereo_synth.shapes.finite import SquareRelief
from psstereo_synth.shapes.relief import Elevation

__all__ = ["Terrain"]

_BLOCK = 1 << 21
"""Phases worked on at once; 16 MB."""


@dataclass(frozen=True, kw_only=True)
class Terrain(SquareRelief):
    """z = Σ aⱼ cos(kⱼ·(x, y) + φⱼ), so that heights and slopes are exact anywhere, not only on a grid.

    Wave numbers are spread evenly in log |k| between the band's limits, directions and phases at random, and
    aⱼ ∝ |kⱼ|^−hurst. Within the band that is the power spectrum |k|^−2(hurst + 1) of a surface whose heights differ by
    distance^hurst, of fractal dimension 3 − hurst [1]_. Outside the band there is nothing: it is smooth below the
    shortest wave.

    Its cost is points times waves; a large grid of it is made once and kept as a
    :class:`~psstereo_synth.shapes.grid.HeightGrid` where speed matters more than the last digit.

    Attributes
    ----------
    rms : float
        Root-mean-square height that many such terrains have on average [length].
    hurst : float
        Exponent, 0 … 1: small is rough, large is smooth [1].
    longest, shortest : float
        Wavelengths between which the waves lie [length].
    waves : int
        Number of waves.
    seed : int
        The same seed gives the same surface.
    half_width : float
        Half the side of the square [length].

    Raises
    ------
    InputError
        If a length is not positive, the band empty, or the exponent outside 0 … 1.

    References
    ----------
    .. [1] B. B. Mandelbrot, "The Fractal Geometry of Nature", W. H. Freeman, 1982
    """

    name: ClassVar[str] = "terrain"
    summary: ClassVar[str] = "Random terrain with the spectrum of a fractal between two wavelengths."
    rms: float = 0.05
    hurst: float = 0.8
    longest: float = 2.0
    shortest: float = 0.1
    waves: int = 128
    seed: int = 0

    def __post_init__(self) -> None:
        SquareRelief.__post_init__(self)
        whole("terrain", least=1, waves=self.waves)
        whole("terrain", least=0, seed=self.seed)
        positive("terrain", rms=self.rms, longest=self.longest, shortest=self.shortest)
        if self.shortest > self.longest:
            raise InputError(
                given=f"The waves of a terrain are {self.longest:g} long at most and {self.shortest:g} at least.",
                needed="The longest must not be shorter than the shortest.",
                remedy="Exchange the two.",
            )
        if not 0.0 <= self.hurst <= 1.0:
            raise InputError(
                given=f"The exponent of a terrain is {self.hurst}.",
                needed="It lies between 0, very rough, and 1, smooth.",
                remedy="Take 0.7 to 0.9 for what looks like mountains.",
            )

    @cached_property
    def _waves(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Wave vectors (2, waves), phases and amplitudes (waves,)."""
        rng = np.random.default_rng(self.seed)
        jitter, turn, phase = rng.uniform(size=(3, self.waves))
        share = (np.arange(self.waves) + jitter) / self.waves
        length = self.longest * (self.shortest / self.longest) ** share
        k = 2 * np.pi / length
        amplitude = length**self.hurst
        amplitude *= self.rms * np.sqrt(2.0 / (amplitude * amplitude).sum())
        turn, phase = 2 * np.pi * turn, 2 * np.pi * phase
        return np.stack([k * np.cos(turn), k * np.sin(turn)]), phase, amplitude

    @cached_property
    def _bounds(self) -> tuple[float, float]:
        (kx, ky), phase, amplitude = self._waves

        def heights(axis: FloatArray) -> FloatArray:
            along_x, along_y = np.exp(1j * axis[:, None] * kx), np.exp(1j * (axis[:, None] * ky + phase))
            return np.asarray(((along_y * amplitude) @ along_x.T).real)

        return smooth_bounds(heights, self.half_width, float((amplitude * (kx * kx + ky * ky)).sum()))

    @property
    def bounds(self) -> tuple[float, float]:
        """See :attr:`Relief.bounds`."""
        return self._bounds

    def evaluate(self, x: FloatArray, y: FloatArray) -> Elevation:
        """Return heights and slopes; see :meth:`Relief.evaluate`."""
        x, y = places(x, y)
        inside = self.inside(x, y)
        out = np.full((3, *x.shape), np.nan)
        out[:, inside] = self._at(np.stack([x[inside], y[inside]], axis=1))
        return Elevation(height=out[0], slope_x=out[1], slope_y=out[2])

    def _at(self, at: FloatArray) -> FloatArray:
        """Return heights and the two slopes (3, p) at places (p, 2)."""
        vectors, phase, amplitude = self._waves
        out = np.zeros((3, len(at)))
        rows = max(_BLOCK // self.waves, 1)
        for start in range(0, len(at), rows):
            angle = at[start : start + rows] @ vectors + phase
            out[0, start : start + rows] = np.cos(angle) @ amplitude
            out[1:, start : start + rows] = -(vectors * amplitude) @ np.sin(angle, out=angle).T
        return out
