"""MATLAB files of version 4 to 7.2."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from psstereo.errors import UnreadableFileError
from psstereo.io.text import require_file
from psstereo.types import Array

__all__ = ["is_hdf5", "read_mat", "write_mat"]

_HDF5 = (b"\x89HDF", b"MATLAB 7.3")
_HEADER = b"MATLAB 5.0 MAT-file, written by psstereo".ljust(116)
"""Text at the head of the file; SciPy's own has the time of day in it, so that no two files would be the same."""


def is_hdf5(path: Path) -> bool:
    """Say whether a file is of MATLAB's version 7.3, which is HDF5 inside."""
    try:
        with path.open("rb") as file:
            return file.read(16).startswith(_HDF5)
    except OSError:
        return False


def read_mat(path: Path) -> dict[str, Any]:
    """Return the variables of a MATLAB file by name.

    Raises
    ------
    MissingFileError
        If the file is not there.
    UnreadableFileError
        If it is damaged, no MATLAB file, or of version 7.3.
    """
    import scipy.io

    require_file(path)
    if is_hdf5(path):
        raise UnreadableFileError(
            given=f"{path} is a MATLAB file of version 7.3 (HDF5).",
            needed="Version 5 to 7.2 is needed.",
            remedy="Save it in MATLAB with save(..., '-v7').",
        )
    try:
        content: dict[str, Any] = scipy.io.loadmat(path)
    except Exception as error:  # the decoder raises whatever it likes on damaged files
        raise UnreadableFileError(
            given=f"The file {path} cannot be decoded ({error or type(error).__name__}).",
            needed="A whole MATLAB file of version 5 to 7.2.",
            remedy="Copy it again from its source.",
        ) from error
    return {name: value for name, value in content.items() if not name.startswith("__")}


def write_mat(path: Path, variables: Mapping[str, Array]) -> None:
    """Write arrays into a MATLAB file of version 5; the same arrays give the same bytes.

    Parameters
    ----------
    path : Path
        File to write.
    variables : mapping of str to array
        Arrays by name.
    """
    import scipy.io

    scipy.io.savemat(path, dict(variables))
    with path.open("r+b") as file:
        file.write(_HEADER)
