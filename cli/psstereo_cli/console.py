"""Talking to a person: tables and progress on stderr, so that stdout stays for machines."""

import json
import sys
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from psstereo.types import Progress, no_progress

if TYPE_CHECKING:
    from rich.progress import Progress as Bars
    from rich.progress import TaskID

__all__ = ["print_json", "print_table", "progress_bars", "say"]

_FILE_WIDTH = 120
"""Characters a line when the words go into a file rather than onto a screen."""

_PATIENCE = 0.7
"""Seconds before a bar appears; quicker work needs none, and drawing has to be loaded first."""


def say(text: str) -> None:
    """Write a line for a person."""
    sys.stderr.write(text + "\n")


def print_json(record: Mapping[str, Any]) -> None:
    """Write one JSON object on stdout, with escapes where its encoding lacks a letter."""
    text = json.dumps(record, ensure_ascii=False, indent=1, allow_nan=False)
    try:
        text.encode(sys.stdout.encoding or "utf-8")
    except UnicodeEncodeError:
        text = json.dumps(record, indent=1, allow_nan=False)
    sys.stdout.write(text + "\n")


def print_table(title: str, rows: Iterable[tuple[str, ...]], columns: tuple[str, ...] = ()) -> None:
    """Write a table; the first column names, the others are values."""
    from rich import box
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    table = Table(title=title, title_justify="left", box=box.SIMPLE, show_header=bool(columns), pad_edge=False)
    content = list(rows)
    for i in range(len(content[0]) if content else len(columns)):
        table.add_column(columns[i] if columns else "", overflow="fold")
    for row in content:
        table.add_row(*(escape(cell) for cell in row))
    console = Console(stderr=True)
    if not console.is_terminal:
        console.width = _FILE_WIDTH
    console.print(table)


@contextmanager
def progress_bars() -> Iterator[Progress]:
    """Give a callback that draws one bar a stage on a terminal, once the work has taken a moment."""
    if not sys.stderr.isatty():
        yield no_progress
        return
    bars = _Bars()
    try:
        yield bars
    finally:
        bars.close()


class _Bars:
    """Bars that come into being when the work turns out to be long."""

    def __init__(self) -> None:
        self._started = time.monotonic()
        self._drawn: Bars | None = None
        self._tasks: dict[str, TaskID] = {}
        self._done: dict[str, int] = {}

    def __call__(self, stage: str, done: int, total: int, /) -> None:
        if self._drawn is None:
            if time.monotonic() - self._started < _PATIENCE or done == total:
                return
            self._drawn = self._draw()
        if stage not in self._tasks:
            self._tasks[stage] = self._drawn.add_task(stage, total=total)
        if done < self._done.get(stage, 0):  # begun anew, and the time left is that of the new round
            self._drawn.reset(self._tasks[stage], total=total)
        self._done[stage] = done
        self._drawn.update(self._tasks[stage], completed=done, total=total)

    @staticmethod
    def _draw() -> "Bars":
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
        from rich.progress import Progress as Bars

        bars = Bars(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(),
            console=Console(stderr=True),
            transient=True,
        )
        bars.start()
        return bars

    def close(self) -> None:
        """Take the bars off the screen."""
        if self._drawn is not None:
            self._drawn.stop()
