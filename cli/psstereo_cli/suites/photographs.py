"""Suite photographs: every solver on captures of the user whose true normals are known."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from psstereo.errors import MissingFileError, OptionError

if TYPE_CHECKING:
    from psstereo.bench import Problem, Record
    from psstereo.capture import Capture, Truth
    from psstereo.types import Map, Progress

__all__ = ["photographs"]


def photographs(
    repeats: int,
    size: str | None,
    lights: int,
    threads: int,
    over: "Map",
    progress: "Progress",
    folder: Path | None = None,
) -> tuple[list["Record"], str, dict[str, Any]]:
    """Run every solver on each capture with truth in a folder; the images are read anew by each."""
    del lights, threads
    from psstereo.bench import run_solvers
    from psstereo.normals import NORMAL_SOLVERS

    if size is not None:
        raise OptionError(
            given=f"The size is {size!r}.",
            needed="The suite photographs takes captures as large as they are.",
            remedy="Leave --size out.",
        )
    problems, left_out = _problems(folder)
    methods = {name: kind() for name, kind in NORMAL_SOLVERS.items()}
    records = run_solvers(
        "photographs", problems, methods, repeats=repeats, warm_up=repeats > 1, over=over, progress=progress
    )
    notes = ["Times include reading and decoding the images, which costs every solver the same."]
    if repeats == 1:
        notes.append("With one round nothing warmed up: the first solver of each capture also reads from a cold disk.")
    return records, "least-squares", {"notes": notes + left_out}


def _problems(folder: Path | None) -> "tuple[list[Problem], list[str]]":
    """Return the captures in a folder, or that folder itself, and a word on those without truth."""
    from psstereo.bench import Problem
    from psstereo.io import recognise

    if folder is None:
        raise MissingFileError(
            given="The suite photographs has no images of its own.",
            needed="A folder of captures with true normals, such as DiLiGenT's pmsData.",
            remedy="Name it with --folder.",
        )
    inside = sorted(path for path in folder.iterdir() if path.is_dir()) if folder.is_dir() else []
    places = [place for place in (folder, *inside) if place.is_dir() and recognise(place)]
    problems, left_out = [], []
    for place in places:
        if _has_truth(place):
            problems.append(Problem(name=place.name, summary="photographs", make=partial(_read, place)))
        else:
            left_out.append(f"{place.name} was left out: it has no true normals.")
    if not problems:
        raise MissingFileError(
            given=f"{folder} holds no capture with true normals" + (f" ({len(places)} without)." if places else "."),
            needed="A capture with true normals, or a folder of such captures.",
            remedy="Name another one with --folder.",
        )
    return problems, left_out


def _has_truth(place: Path) -> bool:
    from psstereo.io import read_capture

    truth = read_capture(place)[1]
    return truth is not None and truth.normals is not None


def _read(place: Path) -> "tuple[Capture, Truth]":
    from psstereo.capture import Truth
    from psstereo.io import read_capture

    capture, truth = read_capture(place)
    return capture, truth or Truth()
