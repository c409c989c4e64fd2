"""Scene files: every slip is one clear error."""

import pytest

from psstereo.errors import (
    InputError,
    MissingFileError,
    OptionError,
    PsstereoError,
    UnreadableFileError,
    UnsupportedError,
)
from psstereo_synth.scenes.file import read_scene
from tests.synth.scenes.scene_texts import HILLS, parse

WRONG = {
    "no surface": "",
    "empty surface": "[surface]",
    "surface is text": 'surface = "hills"',
    "two surfaces": '[surface]\nshape = "hills"\nmesh = "a.ply"',
    "no such shape": '[surface]\nshape = "hils"',
    "shape is a number": "[surface]\nshape = 3",
    "key of another shape": "[surface]\nshape = 'sphere'\nsteepness = 3",
    "radius zero": "[surface]\nshape = 'sphere'\nradius = 0",
    "radius nan": "[surface]\nshape = 'sphere'\nradius = nan",
    "radius inf": "[surface]\nshape = 'sphere'\nradius = inf",
    "steepness text": "[surface]\nshape = 'hills'\nsteepness = '2'",
    "count real": "[surface]\nshape = 'hills'\ncount = 2.5",
    "mesh empty": "[surface]\nmesh = ''",
    "mesh number": "[surface]\nmesh = 3",
    "mesh scale": "[surface]\nmesh = 'a.ply'\nscale = 0",
    "mesh smooth": "[surface]\nmesh = 'a.ply'\nsmooth = 1",
    "mesh key": "[surface]\nmesh = 'a.ply'\nsteepness = 1",
    "elevation key": "[surface]\nelevation = 'a.npy'\nscale = 1",
    "elevation number": "[surface]\nelevation = 1",
    "unknown key": f"sise = [3, 3]\n{HILLS}",
    "unknown table": f"{HILLS}[camra]\nwidth = 1",
    "size zero": f"size = [0, 5]\n{HILLS}",
    "size negative": f"size = [5, -5]\n{HILLS}",
    "size one": f"size = 256\n{HILLS}",
    "size three": f"size = [1, 2, 3]\n{HILLS}",
    "size real": f"size = [8.0, 8.0]\n{HILLS}",
    "size true": f"size = [true, true]\n{HILLS}",
    "size text": f'size = "8x8"\n{HILLS}',
    "size huge": f"size = [100000, 100000]\n{HILLS}",
    "seed negative": f"seed = -1\n{HILLS}",
    "seed real": f"seed = 1.5\n{HILLS}",
    "seed true": f"seed = true\n{HILLS}",
    "name empty": f'name = ""\n{HILLS}',
    "name number": f"name = 3\n{HILLS}",
    "unit number": f"unit = 3\n{HILLS}",
    "summary list": f"summary = ['a']\n{HILLS}",
    "camera type": f"{HILLS}[camera]\ntype = 'fisheye'",
    "camera key": f"{HILLS}[camera]\nfocal = 3",
    "camera width": f"{HILLS}[camera]\nwidth = -1",
    "camera width nan": f"{HILLS}[camera]\nwidth = nan",
    "camera focal": f"{HILLS}[camera]\ntype = 'pinhole'\nfocal = 0",
    "camera distance": f"{HILLS}[camera]\ntype = 'pinhole'\ndistance = inf",
    "camera distance text": f"{HILLS}[camera]\ntype = 'pinhole'\ndistance = '8'",
    "views table": f"{HILLS}[views]\nposition = [0, 0, 3]",
    "views empty": f"views = []\n{HILLS}",
    "views numbers": f"views = [1, 2]\n{HILLS}",
    "view without position": f"{HILLS}[[views]]\ntarget = [0, 0, 0]",
    "view key": f"{HILLS}[[views]]\nposition = [0, 0, 3]\nroll = 3",
    "view position": f"{HILLS}[[views]]\nposition = [0, 0]",
    "view position text": f"{HILLS}[[views]]\nposition = ['0', '0', '3']",
    "view position nan": f"{HILLS}[[views]]\nposition = [0, 0, nan]",
    "view at its target": f"{HILLS}[[views]]\nposition = [0, 0, 0]",
    "view up": f"{HILLS}[[views]]\nposition = [0, 0, 3]\nup = [0, 0, 1]",
    "brdf unknown": f"{HILLS}[material]\nbrdf = 'lambertian'",
    "brdf key": f"{HILLS}[material]\nroughness = 0.3",
    "brdf albedo": f"{HILLS}[material]\nalbedo = 0.3",
    "brdf diffuse": f"{HILLS}[material]\nbrdf = 'phong'\ndiffuse = 0.3\nspecular = 0.1\nexponent = 3",
    "brdf text": f"{HILLS}[material]\nbrdf = 'ggx'\nf0 = '0.3'\nroughness = 0.3",
    "brdf nan": f"{HILLS}[material]\nbrdf = 'ggx'\nf0 = nan\nroughness = 0.3",
    "brdf map": f"{HILLS}[material]\nbrdf = 'ggx'\nf0 = [[0.3, 0.2], [0.1, 0.1]]\nroughness = 0.3",
    "brdf channels": f"{HILLS}[material]\nbrdf = 'ggx'\nf0 = [0.3, 0.2]\nroughness = [0.1, 0.2, 0.3]",
    "merl file": f"{HILLS}[material]\nbrdf = 'merl'",
    "pattern missing": f"{HILLS}[albedo]\nalbedo = 0.3",
    "pattern unknown": f"{HILLS}[albedo]\npattern = 'chequer'",
    "pattern key": f"{HILLS}[albedo]\npattern = 'constant'\ncells = 3",
    "albedo negative": f"{HILLS}[albedo]\npattern = 'constant'\nalbedo = -0.1",
    "albedo above one": f"{HILLS}[albedo]\npattern = 'constant'\nalbedo = 1.1",
    "albedo nan": f"{HILLS}[albedo]\npattern = 'constant'\nalbedo = nan",
    "albedo text": f"{HILLS}[albedo]\npattern = 'constant'\nalbedo = '0.3'",
    "albedo true": f"{HILLS}[albedo]\npattern = 'constant'\nalbedo = true",
    "image without path": f"{HILLS}[albedo]\npattern = 'image'",
    "shadows": f"{HILLS}[render]\ncast_shadows = 'no'",
    "beams zero": f"{HILLS}[render]\nbeams = 0",
    "beams real": f"{HILLS}[render]\nbeams = 3.5",
    "beams true": f"{HILLS}[render]\nbeams = true",
    "beams huge": f"{HILLS}[render]\nbeams = 1000000000",
    "bounce negative": f"{HILLS}[render]\nbounce = -1",
    "bounce huge": f"{HILLS}[render]\nbounce = 1000000000",
    "extinction negative": f"{HILLS}[render]\nextinction = -0.1",
    "extinction nan": f"{HILLS}[render]\nextinction = nan",
    "extinction text": f"{HILLS}[render]\nextinction = '0'",
    "bounce in fog": f"{HILLS}[render]\nbounce = 4\nextinction = 0.1",
    "render key": f"{HILLS}[render]\nshadows = true",
    "bits": f"{HILLS}[sensor]\nbits = 9",
    "bits text": f"{HILLS}[sensor]\nbits = '8'",
    "bits true": f"{HILLS}[sensor]\nbits = true",
    "bits real": f"{HILLS}[sensor]\nbits = 8.0",
    "white zero": f"{HILLS}[sensor]\nwhite = 0",
    "white nan": f"{HILLS}[sensor]\nwhite = nan",
    "white text": f"{HILLS}[sensor]\nwhite = '3'",
    "read noise alone": f"{HILLS}[sensor]\nread_noise = 3",
    "dark level": f"{HILLS}[sensor]\ndark_level = 1",
    "vignetting": f"{HILLS}[sensor]\nvignetting = -0.1",
    "response word": f"{HILLS}[sensor]\nresponse = 'gamma'",
    "response true": f"{HILLS}[sensor]\nresponse = true",
    "response list": f"{HILLS}[sensor]\nresponse = [2.2]",
    "response nan": f"{HILLS}[sensor]\nresponse = nan",
    "response huge": f"{HILLS}[sensor]\nresponse = 100",
    "sensor key": f"{HILLS}[sensor]\niso = 100",
    "sensor seed": f"{HILLS}[sensor]\nseed = -1",
    "dark frame of nothing": f"{HILLS}[ambient]\ndark_frame = true",
    "faults table": f"{HILLS}[faults]\nfault = 'motion'",
    "faults list": f"faults = ['motion']\n{HILLS}",
    "fault without name": f"{HILLS}[[faults]]\nrms = 0.3",
    "fault unknown": f"{HILLS}[[faults]]\nfault = 'mution'",
    "fault key": f"{HILLS}[[faults]]\nfault = 'motion'\nsigma = 0.3",
    "fault value": f"{HILLS}[[faults]]\nfault = 'motion'\nrms = -0.3",
    "fault word": f"{HILLS}[[faults]]\nfault = 'motion'\nkind = 'drunk'",
    "fault without its value": f"{HILLS}[[faults]]\nfault = 'ambient-leak'",
    "more than 64 bits": f"seed = 123456789012345678901234567890\n{HILLS}",
    "more digits than are read": f"seed = {'9' * 5000}\n{HILLS}",
    "hexadecimal without end": f"size = [8, 0x{'f' * 5000}]\n{HILLS}",
    "nested without end": f"size = {'[' * 5000}{']' * 5000}\n{HILLS}",
    "date": f"size = [2020-01-01, 5]\n{HILLS}",
    "twice": f"size = [3, 3]\nsize = [4, 4]\n{HILLS}",
    "no TOML": "this is = = no TOML",
}


