"""Meshroom's JSON files of lights."""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from psstereo.errors import InputError, UnreadableFileError, UnsupportedError
from psstereo.io.conventions import to_canonical
from psstereo.io.light_file import Directions
from psstereo.io.text import read_lines
from psstereo.types import FloatArray

__all__ = ["JsonLights", "read_light_json"]


@dataclass(frozen=True, eq=False)
class JsonLights:
    """Lights of a JSON file, in its order.

    Attributes
    ----------
    keys : tuple of str
        Identities of views, or names of images in older files; empty where there are none.
    vectors : float64 array (m, 3)
        Toward the lights, x right, y up, z toward the camera, not normalised [1].
    strengths : float64 array (m, 3)
        Intensities of the lights in R, G, B [relative].
    """

    keys: tuple[str, ...]
    vectors: FloatArray
    strengths: FloatArray

    def for_images(self, names: Sequence[str], source: str) -> Directions:
        """Return the lights in the order of images.

        A light belongs to the image whose name, without ending, is its key or has its number; in older files, whose
        keys are names, to the one that contains it. Where no key means an image, the order of the file counts:
        Meshroom's own identities stand in its scene only.

        Parameters
        ----------
        names : sequence of str
            File names of the images.
        source : str
            Name of the light file, for messages.

        Returns
        -------
        Directions
            Vectors and strengths, one an image.

        Raises
        ------
        InputError
            If some keys mean images and others do not, or the numbers of lights and images differ.
        """
        stems = [Path(name).stem.casefold() for name in names]
        keys = [key.casefold() for key in self.keys]
        best: list[list[int]] = [[] for _ in names]
        for fits in (_is, _has_number, _contains):
            hits = [[i for i, key in enumerate(keys) if fits(stem, key)] for stem in stems]
            order = [hit[0] for hit in hits if len(hit) == 1]
            if len(order) == len(names) == len(set(order)):
                return Directions(self.vectors[order], (), self.strengths[order])
            best = max(best, hits, key=lambda found: sum(map(bool, found)))
        if len(keys) != len(names) or any(best):
            odd = [name for name, hit in zip(names, best, strict=True) if len(hit) != 1]
            raise InputError(
                given=f"{source} holds {len(keys)} lights, and not just one of them for each of the {len(names)} images"
                f"{': ' + ', '.join(odd[:4]) if odd and any(best) else ''}.",
                needed="Each image needs its light: a key that is the image's name or number.",
                remedy="Take the lights of other images out of the file, or pad numbers in names to equal width.",
            )
        note = f"No light in {source} names an image; they were taken in their order."
        return Directions(self.vectors, (note,), self.strengths)


def _is(stem: str, key: str) -> bool:
    return stem == key


def _has_number(stem: str, key: str) -> bool:
    digits = re.findall(r"\d+", stem)
    return key.isdecimal() and bool(digits) and int(digits[-1]) == int(key)


def _contains(stem: str, key: str) -> bool:
    return bool(key) and not key.isdecimal() and key in stem


def read_light_json(path: Path) -> JsonLights:
    """Read ``{"lights": [{"viewId": …, "type": "directional", "direction": […], "intensity": […]}]}``.

    Numbers may stand as strings, as Meshroom writes them, and ``lights`` may be a table by image names, as in older
    files. Directions are x right, y down, z into the scene there.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    JsonLights
        Lights in the canonical frame.

    Raises
    ------
    UnreadableFileError
        If it is not valid JSON of this form; the message names the light.
    UnsupportedError
        If a light is a set of spherical harmonics, which has no single direction.
    MissingFileError
        If the file is not there.
    """
    try:
        content = json.loads("\n".join(read_lines(path)))
    except ValueError as error:
        raise _wrong(path, f"is not valid JSON ({error})") from None
    lights = content.get("lights") if isinstance(content, dict) else None
    if isinstance(lights, dict):
        entries = list(lights.items())
    elif isinstance(lights, list):
        entries = [(_key(entry), entry) for entry in lights]
    else:
        entries = []
    if not entries:
        raise _wrong(path, "holds no list of lights")
    rows = [_light(path, number, entry) for number, (_, entry) in enumerate(entries, start=1)]
    vectors = np.array([direction for direction, _ in rows], np.float64)
    strengths = np.array([intensity for _, intensity in rows], np.float64)
    return JsonLights(tuple(key for key, _ in entries), to_canonical(vectors, "meshroom"), strengths)


def _key(entry: Any) -> str:
    # A lightId, as in lights that are saved to be used again, numbers the lights and means no image.
    return str(entry.get("viewId", "")) if isinstance(entry, dict) else ""


def _light(path: Path, number: int, entry: Any) -> tuple[list[float], list[float]]:
    key = str(number)
    if not isinstance(entry, dict):
        raise _wrong(path, f"has a light {key} that is no table")
    kind = entry.get("type", "directional")
    if kind != "directional":
        raise UnsupportedError(
            given=f"Light {key} in {path.name} is of the type {kind}.",
            needed='Only lights of the type "directional" have a direction.',
            remedy="Calibrate the lights as directional in Meshroom.",
        )
    direction, intensity = entry.get("direction"), entry.get("intensity", [1, 1, 1])
    return _three(path, key, "direction", direction), _three(path, key, "intensity", intensity)


def _three(path: Path, key: str, what: str, values: Any) -> list[float]:
    try:
        numbers = [float(value) for value in values]
    except (TypeError, ValueError):
        numbers = []
    if len(numbers) != 3:
        raise _wrong(path, f"has a light {key} whose {what} is {str(values)[:60]}")
    return numbers


def _wrong(path: Path, how: str) -> UnreadableFileError:
    return UnreadableFileError(
        given=f"The lights file {path} {how}.",
        needed='{"lights": [{"viewId": "1", "type": "directional", "direction": [x, y, z], "intensity": [r, g, b]}]}.',
        remedy="Name a file of lights that Meshroom saved.",
    )
