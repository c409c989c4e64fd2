"""Captures written in our own layout: ``capture.toml``, images, mask and truth."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import ClassVar

import numpy as np

from psstereo.camera import Camera, Orthographic, Pinhole
from psstereo.capture import Capture, Truth
from psstereo.errors import InputError, UnsupportedError
from psstereo.io.layout_writer import LayoutWriter, Save, mask_file, text_file
from psstereo.io.pictures import write_png
from psstereo.io.response_section import response_line
from psstereo.io.toml_text import toml_number, toml_rows, toml_text
from psstereo.io.write_checks import LampTable, known_lights, require_channels
from psstereo.lights import StrengthUnit
from psstereo.stack import ImageStack
from psstereo.stack.stack import full_scale
from psstereo.types import Array

__all__ = ["CaptureWriter"]


class CaptureWriter(LayoutWriter):
    """``capture.toml`` with ``images/0001.png …``, ``mask.png``, ``dark.npy`` and a folder ``truth``; nothing is lost.

    Images stay what they are: integers become PNG of 8 or 16 bits, with ``white_level`` where full scale is another
    than the type's, floats become TIFF of 32 or 64 bits. Numbers in the text come back to the last bit. Lights that are
    neither suns nor lamps are written as the sun or lamp that they look like from afar. Truth keeps its precision, but
    visibility, which is stored as float32.
    """

    name: ClassVar[str] = "capture"
    summary: ClassVar[str] = "capture.toml, images/0001.png … (floats: .tif), mask.png, truth/*.npy: all that is known"
    holds: ClassVar[frozenset[str]] = frozenset({"normals", "depth", "albedo", "visibility", "radiance", "pixel size"})

    def check(self, capture: Capture, truth: Truth | None) -> None:
        """See :meth:`Writer.check`."""
        super().check(capture, truth)
        stack = capture.stack
        if not (np.isfinite(stack.white) and stack.white > 0):
            raise InputError(
                given=f"The value of full scale is {stack.white}.",
                needed="It must be a positive number.",
                remedy="Correct the stack's white level.",
            )

    def check_images(self, capture: Capture) -> None:
        """Refuse images of other than one or three channels."""
        require_channels(capture)

    def image_name(self, index: int, stack: ImageStack) -> str:
        """See :meth:`LayoutWriter.image_name`."""
        ending = "png" if stack.dtype.kind == "u" else "tif"
        return f"images/{index + 1:0{max(4, len(str(len(stack))))}d}.{ending}"

    def image_saver(self, stack: ImageStack) -> Callable[[Path, Array], None]:
        """See :meth:`LayoutWriter.image_saver`."""
        return write_png if stack.dtype.kind == "u" else _write_tiff

    def parts(self, capture: Capture, truth: Truth | None) -> Mapping[str, Save]:
        """See :meth:`LayoutWriter.parts`."""
        lines = [*_head(capture), *self._images(capture), *_lights(capture, self.name), *_camera(capture.camera)]
        files: dict[str, Save] = {}
        if capture.mask is not None:
            lines += ["", "[mask]", 'file = "mask.png"']
            files["mask.png"] = mask_file(capture.mask)
        if capture.dark is not None:
            files["dark.npy"] = _array_file(capture.dark)
        files.update(_flats(capture))
        truths = _truth(truth)
        if truths:
            lines += ["", "[truth]", *(f'{Path(name).stem} = "{name}"' for name in truths)]
            files.update(truths)
        return {"capture.toml": text_file(lines), **files}

    def _images(self, capture: Capture) -> list[str]:
        stack = capture.stack
        lines = ["", "[images]", "files = ["]
        lines += [f'    "{self.image_name(i, stack)}",' for i in range(len(stack))]
        lines.append("]")
        whole = stack.dtype.kind == "u"
        if stack.white != full_scale(stack.dtype) or stack.saturates != whole:
            lines.append(f"white_level = {toml_number(stack.white)}")
        lines += response_line(capture.response)
        if capture.dark is not None:
            lines.append('dark_linear = "dark.npy"')
        flats = list(_flats(capture))
        if flats:
            named = ", ".join(f'"{name}"' for name in flats)
            lines.append(f"flat = {named}" if len(flats) == 1 else f"flat = [{named}]")
        if capture.radiance_at_white is not None:
            lines.append(f"radiance_at_white = {toml_number(capture.radiance_at_white)}")
        return lines


def _head(capture: Capture) -> list[str]:
    return [f"name = {toml_text(capture.name, 'name of the capture')}"]


def _lights(capture: Capture, layout: str) -> list[str]:
    found = known_lights(capture, layout)
    lines = ["", "[lights]"]
    if isinstance(found, LampTable):
        lines += [*toml_rows("positions", found.positions), *toml_rows("axes", found.axes)]
        lines += [*toml_rows("mu", found.mu[:, None]), *toml_rows("flux", found.flux)]
    else:
        directions, strengths = found
        lines += [*toml_rows("directions", directions), *toml_rows("strengths", strengths)]
    if capture.rig.strength_unit is StrengthUnit.IRRADIANCE:
        lines.append('unit = "W/m2"')
    return lines


def _camera(camera: Camera) -> list[str]:
    lines = ["", "[camera]", f'type = "{camera.name}"']
    if isinstance(camera, Pinhole):
        return [*lines, *toml_rows("K", camera.matrix)]
    if isinstance(camera, Orthographic):
        unit = toml_text(camera.length_unit, "unit of length")
        return [*lines, f"pixel_size = {toml_number(camera.pixel_size)}", f"unit = {unit}"]
    raise UnsupportedError(
        given=f"The camera is {camera.name}.",
        needed="A capture.toml describes an orthographic or a pinhole camera.",
        remedy="Use one of the two.",
    )


def _flats(capture: Capture) -> dict[str, Save]:
    """Return the flat fields as the light of an even surface, one for all images or one each."""
    if capture.flat is None:
        return {}
    gains = capture.flat.gain if capture.flat.per_light else capture.flat.gain[None]
    name = "flat/{:04d}.npy" if capture.flat.per_light else "flat.npy"
    return {name.format(i + 1): _array_file(np.nan_to_num(1.0 / gain)) for i, gain in enumerate(gains)}


def _truth(truth: Truth | None) -> dict[str, Save]:
    if truth is None:
        return {}
    given = {f"truth/{name}.npy": getattr(truth, name) for name in ("normals", "depth", "albedo")}
    files = {name: _array_file(array) for name, array in given.items() if array is not None}
    if truth.visibility is not None:
        shares = np.asarray(truth.visibility, np.float32)
        files["truth/visibility.npz"] = lambda path: np.savez_compressed(path, visibility=shares)
    return files


def _array_file(array: Array) -> Save:
    return lambda path: np.save(path, array, allow_pickle=False)


def _write_tiff(path: Path, frame: Array) -> None:
    import tifffile

    gray = frame.shape[2] == 1
    tifffile.imwrite(path, frame[..., 0] if gray else frame, photometric="minisblack" if gray else "rgb", metadata=None)
