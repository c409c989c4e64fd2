"""The section [lights] of a ``capture.toml``: distant lights, or lamps at known positions."""

import numpy as np

from psstereo.errors import InputError, OptionError
from psstereo.io.conventions import CONVENTIONS, to_canonical
from psstereo.io.distant_lights import chosen_directions, distant_rig
from psstereo.io.led_rig import led_rig
from psstereo.io.light_file import Directions, as_rows, read_directions
from psstereo.io.parts import channel_values
from psstereo.io.reader import Choices
from psstereo.io.toml_section import Section
from psstereo.lights import Rig, StrengthUnit
from psstereo.stack import ImageStack
from psstereo.types import FloatArray

__all__ = ["read_lights"]

_UNITS = {"relative": StrengthUnit.RELATIVE, "W/m2": StrengthUnit.IRRADIANCE}


def read_lights(lights: Section, camera: Section, stack: ImageStack, choices: Choices) -> tuple[Rig, tuple[str, ...]]:
    """Build the rig of the section [lights], or of the file that was chosen instead.

    Parameters
    ----------
    lights, camera : Section
        The sections [lights] and [camera], with known keys only.
    stack : ImageStack
        The images.
    choices : Choices
        Whether other lights are to be taken.

    Returns
    -------
    rig : Rig
        The lights in the order of the images, canonical frame.
    notes : tuple of str
        What was found about them.
    """
    unit = _UNITS[lights.choice("unit", tuple(_UNITS)) or "relative"]
    if "positions" in lights.values and choices.lights is None:
        return _near_rig(lights, camera, stack, unit)
    strengths = lights.matrix("strengths")
    notes: tuple[str, ...] = ()
    if strengths is not None:
        strengths = _one_row_each(strengths, len(stack), lights, "strengths")
        strengths, notes = channel_values(strengths, stack.shape[3], "light strengths")
    source = lights.values.get("directions")
    source = source if isinstance(source, str) else lights.file.name
    rig, found = distant_rig(
        stack,
        choices,
        lambda: _directions(lights, stack, choices),
        source,
        strengths=strengths,
        strengths_source=f"lights.strengths in {lights.file.name}",
        strength_unit=unit,
    )
    return rig, (*found, *notes)


def _directions(lights: Section, stack: ImageStack, choices: Choices) -> Directions:
    given = [key for key in ("directions", "angles", "positions") if key in lights.values]
    if len(given) != 1 or ("frame" in lights.values and given == ["angles"]):
        raise OptionError(
            given=f"[lights] in {lights.file.name} has {' and '.join(given) or 'no lights'}"
            + (" with a frame." if given == ["angles"] else "."),
            needed="One of directions, angles or positions says where the lights are; angles have no frame to choose.",
            remedy="Keep one of them; psstereo info --template shows how each is written.",
        )
    surplus = [key for key in ("axes", "mu", "flux") if key in lights.values]
    if surplus:
        raise OptionError(
            given=f"[lights] in {lights.file.name} has {', '.join(surplus)} with {given[0]}.",
            needed="These describe lamps at known positions.",
            remedy="Give positions, or strengths instead of flux.",
        )
    if given == ["angles"]:
        angles = lights.matrix("angles", 2)
        assert angles is not None
        return as_rows(_from_angles(angles), len(stack), f"lights.angles in {lights.file.name}", layout="rows")
    found = _vectors(lights, "directions", stack, choices)
    strengths = None if "strengths" in lights.values else found.strengths
    return Directions(to_canonical(found.vectors, _frame(lights)), found.notes, strengths)


def _vectors(lights: Section, key: str, stack: ImageStack, choices: Choices) -> Directions:
    """Return (m, 3) vectors in the file's own frame."""
    layout = choices.lights_layout or lights.choice("layout", ("rows", "columns"))
    path = lights.values[key]
    if isinstance(path, str):
        file = lights.file.parent / path
        chosen = chosen_directions(Choices(lights=file, lights_layout=layout), stack.names)
        return chosen or read_directions(file, len(stack), layout=layout)
    values = lights.matrix(key)
    assert values is not None
    # Written here, one light stands in one pair of brackets.
    return as_rows(values, len(stack), f"lights.{key} in {lights.file.name}", layout=layout or "rows")


def _frame(lights: Section) -> str:
    return lights.choice("frame", tuple(CONVENTIONS)) or "opengl"


def _from_angles(angles: FloatArray) -> FloatArray:
    """Return unit vectors for azimuth from +x toward +y and elevation above the image plane [deg]."""
    azimuth, elevation = np.deg2rad(angles[:, 0]), np.deg2rad(angles[:, 1])
    level = np.cos(elevation)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], axis=1)


def _near_rig(lights: Section, camera: Section, stack: ImageStack, unit: StrengthUnit) -> tuple[Rig, tuple[str, ...]]:
    if {"directions", "angles", "strengths"} & set(lights.values):
        raise OptionError(
            given=f"[lights] in {lights.file.name} has positions together with directions, angles or strengths.",
            needed="A lamp has a position, an axis, mu and a flux; a distant light a direction and a strength.",
            remedy="Keep one of the two kinds; write flux for the lamps' strengths.",
        )
    count = len(stack)
    positions = _vectors(lights, "positions", stack, Choices())
    where = camera.matrix("position", 1)
    points = positions.vectors - (0.0 if where is None else _three(camera, where))
    mu = lights.matrix("mu", 1)
    exponents = np.zeros(count) if mu is None else _one_row_each(mu, count, lights, "mu")[:, 0]
    if "axes" in lights.values:
        axes = _vectors(lights, "axes", stack, Choices()).vectors
    elif exponents.any():
        raise InputError(
            given=f"[lights] in {lights.file.name} has mu but no axes.",
            needed="Lamps that do not shine all around need their main directions.",
            remedy="Add axes, one x y z a lamp, or leave mu out.",
        )
    else:
        axes = np.broadcast_to([0.0, 0.0, -1.0], points.shape)  # of no account where mu is 0
    flux = lights.matrix("flux")
    power = np.ones((count, 1)) if flux is None else _one_row_each(flux, count, lights, "flux")
    power, notes = channel_values(power, stack.shape[3], "lamp fluxes")
    rig = led_rig(
        positions=points,
        axes=axes,
        mu=exponents,
        flux=power,
        frame=_frame(lights),
        source=lights.file.name,
        strength_unit=unit,
    )
    return rig, (*positions.notes, *notes)


def _three(camera: Section, where: FloatArray) -> FloatArray:
    if where.shape != (3, 1):
        raise camera.wrong("position", "three numbers x, y, z")
    return where[:, 0]


def _one_row_each(values: FloatArray, count: int, lights: Section, key: str) -> FloatArray:
    values = values.T if values.shape == (1, count) else values
    if len(values) != count:
        raise InputError(
            given=f"lights.{key} in {lights.file.name} has {len(values)} rows; there are {count} images.",
            needed="Each image needs its own.",
            remedy="Check for missing or extra ones.",
        )
    return values
