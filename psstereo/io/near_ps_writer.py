"""Captures under near lamps, written as the MATLAB code near_ps takes them."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import ClassVar

from psstereo.capture import Capture, Truth
from psstereo.errors import UnsupportedError
from psstereo.io.conventions import from_canonical
from psstereo.io.layout_writer import LayoutWriter, Save, mask_file, three, whole_type
from psstereo.io.mat_file import write_mat
from psstereo.io.pictures import write_png
from psstereo.io.write_checks import lamps, require_integers, require_pinhole, whole_dark
from psstereo.stack import ImageStack
from psstereo.types import Array

__all__ = ["NearPsWriter"]

_STEM = "photometric_sample_"
_MOST = 9999
"""Images that four digits can number."""


class NearPsWriter(LayoutWriter):
    """``photometric_sample_raw_0001.png …``, ``light.mat`` (S, Dir, mu, Phi), ``camera.mat`` (K), mask, ambient image.

    Lamps and a pinhole camera are needed; positions and axes are in the camera's frame, x right, y down, z into the
    scene, and lengths are taken for millimetres [1]_. There is no place for truth: use the layout luces or capture.

    References
    ----------
    .. [1] Y. Quéau, B. Durix, T. Wu, D. Cremers, F. Lauze, J.-D. Durou, "LED-based Photometric Stereo: Modeling,
       Calibration and Numerical Solution", J. Math. Imaging Vis. 60, 2018. doi:10.1007/s10851-017-0761-1
    """

    name: ClassVar[str] = "near-ps"
    summary: ClassVar[str] = "photometric_sample_raw_0001.png …, light.mat, camera.mat (near_ps: near lamps, pinhole)"

    def check_images(self, capture: Capture) -> None:
        """Refuse what is not linear integers, and more images than four digits can number."""
        require_integers(capture, self.name)
        if len(capture.stack) > _MOST:
            raise UnsupportedError(
                given=f"The capture has {len(capture.stack)} images.",
                needed=f"The layout {self.name} numbers them with four digits, so that {_MOST} are the most.",
                remedy="Write fewer of them, or choose the layout capture or luces.",
            )

    def image_name(self, index: int, stack: ImageStack) -> str:
        """See :meth:`LayoutWriter.image_name`."""
        del stack
        return f"{_STEM}raw_{index + 1:04d}.png"

    def image_saver(self, stack: ImageStack) -> Callable[[Path, Array], None]:
        """See :meth:`LayoutWriter.image_saver`."""
        fill = whole_type(stack)
        return lambda path, frame: write_png(path, fill(frame))

    def parts(self, capture: Capture, truth: Truth | None) -> Mapping[str, Save]:
        """See :meth:`LayoutWriter.parts`."""
        del truth
        camera = require_pinhole(capture, self.name)
        table = lamps(capture, self.name)
        light = {
            "S": from_canonical(table.positions, "opencv"),
            "Dir": from_canonical(table.axes, "opencv"),
            "mu": table.mu[:, None],
            "Phi": three(table.flux),
        }
        files: dict[str, Save] = {
            "light.mat": lambda path: write_mat(path, light),
            "camera.mat": lambda path: write_mat(path, {"K": camera.matrix}),
            f"{_STEM}mask_raw.png": mask_file(capture.effective_mask),
        }
        dark = whole_dark(capture, self.name)
        if dark is not None:
            save = self.image_saver(capture.stack)
            files[f"{_STEM}raw_ambient.png"] = lambda path: save(path, dark)
        return files
