"""Records of measurements: one JSON object a line, of a schema that is checked on the way in and out."""

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

from psstereo.bench.environment import machine, versions
from psstereo.errors import InputError

__all__ = ["SCHEMA", "Record", "read_records", "write_records"]

SCHEMA = 2
"""Number of the records' present form; it grows when a field changes its meaning."""


@dataclass(frozen=True, kw_only=True)
class Record:
    """One measurement, or that a method declined.

    Attributes
    ----------
    suite, problem, method : str
        What was measured.
    repeat : int
        Count of the repetition, from 0.
    seconds : mapping
        Wall-clock time by stage, with ``total``; empty if the method declined [s].
    error : mapping
        Figures of the error by name, empty where only time was measured.
    sizes : mapping
        Lights, pixels and what else time or error depends on.
    memory : int or None
        Largest memory of the process so far [byte].
    declined : str or None
        Why the method refused the problem; None where it was measured.
    versions, machine : mapping
        Where it was measured.
    schema : int
        Form of the record.
    """

    suite: str
    problem: str
    method: str
    repeat: int
    seconds: Mapping[str, float]
    error: Mapping[str, float] = field(default_factory=dict)
    sizes: Mapping[str, float] = field(default_factory=dict)
    memory: int | None = None
    declined: str | None = None
    versions: Mapping[str, str] = field(default_factory=versions)
    machine: Mapping[str, str | int] = field(default_factory=machine)
    schema: int = SCHEMA

    def to_json(self) -> str:
        """Return the record as one line."""
        return json.dumps(asdict(self), sort_keys=True, allow_nan=False)

    @classmethod
    def from_json(cls, line: str) -> "Record":
        """Read a record from its line.

        Raises
        ------
        InputError
            If it is no record of this schema.
        """
        try:
            content = json.loads(line)
        except ValueError as error:
            raise _no_record(str(error)) from None
        if not isinstance(content, dict):
            raise _no_record("it is no object")
        if content.get("schema") != SCHEMA:
            raise _no_record(f"it has the schema {content.get('schema')}")
        missing = {f.name for f in fields(cls)} ^ set(content)
        if missing:
            raise _no_record(f"fields that are missing or unknown: {', '.join(sorted(missing))}")
        _check_types(content)
        return cls(**content)


def _check_types(content: Mapping[str, Any]) -> None:
    texts = ("suite", "problem", "method")
    numbers = ("seconds", "error", "sizes")
    good = all(isinstance(content[key], str) for key in texts) and type(content["repeat"]) is int
    good = good and (content["memory"] is None or type(content["memory"]) is int)
    good = good and all(isinstance(content[key], dict) for key in ("versions", "machine"))
    for key in numbers:
        entries = content[key]
        good = good and isinstance(entries, dict) and all(_is_number(v) for v in entries.values())
    declined = content["declined"]
    good = good and (declined is None or (isinstance(declined, str) and bool(declined)))
    if not good or (declined is None and "total" not in content["seconds"]):
        raise _no_record("a field has the wrong type, or the total time is missing")
    if declined is not None and (content["seconds"] or content["error"]):
        raise _no_record("the method declined, and yet it has figures")


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _no_record(why: str) -> InputError:
    return InputError(
        given=f"A line is no benchmark record: {why}.",
        needed=f"One JSON object a line, of schema {SCHEMA}.",
        remedy="Measure again with this version of the program.",
    )


def write_records(path: Path, records: Iterable[Record]) -> None:
    """Write records as JSON lines; the file appears whole or not at all."""
    partial = path.with_name(f".{path.name}.part")
    try:
        partial.write_text("".join(record.to_json() + "\n" for record in records), encoding="utf-8")
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def read_records(path: Path) -> list[Record]:
    """Read records from JSON lines."""
    return [Record.from_json(line) for line in path.read_text(encoding="utf-8").splitlines() if line.strip()]
