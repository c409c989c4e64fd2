"""Result folders that appear whole or not at all."""

import os
import shutil
import tempfile
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath

from psstereo.errors import ExistingResultError, MissingFileError, UnreadableFileError
from psstereo.io.verdict_files import edited_pictures

__all__ = ["RECORD", "new_folder", "require_free"]

RECORD = "run.json"
"""File by which a result folder is told from any other."""

_LITTER = frozenset({".DS_Store", "Thumbs.db", "desktop.ini"})
"""What file managers leave behind."""
_NAMES = frozenset({RECORD, "report.html"}) | _LITTER
_STEMS = frozenset(
    {
        "normals",
        "albedo",
        "depth",
        "uncertainty",
        "flags",
        "mesh",
        "verdicts",
        "elevation",
        "curvature",
        "relief",
        "components",
    }
)
"""What a result folder may hold; one with anything else in it is somebody's work and is never removed."""
_VERDICTS = "verdicts"
"""A folder in it, of pictures that somebody may have painted in since."""


def require_free(folder: Path, *, overwrite: bool, names: Collection[str] | None = None) -> None:
    """Refuse to write where something is that nobody asked to replace.

    Parameters
    ----------
    folder : Path
        Where a result is to go.
    overwrite : bool
        Whether an earlier result may be replaced. Any other folder with content is refused even then.
    names : collection of str, optional
        Files that are to be written, relative, with forward slashes, if it is no result: then a folder
        that holds just these files, no other and none less, is what may be replaced.

    Raises
    ------
    ExistingResultError
        If something is in the way.
    MissingFileError
        If a part of the path is a file.
    """
    for parent in folder.absolute().parents:
        if parent.exists():
            if not parent.is_dir():
                raise MissingFileError(
                    given=f"{parent} is a file.", needed="A folder to put the result in.", remedy="Choose another name."
                )
            break
    if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
        return
    if names is None:
        _require_result(folder)
    else:
        _require_capture(folder, names)
    if not overwrite:
        raise ExistingResultError(
            given=f"{folder} holds {'the result of an earlier run' if names is None else 'what an earlier run wrote'}.",
            needed="It is not replaced without being asked for.",
            remedy="Add --overwrite, or choose another folder with -o.",
        )


def _require_result(folder: Path) -> None:
    if not (folder / RECORD).is_file():
        raise ExistingResultError(
            given=f"{folder} exists and is no result of an earlier run.",
            needed="A new name, so that nothing of yours is lost.",
            remedy="Choose another folder with -o.",
        )
    foreign = sorted(p.name for p in folder.iterdir() if p.name not in _NAMES and (p.stem not in _STEMS or p.is_dir()))
    if (folder / _VERDICTS).is_dir():
        foreign.remove(_VERDICTS)
        foreign += [name for name in edited_pictures(folder / _VERDICTS) if Path(name).name not in _LITTER]
    if foreign:
        names = ", ".join(foreign[:4]) + (" …" if len(foreign) > 4 else "")
        raise ExistingResultError(
            given=f"{folder} holds what no run has written: {names}.",
            needed="A folder is replaced only if nothing else would be lost.",
            remedy="Move that away, or choose another folder with -o.",
        )


def _require_capture(folder: Path, names: Collection[str]) -> None:
    """Refuse a folder unless its files are just those that will be written again."""
    if not folder.is_dir():
        raise ExistingResultError(
            given=f"{folder} is a file.",
            needed="A new name, so that nothing of yours is lost.",
            remedy="Choose another folder with -o.",
        )
    wanted = set(names)
    above = {parent.as_posix() for name in wanted for parent in PurePosixPath(name).parents}
    found: set[str] = set()
    for path in folder.rglob("*"):
        name = path.relative_to(folder).as_posix()
        ours = (path.is_file() and (name in wanted or path.name in _LITTER)) or (path.is_dir() and name in above)
        if path.is_symlink() or not ours:
            raise ExistingResultError(
                given=f"{folder} holds {name}, which is no part of what is to be written.",
                needed="A folder is replaced only if its files are just those that are written again.",
                remedy="Move or delete the folder yourself, or choose another one with -o.",
            )
        found.add(name)
    missing = sorted(wanted - found)
    if missing:
        raise ExistingResultError(
            given=f"{folder} exists and does not hold {missing[0]}, which is to be written.",
            needed="A folder is replaced only if its files are just those that are written again.",
            remedy="Move or delete the folder yourself, or choose another one with -o.",
        )


@contextmanager
def new_folder(folder: Path, *, overwrite: bool = False, names: Collection[str] | None = None) -> Iterator[Path]:
    """Give a temporary folder to write into, and put it in its place at the end if nothing went wrong.

    Parameters
    ----------
    folder : Path
        Where the result is to be.
    overwrite : bool
        Whether an earlier result may be replaced; it stays until the new one is complete.
    names : collection of str, optional
        Files that will be written, if it is no result; see :func:`require_free`.

    Yields
    ------
    Path
        An empty folder beside it. It vanishes if an exception is raised.

    Raises
    ------
    ExistingResultError
        If something is in the way.
    UnreadableFileError
        If the folder cannot be made.
    """
    require_free(folder, overwrite=overwrite, names=names)
    target = folder.resolve()  # through links and "..", so that what is renamed is the folder itself
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        work = Path(tempfile.mkdtemp(prefix=f".{target.name}-", dir=target.parent))
    except OSError as error:
        raise UnreadableFileError(
            given=f"The folder {target.parent} cannot be written to ({error.strerror}).",
            needed="A folder where you may write.",
            remedy="Choose another one with -o.",
        ) from None
    try:
        yield work
        # mkdtemp makes folders that only their owner may read; a result gets what the umask allows.
        mask = os.umask(0)
        os.umask(mask)
        work.chmod(0o777 & ~mask)
        _exchange(work, target)
    except BaseException:
        shutil.rmtree(work, ignore_errors=True)
        raise


def _exchange(work: Path, target: Path) -> None:
    """Put a finished folder in its place; what was there goes last."""
    if not target.exists():
        work.rename(target)
        return
    old = Path(tempfile.mkdtemp(prefix=f".{target.name}-old-", dir=target.parent))
    kept = old / target.name
    try:
        target.rename(kept)
        work.rename(target)
    except BaseException:  # an interruption between the two must not take the earlier result along
        if kept.exists() and not target.exists():
            kept.rename(target)
        raise
    finally:
        if target.exists():
            shutil.rmtree(old, ignore_errors=True)
