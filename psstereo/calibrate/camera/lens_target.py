"""The camera's matrix and its lens from pictures of a chessboard or a ChArUco board."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from psstereo.camera import Lens, Pinhole
from psstereo.errors import InputError, OptionError
from psstereo.io.rig_file import RigQuality
from psstereo.types import Array, FloatArray, Progress, no_progress

__all__ = ["Board", "LensFit", "find_corners", "lens_from_corners", "lens_from_pictures"]

_MODELS = {"k1": 4, "k1k2": 4, "standard": 5, "rational": 8}
_LEAST_VIEWS = 3
_LEAST_CORNERS = 8
_COVERED = 0.6
"""Share of the image's width and height that corners should reach."""
_BLURRED = 0.5
"""Residual from which pictures are worth another try [px]."""


@dataclass(frozen=True, kw_only=True)
class Board:
    """A printed board.

    Attributes
    ----------
    columns, rows : int
        Squares of the board, not inner corners.
    square : float
        Side of a square, in any unit of length.
    marker : float or None
        Side of the markers of a ChArUco board in the same unit; None for a chessboard.
    dictionary : str
        Of the markers, a name of OpenCV such as ``"4X4_50"``.

    Raises
    ------
    OptionError
        If it is smaller than 3 × 3 squares, a length is not positive, or a marker as large as its square.
    """

    columns: int
    rows: int
    square: float = 1.0
    marker: float | None = None
    dictionary: str = "4X4_50"

    def __post_init__(self) -> None:
        lengths = 0 < self.square < np.inf and (self.marker is None or 0 < self.marker < self.square)
        if min(self.columns, self.rows) < 3 or not lengths:
            raise OptionError(
                given=f"The board has {self.columns} × {self.rows} squares of {self.square}, markers of {self.marker}.",
                needed="At least 3 × 3 squares, and markers smaller than them.",
                remedy="Count squares along both sides, and measure one.",
            )

    @property
    def corners(self) -> FloatArray:
        """Inner corners, row by row, float64 (n, 3), in the unit of `square`."""
        rows, columns = np.indices((self.rows - 1, self.columns - 1), dtype=np.float64)
        flat = np.stack([columns.ravel(), rows.ravel(), np.zeros(rows.size)], axis=1)
        return np.asarray((flat + (np.array([1.0, 1.0, 0.0]) if self.marker else 0.0)) * self.square)


@dataclass(frozen=True, kw_only=True, eq=False)
class LensFit:
    """A camera with its lens, and how well they are known.

    Attributes
    ----------
    camera : Pinhole
        The camera without the lens [px].
    lens : Lens
        What the lens does.
    errors : float array (4,)
        Standard errors of fx, fy, cx, cy [px].
    residual : float
        Root-mean-square distance of corners from where the model puts them [px].
    straight : float
        The same without a lens, for comparison [px].
    per_view : float array (k,)
        The residual of each picture that was used [px].
    used : tuple of int
        Which pictures those are, from 0.
    quality : RigQuality
        The same in words.
    """

    camera: Pinhole
    lens: Lens
    errors: FloatArray
    residual: float
    straight: float
    per_view: FloatArray
    used: tuple[int, ...]
    quality: RigQuality


def find_corners(picture: Array, board: Board) -> tuple[FloatArray, FloatArray] | None:
    """Find the inner corners of a board in a picture.

    Parameters
    ----------
    picture : uint8 or uint16 array (h, w) or (h, w, c)
        The picture.
    board : Board
        What is looked for.

    Returns
    -------
    (float64 array (n, 3), float64 array (n, 2)) or None
        Corners on the board [its unit] and in the picture, column and row [px]; None if the board is not seen. A
        chessboard must be seen whole, a ChArUco board in part.

    Raises
    ------
    OptionError
        If OpenCV has no such dictionary of markers.
    """
    import cv2

    gray = np.asarray(picture, np.float64)
    gray = gray.mean(axis=2) if gray.ndim == 3 else gray
    eight = np.asarray(gray * (255.0 / max(float(gray.max()), 1e-300)), np.uint8)
    if board.marker is None:
        size = (board.columns - 1, board.rows - 1)
        found, seen = cv2.findChessboardCornersSB(eight, size, flags=cv2.CALIB_CB_NORMALIZE_IMAGE)
        return (board.corners, _sharpened(eight, np.asarray(seen, np.float32).reshape(-1, 2))) if found else None
    number = getattr(cv2.aruco, f"DICT_{board.dictionary.upper()}", None)
    if number is None:
        raise OptionError(
            given=f"The dictionary of markers is {board.dictionary!r}.",
            needed="One of OpenCV's, such as 4X4_50, 5X5_100 or 6X6_250.",
            remedy="Look at what the board was printed with.",
        )
    pattern = cv2.aruco.CharucoBoard(
        (board.columns, board.rows), board.square, board.marker, cv2.aruco.getPredefinedDictionary(number)
    )
    seen, names, _, _ = cv2.aruco.CharucoDetector(pattern).detectBoard(eight)
    if names is None or len(names) < _LEAST_CORNERS:
        return None
    return board.corners[np.asarray(names).ravel()], np.asarray(seen, np.float64).reshape(-1, 2)


