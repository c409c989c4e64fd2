"""Options that several calibrations share, each declared once, and the size of a board in words."""

import re
from pathlib import Path
from typing import Annotated

import typer

__all__ = [
    "BallFolders",
    "BallOrigin",
    "BallWords",
    "ByName",
    "DarkPicture",
    "PinholeMatrix",
    "RigOut",
    "ToneCurve",
    "parse_board",
]

RigOut = Annotated[Path, typer.Option("-o", "--out", help="Rig file (.toml) to write.")]
BallFolders = Annotated[
    list[Path], typer.Argument(help="Folder of the pictures, one a light; or one folder for each ball.")
]
BallWords = Annotated[
    list[str] | None,
    typer.Option(
        "--ball",
        help="A ball, once for each: X,Y,R in pixels; columns and rows of three or more clicks on its outline,"
        " X,Y,X,Y,X,Y; a mask; a file with x, y and r; or auto. If absent, the mask or circle_data.txt in the"
        " folder, else auto.",
    ),
]
BallOrigin = Annotated[
    str,
    typer.Option("--origin", help="Of numbers in --ball: top-left, counted from 0; or bottom-left, counted from 1."),
]
PinholeMatrix = Annotated[
    str | None,
    typer.Option(
        "--K",
        help="The camera is a pinhole: a file with its 3 × 3 matrix, or fx,fy,cx,cy,skew in pixels, the skew if there"
        " is any.",
    ),
]
ToneCurve = Annotated[
    str,
    typer.Option(
        "--response", help="Tone curve of the photographs: linear, srgb, or the exponent of a gamma curve such as 2.2."
    ),
]
DarkPicture = Annotated[Path | None, typer.Option("--dark", help="Picture without any of the lights, to subtract.")]
ByName = Annotated[
    bool, typer.Option("--by-name", help="The object is in the same pictures: keep their names in the rig.")
]


def parse_board(text: str, *, needed: str, remedy: str) -> tuple[int, int]:
    """Read two counts along the sides of a board.

    Parameters
    ----------
    text : str
        What was said.
    needed, remedy : str
        What is counted and how, for the message.

    Returns
    -------
    int, int
        Across and down.

    Raises
    ------
    OptionError
        If it is anything but two whole numbers.

    Examples
    --------
    >>> parse_board("9x7", needed="", remedy=""), parse_board(" 9 × 7", needed="", remedy="")
    ((9, 7), (9, 7))
    """
    from psstereo.errors import OptionError

    match = re.fullmatch(r"\s*(\d{1,3})\s*[x×]\s*(\d{1,3})\s*", text.lower())
    if match is None:
        raise OptionError(given=f"The board is {text!r}.", needed=needed, remedy=remedy)
    return int(match[1]), int(match[2])
