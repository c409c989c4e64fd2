import struct

import numpy as np
import pytest

from psstereo.brdf import (
    BlinnPhong,
    Ggx,
    Lambert,
    Merl,
    OrenNayar,
    Phong,
    directional_reflectance,
    read_merl,
    tabulate,
    write_merl,
)
from psstereo.errors import InputError, MissingFileError, OptionError, UnreadableFileError

Z = np.array([0.0, 0.0, 1.0])


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def scene(count, seed=0, least=0.2):
    """Lights and eyes above the surface, not at grazing incidence."""
    to_light, to_eye = unit(np.random.default_rng(seed).normal(size=(2, count, 3)))
    to_light[:, 2], to_eye[:, 2] = np.abs(to_light[:, 2]), np.abs(to_eye[:, 2])
    keep = (to_light[:, 2] > least) & (to_eye[:, 2] > least)
    return to_light[keep], to_eye[keep]


@pytest.fixture(scope="module")
def numbered():
    """A table whose cells are their own numbers."""
    return Merl(table=np.arange(90.0 * 90 * 180).reshape(90, 90, 180, 1))


def turned(vector, axis, angle):
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = vector
    return np.array([c * x - s * y, s * x + c * y, z]) if axis == "z" else np.array([c * x + s * z, y, c * z - s * x])


def cell(light, eye):
    """The cell by turning: half vector into the plane of x and z, then onto z; the light's angles are then those asked.

    Returned with the distance to the nearest edge of the cell, in cells.
    """
    half = unit(light + eye)
    tilt, azimuth = np.arctan2(np.hypot(half[0], half[1]), half[2]), np.arctan2(half[1], half[0])
    apart = turned(turned(light, "z", -azimuth), "y", -tilt)
    position = np.array(
        [
            90 * np.sqrt(tilt / (np.pi / 2)),
            90 * np.arctan2(np.hypot(apart[0], apart[1]), apart[2]) / (np.pi / 2),
            180 * (np.arctan2(apart[1], apart[0]) % np.pi) / np.pi,
        ]
    )
    return np.minimum(position.astype(int), [89, 89, 179]), np.abs(position - np.round(position)).min()


def test_cells_are_those_found_by_turning(numbered):
    to_light, to_eye = scene(3000, least=0.0)
    value = numbered.evaluate(Z, to_light, to_eye)[:, 0]
    compared = 0
    for light, eye, found in zip(to_light, to_eye, value, strict=True):
        index, room = cell(light, eye)
        if room > 1e-9:
            assert found == np.ravel_multi_index(index, (90, 90, 180))
            compared += 1
    assert compared > 2900


