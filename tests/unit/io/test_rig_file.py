"""Rig files: written and read again to the last bit, used on other photographs, and refused where they are wrong."""

from dataclasses import replace

import numpy as np
import pytest

from psstereo.camera import Orthographic, Pinhole
from psstereo.camera.lens import Lens
from psstereo.capture import Capture
from psstereo.errors import (
    ExistingResultError,
    InputError,
    MissingFileError,
    PsstereoError,
    UnreadableFileError,
    UnsupportedError,
)
from psstereo.io.rig_file import RigFile, RigQuality, is_rig_file, read_rig
from psstereo.io.rig_use import with_rig
from psstereo.io.rig_writer import write_rig
from psstereo.lights import Directional, Led, Rig, StrengthUnit
from psstereo.stack import MemoryStack, Response

_RNG = np.random.default_rng(7)
_L = _RNG.normal(size=(4, 3)) + np.array([0, 0, 3])
_S = _RNG.uniform(0.5, 2, (4, 3))
_NAMES = ("a.png", "b ü.png", "c.png", "d.png")


def lamps():
    return Rig(
        tuple(
            Led(position=_RNG.normal(size=3) * 100, axis=[0.1 * i, 0, -1], mu=0.5 * i, flux=_S[i] * 1e5)
            for i in range(4)
        )
    )


def capture(names=_NAMES, channels=3):
    stack = MemoryStack(np.full((len(names), 2, 3, channels), 40, np.uint8), names=tuple(names))
    return Capture(stack=stack, rig=Rig.distant(np.tile([0.0, 0, 1], (len(names), 1))))


def test_distant_lights_come_back(tmp_path):
    covariance = np.array([np.diag([1.0, 2.0, 3e-5])] * 4)
    quality = RigQuality(
        direction_error=np.array([0.01, np.nan, 0.02, 0.03]),
        position_covariance=covariance,
        strength_error=np.array([0.01, 0.02, 0.03, 0.04]),
        residual_angle=0.002,
        residual_brightness=0.05,
        verdict='Good to 0.5°, "quoted".',
        advice=("Two lights are 4° apart.", "No light is below 30°."),
    )
    (tmp_path / "frames").mkdir()
    rig = RigFile(
        rig=Rig.distant(_L, _S, strength_unit=StrengthUnit.IRRADIANCE),
        names=_NAMES,
        camera=Pinhole(fx=1000.1, fy=999.9, cx=3.3, cy=4.4, skew=0.5),
        response=Response("gamma", 2.2),
        dark=tmp_path / "frames" / "dark ü.png",
        flat=tmp_path / "flat.npy",
        lens=Lens(coefficients=(0.1, -0.2, 0.001, 0.002, 0.3)),
        quality=quality,
        provenance=("From a ball.", "At noon."),
    )
    path = tmp_path / "été rig.toml"
    write_rig(path, rig)
    assert list(tmp_path.glob(".*")) == []
    back = read_rig(path)
    np.testing.assert_allclose(back.rig.directions, rig.rig.directions, rtol=0, atol=2e-16)  # made units again
    np.testing.assert_array_equal(back.rig.strengths(3), _S)
    assert back.rig.strength_unit is StrengthUnit.IRRADIANCE
    assert (back.names, back.camera, back.response, back.lens) == (_NAMES, rig.camera, rig.response, rig.lens)
    assert back.dark is not None
    assert back.dark.resolve() == rig.dark.resolve()
    assert back.provenance == rig.provenance
    assert (back.quality.verdict, back.quality.advice) == (quality.verdict, quality.advice)
    for name in ("direction_error", "strength_error", "position_covariance", "residual_angle", "residual_brightness"):
        np.testing.assert_allclose(getattr(back.quality, name), getattr(quality, name), rtol=1e-5)


def test_lamps_come_back_to_the_last_bit(tmp_path):
    rig = lamps()
    write_rig(tmp_path / "rig.toml", RigFile(rig=rig, camera=Orthographic(pixel_size=0.05, length_unit="mm")))
    back = read_rig(tmp_path / "rig.toml")
    for a, b in zip(rig.lights, back.rig.lights, strict=True):
        np.testing.assert_array_equal(a.position, b.position)
        np.testing.assert_allclose(a.axis, b.axis, atol=1e-16)
        np.testing.assert_array_equal(a.flux, b.flux)
        assert a.mu == b.mu
    assert back.camera == Orthographic(pixel_size=0.05, length_unit="mm")


