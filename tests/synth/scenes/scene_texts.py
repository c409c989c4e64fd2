"""Scene files as text."""

from pathlib import Path

from psstereo_synth.scenes.file import parse_scene

HILLS = '[surface]\nshape = "hills"\n'


def parse(text, changes=None, folder=Path()):
    return parse_scene(text.encode(), folder / "my.toml", changes)
