"""Samples of a matte chessboard under each lamp: its pose from the corners, its brightness on the white squares."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from psstereo.calibrate.lamps.fit import PlaneSamples
from psstereo.camera import Pinhole
from psstereo.errors import InputError
from psstereo.types import FloatArray, IntArray

__all__ = ["Chessboard", "board_pose", "board_samples", "joined"]

_MIDDLE = 0.5
"""Share of a square's side within which it is sampled: away from ink that bleeds and from the lens' blur."""
_ACROSS = 5
"""Samples across a square."""
_FLIP = np.diag([1.0, -1.0, -1.0])
"""From the frame of computer vision, y down and z forward, to y up and z toward the camera."""


@dataclass(frozen=True, kw_only=True)
class Chessboard:
    """A printed chessboard.

    Attributes
    ----------
    columns, rows : int
        Inner corners along its two sides, 3 or more [1].
    square : float
        Side of a square [length].

    Raises
    ------
    InputError
        If a number cannot be.
    """

    columns: int
    rows: int
    square: float

    def __post_init__(self) -> None:
        if min(self.columns, self.rows) < 3 or not 0 < self.square < np.inf:
            raise InputError(
                given=f"The chessboard has {self.columns} × {self.rows} inner corners and squares of {self.square}.",
                needed="At least 3 × 3 inner corners, and squares of a positive side.",
                remedy="Count the corners where four squares meet, such as 9x6.",
            )

    @property
    def corners(self) -> FloatArray:
        """Inner corners, row by row, float64 (columns · rows, 3) with z = 0 [length]."""
        rows, columns = np.mgrid[: self.rows, : self.columns]
        flat = np.stack([columns.ravel(), rows.ravel(), np.zeros(columns.size)], axis=1)
        return np.asarray(flat * self.square, np.float64)


def board_pose(
    image: FloatArray, camera: Pinhole, board: Chessboard, name: str = "image"
) -> tuple[FloatArray, FloatArray]:
    """Find a chessboard and return how it lies.

    Not for pictures with lens distortion: remove that first.

    Parameters
    ----------
    image : float array (h, w)
        Brightness.
    camera : Pinhole
        The camera.
    board : Chessboard
        The board.
    name : str
        What the picture is called, for messages.

    Returns
    -------
    rotation : float64 array (3, 3)
        Board's axes as columns in the camera's frame, x right, y up, z toward the camera [1].
    position : float64 array (3,)
        Its first inner corner [length].

    Raises
    ------
    InputError
        If the board is not found whole.
    """
    import cv2

    finite = np.nan_to_num(np.asarray(image, np.float64))
    high = float(np.quantile(finite, 0.99)) or 1.0
    eight = np.clip(np.rint(255.0 * finite / high), 0, 255).astype(np.uint8)
    size = (board.columns, board.rows)
    found, corners = cv2.findChessboardCornersSB(eight, size, flags=cv2.CALIB_CB_ACCURACY)
    if not found:
        found, corners = cv2.findChessboardCornersSB(eight, size, flags=cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY)
    solved = False
    if found:
        solved, turn, place = cv2.solvePnP(board.corners, np.asarray(corners, np.float64), camera.matrix, np.zeros(4))
    if not solved:
        raise InputError(
            given=f"No chessboard with {board.columns} × {board.rows} inner corners is found in {name}.",
            needed="The whole board, with a white border around it, sharp and not too dark.",
            remedy="Count inner corners, not squares; leave this pose out if light or slant hide the board.",
        )
    return _FLIP @ cv2.Rodrigues(turn)[0], _FLIP @ np.asarray(place, np.float64).reshape(3)


def board_samples(
    images: FloatArray, camera: Pinhole, board: Chessboard, *, pose: int = 0, name: str = "image"
) -> tuple[PlaneSamples, ...]:
    """Sample the white squares of a chessboard in one pose under each lamp.

    Parameters
    ----------
    images : float array (m, h, w, c)
        Linear brightness under each lamp, ambient light subtracted, lens distortion removed; NaN where clipped.
    camera : Pinhole
        The camera.
    board : Chessboard
        The board.
    pose : int
        Number of the pose, which keeps groups of samples apart.
    name : str
        What the pictures are called, for messages.

    Returns
    -------
    tuple of PlaneSamples (m,)
        One a lamp.

    Raises
    ------
    InputError
        If the board is not found in the sum of the images, or their shape is another.
    """
    import cv2

    stack = np.asarray(images, np.float64)
    if stack.ndim != 4 or not stack.size:
        raise InputError(
            given=f"The pictures of {name} have the shape {stack.shape}.",
            needed="(m, h, w, c): one a lamp.",
            remedy="Add an axis for channels to gray pictures.",
        )
    rotation, position = board_pose(np.nansum(stack, axis=(0, 3)), camera, board, name)
    flat, cell = _white(board, np.nansum(stack, axis=(0, 3)), camera, rotation, position)
    points = flat @ rotation.T + position
    # The board's own z points away from the camera or toward it, by the order of its corners.
    normal = rotation[:, 2] * -np.sign(rotation[:, 2] @ position)
    column, row = _project(points, camera)
    tables = [
        np.stack(
            [
                cv2.remap(
                    np.ascontiguousarray(one[..., k]),
                    column.astype(np.float32)[None],
                    row.astype(np.float32)[None],
                    cv2.INTER_LINEAR,
                    borderMode=cv2.BORDER_CONSTANT,
                    borderValue=(float("nan"),) * 4,
                )[0]
                for k in range(stack.shape[3])
            ],
            axis=1,
        )
        for one in stack
    ]
    return tuple(
        PlaneSamples(points=points, normals=normal, values=table, groups=cell + 10000 * pose) for table in tables
    )


def joined(parts: Sequence[PlaneSamples]) -> PlaneSamples:
    """Return samples of several poses of one lamp as one set, groups kept apart.

    Parameters
    ----------
    parts : sequence of PlaneSamples
        One a pose.

    Returns
    -------
    PlaneSamples
        All of them.
    """
    starts = np.cumsum([0, *(int(part.groups.max()) + 1 for part in parts)])
    return PlaneSamples(
        points=np.concatenate([part.points for part in parts]),
        normals=np.concatenate([part.normals for part in parts]),
        values=np.concatenate([part.values for part in parts]),
        groups=np.concatenate([part.groups + start for part, start in zip(parts, starts[:-1], strict=True)]),
    )


def _project(points: FloatArray, camera: Pinhole) -> tuple[FloatArray, FloatArray]:
    x, y = points[:, 0] / -points[:, 2], points[:, 1] / points[:, 2]
    return camera.cx + camera.fx * x + camera.skew * y, camera.cy + camera.fy * y


def _white(
    board: Chessboard, image: FloatArray, camera: Pinhole, rotation: FloatArray, position: FloatArray
) -> tuple[FloatArray, IntArray]:
    """Return places (p, 3) on the white squares, in the board's frame, and the number of each one's square."""
    from scipy.ndimage import map_coordinates

    rows, columns = (axis.ravel() for axis in np.mgrid[: board.rows - 1, : board.columns - 1])
    middles = board.square * np.stack([columns + 0.5, rows + 0.5, np.zeros(len(rows))], axis=1)
    column, row = _project(middles @ rotation.T + position, camera)
    brightness = map_coordinates(np.nan_to_num(image), [row, column], order=1, mode="nearest")
    odd = (rows + columns) % 2 == 1
    white = odd if brightness[odd].mean() > brightness[~odd].mean() else ~odd
    steps = _MIDDLE * (np.arange(_ACROSS) / (_ACROSS - 1) - 0.5) * board.square
    grid = np.stack([*np.meshgrid(steps, steps), np.zeros((_ACROSS, _ACROSS))], axis=-1).reshape(1, -1, 3)
    places = (middles[white][:, None] + grid).reshape(-1, 3)
    return places, np.repeat(np.flatnonzero(white), _ACROSS * _ACROSS)