def _sharpened(gray: Array, seen: FloatArray) -> FloatArray:
    """Return corners where the slopes around them meet; the finder's own places are off by a quarter of a pixel."""
    import cv2

    steps = np.linalg.norm(seen[:, None] - seen[None], axis=2)
    np.fill_diagonal(steps, np.inf)
    half = int(np.clip(steps.min() / 4.0, 2, 11))
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-4)
    fine = cv2.cornerSubPix(gray, seen.reshape(-1, 1, 2).copy(), (half, half), (-1, -1), stop)
    return np.asarray(fine, np.float64).reshape(-1, 2)


def lens_from_pictures(
    pictures: Sequence[Array], board: Board, *, model: str = "standard", progress: Progress = no_progress
) -> LensFit:
    """Find camera and lens from pictures of a board; see :func:`find_corners` and :func:`lens_from_corners`.

    Not for pictures in which the camera refocused or zoomed: each has a lens of its own then.

    Parameters
    ----------
    pictures : sequence of uint8 or uint16 array (h, w) or (h, w, c)
        Pictures of the board from different sides; those that do not show it are left out.
    board : Board
        What is looked for.
    model : {"k1", "k1k2", "standard", "rational"}
        Coefficients that are looked for.
    progress : callable
        Told in how many pictures the board has been looked for.

    Returns
    -------
    LensFit
        Camera, lens, errors, and which pictures told them.

    Raises
    ------
    InputError
        If pictures differ in size, or fewer than three show the board.
    OptionError
        If the model or the dictionary of markers is unknown.
    """
    _require_model(model)  # before the search
    shapes = {np.shape(picture)[:2] for picture in pictures}
    if len(shapes) != 1:
        raise InputError(
            given=f"The {len(pictures)} pictures have the sizes {sorted(shapes)}.",
            needed="Pictures of one size, taken with one lens at one focus.",
            remedy="Leave the odd ones out.",
        )
    found: list[tuple[FloatArray, FloatArray] | None] = []
    for picture in pictures:
        progress("corners of the board", len(found), len(pictures))
        found.append(find_corners(picture, board))
    progress("corners of the board", len(found), len(pictures))
    seen = [(index, one) for index, one in enumerate(found) if one is not None]
    if len(seen) < _LEAST_VIEWS:
        raise InputError(
            given=f"The board of {board.columns} × {board.rows} squares is seen in {len(seen)} of {len(pictures)} "
            "pictures.",
            needed=f"At least {_LEAST_VIEWS}, of different tilts; ten are good.",
            remedy="Check the number of squares; show the whole chessboard, sharp, and with a white margin.",
        )
    shape = shapes.pop()
    fit = lens_from_corners([one for _, one in seen], (shape[0], shape[1]), model=model)
    return LensFit(**{**vars(fit), "used": tuple(index for index, _ in seen)})


def _require_model(model: str) -> None:
    if model not in _MODELS:
        raise OptionError(
            given=f"The model of the lens is {model!r}.", needed=f"One of {', '.join(_MODELS)}.", remedy="Choose one."
        )


