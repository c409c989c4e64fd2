"""Captures written as SDM-UniPS takes them."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import ClassVar

from psstereo.camera import Pinhole
from psstereo.capture import Capture, Truth
from psstereo.io.layout_writer import (
    LayoutWriter,
    Save,
    camera_file,
    mask_file,
    numbers,
    rgb,
    text_file,
    three,
    whole_type,
)
from psstereo.io.normal_map import write_normal_map
from psstereo.io.pictures import write_png
from psstereo.io.write_checks import distant_lights, require_integers, require_no_dark
from psstereo.stack import ImageStack
from psstereo.types import Array

__all__ = ["SdmUniPsWriter"]


class SdmUniPsWriter(LayoutWriter):
    """``L_01.png …``, ``mask.png``, ``Normal_gt.png`` in 16-bit OpenGL colours, and the lights as text beside them.

    SDM-UniPS [1]_ takes folders whose names end in ``.data``, and LINO-UniPS such without; it needs no lights and skips
    text files, so that ``light_directions.txt`` and ``light_intensities.txt`` are for this package's reader. Images
    have three channels. Normals lose up to 0.0015 degrees.

    References
    ----------
    .. [1] S. Ikehata, "Scalable, Detailed and Mask-Free Universal Photometric Stereo", CVPR 2023.
    """

    name: ClassVar[str] = "sdm-unips"
    summary: ClassVar[str] = "L_01.png …, mask.png, Normal_gt.png (SDM-UniPS, folder NAME.data; lights as text besides)"
    holds: ClassVar[frozenset[str]] = frozenset({"normals"})

    def check_images(self, capture: Capture) -> None:
        """Refuse what is not linear integers."""
        require_integers(capture, self.name)

    def image_name(self, index: int, stack: ImageStack) -> str:
        """See :meth:`LayoutWriter.image_name`."""
        return f"L_{index + 1:0{max(2, len(str(len(stack))))}d}.png"

    def image_saver(self, stack: ImageStack) -> Callable[[Path, Array], None]:
        """See :meth:`LayoutWriter.image_saver`."""
        fill = whole_type(stack)
        return lambda path, frame: write_png(path, rgb(fill(frame)))

    def parts(self, capture: Capture, truth: Truth | None) -> Mapping[str, Save]:
        """See :meth:`LayoutWriter.parts`."""
        require_no_dark(capture, self.name)
        directions, strengths = distant_lights(capture, self.name)
        files: dict[str, Save] = {
            "light_directions.txt": text_file([numbers(row) for row in directions]),
            "light_intensities.txt": text_file([numbers(row) for row in three(strengths)]),
        }
        if capture.mask is not None:
            files["mask.png"] = mask_file(capture.mask)
        if isinstance(capture.camera, Pinhole):
            files["K.txt"] = camera_file(capture.camera)
        if truth is not None and truth.normals is not None:
            normals = truth.normals
            files["Normal_gt.png"] = lambda path: write_normal_map(normals, path)
        return files
