"""Files that scenes name."""

import cv2
import numpy as np
import pytest
import trimesh

from psstereo.io.environment_file import write_environment


@pytest.fixture(scope="session")
def files(tmp_path_factory):
    """One of each kind of file that a scene can name."""
    tmp_path = tmp_path_factory.mktemp("files")
    np.save(tmp_path / "dem.npy", np.outer(np.hanning(5), np.hanning(7)))
    trimesh.creation.icosphere(subdivisions=2).export(tmp_path / "ball.ply")
    cv2.imwrite(str(tmp_path / "paint.png"), np.full((4, 4, 3), 128, np.uint8))
    write_environment(tmp_path / "sky.exr", np.ones((4, 8, 3)))
    # A MERL file: three sizes, then red, green and blue in turn, with the scales that the format takes out.
    table = np.full(3 * 90 * 90 * 180, 1.0)
    (tmp_path / "gray.binary").write_bytes(np.array([90, 90, 180], "<i4").tobytes() + table.astype("<f8").tobytes())
    return tmp_path
