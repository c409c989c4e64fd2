"""``psstereo calibrate shape``, ``object`` and ``lamps``: files in, a rig file out, or a refusal with its reason."""

import math

import cv2
import numpy as np
import pytest
import trimesh

from psstereo.calibrate.lamps import Chessboard
from psstereo.calibrate.shape import sphere_normals
from psstereo.camera import Pinhole
from psstereo.forward import lambertian_images
from psstereo.io.rig_file import read_rig
from psstereo.lights import Led, Rig
from tests.cli.stages import Stages
from tests.unit.calibrate.test_lamps import board_image, turned
from tests.unit.normals.strength_captures import drawn, hilly, lit_by, relative

LIGHTS = np.array([[0.3, 0.2, 0.9], [-0.6, 0.1, 0.7], [0.1, -0.7, 0.5], [0.0, 0.0, 1.0]])
LIGHTS /= np.linalg.norm(LIGHTS, axis=1, keepdims=True)
POWERS = np.array([1.0, 0.7, 0.9, 0.5])


def refused(done, reason):
    """Require that a command refused, with exit code 3 and words."""
    assert done.code == 3, done.err
    assert reason in done.text, done.text


def degrees(a, b):
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(axis=-1)))


def folder_of(path, images):
    """Write images (m, h, w) from 0 to 1 as 16-bit files, without lights."""
    path.mkdir()
    for k, image in enumerate(images):
        cv2.imwrite(str(path / f"{k:02d}.png"), np.rint(65535 * np.clip(image, 0, 1)).astype(np.uint16))
    return path


@pytest.fixture
def ball(tmp_path):
    """Return a folder of photographs of a matte ball, its normal map, and its mesh."""
    normals = sphere_normals((64, 80), (42.0, 30.0), 25.0)
    seen = np.isfinite(normals[..., 0])
    rig = Rig.distant(LIGHTS, POWERS)
    images = lambertian_images(np.nan_to_num(normals), np.where(seen, 0.8, 0.0), rig)[..., 0] + 0.02
    np.save(tmp_path / "normals.npy", np.nan_to_num(normals))
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=25.0)
    mesh.apply_translation([42.0, -30.0, 0.0])
    mesh.export(tmp_path / "ball.ply")
    return folder_of(tmp_path / "photos", images)


@pytest.mark.parametrize("shape", [("--sphere", "42,30,25"), ("--normals", "normals.npy"), ("--mesh", "ball.ply")])
def test_a_known_shape_gives_lights(run, ball, shape):
    out = ball.parent / "rig.toml"
    name, value = shape
    words = (ball, "-o", out, name, value if name == "--sphere" else ball.parent / value, "--mask", "none")
    record = run("calibrate", "shape", *words, "--json").record
    assert "lights from a known shape" in record["verdict"]
    rig = read_rig(out)
    assert degrees(rig.rig.directions, LIGHTS).max() < (0.01 if name == "--sphere" else 0.4)
    np.testing.assert_allclose(rig.rig.strengths(1)[:, 0] / 0.8, POWERS, rtol=0.01)
    np.testing.assert_allclose(np.ravel(record["ambient"]), 0.02, atol=2e-3)
    assert rig.names == ("00.png", "01.png", "02.png", "03.png")


def test_a_shape_that_is_none_is_refused(run, ball):
    common = (ball, "-o", ball.parent / "rig.toml", "--mask", "none")
    for words, reason in (
        ((), "not at all"),
        (("--sphere", "1,2,3", "--mesh", ball.parent / "ball.ply"), "more than once"),
        (("--sphere", "900,900,3"), "sphere"),
        (("--mesh", ball.parent / "no.ply"), "not there"),
        (("--mesh", ball / "00.png"), "read as a mesh"),
    ):
        refused(run("calibrate", "shape", *common, *words), reason)
    flat = np.zeros((64, 80, 3))
    flat[..., 2] = 1.0
    np.save(ball.parent / "flat.npy", flat)
    refused(run("calibrate", "shape", *common, "--normals", ball.parent / "flat.npy"), "one number a light")


def test_the_object_itself_gives_strengths(run, tmp_path):
    strengths = drawn(12)
    capture = lit_by(hilly(size=32), strengths)
    images = capture.stack.read()[..., 0]
    folder = folder_of(tmp_path / "photos", images / images.max())
    np.savetxt(tmp_path / "lights.txt", capture.rig.directions)
    words = (folder, "-o", tmp_path / "rig.toml", "--lights", tmp_path / "lights.txt", "--threads", 1)
    told = run("calibrate", "object", *words)
    assert "strengths to" in told.err
    found = read_rig(tmp_path / "rig.toml").rig.strengths(1)[:, 0]
    assert np.abs(relative(found, strengths)).max() < 0.01
    refused(run("calibrate", "object", *words, "--no-strengths", "--overwrite"), "Neither")


def test_a_chessboard_gives_lamps(run, tmp_path, monkeypatch):
    stages = Stages(monkeypatch)
    camera = Pinhole(fx=500.0, fy=500.0, cx=199.5, cy=149.5)
    board = Chessboard(columns=7, rows=5, square=25.0)
    lamps = [
        Led(position=np.array([x, 40.0, 10.0]), axis=np.array([-x / 500, 0.0, -1.0]), mu=1.5, flux=np.array([3e5]))
        for x in (90.0, -90.0)
    ]
    poses = []
    for k, (a, b, place) in enumerate(
        [(0.05, 0.05, [-80, 60, -420]), (0.5, 0.1, [-80, 50, -470]), (-0.35, 0.4, [-70, 60, -450])]
    ):
        pose = turned(math.pi + a, b), np.array(place, float)
        images = [board_image(lamp, camera, board, pose, (300, 400))[..., 0] for lamp in lamps]
        poses.append(folder_of(tmp_path / f"pose{k}", np.array(images)))
    (tmp_path / "lamps.txt").write_text("90 40 10\n-90 40 10\n")
    words = ("-o", tmp_path / "rig.toml", "--positions", tmp_path / "lamps.txt", "--K", "500,500,199.5,149.5,0")
    size = ("--board", "7x5", "--square", 25, "--albedo", 0.25 * math.pi)
    record = run("calibrate", "lamps", *poses, *words, *size, "--same-mu", "--json").record
    assert "2 lamps" in record["verdict"]
    assert stages.ended() == ["pose pose0", "pose pose1", "pose pose2", "lamps", "lamps of one make"]
    rig = read_rig(tmp_path / "rig.toml")
    for light in rig.rig.lights:
        assert light.mu == pytest.approx(1.5, rel=0.03)
        assert light.flux[0] == pytest.approx(3e5, rel=0.01)
    refused(run("calibrate", "lamps", *poses, *words, *size), "is there already")
    (tmp_path / "lamps.txt").write_text("90 40 10\n")
    refused(run("calibrate", "lamps", *poses, *words, *size, "--overwrite"), "there are 1 lamps")
