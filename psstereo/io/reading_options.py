"""A capture read otherwise: another response, a flat field, a lens undone, frames moved, a part of it, coarser pixels.

Each function takes a capture and returns one with images, mask, camera and lamps that belong together, and a note on
what was done. What moves or averages pixels works on linear light, with response, dark level and flat field undone.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from psstereo.camera import Lens, Orthographic, Pinhole, Undistortion
from psstereo.capture import Capture
from psstereo.errors import InputError, OptionError
from psstereo.io.flat_file import read_flat
from psstereo.lights import Rig
from psstereo.stack import LINEAR, BinnedStack, CroppedStack, LinearStack, Response, UnmixedStack, WarpedStack
from psstereo.stack.warped import warp_mask

__all__ = ["binned", "cropped", "in_linear_light", "with_flat", "with_lens", "with_moves", "with_response"]


def with_response(capture: Capture, response: Response) -> Capture:
    """Return the capture with a response to undo, instead of none.

    Parameters
    ----------
    capture : Capture
        Photographs that count as linear; a dark image goes through the same response.
    response : Response
        What is undone when they are read.

    Returns
    -------
    Capture
        The same images.

    Raises
    ------
    OptionError
        If the capture has another response already, which may be in its dark level.
    """
    if response == capture.response:
        return capture
    if not capture.response.is_linear or isinstance(capture.stack, UnmixedStack):
        raise OptionError(
            given=f"The capture {capture.name} has the response {capture.response.name} already, or has undone one.",
            needed="Photographs whose response is not known yet.",
            remedy="Change the response where the capture is described.",
        )
    if capture.flat is not None:
        raise OptionError(
            given=f"The flat field of {capture.name} was read as linear before the response was given.",
            needed="The response first.",
            remedy="Say response = … in capture.toml, or give --flat beside --response.",
        )
    dark = None if capture.dark is None else response.linearise(np.asarray(capture.dark), capture.stack.white)
    note = f"The response {response.name} is undone."
    return replace(capture, response=response, dark=dark, notes=(*capture.notes, note))


def with_flat(capture: Capture, paths: tuple[Path, ...]) -> Capture:
    """Return the capture with a flat field, one for all images or one a light.

    Parameters
    ----------
    capture : Capture
        Photographs; the flat frame goes through the same response, and has the same dark level if it is a photograph.
    paths : tuple of Path
        One file, or one a light.

    Returns
    -------
    Capture
        The same images.

    Raises
    ------
    PsstereoError
        If a file cannot be used, or several coloured lights shine at once.
    """
    if isinstance(capture.stack, UnmixedStack):
        raise OptionError(
            given="A flat field is given, and the images are lights told apart by their colour.",
            needed="Photographs of one light each.",
            remedy="Leave the flat field out.",
        )
    flat = read_flat(paths, capture.stack, response=capture.response, dark=capture.dark)
    named = paths[0].name + (f" and {len(paths) - 1} more" if len(paths) > 1 else "")
    return replace(capture, flat=flat, notes=(*capture.notes, f"Pixels are made even by {named}."))


def in_linear_light(capture: Capture) -> Capture:
    """Return the capture as images of linear light: response, dark level and flat field are undone while decoding."""
    if isinstance(capture.stack, LinearStack | WarpedStack | BinnedStack | UnmixedStack):
        return capture
    stack = LinearStack(capture.stack, response=capture.response, dark=capture.dark, flat=capture.flat)
    return replace(capture, stack=stack, response=LINEAR, dark=None, flat=None)


def with_lens(capture: Capture, lens: Lens, camera: Pinhole | None = None) -> Capture:
    """Return the capture with the distortion of its lens undone in images and mask.

    Parameters
    ----------
    capture : Capture
        Photographs, not cropped.
    lens : Lens
        What is undone.
    camera : Pinhole, optional
        The camera that it belongs to; the capture's own if absent.

    Returns
    -------
    Capture
        Its camera is the pinhole without the lens.

    Raises
    ------
    InputError
        If there is no pinhole camera, or nothing is left of the mask.
    """
    pinhole = capture.camera if camera is None else camera
    if not isinstance(pinhole, Pinhole):
        raise InputError(
            given="A lens is to be undone, and the camera has no matrix.",
            needed="The matrix K that the lens was calibrated with.",
            remedy="Give the camera beside the lens; psstereo calibrate lens writes both.",
        )
    glass = Undistortion(lens=lens, camera=pinhole)
    light = in_linear_light(capture)
    mask = None if capture.mask is None else warp_mask(capture.mask, glass)
    note = f"The lens is undone (k1 = {lens.coefficients[0]:.3g})."
    return replace(
        light, stack=WarpedStack(light.stack, lens=glass), mask=mask, camera=pinhole, notes=(*capture.notes, note)
    )


def with_moves(capture: Capture, affines: npt.ArrayLike, note: str) -> Capture:
    """Return the capture with its frames moved while they are decoded.

    Parameters
    ----------
    capture : Capture
        The frames.
    affines : float array (m, 2, 3)
        Pixel (x, y, 1) of the result is found at ``affine @ (x, y, 1)`` of the frame [px].
    note : str
        What was done.

    Returns
    -------
    Capture
        The mask stays: it is that of the reference.

    Raises
    ------
    InputError
        If there are not as many moves as frames.
    """
    light = in_linear_light(capture)
    source = light.stack
    if isinstance(source, WarpedStack) and source.affines is None:
        stack = WarpedStack(source.source, lens=source.lens, affines=affines)  # one interpolation, not two
    else:
        stack = WarpedStack(source, affines=affines)
    return replace(light, stack=stack, notes=(*capture.notes, note))


def cropped(capture: Capture, rows: tuple[int, int], columns: tuple[int, int]) -> Capture:
    """Return a rectangle of the capture.

    Parameters
    ----------
    capture : Capture
        The photographs.
    rows, columns : (int, int)
        First row and the one after the last, and the same of columns, from 0 [px].

    Returns
    -------
    Capture
        Camera and lamps are those of the rectangle.

    Raises
    ------
    OptionError
        If the rectangle is not within the images.
    InputError
        If nothing of the mask lies in it.
    """
    stack = CroppedStack(capture.stack, rows=rows, columns=columns)
    down, right = slice(*rows), slice(*columns)
    moved = _seen_from(capture, shift=(float(columns[0]), float(rows[0])), size=1)
    note = f"Rows {rows[0]} to {rows[1] - 1} and columns {columns[0]} to {columns[1] - 1} are kept."
    return replace(
        capture,
        stack=stack,
        mask=None if capture.mask is None else capture.mask[down, right],
        dark=None if capture.dark is None else capture.dark[down, right],
        flat=None if capture.flat is None else capture.flat.cut(down, right),
        camera=moved[0],
        rig=moved[1],
        notes=(*capture.notes, note),
    )


def binned(capture: Capture, size: int) -> Capture:
    """Return the capture with coarser pixels, each the mean light of a square of pixels.

    Parameters
    ----------
    capture : Capture
        The photographs.
    size : int
        Pixels along a side of the square [px].

    Returns
    -------
    Capture
        A square is in the mask if all of its pixels are.

    Raises
    ------
    OptionError
        If the size is not positive, or larger than the images.
    InputError
        If nothing is left of the mask.
    """
    if size == 1:
        return capture
    light = in_linear_light(capture)
    stack = BinnedStack(light.stack, size=size)
    _, height, width, _ = stack.shape
    mask = None
    if capture.mask is not None:
        squares = capture.mask[: height * size, : width * size].reshape(height, size, width, size)
        mask = np.asarray(squares.all(axis=(1, 3)))
    camera, rig = _seen_from(capture, shift=((size - 1) / 2.0, (size - 1) / 2.0), size=size)
    note = f"Squares of {size} × {size} pixels are averaged in linear light."
    return replace(light, stack=stack, mask=mask, camera=camera, rig=rig, notes=(*capture.notes, note))


def _seen_from(capture: Capture, *, shift: tuple[float, float], size: int) -> tuple[Orthographic | Pinhole, Rig]:
    """Return camera and lights for pixels `size` as large, the first where column and row `shift` were."""
    camera, rig = capture.camera, capture.rig
    across, down = shift
    if isinstance(camera, Pinhole):
        moved = Pinhole(
            fx=camera.fx / size,
            fy=camera.fy / size,
            cx=(camera.cx - across) / size,
            cy=(camera.cy - down) / size,
            skew=camera.skew / size,
        )
        return moved, rig
    if not isinstance(camera, Orthographic):
        raise OptionError(
            given=f"The camera is {camera.name}.",
            needed="A pinhole or an orthographic camera.",
            remedy="Do without cropping and binning.",
        )
    counted = camera.length_unit == "px"  # lengths that are pixels count the new ones
    if not rig.all_distant:
        origin = np.array([-across, down, 0.0]) * camera.pixel_size
        lights = tuple(light.moved(np.eye(3), origin) for light in rig.lights)
        rig = Rig(lights, rig.strength_unit, rig.source)
        counted = False
    return Orthographic(pixel_size=camera.pixel_size * (1 if counted else size), length_unit=camera.length_unit), rig
