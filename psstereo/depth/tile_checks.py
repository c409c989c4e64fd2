"""What integration by tiles refuses, before it writes anything."""

from pathlib import Path
from typing import Any

import numpy as np

from psstereo.camera import Camera, Orthographic, Pinhole
from psstereo.depth.domain import COMPILED
from psstereo.depth.poisson import Poisson
from psstereo.depth.prior import Prior
from psstereo.depth.tile_input import Source
from psstereo.errors import (
    ExistingResultError,
    InputError,
    MissingFileError,
    OptionError,
    UnreadableFileError,
    UnsupportedError,
)
from psstereo.kernels.poisson_steps import AWAY, BAD_WEIGHT, INSIDE, NO_NORMAL, UNWEIGHED
from psstereo.types import IntArray

__all__ = ["checked_source", "free_target", "refuse_input"]

_ITERATIONS = 20
"""Passes over all pixels that are to be expected at least, for whether loading the compiled loops pays."""


def checked_source(
    normals: Any,
    camera: Camera,
    *,
    mask: Any,
    weights: Any,
    prior: Prior | None,
    integrator: Poisson,
    dtype: str,
) -> Source:
    """Check shapes, types and options, reading no more than the headers of files.

    Parameters
    ----------
    normals : path or array
        Normals.
    camera : Camera
        The camera.
    mask, weights : path, array or None
        Pixels wanted, and their confidence.
    prior : Prior or None
        Depth known beforehand.
    integrator : Poisson
        How edges are weighed.
    dtype : str
        Type of the result.

    Returns
    -------
    Source
        The same, ready to be read by windows.

    Raises
    ------
    InputError, OptionError, UnsupportedError, MissingFileError, UnreadableFileError
        If something does not fit.
    """
    if not isinstance(camera, Orthographic | Pinhole):
        raise UnsupportedError(
            given=f"The camera is of the kind {camera.name}.",
            needed="Integration by tiles knows orthographic cameras and pinholes.",
            remedy="Remove the distortion from the images first, or integrate in memory.",
        )
    if type(integrator) is not Poisson:
        raise UnsupportedError(
            given=f"The integrator is {integrator.name}.",
            needed="Only poisson is done by tiles.",
            remedy="Use poisson, or integrate in memory.",
        )
    if dtype not in {"float32", "float64"}:
        raise OptionError(
            given=f"The type of the depth is {dtype!r}.", needed="It must be float64 or float32.", remedy="Choose one."
        )
    given, found = _opened(normals)
    if len(found.shape) != 3 or found.shape[2] != 3 or np.dtype(found.dtype).kind != "f" or 0 in found.shape:
        raise InputError(
            given=f"The normals are an array of shape {tuple(found.shape)} and type {found.dtype}.",
            needed="They must be floating-point numbers of shape (rows, columns, 3).",
            remedy="Decode a normal map picture to vectors first; its integers are not components.",
        )
    shape = (int(found.shape[0]), int(found.shape[1]))
    return Source(
        normals=given,
        mask=_checked(mask, shape, "mask", "b", "true or false"),
        weights=_checked(weights, shape, "weights", "fiub", "one real number"),
        shape=shape,
        camera=camera,
        integrator=integrator,
        prior=None if prior is None else _checked_prior(prior, shape),
        compiled=shape[0] * shape[1] * _ITERATIONS >= COMPILED,
    )


def _opened(given: Any) -> tuple[Any, Any]:
    """Return a path or an array, and what has its shape and type."""
    if not isinstance(given, str | Path):
        found = given if hasattr(given, "shape") and hasattr(given, "dtype") else np.asarray(given)
        return found, found
    path = Path(given)
    if not path.is_file():
        raise MissingFileError(
            given=f"There is no file {path}.", needed="An .npy file is expected there.", remedy="Check the path."
        )
    try:
        return path, np.load(path, mmap_mode="r", allow_pickle=False)
    except (ValueError, OSError, EOFError) as error:
        raise UnreadableFileError(
            given=f"{path} is no .npy file of numbers ({error}).",
            needed="Integration by tiles reads .npy files, which hold the numbers as they are.",
            remedy="Write it with numpy.save, or give an array.",
        ) from None


