"""Captures under lamps at known positions: LED files of near_ps, LUCES, and positions beside a DiLiGenT layout."""

from pathlib import Path
from typing import ClassVar

import numpy as np

from psstereo.capture import Capture, Truth
from psstereo.errors import InputError, MissingFileError
from psstereo.io.diligent import true_surface
from psstereo.io.distant_lights import distant_rig
from psstereo.io.lamps import LAYOUTS, LampLayout, Lamps
from psstereo.io.led_rig import led_rig
from psstereo.io.light_file import Directions
from psstereo.io.parts import channel_values, find_mask, read_dark, read_depth, read_true_normals
from psstereo.io.reader import Choices, Reader
from psstereo.lights import Rig
from psstereo.stack import FileStack

__all__ = ["NearLed"]


class NearLed(Reader):
    """Lamps near the object: their positions, axes, lobes and fluxes.

    Known are ``led_positions_mm.txt`` with ``led_axes.txt`` and its kin, ``led_params.txt`` (LUCES), ``light.mat`` with
    ``camera.mat`` (near_ps), and ``light_positions.txt`` beside a DiLiGenT layout, where lamps shine all around.
    """

    name: ClassVar[str] = "near-led"
    summary: ClassVar[str] = (
        "lamps at known positions: led_positions_mm.txt, led_params.txt (LUCES) or light.mat (near_ps)"
    )

    def recognise(self, path: Path) -> str | None:
        """See :meth:`Reader.recognise`."""
        layout = _layout(path)
        return layout.reason if layout else None

    def read(self, path: Path, choices: Choices) -> tuple[Capture, Truth | None]:
        """See :meth:`Reader.read`."""
        layout = _layout(path)
        if layout is None:
            raise MissingFileError(
                given=f"No file in {path} says where lamps are.",
                needed=f"One of {', '.join(known.key for known in LAYOUTS)}.",
                remedy="Name the folder that holds it, or write positions into a capture.toml.",
            )
        lamps = layout.read(path)
        stack = FileStack(lamps.files)
        shape = (stack.shape[1], stack.shape[2])
        rig, notes = _rig(lamps, stack, choices)
        dark = () if lamps.dark is None else (f"{lamps.dark.name} is subtracted.",)
        capture = Capture(
            stack=stack,
            rig=rig,
            camera=lamps.camera,
            mask=find_mask(path, shape, choices, lamps.mask),
            dark=None if lamps.dark is None else read_dark(lamps.dark, stack),
            name=path.resolve().name,
            notes=(*lamps.notes, *notes, *dark),
        )
        return capture, _truth(path, shape) if choices.truth else None


def _layout(path: Path) -> LampLayout | None:
    known = next((layout for layout in LAYOUTS if (path / layout.key).is_file()), None)
    if known is not None and known.key == "light.mat" and not (path / "camera.mat").is_file():
        return None
    return known


def _rig(lamps: Lamps, stack: FileStack, choices: Choices) -> tuple[Rig, tuple[str, ...]]:
    if choices.lights is not None:
        rig, notes = distant_rig(stack, choices, lambda: Directions(np.zeros((0, 3))), lamps.source)
        return rig, (*notes, f"{lamps.source} was left out: the lights are taken as distant and equally strong.")
    flux, notes = channel_values(lamps.flux, stack.shape[3], "lamp fluxes")
    if flux.shape[1] not in (1, stack.shape[3]):
        raise InputError(
            given=f"{lamps.source} has {flux.shape[1]} fluxes a lamp; the images, {stack.shape[3]} channels.",
            needed="One flux a lamp, or one for each channel.",
            remedy="Use the images and the lamp files of one and the same capture.",
        )
    turned = ("Lamps were turned from x right, y down, z into the scene.",) if lamps.frame == "opencv" else ()
    rig = led_rig(
        positions=lamps.positions, axes=lamps.axes, mu=lamps.mu, flux=flux, frame=lamps.frame, source=lamps.source
    )
    return rig, (*turned, *notes)


def _truth(path: Path, shape: tuple[int, int]) -> Truth | None:
    """Return the true surface: LUCES's ``normals.png`` and ``zgt.npz``, or that of a DiLiGenT layout."""
    normals, depth = path / "normals.png", path / "zgt.npz"
    if not (normals.is_file() or depth.is_file()):
        return true_surface(path, shape)
    return Truth(
        normals=read_true_normals(normals, shape) if normals.is_file() else None,
        depth=read_depth(depth, shape, variable="zgt") if depth.is_file() else None,
        source=" and ".join(p.name for p in (normals, depth) if p.is_file()),
    )
