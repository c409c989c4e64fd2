"""One file that appears whole or not at all, and never in place of what is not of its kind."""

import os
import tempfile
from collections.abc import Callable
from pathlib import Path

from psstereo.errors import ExistingResultError, MissingFileError, UnreadableFileError

__all__ = ["begins_with", "put_file", "require_file_place"]


def begins_with(*heads: bytes) -> Callable[[Path], bool]:
    """Return what tells whether a file begins with one of these bytes; it never raises."""

    def ours(path: Path) -> bool:
        try:
            with path.open("rb") as file:
                return file.read(max(map(len, heads))).startswith(heads)
        except OSError:
            return False

    return ours


def require_file_place(path: Path, *, overwrite: bool, ours: Callable[[Path], bool], kind: str) -> None:
    """Refuse a name that cannot be taken for a file, before the work.

    Parameters
    ----------
    path : Path
        The file that is to be written.
    overwrite : bool
        Whether one of its kind may be replaced; anything else is refused even then.
    ours : callable
        Tells whether an existing file is of its kind.
    kind : str
        What it is called in the message, such as ``.ptm file``.

    Raises
    ------
    MissingFileError
        If the folder is not there.
    ExistingResultError
        If something is in the way.
    """
    if not path.absolute().parent.is_dir():
        raise MissingFileError(
            given=f"The folder {path.absolute().parent} does not exist.",
            needed="A folder that exists.",
            remedy="Make it, or choose another name.",
        )
    if not path.exists():
        return
    mine = path.is_file() and ours(path)
    if not (mine and overwrite):
        what = "" if mine else ", as a folder" if path.is_dir() else f", and is no {kind}"
        raise ExistingResultError(
            given=f"{path} is there already{what}.",
            needed="It is not replaced without being asked for." if mine else "A new name, so that nothing is lost.",
            remedy="Add --overwrite, or choose another name." if mine else "Choose another name.",
        )


def put_file(path: Path, data: bytes, *, overwrite: bool, ours: Callable[[Path], bool], kind: str) -> None:
    """Write a file, which appears whole or not at all.

    Parameters
    ----------
    path : Path
        The file.
    data : bytes
        Its content.
    overwrite : bool
        Whether one of its kind may be replaced; anything else is refused even then.
    ours : callable
        Tells whether an existing file is of its kind.
    kind : str
        What it is called in messages.

    Raises
    ------
    MissingFileError
        If the folder is not there.
    ExistingResultError
        If something is in the way.
    UnreadableFileError
        If it cannot be written.
    """
    require_file_place(path, overwrite=overwrite, ours=ours, kind=kind)
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.name}-", dir=path.absolute().parent)
    except OSError as error:
        raise UnreadableFileError(
            given=f"{path} cannot be written ({error.strerror}).",
            needed="A folder that you may write to.",
            remedy="Choose another name.",
        ) from None
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        mask = os.umask(0)
        os.umask(mask)
        Path(name).chmod(0o666 & ~mask)
        Path(name).replace(path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