def _checked(given: Any, shape: tuple[int, int], name: str, kinds: str, what: str) -> Any:
    if given is None:
        return None
    source, found = _opened(given)
    if tuple(found.shape) != shape or np.dtype(found.dtype).kind not in kinds:
        raise InputError(
            given=f"The {name} is an array of shape {tuple(found.shape)} and type {found.dtype}.",
            needed=f"There must be {what} for each of the {shape} pixels of the normals.",
            remedy=f"Use the {name} that belongs to the normals, or leave it out.",
        )
    return source


def _checked_prior(prior: Prior, shape: tuple[int, int]) -> Prior:
    if tuple(np.shape(prior.depth)) != shape or np.shape(prior.sigma) not in {(), shape}:
        raise InputError(
            given=f"The prior depth has shape {np.shape(prior.depth)}, its error {np.shape(prior.sigma)}.",
            needed=f"Depth must be given for the {shape} pixels of the normals, its error likewise or as one number.",
            remedy="Bring the prior to the pixels of the normal map, with NaN where it is unknown.",
        )
    return prior


def refuse_input(counts: IntArray, *, tied: bool | None = None) -> None:
    """Refuse weights that are none, a domain without pixels, and a prior that touches none.

    Parameters
    ----------
    counts : int64 array (6,)
        Pixels in each of the states of :mod:`psstereo.kernels.poisson_steps`.
    tied : bool, optional
        Whether a pixel of the domain has a prior; None if there is none or that is not known yet.

    Raises
    ------
    InputError
        As said.
    """
    if counts[BAD_WEIGHT]:
        raise InputError(
            given=f"{counts[BAD_WEIGHT]} pixels that have a normal have a weight that is negative or not finite.",
            needed="Weights must be 0 (leave the pixel out) or positive numbers.",
            remedy="Replace them, for instance by 0, or by a typical weight where the uncertainty is unknown.",
        )
    if not counts[INSIDE]:
        raise InputError(
            given=(
                f"None of {int(counts[1:].sum())} pixels in the mask can be integrated: {counts[NO_NORMAL]} have no "
                f"normal, {counts[AWAY]} face away from the camera, {counts[UNWEIGHED]} have weight 0."
            ),
            needed="At least one pixel needs a normal toward the camera and a weight above 0.",
            remedy="Check the mask and the axes: x right, y up, z toward the camera.",
        )
    if tied is False:
        raise InputError(
            given="No pixel with a normal has a prior depth.",
            needed="At least one is needed.",
            remedy="Check the mask and where the prior is NaN, or leave the prior out.",
        )


def free_target(path: str | Path, overwrite: bool, *, other: Path | None = None) -> Path:
    """Return the place for a file, if it may be written there.

    Parameters
    ----------
    path : path
        The file.
    overwrite : bool
        Whether a file that exists may be replaced.
    other : Path, optional
        Another file that is to be written.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ExistingResultError
        If something is there.
    MissingFileError
        If its folder does not exist.
    OptionError
        If the name does not end in ``.npy`` or both files are the same.
    """
    target = Path(path)
    if target.suffix != ".npy" or target == other:
        raise OptionError(
            given=f"The result is to be written to {target}.",
            needed="Depth and components are .npy files, one each.",
            remedy="Choose another name.",
        )
    if not target.absolute().parent.is_dir():
        raise MissingFileError(
            given=f"There is no folder {target.parent}.",
            needed="The result needs a folder that exists.",
            remedy="Make it, or choose another.",
        )
    if target.is_dir() or (target.exists() and not overwrite):
        raise ExistingResultError(
            given=f"{target} exists.",
            needed="Nothing is replaced unasked.",
            remedy="Choose another name, or overwrite.",
        )
    return target
