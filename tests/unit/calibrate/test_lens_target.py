import importlib.util
from pathlib import Path

import cv2
import numpy as np
import pytest

from psstereo.calibrate.camera import Board, find_corners, lens_from_corners, lens_from_pictures
from psstereo.camera import Lens, Pinhole
from psstereo.errors import InputError, OptionError
from psstereo.io.lens_file import lens_text, read_lens

_spec = importlib.util.spec_from_file_location("boards", Path(__file__).with_name("boards.py"))
boards = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(boards)

CHESS = Board(columns=9, rows=7, square=25.0)
CHARUCO = Board(columns=8, rows=6, square=25.0, marker=18.0)


def crookedness(lens, camera):
    """Return how crooked ideal straight lines are, seen through the true lens and with the one found undone."""
    worst = 0.0
    for turn in np.linspace(0, np.pi, 7)[:-1]:
        for off in (-70, -30, 25, 65):
            along = np.linspace(-105, 105, 16)[:, None] * [np.cos(turn), np.sin(turn)]
            ideal = along + off * np.array([-np.sin(turn), np.cos(turn)]) + [160, 120]
            seen = boards.LENS.distorted(ideal, boards.CAMERA)
            back = cv2.undistortPoints(seen[:, None], camera.matrix, np.array(lens.coefficients), P=camera.matrix)
            line = back.reshape(-1, 2) - back.reshape(-1, 2).mean(axis=0)
            worst = max(worst, np.abs(line @ np.linalg.svd(line)[2][1]).max())
    return worst


@pytest.mark.parametrize("board", [CHESS, CHARUCO], ids=["chessboard", "charuco"])
def test_camera_and_lens_from_pictures(board):
    found = lens_from_pictures(boards.pictures(board, 6), board)
    assert len(found.used) >= 4
    assert found.residual < 0.2
    assert found.straight > 2.5 * found.residual
    assert abs(found.camera.fx - boards.CAMERA.fx) < 5 * found.errors[0] + 0.5
    assert crookedness(found.lens, found.camera) < 0.15 * crookedness(Lens((0.0,) * 4), boards.CAMERA)


def exact_views(model_camera, lens, count=6):
    rng = np.random.default_rng(0)
    views = []
    for _ in range(count):
        rotation = cv2.Rodrigues(rng.uniform(-0.5, 0.5, 3))[0]
        points = CHESS.corners @ rotation.T + [*rng.uniform(-90, -50, 2), rng.uniform(350, 500)]
        ideal = (points @ model_camera.matrix.T)[:, :2] / points[:, 2:]
        views.append((CHESS.corners, lens.distorted(ideal, model_camera)))
    return views


def test_exact_corners_give_the_lens_exactly():
    found = lens_from_corners(exact_views(boards.CAMERA, boards.LENS), boards.SHAPE)
    assert found.residual < 1e-3
    assert crookedness(found.lens, found.camera) < 1e-3
    np.testing.assert_allclose(found.lens.coefficients[:2], boards.LENS.coefficients[:2], atol=2e-3)


def test_errors_are_those_of_noise():
    views, scores = exact_views(boards.CAMERA, boards.LENS), []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        noisy = [(plane, pixels + rng.normal(0, 0.1, pixels.shape)) for plane, pixels in views]
        found = lens_from_corners(noisy, boards.SHAPE)
        camera = found.camera
        wrong = np.array([camera.fx, camera.fy, camera.cx, camera.cy]) - [410, 412, 161, 118]
        scores.append(wrong / found.errors)
    assert 0.5 < np.sqrt(np.mean(np.square(scores))) < 1.5


def test_what_cannot_be_used_is_refused():
    empty = np.full(boards.SHAPE, 128, np.uint8)
    assert find_corners(empty, CHESS) is None
    with pytest.raises(InputError, match="seen in 0 of 3"):
        lens_from_pictures([empty] * 3, CHESS)
    with pytest.raises(InputError, match="sizes"):
        lens_from_pictures([empty, empty[:-1]], CHESS)
    with pytest.raises(OptionError, match="dictionary"):
        find_corners(empty, Board(columns=5, rows=5, square=2.0, marker=1.0, dictionary="9X9"))
    with pytest.raises(OptionError, match="board"):
        Board(columns=2, rows=7)
    with pytest.raises(OptionError, match="markers"):
        Board(columns=5, rows=7, square=1.0, marker=1.5)
    with pytest.raises(OptionError, match="model"):
        lens_from_corners(exact_views(boards.CAMERA, boards.LENS), boards.SHAPE, model="fisheye")
    with pytest.raises(InputError, match="2 views"):
        lens_from_corners(exact_views(boards.CAMERA, boards.LENS, 2), boards.SHAPE)


def test_files_keep_camera_and_lens(tmp_path):
    path = tmp_path / "camera.toml"
    camera = Pinhole(fx=410.123456789, fy=412, cx=161, cy=118, skew=0.25)
    path.write_text(lens_text(camera, boards.LENS), encoding="utf-8")
    assert read_lens(path) == (camera, boards.LENS)
    path.write_text("[camera]\nK = [[1,0,0],[0,1,0],[0,0,1]]\n")
    with pytest.raises(InputError, match="no lens"):
        read_lens(path)