def lens_from_corners(
    views: Sequence[tuple[FloatArray, FloatArray]], shape: tuple[int, int], *, model: str = "standard"
) -> LensFit:
    """Find camera and lens from corners that were seen.

    Parameters
    ----------
    views : sequence of (float array (n, 3), float array (n, 2))
        Corners on the plane of the board [any unit], and in the picture, column and row [px].
    shape : (int, int)
        Rows and columns of the pictures.
    model : {"k1", "k1k2", "standard", "rational"}
        Coefficients that are looked for: one; two; k₁ k₂ p₁ p₂ k₃; or k₄ k₅ k₆ besides, for wide angles.

    Returns
    -------
    LensFit
        Camera, lens, and errors.

    Raises
    ------
    InputError
        If there are fewer than three views, or they do not determine the camera.
    OptionError
        If the model is unknown.

    References
    ----------
    .. [1] Z. Zhang, "A Flexible New Technique for Camera Calibration", IEEE TPAMI 22(11), 2000.
       doi:10.1109/34.888718
    """
    _require_model(model)
    fewest = min((len(plane) for plane, _ in views), default=0)
    if len(views) < _LEAST_VIEWS or fewest < _LEAST_CORNERS:
        raise InputError(
            given=f"There are {len(views)} views with {fewest} corners or more.",
            needed=f"At least {_LEAST_VIEWS} views of {_LEAST_CORNERS} corners.",
            remedy="Take more pictures of the board.",
        )
    residual, matrix, lens, errors, per_view = _calibrate(views, shape, model)
    straight = _calibrate(views, shape, "none")[0]
    camera = Pinhole.from_matrix(matrix)
    return LensFit(
        camera=camera,
        lens=lens,
        errors=errors,
        residual=residual,
        straight=straight,
        per_view=per_view,
        used=tuple(range(len(views))),
        quality=_quality(views, shape, camera, errors, residual),
    )


def _calibrate(
    views: Sequence[tuple[FloatArray, FloatArray]], shape: tuple[int, int], model: str
) -> tuple[float, FloatArray, Lens, FloatArray, FloatArray]:
    """Return the residual, K, the lens, errors of fx, fy, cx, cy, and each view's residual, by OpenCV."""
    import cv2

    tangential, k2, k3 = cv2.CALIB_ZERO_TANGENT_DIST, cv2.CALIB_FIX_K2, cv2.CALIB_FIX_K3
    flags = {
        "none": tangential | cv2.CALIB_FIX_K1 | k2 | k3,
        "k1": tangential | k2 | k3,
        "k1k2": tangential | k3,
        "standard": 0,
        "rational": cv2.CALIB_RATIONAL_MODEL,
    }[model]
    planes = [np.asarray(plane, np.float32).reshape(-1, 1, 3) for plane, _ in views]
    seen = [np.asarray(pixels, np.float32).reshape(-1, 1, 2) for _, pixels in views]
    size = (shape[1], shape[0])
    try:
        found = cv2.calibrateCameraExtended(planes, seen, size, np.eye(3), np.zeros(8), flags=flags)
    except cv2.error as error:
        raise InputError(
            given=f"The views do not determine a camera ({error.err}).",
            needed="Corners in one plane, seen from different directions.",
            remedy="Tilt the board against the camera between pictures.",
        ) from None
    residual, matrix, coefficients, _, _, spread, _, per_view = found
    numbers = np.asarray(coefficients, np.float64).ravel()[: _MODELS.get(model, 4)]
    if not (np.isfinite(residual) and np.isfinite(matrix).all() and np.isfinite(numbers).all()):
        raise InputError(
            given="The views do not determine a camera.",
            needed="Corners in one plane, seen from different directions.",
            remedy="Tilt the board against the camera between pictures.",
        )
    errors = np.asarray(spread, np.float64).ravel()[:4]
    return (
        float(residual),
        np.asarray(matrix, np.float64),
        Lens(tuple(float(number) for number in numbers)),
        errors,
        np.asarray(per_view, np.float64).ravel(),
    )


def _quality(
    views: Sequence[tuple[FloatArray, FloatArray]],
    shape: tuple[int, int],
    camera: Pinhole,
    errors: FloatArray,
    residual: float,
) -> RigQuality:
    everywhere = np.vstack([pixels for _, pixels in views])
    reach = np.ptp(everywhere, axis=0) / np.array([shape[1], shape[0]])
    advice = []
    if reach.min() < _COVERED:
        advice.append(f"Corners reach over {reach.min():.0%} of the image: show the board near its borders too.")
    if errors[0] > 0.01 * camera.fx:
        advice.append("The focal length is known to no better than 1 %: tilt the board by 30° to 45° to either side.")
    if len(views) < 8:
        advice.append(f"{len(views)} pictures are few; ten of different tilts and places are good.")
    if residual > _BLURRED:
        advice.append("Corners miss the model by more than half a pixel: is the board flat, and are pictures sharp?")
    return RigQuality(
        residual_angle=float(np.arctan(residual / camera.fx)),
        verdict=f"Focal length {camera.fx:.1f} ± {errors[0]:.1f} px; corners are met to {residual:.3f} px.",
        advice=tuple(advice),
    )
