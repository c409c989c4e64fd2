"""Pixels turned so that the eye is along z, and lamps as each pixel sees them there."""

from typing import NamedTuple

import numpy as np

from psstereo.types import FloatArray

__all__ = ["SeenLamps", "eye_frames", "seen_lamps", "turned"]

_REACH = 1e-6
"""Length of a light vector, over a pixel's longest, up to which the lamp does not reach it [1]."""


class SeenLamps(NamedTuple):
    """Lamps as some pixels see them.

    Attributes
    ----------
    directions : float64 array (p, m, 3)
        Unit vectors to the lamps, in frames whose z points at the camera; zero where a lamp does not reach [1].
    strengths : float64 array (p, m)
        What a lamp of unit radiant intensity sheds on a surface that faces it; zero likewise [length⁻²].
    """

    directions: FloatArray
    strengths: FloatArray

    def values(self, brightness: FloatArray) -> FloatArray:
        """Return brightness (m, p) over strength, with a row a pixel; NaN where a lamp does not reach.

        Parameters
        ----------
        brightness : float64 array (m, p)
            Brightness over the lamp's radiant intensity; NaN where not usable.

        Returns
        -------
        float64 array (p, m)
            What distant lights of unit strength would show.
        """
        reached = self.strengths > 0
        over = np.where(reached, self.strengths, 1.0)
        return np.where(reached, brightness.T / over, np.nan)

    @property
    def weights(self) -> FloatArray:
        """Inverse variances of such values for noise that is the same in all images, (p, m); the largest is 1 [1]."""
        most = self.strengths.max(axis=1, keepdims=True)
        return np.asarray((self.strengths / np.where(most > 0, most, 1.0)) ** 2)


def eye_frames(rays: FloatArray) -> FloatArray:
    """Return the smallest rotations that turn the direction to the eye to z.

    Parameters
    ----------
    rays : float64 array (p, 3)
        Directions of sight, z below zero [1].

    Returns
    -------
    float64 array (p, 3, 3)
        Rotations: their product with a vector is that vector in the pixel's frame [1].
    """
    e = -rays / np.sqrt((rays * rays).sum(axis=1, keepdims=True))
    x, y, z = e.T
    share = 1.0 / (1.0 + z)
    rows = (
        (1.0 - x * x * share, -x * y * share, -x),
        (-x * y * share, 1.0 - y * y * share, -y),
        (x, y, z),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=1)


def turned(frames: FloatArray, vectors: FloatArray, *, back: bool = False) -> FloatArray:
    """Return vectors in the pixels' frames, or `back` from there.

    Parameters
    ----------
    frames : float64 array (p, 3, 3)
        From :func:`eye_frames` [1].
    vectors : float64 array (p, 3)
        Any vectors.
    back : bool
        Whether they are in the pixels' frames.

    Returns
    -------
    float64 array (p, 3)
        The same vectors in the other frame.
    """
    return np.asarray(np.einsum("pij,pi->pj" if back else "pij,pj->pi", frames, vectors))


def seen_lamps(light: FloatArray, frames: FloatArray) -> SeenLamps:
    """Return how pixels see the lamps.

    Parameters
    ----------
    light : float64 array (3, m, p)
        Light vectors, from :func:`psstereo.kernels.near.lamp_vectors` [length⁻²].
    frames : float64 array (p, 3, 3)
        From :func:`eye_frames` [1].

    Returns
    -------
    SeenLamps
        Directions and strengths.
    """
    strengths = np.sqrt((light * light).sum(axis=0)).T
    reached = strengths > _REACH * strengths.max(axis=1, keepdims=True, initial=0.0)
    strengths = np.where(reached, strengths, 0.0)
    directions = np.einsum("pij,jmp->pmi", frames, light, optimize=True)
    directions = np.where(reached[..., None], directions, 0.0) / np.where(reached, strengths, 1.0)[..., None]
    return SeenLamps(directions, strengths)