def test_nothing_of_anybody_is_replaced(tmp_path):
    path, rig = tmp_path / "rig.toml", RigFile(rig=Rig.distant(_L))
    path.write_text("my = 'notes'\n")
    with pytest.raises(ExistingResultError, match="no rig file"):
        write_rig(path, rig, overwrite=True)
    assert path.read_text() == "my = 'notes'\n"
    path.unlink()
    write_rig(path, rig)
    with pytest.raises(ExistingResultError, match="--overwrite"):
        write_rig(path, rig)
    write_rig(path, replace(rig, names=_NAMES), overwrite=True)
    assert is_rig_file(path)
    assert read_rig(path).names == _NAMES
    with pytest.raises(MissingFileError, match="does not exist"):
        write_rig(tmp_path / "none" / "rig.toml", rig)


def test_lights_of_two_kinds_are_refused(tmp_path):
    mixed = Rig((Directional(direction=[0, 0, 1], strength=[1.0]), *lamps().lights))
    with pytest.raises(UnsupportedError, match="directional, led"):
        write_rig(tmp_path / "rig.toml", RigFile(rig=mixed))
    assert not (tmp_path / "rig.toml").exists()


def test_figures_belong_to_lights():
    with pytest.raises(InputError, match="4 lights has 3 names"):
        RigFile(rig=Rig.distant(_L), names=_NAMES[:3])
    with pytest.raises(InputError, match="2 errors of directions"):
        RigFile(rig=Rig.distant(_L), quality=RigQuality(direction_error=np.zeros(2)))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("rig = 1", "rig = 2", "version 1"),
        ("rig = 1", "rig = ", "not valid TOML"),
        ("directions", "direction", "Did you mean directions"),
        ("strengths = [", "mu = [", "Distant lights have directions and strengths"),
        ("    1.0,\n", "", "3 strengths"),
        ("    1.0,\n", "    nan,\n", "finite numbers"),
        ("[lights]", "[light]", "Did you mean lights"),
        ("[lights]", '[images]\nnames = ["a"]\n[lights]', "4 lights has 1 names"),
        ("[lights]", "[camera]\nlens = [1, 2, 3]\n[lights]", "4, 5, 8, 12 or 14"),
        ("[lights]", "[quality]\nadvice = 3\n[lights]", "a list of texts"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, old, new, said):
    path = tmp_path / "rig.toml"
    write_rig(path, RigFile(rig=Rig.distant(_L)))
    text = path.read_text("utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), "utf-8")
    with pytest.raises(PsstereoError, match=said) as caught:
        read_rig(path)
    assert "rig.toml" in str(caught.value)


def test_lights_go_to_images_by_name():
    rig = RigFile(rig=Rig.distant(_L, _S), names=_NAMES)
    used = with_rig(capture(("c.PNG", "A.tif", "d.tif")), rig, "rig.toml")
    np.testing.assert_allclose(used.rig.directions, rig.rig.directions[[2, 0, 3]], rtol=0, atol=2e-16)
    np.testing.assert_array_equal(used.rig.strengths(3), _S[[2, 0, 3]])
    assert any("names the images" in note for note in used.notes)


def test_lights_go_to_images_by_order_where_names_are_others():
    rig = RigFile(rig=lamps(), names=_NAMES, camera=Pinhole(fx=9, fy=9, cx=1, cy=1), provenance=("By hand.",))
    used = with_rig(capture(("1.png", "2.png", "3.png", "4.png"), channels=1), rig, "rig.toml")
    assert used.camera == rig.camera
    np.testing.assert_allclose([lamp.flux[0] for lamp in used.rig.lights], 1e5 * _S.mean(axis=1))
    assert any("By hand." in note for note in used.notes)
    with pytest.raises(InputError, match="4 lights; the capture has 3 images"):
        with_rig(capture(("1.png", "2.png", "3.png")), rig, "rig.toml")


def test_a_file_that_is_missing_or_empty_is_told_as_a_rig_file(tmp_path):
    (tmp_path / "empty.toml").touch()
    for name, kind in (("no.toml", MissingFileError), ("empty.toml", UnreadableFileError)):
        with pytest.raises(kind, match="rig file") as caught:
            read_rig(tmp_path / name)
        assert "image" not in str(caught.value)
