import cv2
import numpy as np
import pytest
import scipy.io

from psstereo.camera import Pinhole
from psstereo.errors import InputError, MissingFileError, RigError, UnreadableFileError
from psstereo.io import Choices, read_capture, recognise, write_diligent, write_normal_map
from psstereo.io.lamps import read_led_params

POSITIONS = np.array([[100.0, -50, 20], [-100, 30, 0], [0, 80, -10], [20, 20, 5]])  # opencv: y down, z away
AXES = np.array([[-0.6, 0.0, 0.8], [0.6, 0, 0.8], [0, -0.6, 0.8], [0, 0, 1]])
FLUX = np.array([[1.0, 2, 3], [4, 5, 6], [7, 8, 9], [1, 1, 1]])
TURN = [1, -1, -1]
K = np.array([[900.0, 0, 2], [0, 900, 1.5], [0, 0, 1]])


def picture(path, value=50, channels=3, dtype=np.uint16):
    cv2.imencode(".png", np.full((4, 5, channels), value, dtype))[1].tofile(path)


def check(capture, flux=FLUX, mu=1.0):
    assert not capture.rig.all_distant
    for i, led in enumerate(capture.rig.lights):
        np.testing.assert_allclose(led.position, POSITIONS[i] * TURN)
        np.testing.assert_allclose(led.axis, AXES[i] * TURN, atol=1e-12)
        np.testing.assert_allclose(led.flux, flux[i])
        assert led.mu == mu


def build_led(folder):
    for i in (1, 2, 4, 6):
        picture(folder / f"led_{i}.png", 1000 * i)
    np.savetxt(folder / "led_positions_mm.txt", POSITIONS)
    np.savetxt(folder / "led_axes.txt", AXES)
    np.savetxt(folder / "led_intensity_rgb.txt", FLUX)
    np.savetxt(folder / "led_mu.txt", np.ones(4))
    np.savetxt(folder / "K.txt", K)
    picture(folder / "ambient.png", 7)


def test_led_files(tmp_path):
    build_led(tmp_path)
    capture, truth = read_capture(tmp_path)
    check(capture)
    assert truth is None
    assert (capture.dark == 7).all()
    assert capture.camera == Pinhole.from_matrix(K)
    assert capture.stack.names == ("led_1.png", "led_2.png", "led_4.png", "led_6.png")


def test_led_files_that_disagree(tmp_path):
    build_led(tmp_path)
    picture(tmp_path / "led_7.png")
    with pytest.raises(InputError, match=r"led_positions_mm\.txt holds 4 rows of 3 numbers; there are 5 images"):
        read_capture(tmp_path)
    (tmp_path / "led_7.png").unlink()
    bad = POSITIONS.copy()
    bad[1, 0] = np.nan
    np.savetxt(tmp_path / "led_positions_mm.txt", bad)
    with pytest.raises(RigError, match=r"led_positions_mm\.txt, lamp 2"):
        read_capture(tmp_path)
    (tmp_path / "led_axes.txt").unlink()
    np.savetxt(tmp_path / "led_positions_mm.txt", POSITIONS)
    with pytest.raises(MissingFileError, match=r"led_axes\.txt"):
        read_capture(tmp_path)


def test_chosen_lights_make_it_distant(tmp_path):
    build_led(tmp_path)
    np.savetxt(tmp_path / "far.txt", np.array([[0, 0, 1], [1, 0, 1], [0, 1, 1], [-1, 0, 1]]))
    capture, _ = read_capture(tmp_path, choices=Choices(lights=tmp_path / "far.txt"))
    assert capture.rig.all_distant
    assert any("taken as distant" in note for note in capture.notes)


def led_params(folder, flux, count=4, *, zero=True, trailing=""):
    rows = [[*POSITIONS[i], *AXES[i], *np.atleast_1d(flux[i]), 1.0, *([0.0] if zero else [])] for i in range(4)]
    lines = ["N_img nrows ncols f x0 y0 mean_distance sfull:[Lpos Ldir Phi mu 0]", f"{count} 5 4 900.0 2.0 1.5 1200.0"]
    lines += [" ".join(f"{v:.4f}" for v in row) + trailing for row in rows]
    (folder / "led_params.txt").write_text("\n".join(lines) + "\n")


def build_luces(folder, flux=FLUX):
    for i in range(4):
        picture(folder / f"{i + 1:02d}.png", 100 * i + 5)
    picture(folder / "mask.png", 255, dtype=np.uint8)
    led_params(folder, flux)


def test_luces(tmp_path):
    """Sizes come from the image, since reader and writer of the set disagree on their order."""
    build_luces(tmp_path)
    normals = np.tile([0.0, 0.6, 0.8], (4, 5, 1))
    write_normal_map(normals, tmp_path / "normals.png")
    np.savez(tmp_path / "zgt.npz", zgt=np.full((4, 5), 1200.0), zgt_int=np.zeros((4, 5)))
    assert recognise(tmp_path)[0].format == "near-led"
    capture, truth = read_capture(tmp_path)
    check(capture)
    assert capture.camera == Pinhole(fx=900, fy=900, cx=2, cy=1.5)
    assert len(capture.stack) == 4
    np.testing.assert_allclose(truth.normals, normals, atol=1e-4)
    assert (truth.depth == 1200).all()


