"""What is read must survive what is written."""

from pathlib import Path

from psstereo.errors import ExistingResultError

__all__ = ["require_outside"]


def require_outside(out: Path, *inputs: Path | str | None) -> None:
    """Refuse to replace a folder that holds what is to be read.

    Parameters
    ----------
    out : Path
        Folder for the result.
    inputs : Path, str or None
        What is read; words that name no file are passed over.

    Raises
    ------
    ExistingResultError
        If one of them lies in the folder.
    """
    for path in inputs:
        if path is not None and Path(path).exists() and out.resolve() in Path(path).resolve().parents:
            raise ExistingResultError(
                given=f"{path} lies in {out}, which would be replaced.",
                needed="What is read has to stay.",
                remedy="Choose another folder with -o.",
            )
