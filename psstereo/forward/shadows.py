"""The interface of whatever can throw shadows."""

from abc import ABC, abstractmethod
from typing import ClassVar

from psstereo.lights import Beam
from psstereo.types import BoolArray, FloatArray

__all__ = ["Shadows"]


class Shadows(ABC):
    """Tells which points of a surface a beam reaches past everything else.

    Attached shadows are not its business: a point that faces away from the light gets none whatever it answers.
    """

    name: ClassVar[str]

    @abstractmethod
    def lit(self, points: FloatArray, normals: FloatArray, beam: Beam) -> BoolArray:
        """Return whether nothing lies between points and source.

        Parameters
        ----------
        points : float array (p, 3)
            Points on the surface [length].
        normals : float array (p, 3)
            Their unit normals; to step off the surface before looking for what is in the way [1].
        beam : Beam
            Directions (3,) or (p, 3), and distances to the source.

        Returns
        -------
        bool array (p,)
            True where the beam arrives.
        """