@pytest.mark.parametrize("zero", [True, False])
@pytest.mark.parametrize("trailing", ["", " "])
@pytest.mark.parametrize("single", [True, False])
def test_luces_files_old_and_new(tmp_path, single, trailing, zero):
    """Older files have one flux a lamp, and a blank at the end of all lines but the last."""
    flux = FLUX[:, :1] if single else FLUX
    led_params(tmp_path, flux, zero=zero, trailing=trailing)
    _, values = read_led_params(tmp_path / "led_params.txt")
    np.testing.assert_allclose(values[:, 6:-1], flux)
    assert (values[:, -1] == 1).all()


def test_raw_images_of_one_channel_take_the_mean_flux(tmp_path):
    build_luces(tmp_path)
    for i in range(4):
        picture(tmp_path / f"{i + 1:02d}.png", channels=1)
    capture, _ = read_capture(tmp_path)
    check(capture, FLUX.mean(axis=1, keepdims=True))
    assert any("mean of R, G and B" in note for note in capture.notes)


def test_luces_files_that_are_wrong(tmp_path):
    build_luces(tmp_path)
    led_params(tmp_path, FLUX, 5)
    with pytest.raises(UnreadableFileError, match="says 5 lamps on its second line and has 4 lines"):
        read_capture(tmp_path)
    led_params(tmp_path, FLUX)
    picture(tmp_path / "05.png")
    with pytest.raises(InputError, match="lists 4 lamps; there are 5 images"):
        read_capture(tmp_path)
    file = tmp_path / "led_params.txt"
    file.write_text(file.read_text().replace("0.8000", "0.8x", 1))
    with pytest.raises(UnreadableFileError, match="Line 3 of"):
        read_capture(tmp_path)
    file.write_text("header\n1 2 3\n")
    with pytest.raises(UnreadableFileError, match="Line 2 of"):
        read_capture(tmp_path)
    file.write_text("header\n")
    with pytest.raises(UnreadableFileError, match="Line 1 of"):
        read_capture(tmp_path)


def build_near_ps(folder):
    for i in range(4):
        picture(folder / f"photometric_sample_raw_{i + 1:04d}.png")
    picture(folder / "photometric_sample_raw_ambient.png", 3)
    mask = np.zeros((4, 5), np.uint8)
    mask[1:3] = 255
    cv2.imencode(".png", mask)[1].tofile(folder / "photometric_sample_mask_raw.png")
    scipy.io.savemat(folder / "camera.mat", {"K": K})
    scipy.io.savemat(folder / "light.mat", {"S": POSITIONS, "Dir": AXES, "mu": np.ones((4, 1)), "Phi": FLUX})


def test_near_ps(tmp_path):
    build_near_ps(tmp_path)
    assert recognise(tmp_path)[0].format == "near-led"
    capture, _ = read_capture(tmp_path)
    check(capture)
    assert (capture.dark == 3).all()
    assert capture.mask.sum() == 10
    assert capture.camera == Pinhole.from_matrix(K)


def test_near_ps_that_is_wrong(tmp_path):
    build_near_ps(tmp_path)
    (tmp_path / "photometric_sample_raw_0002.png").unlink()
    with pytest.raises(InputError, match=r"light\.mat has the shape \(4, 3\); there are 3 images"):
        read_capture(tmp_path)
    scipy.io.savemat(tmp_path / "light.mat", {"S": POSITIONS})
    with pytest.raises(UnreadableFileError, match=r"holds S\..*Dir"):
        read_capture(tmp_path)
    (tmp_path / "camera.mat").unlink()
    assert recognise(tmp_path) == []


def test_positions_beside_diligent_only_if_asked_for(tmp_path):
    """The lamp's strength is given as irradiance at its distance to the origin."""
    directions = POSITIONS / np.linalg.norm(POSITIONS, axis=1)[:, None]
    write_diligent(
        tmp_path / "s",
        images=np.full((4, 4, 5, 3), 9, np.uint8),
        directions=directions,
        intensities=FLUX,
        mask=np.ones((4, 5), bool),
    )
    np.savetxt(tmp_path / "s" / "light_positions.txt", POSITIONS)
    assert [r.format for r in recognise(tmp_path / "s")] == ["diligent", "near-led"]
    capture, _ = read_capture(tmp_path / "s")
    assert capture.rig.all_distant
    assert any("near" in note for note in capture.notes)
    capture, _ = read_capture(tmp_path / "s", layout="near-led")
    for i, led in enumerate(capture.rig.lights):
        np.testing.assert_allclose(led.position, POSITIONS[i])
        assert led.mu == 0
        irradiance = led.irradiance(np.zeros((1, 3)), directions[i][None])
        np.testing.assert_allclose(irradiance[0], FLUX[i])


def test_nothing_there(tmp_path):
    with pytest.raises(MissingFileError, match="led_params"):
        read_capture(tmp_path, layout="near-led")
