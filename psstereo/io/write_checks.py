"""What a layout can hold: lights of one kind, whole numbers as pixels, and truth of the images' size."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from psstereo.camera import Pinhole
from psstereo.capture import Capture, Truth
from psstereo.errors import InputError, UnsupportedError
from psstereo.lights import Directional, Led, Light
from psstereo.stack.stack import full_scale
from psstereo.types import Array, FloatArray

__all__ = [
    "LampTable",
    "distant_lights",
    "known_lights",
    "lamps",
    "require_channels",
    "require_integers",
    "require_no_dark",
    "require_pinhole",
    "require_truth",
    "whole_dark",
]


@dataclass(frozen=True, kw_only=True, eq=False)
class LampTable:
    """Lamps of a rig as arrays, in the frame of the camera.

    Attributes
    ----------
    positions, axes : float64 array (m, 3)
        Where the lamps are and their main directions, x right, y up, z toward the camera [length]; [1].
    mu : float64 array (m,)
        Exponents of the lobes [1].
    flux : float64 array (m, 1) or (m, c)
        Radiant intensities along the axes [W sr⁻¹], or relative.
    """

    positions: FloatArray
    axes: FloatArray
    mu: FloatArray
    flux: FloatArray


def distant_lights(capture: Capture, layout: str) -> tuple[FloatArray, FloatArray]:
    """Return directions (m, 3) and strengths (m, 1) or (m, c) of a capture whose lights are all distant.

    Raises
    ------
    UnsupportedError
        If a light is a lamp at a position, or can be written as neither.
    InputError
        If a light has strengths for another number of channels than the images.
    """
    ideal = [light.idealised() for light in capture.rig.lights]
    suns = [light for light in ideal if isinstance(light, Directional)]
    if len(suns) < len(ideal):
        raise UnsupportedError(
            given=f"{_first_other(ideal, Directional)} is a lamp at a position.",
            needed=f"The layout {layout} holds distant lights only: a direction and a strength each.",
            remedy="Choose the layout capture, near-ps or luces.",
        )
    return np.array([sun.direction for sun in suns]), _one_width([sun.strength for sun in suns], capture)


def lamps(capture: Capture, layout: str) -> LampTable:
    """Return positions, axes, exponents and fluxes of a capture whose lights are all lamps at positions.

    Raises
    ------
    UnsupportedError
        If a light is distant, or can be written as neither.
    InputError
        If a lamp has fluxes for another number of channels than the images.
    """
    ideal = [light.idealised() for light in capture.rig.lights]
    leds = [light for light in ideal if isinstance(light, Led)]
    if len(leds) < len(ideal):
        raise UnsupportedError(
            given=f"{_first_other(ideal, Led)} is distant and has no position.",
            needed=f"The layout {layout} holds lamps only: a position, an axis, an exponent and a flux each.",
            remedy="Choose the layout capture, diligent or lp, or place lamps at a distance instead.",
        )
    return LampTable(
        positions=np.array([led.position for led in leds]),
        axes=np.array([led.axis for led in leds]),
        mu=np.array([led.mu for led in leds], np.float64),
        flux=_one_width([led.flux for led in leds], capture),
    )


def known_lights(capture: Capture, layout: str) -> LampTable | tuple[FloatArray, FloatArray]:
    """Return :func:`lamps` if the first light is one, else :func:`distant_lights`."""
    first = capture.rig.lights[0].idealised() if len(capture.rig) else None
    return lamps(capture, layout) if isinstance(first, Led) else distant_lights(capture, layout)


def _first_other(lights: Sequence[Light], kind: type[Light]) -> str:
    index = next(i for i, light in enumerate(lights) if not isinstance(light, kind))
    return f"Light {index + 1}"


def _one_width(rows: Sequence[FloatArray], capture: Capture) -> FloatArray:
    """Return strengths as (m, 1) if no light is coloured, else (m, c)."""
    channels = capture.stack.shape[3]
    odd = next((i for i, row in enumerate(rows) if row.size not in (1, channels)), None)
    if odd is not None:
        raise InputError(
            given=f"Light {odd + 1} has strengths for {rows[odd].size} channels; the images have {channels}.",
            needed="A light has one strength, or one for each channel of the images.",
            remedy="Give it one strength, or images of as many channels.",
        )
    width = max(row.size for row in rows)
    return np.array([np.broadcast_to(row, width) for row in rows], np.float64)


def require_channels(capture: Capture) -> None:
    """Refuse images of other than one or three channels, which image files cannot hold or readers would drop."""
    channels = capture.stack.shape[3]
    if channels not in (1, 3):
        raise UnsupportedError(
            given=f"The images have {channels} channels.",
            needed="Image files hold one channel, or R, G and B.",
            remedy="Choose one or three of the channels, or write the array itself with numpy.save.",
        )


def require_integers(capture: Capture, layout: str) -> None:
    """Refuse images that are not linear integers, which is all that most layouts know.

    Raises
    ------
    UnsupportedError
        If the images are floats, or carry a camera response.
    InputError
        If the value of full scale is not one of the images' type.
    """
    require_channels(capture)
    stack = capture.stack
    if stack.dtype.kind != "u":
        raise UnsupportedError(
            given=f"The images are of type {stack.dtype}.",
            needed=f"The layout {layout} holds images of 8 or 16 bits.",
            remedy="Expose them as a sensor of 8 to 16 bits would, or choose the layout capture.",
        )
    if not capture.response.is_linear:
        raise UnsupportedError(
            given=f"The images carry the camera response {capture.response.name}.",
            needed=f"The layout {layout} has no place to say so; its images are taken to be linear.",
            remedy="Linearise the images, or choose the layout capture.",
        )
    if capture.flat is not None:
        raise UnsupportedError(
            given="The capture has a flat field to divide by.",
            needed=f"The layout {layout} has no place for one.",
            remedy="Divide the images by it first, or choose the layout capture.",
        )
    if not 1 <= stack.white <= full_scale(stack.dtype):
        raise InputError(
            given=f"The value of full scale is {stack.white}; the images are of type {stack.dtype}.",
            needed=f"It must be a number from 1 to {full_scale(stack.dtype):.0f}.",
            remedy="Correct the stack's white level.",
        )


def require_no_dark(capture: Capture, layout: str) -> None:
    """Refuse a dark image: what it holds is also in the images, and a layout without it would hide that."""
    if capture.dark is not None:
        raise UnsupportedError(
            given="The capture has a dark image to subtract.",
            needed=f"The layout {layout} has no place for one.",
            remedy="Subtract it from the images first, or choose the layout capture, diligent or near-ps.",
        )


def whole_dark(capture: Capture, layout: str) -> Array | None:
    """Return the dark image in the images' own integers, None if there is none, or refuse one of fractions."""
    dark = capture.dark
    if dark is None:
        return None
    top = full_scale(capture.stack.dtype)
    if not ((dark == np.rint(dark)) & (dark >= 0) & (dark <= top)).all():
        raise UnsupportedError(
            given="The dark image holds values that are no whole numbers of the images' type.",
            needed=f"The layout {layout} holds it as an image like the others.",
            remedy="Round it, or choose the layout capture.",
        )
    return dark.astype(capture.stack.dtype)


