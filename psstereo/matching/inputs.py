"""Files of well-known stereo sets: camera lists, calibrations and disparity maps."""

import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from psstereo.camera import Pinhole, Pose
from psstereo.errors import InputError, MissingFileError, UnreadableFileError
from psstereo.matching.geometry import CalibratedView
from psstereo.stack.decode import decode_image
from psstereo.types import FloatArray

__all__ = ["PairCalibration", "read_disparity", "read_pair_calibration", "read_view_list"]

_FLIP = np.diag([1.0, -1.0, -1.0])
_NUMBERS = 21
"""K, R and t of a view, row by row."""


@dataclass(frozen=True, kw_only=True)
class PairCalibration:
    """What ``calib.txt`` of Middlebury's sets of 2014 says.

    Attributes
    ----------
    camera : Pinhole
        Of the left image.
    baseline : float
        Distance of the cameras, in the file's unit (mm in Middlebury's) [length].
    shift : float
        Column of the right principal point minus that of the left one, ``doffs`` [px].
    disparities : int or None
        Number of disparities that the scene needs, ``ndisp``.
    """

    camera: Pinhole
    baseline: float
    shift: float = 0.0
    disparities: int | None = None


def read_view_list(path: Path) -> list[CalibratedView]:
    """Read a list of cameras of Middlebury's multi-view sets.

    The first line is the count; each other line holds a file name, K and R row by row, and t, with the projection
    K [R t], x right, y down, z into the scene.

    Parameters
    ----------
    path : Path
        The file, such as ``templeSR_par.txt``.

    Returns
    -------
    list of CalibratedView
        One a line; names are file names.

    Raises
    ------
    MissingFileError, UnreadableFileError
        If it is not there, or lines do not hold that.
    """
    lines = [line.split() for line in _text(path).splitlines() if line.strip()]
    if not lines or len(lines[0]) != 1 or not lines[0][0].isdigit() or int(lines[0][0]) != len(lines) - 1:
        raise _bad(path, f"its first line is {' '.join(lines[0]) if lines else 'missing'!r}, not the count of views")
    return [_view(path, words) for words in lines[1:]]


def _view(path: Path, words: list[str]) -> CalibratedView:
    try:
        numbers = np.array([float(word) for word in words[1:]])
    except ValueError:
        raise _bad(path, f"the line of {words[0]} holds words") from None
    if len(numbers) != _NUMBERS or not np.isfinite(numbers).all():
        raise _bad(path, f"the line of {words[0]} holds {len(numbers)} numbers instead of {_NUMBERS}")
    k, r, t = numbers[:9].reshape(3, 3), numbers[9:18].reshape(3, 3), numbers[18:]
    u, scale, v = np.linalg.svd(r)
    if np.abs(scale - 1).max() > 1e-3 or np.linalg.det(r) < 0:
        raise _bad(path, f"the rotation of {words[0]} is none")
    r = u @ v  # printed with finitely many digits
    pose = Pose(rotation=r.T @ _FLIP, position=-r.T @ t)
    return CalibratedView(camera=Pinhole.from_matrix(k), pose=pose, name=words[0])


def read_pair_calibration(path: Path) -> PairCalibration:
    """Read ``calib.txt`` of a Middlebury pair of 2014.

    Parameters
    ----------
    path : Path
        The file, lines ``key=value`` with cam0, cam1, baseline, and perhaps doffs and ndisp.

    Returns
    -------
    PairCalibration
        What it says.

    Raises
    ------
    MissingFileError, UnreadableFileError
        If it is not there, or a key is missing or no number.
    """
    found = dict(re.findall(r"^\s*(\w+)\s*=\s*(.+?)\s*$", _text(path), re.MULTILINE))
    missing = [key for key in ("cam0", "baseline") if key not in found]
    if missing:
        raise _bad(path, f"it has no {' and no '.join(missing)}")
    try:
        rows = [[float(v) for v in row.split()] for row in found["cam0"].strip("[]").split(";")]
        baseline, shift = float(found["baseline"]), float(found.get("doffs", 0.0))
        count = int(found["ndisp"]) if "ndisp" in found else None
    except ValueError as error:
        raise _bad(path, str(error)) from None
    if not baseline > 0 or not math.isfinite(shift):
        raise _bad(path, f"the baseline is {baseline} and doffs {shift}")
    camera = Pinhole.from_matrix(np.array(rows))
    return PairCalibration(camera=camera, baseline=baseline, shift=shift, disparities=count)


def read_disparity(path: Path, *, scale: float = 1.0) -> FloatArray:
    """Read a disparity map.

    Parameters
    ----------
    path : Path
        ``.pfm`` or ``.npy`` of disparities, where infinity and NaN are unknown, or an image of whole numbers, where 0
        is unknown.
    scale : float
        The numbers are disparities times this: 4 for Middlebury's small images of 2003 [1].

    Returns
    -------
    float64 array (h, w)
        Disparities, NaN where unknown [px].

    Raises
    ------
    MissingFileError, UnreadableFileError
        If it is not there or damaged.
    InputError
        If it holds no map, or the scale is not positive.
    """
    if not 0 < scale < math.inf:
        raise InputError(given=f"The scale is {scale}.", needed="A positive number.", remedy="Middlebury 2003 has 4.")
    if path.suffix.lower() == ".pfm":
        values = _read_pfm(path)
    elif path.suffix.lower() == ".pgm":
        values = _read_pgm(path)
    else:
        values = np.asarray(decode_image(path))
    if values.ndim == 3 and values.shape[2] == 1:
        values = values[..., 0]
    if values.ndim != 2:
        raise InputError(
            given=f"{path.name} holds an array of the shape {values.shape}.",
            needed="A disparity map has one number a pixel.",
            remedy="Name the map, not one of the images.",
        )
    known = np.isfinite(values) if values.dtype.kind == "f" else values > 0
    return np.where(known, np.asarray(values, np.float64) / scale, np.nan)


def _read_pgm(path: Path) -> FloatArray:
    import cv2

    data = _bytes(path)
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED) if data else None
    if image is None:
        raise _bad(path, "it is no PGM image")
    return np.asarray(image)


def _read_pfm(path: Path) -> FloatArray:
    data = _bytes(path)
    head = re.match(rb"(P[fF])\s+(\d+)\s+(\d+)\s+(-?[\d.eE+]+)\s", data)
    if head is None or head[1] != b"Pf":
        raise _bad(path, "it is no gray PFM file")
    width, height, order = int(head[2]), int(head[3]), "<f4" if float(head[4]) < 0 else ">f4"
    body = data[head.end() :]
    if len(body) != 4 * width * height:
        raise _bad(path, f"it holds {len(body)} bytes of numbers instead of {4 * width * height}")
    # The format begins with the lowest row.
    return np.asarray(np.frombuffer(body, order).reshape(height, width)[::-1], np.float32)


def _text(path: Path) -> str:
    try:
        return _bytes(path).decode("utf-8")
    except UnicodeDecodeError:
        raise _bad(path, "it is no text") from None


def _bytes(path: Path) -> bytes:
    if not path.is_file():
        raise MissingFileError(given=f"{path} is not there.", needed="The file.", remedy="Check the name.")
    return path.read_bytes()


def _bad(path: Path, why: str) -> UnreadableFileError:
    return UnreadableFileError(
        given=f"{path.name} cannot be read: {why}.",
        needed="A file of the layout that Middlebury's pages describe.",
        remedy="Fetch it again, or correct it.",
    )
