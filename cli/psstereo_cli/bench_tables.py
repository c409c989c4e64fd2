"""What ``psstereo bench`` prints: its tables, what is to be said of them, and who declined."""

from collections.abc import Mapping
from typing import Any

from psstereo_cli.console import print_table, say

__all__ = ["print_bench"]

_FEW = 3
"""Problems that are named where a method declined."""


def print_bench(content: Mapping[str, Any]) -> None:
    """Print what a suite found.

    Parameters
    ----------
    content : mapping
        Of :func:`psstereo.bench.folder.bench_content`.
    """
    from psstereo.bench.tables import declines_of, remarks_of, tables_of

    for table in tables_of(content):
        print_table(table.title, table.rows, table.columns)
        if table.note:
            say(table.note)
    for one in declines_of(content):
        where = ", ".join(one.problems[:_FEW]) + (" …" if len(one.problems) > _FEW else "")
        say(f"{one.method} declined ({where}): {one.reason}")
    for remark in remarks_of(content):
        say(remark)
