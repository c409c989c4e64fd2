"""Universal ``.rti`` files of RTI viewers, with hemispherical harmonics."""

import os
from pathlib import Path

import numpy as np

from psstereo.errors import UnsupportedError
from psstereo.io.one_file import begins_with, put_file
from psstereo.io.rti_planes import RelightPlanes

__all__ = ["RTI_HEADS", "write_rti"]

RTI_HEADS = (b"#HSH", b"#PTM", b"#SH")
"""How such files begin."""

_HSH = 3
"""Type of the file: 1 PTM, 2 spherical harmonics, 3 hemispherical ones."""
_EACH_CHANNEL = 2
"""Colour: each channel has coefficients of its own."""


def write_rti(path: str | os.PathLike[str], planes: RelightPlanes, *, overwrite: bool = False) -> None:
    """Write an ``.rti`` file with hemispherical harmonics of 4 or 9 terms.

    After lines of text come the scales and the biases of the terms, float32, little-endian, and then for each pixel
    the bytes of all terms of red, of green and of blue. Rows run from the top to the bottom, unlike those of ``.ptm``.

    Parameters
    ----------
    path : path
        The file.
    planes : RelightPlanes
        Of the basis "hsh4" or "hsh9", without a colour of its own.
    overwrite : bool
        Whether an earlier file of this kind may be replaced; any other is refused even then.

    Raises
    ------
    UnsupportedError
        If the planes are of another basis, or have one brightness and a colour.
    ExistingResultError, MissingFileError
        If the file is there, or its folder is not.
    """
    if not planes.basis.startswith("hsh") or planes.colour is not None:
        raise UnsupportedError(
            given=f"The planes are of the basis {planes.basis}{'' if planes.colour is None else ', with a colour'}.",
            needed="Viewers read .rti files of hemispherical harmonics, one set for each channel.",
            remedy="Fit the basis hsh4 or hsh9 in rgb, or write a .ptm file.",
        )
    height, width = planes.size
    terms = len(planes.codes)
    head = f"#HSH1.2\n{_HSH}\n{width} {height} 3\n{terms} {_EACH_CHANNEL} 1\n".encode("ascii")
    numbers = np.concatenate([planes.scale, planes.bias]).astype("<f4").tobytes()
    channels = np.broadcast_to(planes.codes, (*planes.codes.shape[:3], 3))
    body = np.ascontiguousarray(channels.transpose(1, 2, 3, 0)).tobytes()
    put_file(Path(path), head + numbers + body, overwrite=overwrite, ours=begins_with(*RTI_HEADS), kind=".rti file")
