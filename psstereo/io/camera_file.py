"""The camera matrix K from a file or from the words of a command."""

import zipfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from psstereo.camera import Pinhole
from psstereo.errors import InputError, MissingFileError, OptionError, PsstereoError, UnreadableFileError
from psstereo.io.mat_file import read_mat
from psstereo.io.text import parse_numbers, read_table, require_file
from psstereo.stack.decode import decode_image, read_bytes
from psstereo.types import Array, FloatArray

__all__ = ["parse_camera", "read_camera"]

_NAMES = ("K", "intrinsics", "camera_matrix")
"""What the matrix is called in files that hold several."""


def parse_camera(words: str) -> Pinhole:
    """Return the pinhole camera that a file holds, or whose numbers are written out.

    Parameters
    ----------
    words : str
        Name of a file as :func:`read_camera` takes it, or ``"fx,fy,cx,cy"``, perhaps with ``",skew"``; with decimal
        commas, numbers are parted by semicolons or blanks [px].

    Returns
    -------
    Pinhole
        The camera.

    Raises
    ------
    MissingFileError
        If the words are neither numbers nor the name of a file.
    InputError
        If no camera has such numbers, or the file holds no such matrix.
    UnreadableFileError
        If the file is damaged.

    Examples
    --------
    >>> parse_camera("1200,1210,320,240").matrix.tolist()
    [[1200.0, 0.0, 320.0], [0.0, 1210.0, 240.0], [0.0, 0.0, 1.0]]
    """
    if not Path(words).exists():
        numbers = parse_numbers(words)
        if numbers is not None and numbers[0]:
            return _of_numbers(np.array(numbers[0]), f"The camera is given as {words!r}.")
        if not Path(words).suffix:
            raise MissingFileError(
                given=f"The camera is given as {words!r}, which is neither a file nor numbers.",
                needed="A file with the 3 × 3 matrix K, or fx,fy,cx,cy in pixels.",
                remedy="Check the name, or write the numbers, such as 1200,1200,320,240.",
            )
    return read_camera(Path(words))


def read_camera(path: Path) -> Pinhole:
    """Read a pinhole camera: its 3 × 3 matrix K, of any scale, or the numbers fx fy cx cy, perhaps with the skew.

    Pixels are counted from 0, so that the centre of the first one is (0, 0). A matrix made by MATLAB's calibration,
    which counts from 1, has a principal point that is 1 too large in both coordinates.

    Parameters
    ----------
    path : Path
        Text (any parting of the numbers, decimal commas too), ``.npy``, ``.npz`` or ``.mat``. In the latter two the
        matrix is the array ``K``, ``intrinsics`` or ``camera_matrix``, or the only one of 3 × 3.

    Returns
    -------
    Pinhole
        The camera.

    Raises
    ------
    MissingFileError
        If the file is not there.
    UnreadableFileError
        If it is damaged.
    InputError
        If it holds no such matrix, or that is singular, not finite or not upper triangular, or a focal length is not
        positive.
    """
    require_file(path)
    suffix = path.suffix.lower()
    if suffix == ".npy":
        values = decode_image(path)
    elif suffix == ".npz":
        values = _pick(path, _archive(path))
    elif suffix == ".mat":
        values = _pick(path, {k: v for k, v in read_mat(path).items() if isinstance(v, np.ndarray)})
    else:
        values = read_table(path).values
    if values.dtype.kind not in "fiu":
        raise _no_matrix(f"{path.name} holds an array of type {values.dtype}.")
    numbers: FloatArray = np.asarray(values, np.float64)
    if numbers.shape == (3, 3):
        return _of_matrix(numbers, path)
    if numbers.ndim in (1, 2) and numbers.size == max(numbers.shape, default=0):
        return _of_numbers(numbers.ravel(), f"{path.name} holds {numbers.size} numbers.")
    raise _no_matrix(f"{path.name} holds an array of shape {numbers.shape}.")


def _of_matrix(matrix: FloatArray, path: Path) -> Pinhole:
    try:
        return Pinhole.from_matrix(matrix)
    except InputError as error:
        raise InputError(given=f"{path.name}: {error.given}", needed=error.needed, remedy=error.remedy) from None


def _of_numbers(numbers: FloatArray, given: str) -> Pinhole:
    if numbers.size not in (4, 5):
        raise _no_matrix(given)
    fx, fy, cx, cy, skew = (float(number) for number in (*numbers, 0.0)[:5])
    return Pinhole(fx=fx, fy=fy, cx=cx, cy=cy, skew=skew)


def _no_matrix(given: str) -> OptionError | InputError:
    return InputError(
        given=given,
        needed="The camera is a 3 × 3 matrix K, or four or five numbers fx, fy, cx, cy, skew.",
        remedy="Write K = [[fx, s, cx], [0, fy, cy], [0, 0, 1]] as three rows of text.",
    )


def _archive(path: Path) -> dict[str, Array]:
    read_bytes(path)
    try:
        if not zipfile.is_zipfile(path):
            raise ValueError("it is no .npz archive, or is cut short")
        with np.load(path, allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except PsstereoError:
        raise
    except Exception as error:  # the decoder raises whatever it likes on damaged files
        raise UnreadableFileError(
            given=f"The camera file {path} cannot be decoded ({error or type(error).__name__}).",
            needed="A complete .npz archive.",
            remedy="Save the matrix again, with numpy.savez(file, K=K).",
        ) from error


def _pick(path: Path, arrays: Mapping[str, Array]) -> Array:
    """Return the matrix by its name, or the only one of 3 × 3."""
    known = [arrays[name] for name in _NAMES if name in arrays][:1]
    found = known or [value for value in arrays.values() if value.shape == (3, 3)]
    if len(found) != 1:
        listed = ", ".join(f"{name} {value.shape}" for name, value in arrays.items()) or "nothing"
        raise InputError(
            given=f"{path.name} holds {listed}.",
            needed="The camera matrix K, 3 × 3, by that name or as the only one of that size.",
            remedy="Save K by itself, or write fx,fy,cx,cy instead of the file.",
        )
    return found[0]
