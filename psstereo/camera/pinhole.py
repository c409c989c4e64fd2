"""Central projection through a pinhole."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from psstereo.camera.camera import Camera
from psstereo.errors import InputError
from psstereo.results import DepthKind
from psstereo.types import FloatArray

__all__ = ["Pinhole"]


@dataclass(frozen=True, kw_only=True)
class Pinhole(Camera):
    """Central projection with the calibration matrix K of computer vision, lens distortion already removed.

    Attributes
    ----------
    fx, fy : float
        Focal lengths [px].
    cx, cy : float
        Principal point; the centre of pixel (0, 0) is (0, 0) [px].
    skew : float
        Shear of the pixel axes, the entry K₀₁ [px].
    """

    name: ClassVar[str] = "pinhole"
    depth_kind: ClassVar[DepthKind] = DepthKind.DISTANCE
    fx: float
    fy: float
    cx: float
    cy: float
    skew: float = 0.0

    def __post_init__(self) -> None:
        values = np.array([self.fx, self.fy, self.cx, self.cy, self.skew])
        if not np.isfinite(values).all() or self.fx <= 0 or self.fy <= 0:
            raise InputError(
                given=f"The focal lengths are {self.fx} and {self.fy}, the principal point ({self.cx}, {self.cy}).",
                needed="Focal lengths must be positive numbers of pixels and the rest finite.",
                remedy="Check the camera matrix K = [[fx, s, cx], [0, fy, cy], [0, 0, 1]].",
            )

    @classmethod
    def from_matrix(cls, matrix: FloatArray) -> "Pinhole":
        """Build the camera from its 3 × 3 matrix K, of any non-zero scale.

        Parameters
        ----------
        matrix : float array (3, 3)
            ``[[fx, s, cx], [0, fy, cy], [0, 0, 1]]`` [px].

        Returns
        -------
        Pinhole
            The camera.

        Raises
        ------
        InputError
            If the matrix has another shape, is singular, or is not upper triangular.
        """
        k = np.asarray(matrix, np.float64)
        upper = k.shape == (3, 3) and np.isfinite(k).all() and k[2, 2] != 0
        if not upper or np.abs([k[1, 0], k[2, 0], k[2, 1]]).max() > 1e-9 * np.abs(k).max():
            raise InputError(
                given=f"The camera matrix is {k.tolist()}.",
                needed="It must be a 3 × 3 upper triangular matrix [[fx, s, cx], [0, fy, cy], [0, 0, 1]].",
                remedy="Check the file; a transposed matrix has the principal point in its last row.",
            )
        k = k / k[2, 2]
        return cls(fx=float(k[0, 0]), fy=float(k[1, 1]), cx=float(k[0, 2]), cy=float(k[1, 2]), skew=float(k[0, 1]))

    @property
    def matrix(self) -> FloatArray:
        """Return K, float64 (3, 3) [px]."""
        return np.array([[self.fx, self.skew, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    @property
    def unit(self) -> str:
        """``"relative"``: normals alone leave the scale of a pinhole depth free."""
        return "relative"

    def rays(self, shape: tuple[int, int]) -> FloatArray:
        """Return ((u − cx − s·y') / fx, −y', −1) with y' = (v − cy) / fy; see :meth:`Camera.rays`."""
        rows, columns = np.indices(shape, dtype=np.float64)
        down = (rows - self.cy) / self.fy
        right = (columns - self.cx - self.skew * down) / self.fx
        return np.stack([right, -down, -np.ones(shape)], axis=-1)

    def points(self, depth: FloatArray) -> FloatArray:
        """Return depth · ray; see :meth:`Camera.points`."""
        return np.asarray(self.rays(depth.shape) * np.asarray(depth, np.float64)[..., None])
