"""Captures under near lamps, written in the layout of the LUCES data set."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import ClassVar

import numpy as np

from psstereo.capture import Capture, Truth
from psstereo.errors import InputError
from psstereo.io.conventions import from_canonical
from psstereo.io.layout_writer import LayoutWriter, Save, mask_file, numbers, rgb, sixteen_bits, text_file, three
from psstereo.io.normal_map import write_normal_map
from psstereo.io.pictures import write_png
from psstereo.io.write_checks import lamps, require_integers, require_no_dark, require_pinhole
from psstereo.stack import ImageStack
from psstereo.types import Array

__all__ = ["LED_PARAMS_HEADER", "LucesWriter"]

LED_PARAMS_HEADER = "N_img nrows ncols f x0 y0 mean_distance sfull:[Lpos Ldir Phi mu 0]"
"""First line of ``led_params.txt``."""


class LucesWriter(LayoutWriter):
    """``01.png …`` of 16 bits and three channels, ``led_params.txt``, ``mask.png``, ``normals.png``, ``zgt.npz``.

    Lamps and a pinhole camera of one focal length are needed, and the true depth, whose mean the file states. Lengths
    are taken for millimetres by other programs; positions and axes are in the camera's frame, x right, y down, z
    into the scene. Numbers have 17 digits, where LUCES itself [1]_ has four after the point. Normals lose up to 0.0015
    degrees.

    References
    ----------
    .. [1] R. Mecca, F. Logothetis, I. Budvytis, R. Cipolla, "LUCES: A Dataset for Near-Field Point Light Source
       Photometric Stereo", BMVC 2021.
    """

    name: ClassVar[str] = "luces"
    summary: ClassVar[str] = "01.png …, led_params.txt, mask.png, normals.png, zgt.npz (LUCES: near lamps, pinhole)"
    holds: ClassVar[frozenset[str]] = frozenset({"normals", "depth"})

    def check_images(self, capture: Capture) -> None:
        """Refuse what is not linear integers."""
        require_integers(capture, self.name)

    def image_name(self, index: int, stack: ImageStack) -> str:
        """See :meth:`LayoutWriter.image_name`."""
        return f"{index + 1:0{max(2, len(str(len(stack))))}d}.png"

    def image_saver(self, stack: ImageStack) -> Callable[[Path, Array], None]:
        """See :meth:`LayoutWriter.image_saver`."""
        deep = sixteen_bits(stack)
        return lambda path, frame: write_png(path, rgb(deep(frame)))

    def parts(self, capture: Capture, truth: Truth | None) -> Mapping[str, Save]:
        """See :meth:`LayoutWriter.parts`."""
        require_no_dark(capture, self.name)
        depth = None if truth is None else truth.depth
        files: dict[str, Save] = {
            "led_params.txt": text_file(self._parameters(capture, depth)),
            "mask.png": mask_file(capture.effective_mask),
        }
        if depth is not None:
            files["zgt.npz"] = lambda path: np.savez_compressed(path, zgt=depth)
        if truth is not None and truth.normals is not None:
            normals = truth.normals
            files["normals.png"] = lambda path: write_normal_map(normals, path)
        return files

    def _parameters(self, capture: Capture, depth: Array | None) -> list[str]:
        camera = require_pinhole(capture, self.name, one_focal_length=True)
        table = lamps(capture, self.name)
        known = np.zeros(0) if depth is None else depth[capture.effective_mask & np.isfinite(depth)]
        if known.size == 0:
            raise InputError(
                given="There is no true depth.",
                needed=f"The layout {self.name} states the mean distance of the object.",
                remedy="Give the truth with a depth, or choose the layout near-ps or capture.",
            )
        rows, columns = capture.shape
        # The public reader takes rows first, as the header says; the public writer puts columns first.
        head = np.array([len(table.mu), rows, columns, camera.fx, camera.cx, camera.cy, known.mean(dtype=np.float64)])
        values = np.hstack(
            [
                from_canonical(table.positions, "opencv"),
                from_canonical(table.axes, "opencv"),
                three(table.flux),
                table.mu[:, None],
                np.zeros((len(table.mu), 1)),
            ]
        )
        return [LED_PARAMS_HEADER, numbers(head), *(numbers(row) for row in values)]