@pytest.mark.parametrize("what", WRONG)
def test_every_slip_is_one_clear_error(what):
    kinds = (InputError, OptionError, UnreadableFileError, UnsupportedError)
    with pytest.raises(PsstereoError) as caught:
        parse(WRONG[what])
    error = caught.value
    assert isinstance(error, kinds)
    assert all(part and part[0].isupper() | (part[0] in "[/") | part[0].isalnum() for part in (error.given,))
    assert error.needed.endswith((".", "]"))
    assert error.remedy
    assert len(str(error)) < 700


@pytest.mark.parametrize(
    ("text", "near"),
    [
        (f"sise = [3, 3]\n{HILLS}", "size"),
        (f"{HILLS}[camra]\nwidth = 1", "camera"),
        (f"{HILLS}[camera]\nwith = 1", "width"),
        (f"{HILLS}[camera]\ntype = 'pinole'", "pinhole"),
        ("[surface]\nshape = 'terain'", "terrain"),
        ("[surface]\nshape = 'hills'\nstepness = 1", "steepness"),
        (f"{HILLS}[material]\nbrdf = 'lamberd'", "lambert"),
        (f"{HILLS}[albedo]\npattern = 'cheker'", "checker"),
        (f"{HILLS}[[faults]]\nfault = 'deadpixels'", "dead-pixels"),
        (f"{HILLS}[render]\nbounces = 3", "bounce"),
        (f"{HILLS}[sensor]\nfullwell = 3", "full_well"),
        (f"{HILLS}[ambient]\nradience = 3", "radiance"),
    ],
)
def test_the_nearest_name_is_offered(text, near):
    with pytest.raises(OptionError) as caught:
        parse(text)
    assert caught.value.remedy == f"Did you mean {near}?"


def test_files_of_all_sorts(tmp_path):
    folder = tmp_path / "Größe 尺寸"
    folder.mkdir()
    path = folder / "Hügel.toml"
    path.write_bytes(b"\xef\xbb\xbf" + f'summary = "Für Äpfel."\r\n{HILLS}'.encode())
    made = read_scene(path)
    assert made.name == "Hügel"
    assert made.summary == "Für Äpfel."
    for content, error in ((b"", InputError), (b"\xff\xfe\x00", UnreadableFileError), (b"\0", UnreadableFileError)):
        path.write_bytes(content)
        with pytest.raises(error, match="Hügel"):
            read_scene(path)
    with pytest.raises(MissingFileError, match="none"):
        read_scene(folder / "none.toml")
    with pytest.raises(UnreadableFileError):
        read_scene(folder)
