"""Captures written as RTI programs take them: images and an ``.lp`` list of light directions."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import ClassVar

from psstereo.camera import Pinhole
from psstereo.capture import Capture, Truth
from psstereo.errors import UnsupportedError
from psstereo.io.layout_writer import LayoutWriter, Save, camera_file, mask_file, whole_type
from psstereo.io.lp_file import write_lp
from psstereo.io.pictures import write_png
from psstereo.io.write_checks import distant_lights, require_integers, require_no_dark
from psstereo.stack import ImageStack
from psstereo.types import Array

__all__ = ["LpWriter"]

_MOST = 1000
"""Lights that relight takes."""


class LpWriter(LayoutWriter):
    """``lights.lp`` with ``0001.png …``; ``mask.png`` and ``K.txt`` where known, which RTI programs do not read.

    RTI knows lights of equal strength before the object only; others are refused. Do not use it for reconstruction
    where another layout will do: strengths, units and truth have no place in it.
    """

    name: ClassVar[str] = "lp"
    summary: ClassVar[str] = "lights.lp (RTI: relight, Meshroom) and 0001.png …; lights of equal strength, z > 0"

    def check_images(self, capture: Capture) -> None:
        """Refuse what is not linear integers, and more images than relight takes."""
        require_integers(capture, self.name)
        if len(capture.stack) > _MOST:
            raise UnsupportedError(
                given=f"The capture has {len(capture.stack)} images.",
                needed=f"relight takes {_MOST} at most.",
                remedy="Write fewer of them, or choose the layout capture or diligent.",
            )

    def image_name(self, index: int, stack: ImageStack) -> str:
        """See :meth:`LayoutWriter.image_name`."""
        del stack
        return f"{index + 1:04d}.png"

    def image_saver(self, stack: ImageStack) -> Callable[[Path, Array], None]:
        """See :meth:`LayoutWriter.image_saver`."""
        fill = whole_type(stack)
        return lambda path, frame: write_png(path, fill(frame))

    def parts(self, capture: Capture, truth: Truth | None) -> Mapping[str, Save]:
        """See :meth:`LayoutWriter.parts`."""
        del truth
        require_no_dark(capture, self.name)
        directions, strengths = distant_lights(capture, self.name)
        below = (directions[:, 2] <= 0).nonzero()[0]
        if below.size:
            raise UnsupportedError(
                given=f"Light {below[0] + 1} has z = {directions[below[0], 2]:.3g}, from the side or from behind.",
                needed="RTI programs know lights on the upper half of the dome only, z > 0.",
                remedy="Leave those images out, or choose the layout capture or diligent.",
            )
        if strengths.min() != strengths.max():
            raise UnsupportedError(
                given=f"The lights have strengths from {strengths.min():.6g} to {strengths.max():.6g}.",
                needed="An .lp list has no place for them: all lights count as equally strong and white.",
                remedy="Render or scale the images for one strength, or choose the layout capture or diligent.",
            )
        names = [self.image_name(i, capture.stack) for i in range(len(capture.stack))]
        files: dict[str, Save] = {"lights.lp": lambda path: write_lp(path, names, directions, digits=17)}
        if capture.mask is not None:
            files["mask.png"] = mask_file(capture.mask)
        if isinstance(capture.camera, Pinhole):
            files["K.txt"] = camera_file(capture.camera)
        return files
