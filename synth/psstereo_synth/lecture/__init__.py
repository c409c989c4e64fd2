"""The lecture's statements as worked examples: each computes a small table, and how far it is from the statement.

``python -m psstereo_synth.lecture`` prints them all, with a name only that one.
"""

from collections.abc import Callable

from psstereo_synth.lecture.cosine import cosine
from psstereo_synth.lecture.example import Example
from psstereo_synth.lecture.laboratory import laboratory
from psstereo_synth.lecture.radiance import radiance
from psstereo_synth.lecture.room import room
from psstereo_synth.lecture.skylight import skylight
from psstereo_synth.lecture.statements import STATEMENTS
from psstereo_synth.lecture.sun import sun
from psstereo_synth.lecture.tube import tube
from psstereo_synth.lecture.viewpoints import viewpoints

__all__ = ["LECTURE", "STATEMENTS", "Example"]

LECTURE: dict[str, Callable[[], Example]] = {
    "tube": tube,
    "radiance": radiance,
    "room": room,
    "cosine": cosine,
    "skylight": skylight,
    "laboratory": laboratory,
    "viewpoints": viewpoints,
    "sun": sun,
}
"""Worked examples by name; `STATEMENTS` has what each shows."""
