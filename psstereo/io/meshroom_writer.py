"""Captures written as Meshroom's photometric stereo takes them."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import ClassVar

import numpy as np

from psstereo.camera import Pinhole
from psstereo.capture import Capture, Truth
from psstereo.io.conventions import CONVENTIONS, from_canonical
from psstereo.io.layout_writer import (
    LayoutWriter,
    Save,
    camera_file,
    mask_file,
    numbers,
    text_file,
    three,
    whole_type,
)
from psstereo.io.pictures import write_png
from psstereo.io.write_checks import distant_lights, require_integers, require_no_dark
from psstereo.stack import ImageStack
from psstereo.types import Array, FloatArray

__all__ = ["MeshroomWriter"]


class MeshroomWriter(LayoutWriter):
    """``PS_Pictures/0001.png …`` with the lights as text and as JSON, and ``mask.png``.

    ``light_directions.txt`` is x right, y up, z toward the camera; ``convertionMatrix.txt`` (their spelling) turns it
    into Meshroom's frame, y down and z into the scene, in which ``lights.json`` is. View identities in the JSON file
    are the numbers of the images, since Meshroom makes its own only when it loads them: replace them by those of its
    scene before the file is used there. Numbers of images have equal widths, since a picture also fits a key that its
    name contains. A pinhole's K goes into ``K.txt``.
    """

    name: ClassVar[str] = "meshroom"
    summary: ClassVar[str] = "PS_Pictures/0001.png …, light_directions.txt, light_intensities.txt, lights.json"

    def check_images(self, capture: Capture) -> None:
        """Refuse what is not linear integers."""
        require_integers(capture, self.name)

    def image_name(self, index: int, stack: ImageStack) -> str:
        """See :meth:`LayoutWriter.image_name`."""
        return f"PS_Pictures/{index + 1:0{max(4, len(str(len(stack))))}d}.png"

    def image_saver(self, stack: ImageStack) -> Callable[[Path, Array], None]:
        """See :meth:`LayoutWriter.image_saver`."""
        fill = whole_type(stack)
        return lambda path, frame: write_png(path, fill(frame))

    def parts(self, capture: Capture, truth: Truth | None) -> Mapping[str, Save]:
        """See :meth:`LayoutWriter.parts`."""
        del truth
        require_no_dark(capture, self.name)
        directions, strengths = distant_lights(capture, self.name)
        powers = three(strengths)
        files: dict[str, Save] = {
            "light_directions.txt": text_file([numbers(row) for row in directions]),
            "light_intensities.txt": text_file([numbers(row) for row in powers]),
            "convertionMatrix.txt": text_file([numbers(np.array(row)) for row in CONVENTIONS["meshroom"].matrix]),
            "lights.json": text_file([_light_json(from_canonical(directions, "meshroom"), powers)]),
        }
        if capture.mask is not None:
            files["mask.png"] = mask_file(capture.mask)
        if isinstance(capture.camera, Pinhole):
            files["K.txt"] = camera_file(capture.camera)
        return files


def _light_json(directions: FloatArray, powers: FloatArray) -> str:
    lights = [
        {
            "viewId": str(i + 1),
            "type": "directional",
            "direction": numbers(direction).split(),
            "intensity": numbers(power).split(),
        }
        for i, (direction, power) in enumerate(zip(directions, powers, strict=True))
    ]
    return json.dumps({"lights": lights}, indent=1)
