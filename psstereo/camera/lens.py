"""What a lens does to straight lines."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from psstereo.camera.pinhole import Pinhole
from psstereo.errors import InputError
from psstereo.types import FloatArray

__all__ = ["Lens", "Undistortion"]

_COUNTS = (4, 5, 8, 12, 14)


@dataclass(frozen=True)
class Lens:
    """Distortion by the polynomial and rational models of OpenCV, radial and tangential.

    A point whose ideal image is (x, y) in units of the focal length, down positive, is seen at
    ``x (1 + k₁ r² + k₂ r⁴ + k₃ r⁶) / (1 + k₄ r² + …) + 2 p₁ x y + p₂ (r² + 2 x²)`` and likewise in y. Not for fish-eye
    lenses beyond about 120°.

    Attributes
    ----------
    coefficients : tuple of float
        k₁, k₂, p₁, p₂, then k₃, then k₄, k₅, k₆, then the thin prism's four, then the tilt's two: 4, 5, 8, 12 or 14
        numbers [1].

    Raises
    ------
    InputError
        If there is another number of them, or one is not finite.

    References
    ----------
    .. [1] Z. Zhang, "A Flexible New Technique for Camera Calibration", IEEE TPAMI 22(11), 2000.
       doi:10.1109/34.888718
    """

    coefficients: tuple[float, ...]

    def __post_init__(self) -> None:
        numbers = np.asarray(self.coefficients, np.float64)
        if numbers.ndim != 1 or numbers.size not in _COUNTS or not np.isfinite(numbers).all():
            raise InputError(
                given=f"The lens has the coefficients {str(self.coefficients)[:80]}.",
                needed="4, 5, 8, 12 or 14 finite numbers, in the order k1, k2, p1, p2, k3, …",
                remedy="Correct them; psstereo calibrate lens finds them from pictures of a chessboard.",
            )
        object.__setattr__(self, "coefficients", tuple(float(number) for number in numbers))

    def distorted(self, points: npt.ArrayLike, camera: Pinhole) -> FloatArray:
        """Return where the lens shows what an ideal pinhole would show at some pixels.

        Parameters
        ----------
        points : float array (n, 2)
            Column and row in the ideal image [px].
        camera : Pinhole
            The camera, without the lens.

        Returns
        -------
        float64 array (n, 2)
            Column and row in the photograph [px].
        """
        import cv2

        ideal = _homogeneous(points) @ np.linalg.inv(camera.matrix).T
        zero = np.zeros(3)
        seen, _ = cv2.projectPoints(ideal[:, None, :], zero, zero, camera.matrix, np.array(self.coefficients))
        found = np.asarray(seen, np.float64).reshape(-1, 2)
        found[:, 0] += camera.skew * (found[:, 1] - camera.cy) / camera.fy  # OpenCV's projection leaves the skew out
        return found


@dataclass(frozen=True, kw_only=True)
class Undistortion:
    """A lens and the camera that it belongs to: where an image without the lens is found in the photograph.

    Attributes
    ----------
    lens : Lens
        What is undone.
    camera : Pinhole
        The camera; the image without the lens has the same matrix.
    """

    lens: Lens
    camera: Pinhole

    def lookup(self, shape: tuple[int, int], affine: FloatArray | None = None) -> FloatArray:
        """Return where in the photograph each pixel of the undistorted image comes from.

        Parameters
        ----------
        shape : (int, int)
            Rows and columns.
        affine : float array (2, 3), optional
            A move of the undistorted image that comes before: pixel (x, y, 1) is looked up at ``affine @ (x, y, 1)``.

        Returns
        -------
        float32 array (2, h, w)
            Column and row in the photograph [px].
        """
        rows, columns = np.indices(shape, dtype=np.float64)
        points = np.stack([columns.ravel(), rows.ravel()], axis=1)
        if affine is not None:
            points = _homogeneous(points) @ np.asarray(affine, np.float64).T
        return np.ascontiguousarray(self.lens.distorted(points, self.camera).T.reshape(2, *shape), np.float32)


def _homogeneous(points: npt.ArrayLike) -> FloatArray:
    given = np.asarray(points, np.float64)
    return np.hstack([given, np.ones((len(given), 1))])
