"""Lights from one program's files to another's, frames and all."""

from collections.abc import Mapping
from pathlib import Path

from psstereo.catalogue import choose
from psstereo.errors import InputError, MissingFileError
from psstereo.io.atomic import new_folder
from psstereo.io.light_bridge_both import DomeLights, RigLights
from psstereo.io.light_bridge_distant import DiligentLights, LpLights, MeshroomLights, PsBoxLights, matrix_of_lights
from psstereo.io.light_bridge_lamps import LucesLights, NearPsLights
from psstereo.io.light_bridge_table import LightFormat, LightTable
from psstereo.io.one_file import require_file_place
from psstereo.io.read import read_capture, recognise
from psstereo.io.reader import Choices
from psstereo.io.rig_file import meant_as_rig_file
from psstereo.stack.decode import IMAGE_SUFFIXES

__all__ = ["LIGHT_FORMATS", "LightFormat", "LightTable", "read_lights", "write_lights"]

LIGHT_FORMATS: Mapping[str, LightFormat] = {
    one.name: one
    for one in (
        RigLights(),
        LpLights(),
        DomeLights(),
        DiligentLights(),
        PsBoxLights(),
        MeshroomLights(),
        LucesLights(),
        NearPsLights(),
    )
}
"""Formats by name; the first that recognises a file reads it."""


def read_lights(path: Path, *, kind: str | None = None) -> LightTable:
    """Read the lights of a file or folder.

    Parameters
    ----------
    path : Path
        A file or folder of a format of lights, a capture, or a matrix of directions as text, ``.npy`` or ``.mat``.
    kind : str, optional
        A key of :data:`LIGHT_FORMATS`; found out if absent. ``diligent`` reads a matrix of one light a row, ``psbox``
        one of one light a column.

    Returns
    -------
    LightTable
        The lights, x right, y up, z toward the camera.

    Raises
    ------
    OptionError
        If the kind is unknown.
    MissingFileError
        If there is no such file.
    InputError
        If nothing fits, or rows cannot be told from columns.
    PsstereoError
        If the file is damaged.
    """
    if not path.exists():
        raise MissingFileError(
            given=f"{path} does not exist.", needed="A file or folder of lights.", remedy="Check the name."
        )
    if kind is not None:
        return choose(LIGHT_FORMATS, kind, "format").read(path)
    fits = [one for one in LIGHT_FORMATS.values() if one.recognise(path)]
    if fits:
        return fits[0].read(path)
    if meant_as_rig_file(path):
        return RigLights().read(path)  # which says what is wrong with it
    if (path / "light_directions.txt").is_file():
        raise InputError(
            given=f"light_directions.txt in {path} holds 3 × 3 numbers, or neither three rows nor three columns.",
            needed="It must be known whether a light is a row or a column.",
            remedy="Say --from diligent (one light a row) or --from psbox (one a column).",
        )
    if recognise(path):
        capture, _ = read_capture(path, choices=Choices(truth=False))
        return LightTable.of_capture(capture)
    if path.is_file() and path.suffix.lower() not in IMAGE_SUFFIXES - {".npy"}:
        return matrix_of_lights(path)
    raise InputError(
        given=f"{path} is of no format of lights that is known, and no capture.",
        needed=f"One of {', '.join(LIGHT_FORMATS)}, or a text of directions, x y z of one light a line.",
        remedy="Name the file of the lights, and --from its format.",
    )


def write_lights(path: Path, table: LightTable, kind: str, *, overwrite: bool = False) -> tuple[str, ...]:
    """Write lights in a format; the file or folder appears whole or not at all.

    Parameters
    ----------
    path : Path
        The file; a new or empty folder for formats of several files.
    table : LightTable
        The lights.
    kind : str
        A key of :data:`LIGHT_FORMATS`.
    overwrite : bool
        Whether a file of that format, or a folder of just these files, may be replaced.

    Returns
    -------
    tuple of str
        What the format has no place for, as sentences.

    Raises
    ------
    OptionError
        If the kind is unknown.
    UnsupportedError
        If the format cannot hold such lights, or needs what is not known; nothing is written then.
    ExistingResultError, MissingFileError
        If something is in the way, or a folder is not there.
    """
    form = choose(LIGHT_FORMATS, kind, "format")
    files = form.files(table)
    if not form.file_name:
        with new_folder(path, overwrite=overwrite, names=list(files)) as work:
            for name, save in files.items():
                (work / name).parent.mkdir(exist_ok=True)
                save(work / name)
        return form.left_out(table)
    words = f"file of the format {form.name}"
    require_file_place(path, overwrite=overwrite, ours=form.recognise, kind=words)
    partial = path.with_name(f".{path.stem}.part{path.suffix}")
    try:
        files[""](partial)
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)
    return form.left_out(table)
