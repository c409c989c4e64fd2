"""Meshroom's JSON files of lights: numbers as strings, y and z turned, keys that are views or names."""

import json

import numpy as np
import pytest

from psstereo.errors import InputError, MissingFileError, RigError, UnreadableFileError, UnsupportedError
from psstereo.io import read_directions
from psstereo.io.distant_lights import chosen_directions
from psstereo.io.light_json import read_light_json
from psstereo.io.reader import Choices

L = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, -0.6, 0.8]])
POWER = np.array([[1.0, 2, 3], [4, 5, 6], [0.1, 0.2, 0.3]])
NAMES = ("img_0007.png", "img_0008.png", "img_0010.png")


def entry(i, **more):
    direction = [repr(float(v)) for v in L[i] * [1, -1, -1]]
    return {"type": "directional", "direction": direction, "intensity": [repr(float(v)) for v in POWER[i]], **more}


def save(folder, lights):
    path = folder / "lights é.json"
    path.write_text(json.dumps({"lights": lights}) + "\n", encoding="utf-8")
    return path


def chosen(path, names=NAMES):
    return chosen_directions(Choices(lights=path), names)


def test_strings_are_numbers_and_the_frame_is_turned(tmp_path):
    path = save(tmp_path, [entry(i, viewId=str(10**9 + i)) for i in range(3)])
    found = read_light_json(path)
    assert found.keys == ("1000000000", "1000000001", "1000000002")
    np.testing.assert_array_equal(found.vectors, L)
    np.testing.assert_array_equal(found.strengths, POWER)
    np.testing.assert_array_equal(read_directions(path, 3).vectors, L)
    np.testing.assert_array_equal(read_directions(path, 3).strengths, POWER)


def test_keys_that_mean_no_image_go_by_order_and_that_is_said(tmp_path):
    for more in ("viewId", "lightId"):
        lights = [entry(i, **{more: str(i) if more == "lightId" else str(10**9 + i)}) for i in range(3)]
        found = chosen(save(tmp_path, lights))
        np.testing.assert_array_equal(found.vectors, L)
        assert "in their order" in found.notes[0]


@pytest.mark.parametrize("keys", [("10", "7", "8"), ("IMG_0010", "img_0007", "img_0008")])
def test_numbers_and_names_of_images_go_by_name(tmp_path, keys):
    found = chosen(save(tmp_path, [entry(i, viewId=keys[i]) for i in range(3)]))
    np.testing.assert_array_equal(found.vectors, L[[1, 2, 0]])
    np.testing.assert_array_equal(found.strengths, POWER[[1, 2, 0]])
    assert found.notes == ()


def test_older_files_have_parts_of_names_as_keys(tmp_path):
    found = chosen(
        save(tmp_path, {"G_0010": entry(0), "g_0007": entry(1), "0008x": entry(2)}),
        (*NAMES[:1], "a_0008x.png", NAMES[2]),
    )
    np.testing.assert_array_equal(found.vectors, L[[1, 2, 0]])


@pytest.mark.parametrize(
    "keys", [("7", "8", "11"), ("img_00", "img_0008", "img_0010"), ("7", "7", "10"), ("7", "1000000001", "10")]
)
def test_keys_that_fit_some_images_only_are_refused(tmp_path, keys):
    with pytest.raises(InputError, match="3 lights"):
        chosen(save(tmp_path, [entry(i, viewId=keys[i]) for i in range(3)]))


def test_another_number_of_lights_is_refused(tmp_path):
    path = save(tmp_path, [entry(i) for i in range(3)])
    with pytest.raises(InputError, match="3 lights"):
        chosen(path, NAMES[:2])
    with pytest.raises(InputError, match="there are 4 images"):
        read_directions(path, 4)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[1, 2", "is not valid JSON"),
        ("[1, 2]", "no list of lights"),
        ('{"lights": []}', "no list of lights"),
        ('{"lights": 3}', "no list of lights"),
        ('{"lights": [7]}', "light 1 that is no table"),
        ('{"lights": [{"direction": ["1", "2"]}]}', "light 1 whose direction"),
        ('{"lights": [{"direction": ["1", "2", "x"]}]}', "light 1 whose direction"),
        ('{"lights": [{"direction": 3}]}', "light 1 whose direction"),
        ('{"lights": [{"direction": [0, 0, 1], "intensity": ["1"]}]}', "light 1 whose intensity"),
    ],
)
def test_damaged_files(tmp_path, text, said):
    path = tmp_path / "l.json"
    path.write_text(text)
    with pytest.raises(UnreadableFileError, match=said):
        read_light_json(path)


def test_harmonics_and_missing_files(tmp_path):
    with pytest.raises(UnsupportedError, match=r"Light 2 .* type SH"):
        read_light_json(save(tmp_path, [entry(0), entry(1, type="SH")]))
    with pytest.raises(MissingFileError):
        read_light_json(tmp_path / "gone.json")


def test_a_light_that_is_no_number_is_named(tmp_path):
    from psstereo.io.distant_lights import distant_rig
    from psstereo.stack import MemoryStack

    stack = MemoryStack(np.ones((3, 2, 2, 3), np.uint8), names=NAMES)
    for key, value in (("direction", ["nan", "0", "1"]), ("intensity", ["0", "1", "1"])):
        path = save(tmp_path, [entry(0), entry(1, **{key: value}), entry(2)])
        with pytest.raises(RigError, match="json: Light 2"):
            distant_rig(stack, Choices(lights=path), lambda: None, "x")