def test_mirror_and_retro_reflection(numbered):
    light = unit(np.array([0.3, 0.1, 1.0]))
    mirrored = light * [-1, -1, 1]
    at_mirror = numbered.evaluate(Z, light, mirrored).item()
    assert at_mirror < 90 * 180  # the first half angle
    back = numbered.evaluate(Z, light, light).item()
    assert (back // 180) % 90 == 0  # the first difference angle
    assert numbered.evaluate(Z, Z, Z).item() == 0.0


@pytest.mark.parametrize("brdf", [Lambert(albedo=[0.9, 0.4, 0.1]), OrenNayar(albedo=[0.9, 0.4, 0.1], roughness=0.4)])
@pytest.mark.parametrize("lookup", ["nearest", "linear"])
def test_a_smooth_model_comes_back_from_its_file(brdf, lookup, tmp_path):
    write_merl(tmp_path / "smooth.binary", tabulate(brdf))
    again = read_merl(tmp_path / "smooth.binary", lookup=lookup)
    to_light, to_eye = scene(4000)
    exact, found = brdf.evaluate(Z, to_light, to_eye), again.evaluate(Z, to_light, to_eye)
    tolerance = 1e-14 if brdf.constant else {"nearest": 0.05, "linear": 0.02}[lookup]
    np.testing.assert_allclose(found, exact, rtol=tolerance)


def test_a_highlight_comes_back_and_linear_is_closer():
    brdf = BlinnPhong(diffuse=0.2, specular=0.5, exponent=60.0)
    table = tabulate(brdf).table
    to_light, to_eye = scene(6000)
    exact = brdf.evaluate(Z, to_light, to_eye)[:, 0]
    nearest, linear = (Merl(table=table, lookup=w).evaluate(Z, to_light, to_eye)[:, 0] for w in ("nearest", "linear"))
    gaps = [np.sqrt(np.mean((found / exact - 1) ** 2)) for found in (nearest, linear)]
    assert gaps[0] < 0.03
    assert gaps[1] < 0.2 * gaps[0]
    np.testing.assert_allclose(linear, exact, rtol=0.02)


def test_centres_of_cells_are_exact_either_way():
    brdf = Phong(diffuse=0.1, specular=0.6, exponent=30.0)
    table = tabulate(brdf).table
    for i, j, k in ((0, 0, 0), (10, 20, 30), (40, 5, 179), (3, 60, 90)):
        tilt, apart, azimuth = ((i + 0.5) / 90) ** 2 * np.pi / 2, (j + 0.5) / 180 * np.pi, (k + 0.5) / 180 * np.pi
        local = np.array([np.sin(apart) * np.cos(azimuth), np.sin(apart) * np.sin(azimuth), np.cos(apart)])
        light, eye = (turned(turned(v, "y", tilt), "z", 0.8) for v in (local, local * [-1, -1, 1]))
        for lookup in ("nearest", "linear"):
            value = Merl(table=table, lookup=lookup).evaluate(Z, light, eye)
            np.testing.assert_allclose(value, table[i, j, k], rtol=1e-10)
            np.testing.assert_allclose(value, brdf.evaluate(Z, light, eye), rtol=1e-10)


def test_azimuth_closes_on_itself():
    """Cells 0 and 179 of azimuth are neighbours: linear look-up is continuous there."""
    table = np.broadcast_to(np.cos(2 * np.pi * (np.arange(180) + 0.5) / 180)[:, None] + 2.0, (90, 90, 180, 1))
    merl = Merl(table=table, lookup="linear")
    for azimuth in (1e-6, np.pi - 1e-6, 0.1, 1.5):
        local = np.array([0.5 * np.cos(azimuth), 0.5 * np.sin(azimuth), np.sqrt(0.75)])
        light, eye = (turned(v, "y", 0.3) for v in (local, local * [-1, -1, 1]))
        assert merl.evaluate(Z, light, eye).item() == pytest.approx(np.cos(2 * azimuth) + 2.0, abs=2e-4)


def test_file_is_laid_out_as_the_database_says(tmp_path):
    path = tmp_path / "flat.binary"
    write_merl(path, tabulate(Lambert(albedo=[0.5, 0.4, 0.3])))
    raw = path.read_bytes()
    assert len(raw) == 12 + 3 * 8 * 90 * 90 * 180
    assert struct.unpack("<3i", raw[:12]) == (90, 90, 180)
    for channel, (albedo, factor) in enumerate(((0.5, 1.0), (0.4, 1.15), (0.3, 1.66))):
        (first,) = struct.unpack_from("<d", raw, 12 + channel * 8 * 90 * 90 * 180)
        assert first * factor / 1500 == pytest.approx(albedo / np.pi, rel=1e-15)
    assert struct.unpack("<d", raw[-8:]) == (-1.0,)  # both directions are under the surface


def test_one_channel_is_written_three_times(tmp_path):
    write_merl(tmp_path / "grey.binary", tabulate(Lambert(albedo=0.5)))
    np.testing.assert_allclose(read_merl(tmp_path / "grey.binary").evaluate(Z, Z, Z), [0.5 / np.pi] * 3, rtol=1e-15)
    with pytest.raises(InputError, match="2 channels"):
        write_merl(tmp_path / "two.binary", tabulate(Lambert(albedo=[0.5, 0.4])))


def test_what_is_not_known_is_not_black():
    table = np.full((90, 90, 180, 2), 0.25)
    table[..., 1] = np.nan
    table[0, 0, :, 0] = -1.0  # light, eye and normal together
    for lookup in ("nearest", "linear"):
        merl = Merl(table=table, lookup=lookup)
        light, eye = unit(np.array([0.5, 0.1, 1.0])), unit(np.array([0.2, 0.5, 1.0]))
        np.testing.assert_array_equal(merl.evaluate(Z, light, eye), [0.25, np.nan])
        assert np.isnan(Merl(table=table, lookup="nearest").evaluate(Z, Z, Z)).all()
    assert np.isnan(Merl(table=table).diffuse_albedo).all()
    # Linear look-up beside a hole takes the neighbours that are known.
    beside = unit(np.array([0.03, 0.0, 1.0]))
    assert Merl(table=table, lookup="linear").evaluate(Z, beside, beside)[0] == pytest.approx(0.25, rel=1e-14)


def test_table_of_a_matte_surface_reflects_its_albedo():
    table = np.broadcast_to(0.3 / np.pi, (90, 90, 180, 1))
    shares = directional_reflectance(Merl(table=table), np.radians([0.0, 40.0, 85.0]), count=32)
    np.testing.assert_allclose(shares, 0.3, rtol=1e-8)


def test_maps_and_look_ups_that_do_not_exist_are_refused():
    with pytest.raises(InputError, match="a map"):
        tabulate(Lambert(albedo=np.full((2, 2, 3), 0.5)))
    with pytest.raises(OptionError, match="cubic"):
        Merl(table=np.ones((90, 90, 180, 1)), lookup="cubic")


def test_a_sharp_highlight_is_finite_in_its_table():
    table = tabulate(Ggx(albedo=0.1, f0=0.5, roughness=1e-3)).table
    assert np.isfinite(table[np.isfinite(table)]).all()
    assert np.nanmin(table) >= 0.0
    assert 0.5 < np.isfinite(table).mean() < 0.9


def broken(path, sizes, values):
    path.write_bytes(struct.pack("<3i", *sizes) + bytes(8 * values))
    return path


@pytest.mark.parametrize(
    ("sizes", "values"),
    [
        ((90, 90, 360), 3 * 90 * 90 * 360),
        ((90, 90, 180), 90 * 90 * 180),
        ((90, 90, 180), 3 * 90 * 90 * 180 - 1),
        ((90, 90, 180), 3 * 90 * 90 * 180 + 1),
        ((-1, 90, 180), 10),
        ((2**31 - 1, 2**31 - 1, 2**31 - 1), 10),
    ],
)
def test_files_of_the_wrong_size_are_refused(tmp_path, sizes, values):
    with pytest.raises(UnreadableFileError, match="starts with") as caught:
        read_merl(broken(tmp_path / "bad.binary", sizes, values))
    assert "bad.binary" in caught.value.given


def test_other_files_are_refused(tmp_path):
    (tmp_path / "empty.binary").write_bytes(b"")
    (tmp_path / "short.binary").write_bytes(b"12345")
    for name in ("empty.binary", "short.binary"):
        with pytest.raises(UnreadableFileError, match=name):
            read_merl(tmp_path / name)
    for path in (tmp_path / "none.binary", tmp_path):
        with pytest.raises(MissingFileError, match="not there"):
            read_merl(path)


def test_files_without_a_value_are_refused(tmp_path):
    path = tmp_path / "void.binary"
    path.write_bytes(struct.pack("<3i", 90, 90, 180) + np.full(3 * 90 * 90 * 180, -1.0).tobytes())
    with pytest.raises(UnreadableFileError, match=r"void\.binary"):
        read_merl(path)
