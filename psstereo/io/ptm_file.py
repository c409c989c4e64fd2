"""Polynomial texture maps: ``.ptm`` files of RTI viewers."""

import os
from pathlib import Path

import numpy as np

from psstereo.errors import UnsupportedError
from psstereo.io.one_file import begins_with, put_file
from psstereo.io.rti_planes import RelightPlanes

__all__ = ["PTM_HEADS", "write_ptm"]

PTM_HEADS = (b"PTM_1.",)
"""How such files begin."""


def write_ptm(path: str | os.PathLike[str], planes: RelightPlanes, *, overwrite: bool = False) -> None:
    """Write a ``.ptm`` file of version 1.2: LRGB if the planes have a colour, else RGB.

    A header of text has the format, width and height, six scales and six whole biases. LRGB then has six bytes a pixel
    of all pixels, then three of colour; RGB has a block of six bytes a pixel for each channel. Rows run from the bottom
    to the top. Viewers show ``a₀u² + a₁v² + a₂uv + a₃u + a₄v + a₅`` [1]_ as it is, so that the coefficients should be
    those of values on the screen's curve.

    Parameters
    ----------
    path : path
        The file.
    planes : RelightPlanes
        Of the basis "ptm".
    overwrite : bool
        Whether an earlier file of this kind may be replaced; any other is refused even then.

    Raises
    ------
    UnsupportedError
        If the planes are of another basis.
    ExistingResultError, MissingFileError
        If the file is there, or its folder is not.

    References
    ----------
    .. [1] T. Malzbender, D. Gelb, H. Wolters, "Polynomial Texture Maps", SIGGRAPH 2001. doi:10.1145/383259.383320
    """
    if planes.basis != "ptm":
        raise UnsupportedError(
            given=f"The planes are of the basis {planes.basis}.",
            needed="A .ptm file holds polynomials.",
            remedy="Fit the basis ptm, or write an .rti file.",
        )
    height, width = planes.size
    kind = "RGB" if planes.colour is None else "LRGB"
    lines = [
        "PTM_1.2",
        f"PTM_FORMAT_{kind}",
        str(width),
        str(height),
        " ".join(f"{s:.9g}" for s in planes.scale),
        " ".join(f"{b:.0f}" for b in planes.bias),
    ]
    upward = planes.codes[:, ::-1]
    if planes.colour is None:
        channels = np.broadcast_to(upward, (*upward.shape[:3], 3))
        body = np.ascontiguousarray(channels.transpose(3, 1, 2, 0)).tobytes()
    else:
        body = np.ascontiguousarray(upward[..., 0].transpose(1, 2, 0)).tobytes() + planes.colour[::-1].tobytes()
    data = "\n".join([*lines, ""]).encode("ascii") + body
    put_file(Path(path), data, overwrite=overwrite, ours=begins_with(*PTM_HEADS), kind=".ptm file")
