"""What a failure looks like: one message on stderr, JSON on stdout where machines read, exit code 3."""

import sys

from psstereo.errors import PsstereoError

__all__ = ["INPUT_UNUSABLE", "NOT_CONVERGED", "report_failure"]

INPUT_UNUSABLE = 3
"""Exit code when the input cannot be used."""
NOT_CONVERGED = 4
"""Exit code when a result was written that did not converge."""


def report_failure(error: Exception, *, as_json: bool) -> int:
    """Tell a person what went wrong and return the exit code; anything unforeseen is raised again.

    Parameters
    ----------
    error : Exception
        What happened.
    as_json : bool
        Whether to print it on stdout as JSON too.

    Returns
    -------
    int
        Exit code.
    """
    if isinstance(error, PsstereoError):
        given, needed, remedy = error.given, error.needed, error.remedy
    elif isinstance(error, MemoryError):
        given, needed = "There is not enough memory.", "The samples and the result must fit."
        remedy = "Use --max-memory, --normals-only, or a mask."
    elif isinstance(error, OSError):
        given = f"{error.filename or 'A file'}: {error.strerror or error}."
        needed, remedy = "The file or folder must be usable.", "Check room on the disk and permissions."
    else:
        raise error
    sys.stderr.write(f"psstereo: {given}\n  {needed}\n  {remedy}\n")
    if as_json:
        from psstereo_cli.console import print_json

        message = {"kind": type(error).__name__, "given": given, "needed": needed, "remedy": remedy}
        print_json({"error": message})
    return INPUT_UNUSABLE
