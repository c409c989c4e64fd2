"""Pictures of a board through a known lens, ray by ray."""

from functools import cache

import cv2
import numpy as np

from psstereo.camera import Lens, Pinhole

CAMERA = Pinhole(fx=410, fy=412, cx=161, cy=118)
LENS = Lens((-0.25, 0.08, 0.0012, -0.0008))
SHAPE = (240, 320)
FINER = 2


@cache
def viewing_rays():
    """Return the rays of all places in a picture, (n, 3), the same for every board."""
    step = (
        (np.arange(SHAPE[0] * FINER) - (FINER - 1) / 2) / FINER,
        (np.arange(SHAPE[1] * FINER) - (FINER - 1) / 2) / FINER,
    )
    rows, columns = np.meshgrid(*step, indexing="ij")
    pixels = np.stack([columns.ravel(), rows.ravel()], 1)[:, None]
    rays = cv2.undistortPoints(pixels, CAMERA.matrix, np.array(LENS.coefficients)).reshape(-1, 2)
    return np.hstack([rays, np.ones((len(rays), 1))])


def picture(board, turn, middle, seed=0):
    """Return 8 bits of a board whose middle is at a place (right, down, into the scene), turned by a vector."""
    rotation = cv2.Rodrigues(np.asarray(turn, float))[0]
    corner = 1.0 if board.marker else 0.0
    centre = np.array([board.columns / 2 - 1 + corner, board.rows / 2 - 1 + corner, 0]) * board.square
    offset = np.asarray(middle, float) - rotation @ centre
    rays = viewing_rays()
    normal = rotation[:, 2]
    at = (rays * ((normal @ offset) / (rays @ normal))[:, None] - offset) @ rotation / board.square
    if board.marker is None:
        i, j = np.floor(at[:, 0] + 1), np.floor(at[:, 1] + 1)
        on = (i >= 0) & (i < board.columns) & (j >= 0) & (j < board.rows)
        shown = np.where(on & ((i + j) % 2 == 0), 25.0, 225.0)
    else:
        size, names = 40, cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
        printed = cv2.aruco.CharucoBoard((board.columns, board.rows), board.square, board.marker, names).generateImage(
            (board.columns * size, board.rows * size)
        )
        where = (at[:, :2] * size - 0.5).astype(np.float32).reshape(SHAPE[0] * FINER, SHAPE[1] * FINER, 2)
        shown = cv2.remap(printed, where[..., 0], where[..., 1], cv2.INTER_LINEAR, borderValue=225).astype(float)
    image = shown.reshape(SHAPE[0], FINER, SHAPE[1], FINER).mean(axis=(1, 3))
    image = cv2.GaussianBlur(image, (0, 0), 0.6) + np.random.default_rng(seed).normal(0, 2, SHAPE)
    return np.clip(np.round(image), 0, 255).astype(np.uint8)


def pictures(board, count=7):
    """Return pictures of different tilts and places."""
    rng = np.random.default_rng(1)
    return [
        picture(board, rng.uniform(-0.5, 0.5, 3) * [1, 1, 0.3], [*rng.uniform(-35, 35, 2), rng.uniform(290, 400)], seed)
        for seed in range(count)
    ]