def require_pinhole(capture: Capture, layout: str, *, one_focal_length: bool = False) -> Pinhole:
    """Return the camera if it is a pinhole, or refuse it.

    Parameters
    ----------
    capture : Capture
        Whose camera it is.
    layout : str
        Name of the layout, for the message.
    one_focal_length : bool
        Whether the layout holds a single focal length and no skew.
    """
    camera = capture.camera
    if not isinstance(camera, Pinhole):
        raise UnsupportedError(
            given=f"The camera is {camera.name}.",
            needed=f"The layout {layout} needs a pinhole camera, in whose frame the lamps stand.",
            remedy="Choose the layout capture.",
        )
    if one_focal_length and (camera.fx != camera.fy or camera.skew != 0):
        raise UnsupportedError(
            given=f"The camera has the focal lengths {camera.fx} and {camera.fy} and the skew {camera.skew}.",
            needed=f"The layout {layout} holds one focal length and no skew.",
            remedy="Choose the layout near-ps or capture.",
        )
    return camera


def require_truth(capture: Capture, truth: Truth | None) -> None:
    """Refuse truth of another size than the images.

    Raises
    ------
    InputError
        If an array has another shape, or the normals are zero or NaN everywhere.
    """
    if truth is None:
        return
    shape = capture.shape
    images, channels = len(capture.stack), capture.stack.shape[3]
    allowed = {
        "normals": ((*shape, 3),),
        "depth": (shape,),
        "albedo": (shape, (*shape, 1), (*shape, channels)),
        "visibility": ((images, *shape),),
    }
    for name, shapes in allowed.items():
        array = getattr(truth, name)
        if array is not None and (array.shape not in shapes or array.dtype not in (np.float32, np.float64)):
            raise InputError(
                given=f"The true {name} have the shape {array.shape} and type {array.dtype}.",
                needed=f"For these images: float32 or float64, {' or '.join(map(str, shapes))}.",
                remedy="Give the truth that belongs to the images, or leave it out.",
            )
    if truth.normals is not None and not (np.abs(np.nan_to_num(truth.normals)) > 0).any():
        raise InputError(
            given="The true normals are zero or NaN everywhere.",
            needed="Some pixel with a normal.",
            remedy="Leave them out.",
        )
