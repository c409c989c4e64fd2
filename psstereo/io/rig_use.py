"""A rig file on the photographs of another object."""

from dataclasses import replace

import numpy as np

from psstereo.camera import Pinhole
from psstereo.capture import Capture
from psstereo.errors import InputError
from psstereo.io.ambient_frame import with_ambient
from psstereo.io.distant_lights import NOT_READ
from psstereo.io.image_names import base_name, name_key
from psstereo.io.parts import channel_values
from psstereo.io.reading_options import with_flat, with_lens, with_response
from psstereo.io.rig_file import RigFile
from psstereo.lights import Led, Rig
from psstereo.types import IntArray

__all__ = ["with_rig"]


def with_rig(capture: Capture, found: RigFile, source: str) -> Capture:
    """Return a capture with the lights, and what is known of the camera, of a rig file.

    Lights go to images by name where the names of all images are in the file, in whatever folder and letter case; else
    by order, if there are as many of both.

    Parameters
    ----------
    capture : Capture
        The photographs; its own lights are of no account.
    found : RigFile
        What a calibration found.
    source : str
        Name of the file, for the record.

    Returns
    -------
    Capture
        The same images with another rig, and with camera, response and frames of the file where it has some.

    Raises
    ------
    InputError
        If lights and images cannot be matched.
    PsstereoError
        If a frame that the file names is missing, damaged, or of another size.
    """
    indices, matched = _order(found, capture.stack.names, source)
    rig, notes = _rig(found.rig.select(indices), capture.stack.shape[3], source)
    changed: Capture = replace(capture, rig=rig)
    said = [f"The lights are those of {source}, {matched}."]
    if found.quality.verdict:
        said.append(f"{source} says of them: {found.quality.verdict}")
    said += [f"{source} was made so: {line}" for line in found.provenance]
    if found.camera is not None:
        changed = replace(changed, camera=found.camera)
        said.append(f"The camera is that of {source}: {found.camera.name}.")
    changed = replace(changed, notes=(*(note for note in capture.notes if note != NOT_READ), *said, *notes))
    return _seen_through(changed, found)


def _seen_through(capture: Capture, found: RigFile) -> Capture:
    """Undo what the camera does, in the order in which frames are told apart from light."""
    if not found.response.is_linear:
        capture = with_response(capture, found.response)
    if found.dark is not None:
        capture = with_ambient(capture, found.dark)
    if found.flat is not None:
        capture = with_flat(capture, (found.flat,))
    if found.lens is not None:
        camera = found.camera if isinstance(found.camera, Pinhole) else None
        capture = with_lens(capture, found.lens, camera)
    return capture


def _order(found: RigFile, names: tuple[str, ...], source: str) -> tuple[IntArray, str]:
    """Return which light belongs to each image, and how that was found."""
    for key in (name_key, _stem):
        rows = {key(base_name(name)): i for i, name in enumerate(found.names)}
        hits = [rows.get(key(base_name(name))) for name in names]
        order = [hit for hit in hits if hit is not None]
        if len(order) == len(names) and len(set(order)) == len(names):
            return np.array(order), "which names the images"
    if len(found.rig) == len(names):
        return np.arange(len(names)), "in the order of the images"
    raise InputError(
        given=f"{source} has {len(found.rig)} lights; the capture has {len(names)} images, of which it names "
        f"{len(order)}.",
        needed="As many images as lights, in the same order, or images by the names that the file lists.",
        remedy="Name the folder of one object under these lights; take other pictures out of it, or rename them.",
    )


def _stem(name: str) -> str:
    return name_key(name.rsplit(".", 1)[0])


def _rig(rig: Rig, channels: int, source: str) -> tuple[Rig, tuple[str, ...]]:
    """Return the rig with strengths of as many channels as the images have."""
    lamps = [light for light in rig.lights if isinstance(light, Led)]
    if len(lamps) == len(rig):
        width = max(lamp.flux.size for lamp in lamps)
        flux = np.array([np.broadcast_to(lamp.flux, width) for lamp in lamps])
        flux, notes = channel_values(flux, channels, "lamp fluxes")
        changed = (replace(lamp, flux=row) for lamp, row in zip(lamps, flux, strict=True))
        return Rig(tuple(changed), rig.strength_unit, source), notes
    width = max(light.channels for light in rig.lights)
    strengths, notes = channel_values(rig.strengths(width), channels, "light strengths")
    return Rig.distant(rig.directions, strengths, strength_unit=rig.strength_unit, source=source), notes
