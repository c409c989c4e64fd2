"""Frames of other programs by name, and nothing but frames: how colours are coded belongs to the normal-map reader.

Inside this package x is right, y up and z toward the camera. A convention's matrix takes a vector from here to the
foreign frame; all of these matrices are signed permutations, so the transpose leads back without rounding.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from psstereo.errors import InputError, OptionError
from psstereo.types import FloatArray

__all__ = [
    "CONVENTIONS",
    "Convention",
    "convert_frame",
    "find_convention",
    "from_canonical",
    "from_slant_tilt",
    "to_canonical",
    "to_slant_tilt",
]


@dataclass(frozen=True, kw_only=True)
class Convention:
    """A frame of another program.

    Attributes
    ----------
    name : str
        Its name at the command and in the API.
    matrix : 3 × 3 floats
        Rows are the foreign axes in canonical coordinates: foreign = matrix · canonical [1].
    sentence : str
        Axes and where the frame is met, for a person.
    """

    name: str
    matrix: tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]
    sentence: str


_DOWN_AND_AWAY = ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0))

CONVENTIONS: Mapping[str, Convention] = {
    "opengl": Convention(
        name="opengl",
        matrix=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
        sentence="x right, y up, z toward the camera: Blender, glTF, DiLiGenT, RTI viewers, this package.",
    ),
    "directx": Convention(
        name="directx",
        matrix=((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)),
        sentence="x right, y down, z toward the camera: Unreal, 3ds Max.",
    ),
    "opencv": Convention(
        name="opencv",
        matrix=_DOWN_AND_AWAY,
        sentence="x right, y down, z into the scene: OpenCV cameras, near_ps, LUCES after loading.",
    ),
    "meshroom": Convention(
        name="meshroom",
        matrix=_DOWN_AND_AWAY,
        sentence="x right, y down, z into the scene: Meshroom's float files. Its PNG files have a code of their own.",
    ),
    "bini": Convention(
        name="bini",
        matrix=((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)),
        sentence="x up, y right, z into the scene: inside BiNI and NormalIntegration. Their PNG files are 'opengl'.",
    ),
}
"""All conventions by name. HALCON has angles instead of vectors: :func:`from_slant_tilt`, :func:`to_slant_tilt`."""


def find_convention(name: str) -> Convention:
    """Look up a convention.

    Parameters
    ----------
    name : str
        A key of :data:`CONVENTIONS`.

    Returns
    -------
    Convention
        The frame of that name.

    Raises
    ------
    OptionError
        If no convention has this name.
    """
    if name not in CONVENTIONS:
        raise OptionError(
            given=f"The convention is {name!r}.",
            needed=f"Known are {', '.join(map(repr, CONVENTIONS))}.",
            remedy="Use 'opengl' where green is up, 'directx' where green is down.",
        )
    return CONVENTIONS[name]


def to_canonical(vectors: FloatArray, convention: str) -> FloatArray:
    """Take vectors from a foreign frame to x right, y up, z toward the camera.

    Parameters
    ----------
    vectors : float array (..., 3)
        Vectors in the foreign frame; NaN stays NaN [any unit].
    convention : str
        A key of :data:`CONVENTIONS`.

    Returns
    -------
    float array (..., 3)
        A new array of the same precision, exact to the last bit [same unit].

    Raises
    ------
    InputError
        If the last axis does not have length 3.
    OptionError
        If the convention is unknown.

    Examples
    --------
    >>> to_canonical(np.array([0.5, -1.0, -2.0]), "opencv").tolist()
    [0.5, 1.0, 2.0]
    """
    return _permute(vectors, np.asarray(find_convention(convention).matrix).T)


def from_canonical(vectors: FloatArray, convention: str) -> FloatArray:
    """Take vectors from x right, y up, z toward the camera to a foreign frame; see :func:`to_canonical`."""
    return _permute(vectors, np.asarray(find_convention(convention).matrix))


def convert_frame(vectors: FloatArray, source: str, target: str) -> FloatArray:
    """Take vectors from one foreign frame to another; see :func:`to_canonical`."""
    matrix = np.asarray(find_convention(target).matrix) @ np.asarray(find_convention(source).matrix).T
    return _permute(vectors, matrix)


def from_slant_tilt(slant: FloatArray, tilt: FloatArray) -> FloatArray:
    """Turn HALCON's angles into unit vectors, ``(sin σ cos τ, sin σ sin τ, cos σ)``.

    Parameters
    ----------
    slant : float array (...)
        Angle σ from the optical axis [rad].
    tilt : float array (...)
        Angle τ in the image plane, counter-clockwise from x toward y as seen in the picture [rad].

    Returns
    -------
    float array (..., 3)
        Unit vectors, x right, y up, z toward the camera; light directions point to the light [1].
    """
    return np.stack([np.sin(slant) * np.cos(tilt), np.sin(slant) * np.sin(tilt), np.cos(slant)], axis=-1)


def to_slant_tilt(vectors: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Turn vectors into HALCON's slant and tilt.

    Parameters
    ----------
    vectors : float array (..., 3)
        Vectors of any length, x right, y up, z toward the camera [any unit].

    Returns
    -------
    slant, tilt : float arrays (...)
        Slant in [0, π] and tilt in [0, 2π); the tilt of the optical axis itself is 0 [rad].

    Raises
    ------
    InputError
        If the last axis does not have length 3.
    """
    array = _vectors(vectors)
    slant = np.arctan2(np.hypot(array[..., 0], array[..., 1]), array[..., 2])
    tilt = np.arctan2(array[..., 1], array[..., 0]) % (2.0 * np.pi)
    return slant, np.where(tilt >= 2.0 * np.pi, 0.0, tilt).astype(array.dtype)


def _permute(vectors: FloatArray, matrix: FloatArray) -> FloatArray:
    """Apply a signed permutation without arithmetic other than changes of sign."""
    array = _vectors(vectors)
    source = np.argmax(np.abs(matrix), axis=1)
    signs = matrix[np.arange(3), source].astype(array.dtype)
    return np.asarray(array[..., source] * signs)


def _vectors(vectors: FloatArray) -> FloatArray:
    array = np.asarray(vectors)
    if not np.issubdtype(array.dtype, np.floating):
        array = array.astype(np.float64)
    if array.ndim == 0 or array.shape[-1] != 3:
        raise InputError(
            given=f"The vectors have shape {array.shape}.",
            needed="Three components on the last axis are needed.",
            remedy="Pass normals as (h, w, 3) or directions as (m, 3).",
        )
    return array
