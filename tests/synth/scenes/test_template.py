"""The template is a scene, and so is all that is commented out in it."""

import re
import tomllib

import pytest

from psstereo.brdf import BRDFS
from psstereo_synth.faults import FAULTS
from psstereo_synth.patterns import PATTERNS
from psstereo_synth.scenes.file import Changes
from psstereo_synth.scenes.template import TEMPLATE
from psstereo_synth.shapes import RELIEFS
from tests.synth.scenes.scene_texts import parse


def test_the_template_is_a_scene():
    made = parse(TEMPLATE)
    assert made.name == "my-scene"
    assert made.summary.endswith(".")
    assert all(len(line) <= 120 for line in TEMPLATE.splitlines())


def test_the_template_names_all_there_is():
    words = set(re.findall(r"[\w-]+", TEMPLATE))
    for catalogue in (set(RELIEFS) - {"grid"}, PATTERNS, FAULTS, BRDFS):
        assert set(catalogue) <= words
    assert {"spiral", "ring", "arc", "day", "directional", "sun", "led", "disc", "window"} <= words


def commented():
    """Lines of the template that are switched off, by the table they stand in."""
    table, found = "", []
    for line in TEMPLATE.splitlines():
        heading = re.match(r"(?:# )?\[+(\w+)\]+", line)
        if heading:
            table = heading[1]
        elif re.match(r"# \w+ = ", line):
            found.append((table, line[2:]))
    return found


# What has to be said beside a line that is switched on, and which lines it takes the place of.
BESIDE = {
    "type": ({}, ("width",)),
    "focal": ({"type": '"pinhole"'}, ("width",)),
    "distance": ({"type": '"pinhole"'}, ("width",)),
    "target": ({"position": "[1, 0, 8]"}, ()),
    "up": ({"position": "[1, 0, 8]"}, ()),
    "elevation": ({"elevation": '"dem.npy"'}, ("shape", "steepness")),
    "mesh": ({"mesh": '"ball.ply"'}, ("shape", "steepness")),
    "scale": ({"mesh": '"ball.ply"'}, ("shape", "steepness")),
    "smooth": ({"mesh": '"ball.ply"'}, ("shape", "steepness")),
    "roughness_deg": ({"brdf": '"oren-nayar"'}, ()),
    "file": ({"brdf": '"merl"', "file": '"gray.binary"'}, ()),
    "albedo": ({"pattern": '"constant"'}, ()),
    "azimuth_deg": ({"arrangement": '"arc"'}, ()),
    "directions": ({}, ("arrangement", "count", "tilt_deg")),
    "angular_radius_deg": ({"kind": '"sun"'}, ()),
    "mu": ({"kind": '"led"'}, ()),
    "radius": ({"kind": '"disc"'}, ()),
    "lights.width": ({"kind": '"window"'}, ()),
    "lights.distance": ({"kind": '"led"'}, ()),
    "latitude_deg": ({"arrangement": '"day"'}, ("tilt_deg",)),
    "day": ({"arrangement": '"day"'}, ("tilt_deg",)),
    "hours": ({"arrangement": '"day"', "latitude_deg": "40"}, ("tilt_deg",)),
    "environment": ({"environment": '"sky.exr"'}, ()),
    "dark_frame": ({"radiance": "1.0"}, ()),
    "read_noise": ({"full_well": "20000"}, ()),
    "gain": ({"full_well": "20000"}, ()),
    "rms": ({"fault": '"motion"'}, ()),
}


def switched_on(table, line):
    """The template with one line, and what belongs to it, in force."""
    key = line.split(" = ", maxsplit=1)[0]
    beside, instead = BESIDE.get(f"{table}.{key}", BESIDE.get(key, ({}, ())))
    lines = {key: line} | {other: f"{other} = {value}" for other, value in beside.items()}
    result, seen, at = [], False, ""
    for old in TEMPLATE.splitlines():
        heading = re.match(r"(?:# )?(\[+(\w+)\]+)", old)
        if heading:
            at = heading[2]
            seen = seen or at == table
            result.append(heading[1] if at == table or not old.startswith("#") else old)
            if at == table:
                result += lines.values()
        elif at != table or old.split(" = ", maxsplit=1)[0] not in (*lines, *instead):
            result.append(old)
    assert seen
    return "\n".join(result)


@pytest.mark.parametrize(("table", "line"), commented(), ids=lambda value: value[:20])
def test_every_line_of_the_template_that_is_switched_off_is_valid_too(files, table, line):
    text = switched_on(table, line)
    if table == "material" and line.startswith("file"):  # a measured reflectance has its albedo in it
        text = text.replace('[albedo]\npattern = "checker"', "")
    off, on = tomllib.loads(TEMPLATE), tomllib.loads(text)
    assert on != off
    made = parse(text, Changes(size=(8, 8)), folder=files)
    assert made.name == "my-scene"


def test_there_are_lines_that_are_switched_off():
    assert len(commented()) > 30
