"""Lines of TOML: numbers that come back to the last bit, text with its escapes, tables of numbers."""

import json

from psstereo.errors import InputError
from psstereo.types import FloatArray

__all__ = ["toml_number", "toml_rows", "toml_text"]


def toml_rows(key: str, values: FloatArray) -> list[str]:
    """Return the lines of a list of numbers, or of rows of numbers, one a line.

    Parameters
    ----------
    key : str
        Name of the value.
    values : float array (k, n)
        The rows; with n = 1 they become plain numbers.

    Returns
    -------
    list of str
        The lines.
    """
    if values.shape[1] == 1:
        rows = [f"    {toml_number(row[0])}," for row in values]
    else:
        rows = [f"    [{', '.join(toml_number(value) for value in row)}]," for row in values]
    return [f"{key} = [", *rows, "]"]


def toml_number(value: float) -> str:
    """Return the shortest number that comes back to the last bit."""
    return repr(float(value))


def toml_text(value: str, what: str) -> str:
    """Return a string of TOML, whose escapes are those of JSON for all but one control character.

    Parameters
    ----------
    value : str
        The text.
    what : str
        What it is, for the message.

    Returns
    -------
    str
        The text between quotation marks.

    Raises
    ------
    InputError
        If it is blank, or no text of Unicode.
    """
    try:
        value.encode("utf-8")
    except UnicodeEncodeError:
        value = ""
    if not value.strip():
        raise InputError(
            given=f"The {what} is blank, or is no text of Unicode.",
            needed="Some letters, which a text file can hold.",
            remedy="Give it another one.",
        )
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
