"""Print the lecture's examples: ``python -m psstereo_synth.lecture [NAME ...]``."""

import argparse
import sys
from collections.abc import Sequence

from psstereo.catalogue import choose
from psstereo.errors import OptionError
from psstereo_synth.lecture import LECTURE, STATEMENTS, Example
from psstereo_synth.lecture.example import Cell

__all__ = ["as_text", "main"]


def _entry(cell: Cell) -> str:
    return cell if isinstance(cell, str) else f"{cell:.6g}"


def as_text(example: Example) -> str:
    """Return an example as lines of text: text columns to the left, numbers to the right.

    Parameters
    ----------
    example : Example
        What an example's function returned.

    Returns
    -------
    str
        Lines, ending in a newline.
    """
    entries = [example.columns, *[tuple(_entry(cell) for cell in row) for row in example.rows]]
    widths = [max(map(len, column)) for column in zip(*entries, strict=True)]
    words = [isinstance(cell, str) for cell in example.rows[0]]

    def line(row: Sequence[str]) -> str:
        cells = zip(row, widths, words, strict=True)
        return "  ".join(cell.ljust(w) if text else cell.rjust(w) for cell, w, text in cells).rstrip()

    verdict = "holds" if example.holds else "DOES NOT HOLD"
    lines = [
        example.title,
        example.statement,
        *example.notes,
        "",
        *map(line, entries),
        "",
        f"{verdict}: largest error {example.largest_error:.2g}, tolerance {example.tolerance:.2g}",
    ]
    return "\n".join(lines) + "\n"


def main(words: Sequence[str] | None = None) -> int:
    """Print examples.

    Parameters
    ----------
    words : sequence of str, optional
        Arguments; those of the process if absent.

    Returns
    -------
    int
        0 if all hold, 1 if one does not, 2 if a name is unknown.
    """
    listing = "\n".join(f"  {name:<11} {sentence}" for name, sentence in STATEMENTS.items())
    parser = argparse.ArgumentParser(
        prog="python -m psstereo_synth.lecture",
        description="Print the lecture's statements, worked out in numbers:\n\n" + listing,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="which ones; all if absent")
    names = parser.parse_args(words).names or list(LECTURE)
    try:
        chosen = [choose(LECTURE, name, "example") for name in names]
    except OptionError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    good = True
    for number, work in enumerate(chosen):
        example = work()
        good &= example.holds
        sys.stdout.write(("\n" if number else "") + as_text(example))
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
