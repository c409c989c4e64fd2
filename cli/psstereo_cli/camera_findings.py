"""What commands that calibrate the camera have in common: pictures, the verdict, the rig file that is to know it."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from psstereo.io.rig_file import RigFile, RigQuality
    from psstereo.stack import ImageStack
    from psstereo.types import Array, Progress

__all__ = ["add_to_rig", "all_frames", "require_rig", "tell_finding"]


def all_frames(stack: "ImageStack", progress: "Progress") -> list["Array"]:
    """Read all pictures.

    Parameters
    ----------
    stack : ImageStack
        The pictures.
    progress : callable
        Told how many have been read.

    Returns
    -------
    list of array
        Their values, as the camera gave them.
    """
    frames: list[Array] = []
    for index in range(len(stack)):
        progress("pictures read", index, len(stack))
        frames.append(stack.frame(index))
    progress("pictures read", len(stack), len(stack))
    return frames


def add_to_rig(path: Path | None, made: str, **found: Any) -> None:
    """Write a rig file anew with something more of the camera.

    Parameters
    ----------
    path : Path or None
        The rig file; nothing is done without one.
    made : str
        How it was found, a sentence for the record.
    **found
        Fields of the rig file and their values.
    """
    if path is None:
        return
    from psstereo.io.rig_writer import write_rig

    rig = _read(path)
    write_rig(path, replace(rig, provenance=(*rig.provenance, made), **found), overwrite=True)


def require_rig(path: Path | None) -> None:
    """Refuse a rig file that cannot be read, before the work."""
    if path is not None:
        _read(path)


def _read(path: Path) -> "RigFile":
    from psstereo.io.rig_file import read_rig

    return read_rig(path)


def tell_finding(
    quality: "RigQuality", rows: list[tuple[str, str]], record: dict[str, Any], *, rig: Path | None, as_json: bool
) -> None:
    """Print what was found: a table and a verdict for a person, or a record for a machine.

    Parameters
    ----------
    quality : RigQuality
        Verdict and advice.
    rows : list of (str, str)
        The table.
    record : dict
        The figures.
    rig : Path or None
        Rig file that knows it now.
    as_json : bool
        Whether a machine reads it.
    """
    from psstereo_cli.console import print_json, print_table, say
    from psstereo_cli.record import finite

    if as_json:
        more = {"verdict": quality.verdict, "advice": list(quality.advice), "rig": None if rig is None else str(rig)}
        print_json(dict(finite({**record, **more})))
        return
    print_table("camera", rows)
    say(quality.verdict)
    for line in quality.advice:
        say(f"  {line}")
    if rig is not None:
        say(f"{rig} knows it now.")
