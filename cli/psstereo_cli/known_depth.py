"""From the words on the command line to depth that is known beforehand."""

from pathlib import Path
from typing import TYPE_CHECKING

from psstereo.errors import OptionError

if TYPE_CHECKING:
    from psstereo.camera import Camera
    from psstereo.depth import Prior

__all__ = ["load_prior"]


def load_prior(
    path: Path | None, shape: tuple[int, int], camera: "Camera", *, sigma: float | None, unit: str | None
) -> "tuple[Prior | None, tuple[str, ...]]":
    """Read the prior that was named, if any.

    Parameters
    ----------
    path, sigma, unit
        As on the command line.
    shape : (int, int)
        Rows and columns of the images.
    camera : Camera
        Their camera.

    Returns
    -------
    Prior or None
        Known depth.
    tuple of str
        Notes for the record.

    Raises
    ------
    OptionError
        If there is an error or a unit and no prior.
    """
    if path is None:
        if sigma is not None or unit is not None:
            raise OptionError(
                given=f"There is {'an error' if sigma is not None else 'a unit'} of a prior and no prior.",
                needed="They belong to --prior.",
                remedy="Name the file with --prior, or leave them out.",
            )
        return None, ()
    from psstereo.depth import Prior
    from psstereo.io.prior_file import read_known_depth

    known = read_known_depth(path, shape, camera, sigma=sigma, unit=unit)
    return Prior(depth=known.depth, sigma=known.sigma, unit=known.unit), known.notes
