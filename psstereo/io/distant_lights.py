"""The rig of distant lights of a capture: the folder's own, or the one that was chosen instead."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt

from psstereo.errors import InputError, MissingFileError, RigError
from psstereo.io.image_names import base_name, name_key
from psstereo.io.light_file import Directions, read_directions
from psstereo.io.parts import channel_values
from psstereo.io.reader import Choices
from psstereo.lights import Rig, StrengthUnit
from psstereo.stack import ImageStack

__all__ = ["NOT_READ", "chosen_directions", "distant_rig"]

NOT_READ = "The lights are taken for unknown: directions were not read."
"""Note of a capture whose own lights are of no interest."""


def distant_rig(
    stack: ImageStack,
    choices: Choices,
    own: Callable[[], Directions],
    source: str,
    *,
    strengths: npt.ArrayLike | None = None,
    strengths_source: str | None = None,
    strength_unit: StrengthUnit = StrengthUnit.RELATIVE,
) -> tuple[Rig, tuple[str, ...]]:
    """Build the rig of a capture.

    Parameters
    ----------
    stack : ImageStack
        The images.
    choices : Choices
        Whether other lights are to be taken than the capture's own.
    own : callable
        Returns the capture's own vectors in the canonical frame; called only if no others are chosen.
    source : str
        Name of their file.
    strengths : array (m,) or (m, c), optional
        Strengths of the lights, unless the file of directions holds some; all one if absent [W m⁻²], or relative.
    strengths_source : str, optional
        Name of the strengths' file, if it is another one.
    strength_unit : StrengthUnit
        Which of the two.

    Returns
    -------
    rig : Rig
        The lights in the order of the images.
    notes : tuple of str
        What was found about them.

    Raises
    ------
    RigError
        If a light is zero or not finite; the message names the file and the light.
    """
    if choices.unknown_lights:
        towards = np.tile([0.0, 0.0, 1.0], (len(stack), 1))
        rig = Rig.distant(towards, strengths, strength_unit=strength_unit, source="unknown")
        return rig, (NOT_READ,)
    found = chosen_directions(choices, stack.names)
    where = source if choices.lights is None else choices.lights.name
    found = own() if found is None else found
    notes = found.notes
    if found.strengths is not None:
        strengths, more = channel_values(found.strengths, stack.shape[3], "light strengths")
        strengths_source, strength_unit, notes = where, StrengthUnit.RELATIVE, (*notes, *more)
    checked = where
    try:
        Rig.distant(found.vectors)
        checked = strengths_source or where
        rig = Rig.distant(found.vectors, strengths, strength_unit=strength_unit, source=where)
    except RigError as error:
        raise RigError(given=f"{checked}: {error.given}", needed=error.needed, remedy=error.remedy) from None
    behind = int(np.count_nonzero(rig.directions[:, 2] <= 0))
    note = f"{behind} of {len(rig)} lights come from the side or from behind (z ≤ 0); they are kept."
    return rig, (*notes, *((note,) if behind else ()))


def chosen_directions(choices: Choices, names: tuple[str, ...]) -> Directions | None:
    """Return the light vectors of the file that was chosen, None if none was.

    Rows of an ``.lp`` file go to the images by name where its names are those of the images, else by order.

    Parameters
    ----------
    choices : Choices
        What was chosen.
    names : tuple of str
        File names of the images.

    Returns
    -------
    Directions or None
        Vectors in the order of the images.
    """
    path = choices.lights
    if path is None:
        return None
    if not path.is_file():
        raise MissingFileError(
            given=f"The lights file {path} does not exist.",
            needed="A file with one light direction x y z for each image.",
            remedy="Check its name and folder.",
        )
    if path.suffix.lower() == ".lp":
        return _by_name(path, names)
    if path.suffix.lower() == ".json":
        from psstereo.io.light_json import read_light_json

        return read_light_json(path).for_images(names, path.name)
    return read_directions(path, len(names), layout=choices.lights_layout)


def _by_name(path: Path, names: tuple[str, ...]) -> Directions:
    from psstereo.io.lp_file import read_lp

    entries = read_lp(path)
    for key in (name_key, lambda name: name_key(Path(name).stem)):
        rows = {key(base_name(name)): i for i, name in enumerate(entries.names)}
        hits = [rows.get(key(name)) for name in names]
        order = [hit for hit in hits if hit is not None]
        if len(order) == len(names) and len(set(order)) == len(names):
            left = len(entries.names) - len(order)
            note = f"{path.name} lists {left} more images, which are not in this capture."
            return Directions(entries.vectors[order], (*entries.notes, *((note,) if left else ())))
    known = len(order)
    if known or len(entries.names) != len(names):
        missing = [name for name, hit in zip(names, hits, strict=True) if hit is None]
        raise InputError(
            given=f"{path.name} lists {len(entries.names)} images; of the {len(names)} images of the capture it does "
            f"not name {', '.join(missing[:5]) or 'each by a row of its own'}{' …' if len(missing) > 5 else ''}.",
            needed="Each image needs its row.",
            remedy="Name the .lp file that belongs to these images, or rename its entries.",
        )
    note = f"None of the names in {path.name} is an image of the capture; its rows were taken in the images' order."
    return Directions(entries.vectors, (*entries.notes, note))
