"""What the planner predicts beside what is then measured: by the command, in processes of their own, at two sizes."""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from psstereo.bench import Record
    from psstereo.types import Progress

__all__ = ["MEASURED", "PREDICTED", "SCENES", "SIDES", "STAGES", "predictions", "prediction_table"]

SCENES = ("hills", "glossy")
"""One that needs nothing and one that needs much."""
PREDICTED, MEASURED = "predicted", "planned"
STAGES = ("read", "survey", "solve", "depth", "mesh")
"""Parts of a run that are predicted."""
SIDES = (200, 632)
"""Sides of the images; the larger ones have ten times the pixels of the smaller ones [px]."""
_FIRST_WORDS = {"read": "reading", "survey": "survey", "solve": "normals (", "depth": "depth (", "mesh": "mesh"}
"""How the steps of a run's record begin that a part consists of."""
_UNSETTLED = 4
"""Exit code of a run that has written its result but did not converge."""


def predictions(threads: int, progress: "Progress") -> list["Record"]:
    """Plan and reconstruct captures of two sizes a decade apart, each command in a process of its own.

    The first prediction probes the machine and keeps the figures in a folder of its own for the others, so that what is
    measured now is compared with what the machine does now.
    """
    work = [(name, side) for name in SCENES for side in SIDES]
    records: list[Record] = []
    with tempfile.TemporaryDirectory() as kept:
        for done, (name, side) in enumerate(work):
            place = Path(kept) / f"{name}-{side}"
            _render(name, side, place)
            records += _compare(f"{name} {side}x{side}", place, Path(kept), threads)
            progress("predictions", done + 1, len(work))
    return records


def _render(name: str, side: int, place: Path) -> None:
    from psstereo.io.write import write_capture
    from psstereo_synth.gallery import gallery_scene
    from psstereo_synth.rendering import render
    from psstereo_synth.scenes.file import Changes

    found = render(gallery_scene(name, Changes(size=(side, side))))[0]
    write_capture(found.capture, place)


def _compare(problem: str, place: Path, kept: Path, threads: int) -> "list[Record]":
    from psstereo.bench import Record

    told = _command(["plan", str(place), "--threads", str(threads)], kept)
    out = place.with_name(f"{place.name}-result")
    done = _command(["reconstruct", str(place), "-o", str(out), "--threads", str(threads)], kept)
    sizes = {key: told["facts"][key] for key in ("images", "height", "width", "pixels")}
    foretold = {stage: float(told["predicted"][stage]) for stage in STAGES}
    measured = {stage: _seconds(done["steps"], stage) for stage in STAGES}
    return [
        Record(
            suite="planner",
            problem=problem,
            method=method,
            repeat=0,
            seconds={**seconds, "total": sum(seconds.values())},
            sizes=sizes,
            memory=None if memory is None else int(memory),
        )
        for method, seconds, memory in (
            (PREDICTED, foretold, told["predicted"]["memory"]),
            (MEASURED, measured, done["peak_memory_bytes"]),
        )
    ]


def _command(words: list[str], kept: Path) -> Any:
    """Run the command with a cache of its own, and return its record."""
    from psstereo.errors import InputError

    environment = {**os.environ, "XDG_CACHE_HOME": str(kept), "LOCALAPPDATA": str(kept)}
    done = subprocess.run(
        [sys.executable, "-m", "psstereo_cli", *words, "--json"],
        capture_output=True,
        text=True,
        env=environment,
        check=False,
    )
    if done.returncode not in (0, _UNSETTLED):
        raise InputError(
            given=f"psstereo {words[0]} ended with the code {done.returncode}: {done.stderr.strip()[-200:]}",
            needed="A run to compare with its prediction.",
            remedy="Run that command by itself to see why.",
        )
    return json.loads(done.stdout)


def _seconds(steps: list[Mapping[str, Any]], stage: str) -> float:
    return float(sum(step["seconds"] for step in steps if step["name"].startswith(_FIRST_WORDS[stage])))


def prediction_table(records: "list[Record]") -> list[str]:
    """Return a line a problem: predicted over measured, part by part, in all, and for memory."""
    lines = []
    for problem in dict.fromkeys(record.problem for record in records):
        foretold, measured = (
            next(one for one in records if (one.problem, one.method) == (problem, method))
            for method in (PREDICTED, MEASURED)
        )
        parts = [_ratio(stage, foretold.seconds[stage], measured.seconds[stage]) for stage in (*STAGES, "total")]
        if foretold.memory is not None and measured.memory is not None:
            megabytes = foretold.memory / 1e6, measured.memory / 1e6
            parts.append(f"memory {megabytes[0]:.0f}/{megabytes[1]:.0f} MB = {megabytes[0] / megabytes[1]:.2f}")
        lines.append(f"Predicted over measured, {problem}: {', '.join(parts)}.")
    return lines


def _ratio(name: str, foretold: float, measured: float) -> str:
    ratio = f"{foretold / measured:.2f}" if measured > 0 else "–"
    return f"{name} {foretold:.2f}/{measured:.2f} s = {ratio}"
