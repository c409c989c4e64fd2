import struct
import zlib

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from psstereo.errors import InputError, MissingFileError, OptionError, UnreadableFileError
from psstereo.io.conventions import CONVENTIONS, from_canonical
from psstereo.io.normal_map import WRITERS, read_normal_map, write_normal_map
from psstereo.metrics import angular_error


def _some_normals(shape=(24, 31), seed=0, holes=True, dtype=np.float64):
    normals = np.random.default_rng(seed).standard_normal((*shape, 3))
    normals[..., 2] = np.abs(normals[..., 2])
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    if holes:
        normals[3:7, 4:9] = np.nan
        normals[0, 0] = np.nan
    return normals.astype(dtype)


def _encode(name, array):
    """Code a picture given as RGB or RGBA, independently of the writer."""
    import cv2

    order = [2, 1, 0, 3][: array.shape[-1]] if array.ndim == 3 else slice(None)
    done, data = cv2.imencode(name[name.rindex(".") :], np.ascontiguousarray(array[..., order]))
    assert done
    return data.tobytes()


def _worst_degrees(a, b):
    return np.degrees(np.nanmax(angular_error(a, b)))


@pytest.mark.parametrize("convention", CONVENTIONS)
@pytest.mark.parametrize("suffix", WRITERS)
def test_round_trip(tmp_path, suffix, convention):
    """Worst of a million random normals: 16 bits 0.0015°, floats 4e-6°, Meshroom's 8 bits 0.55°."""
    normals, path = _some_normals(), tmp_path / f"Vase brûlé ñ 法线{suffix}"
    write_normal_map(normals, path, convention=convention)
    back = read_normal_map(path, convention=convention)
    assert np.array_equal(back.mask, np.isfinite(normals[..., 0]))
    assert np.array_equal(back.mask, np.isfinite(back.normals).all(axis=-1))
    assert back.normals.dtype == np.float32
    assert np.allclose(np.linalg.norm(back.normals[back.mask], axis=-1), 1, atol=1e-6)
    eight_bits = suffix == ".png" and convention == "meshroom"
    assert _worst_degrees(back.normals, normals) < (0.6 if eight_bits else 0.0016 if suffix == ".png" else 1e-5)
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]


@given(st.integers(0, 10**6))
@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_sixteen_bits_stay_sixteen_bits(tmp_path, seed):
    normals = _some_normals(seed=seed, holes=False)
    write_normal_map(normals, tmp_path / "n.png")
    errors = np.degrees(angular_error(read_normal_map(tmp_path / "n.png").normals, normals))
    assert errors.max() < 0.0016
    assert np.sqrt(np.mean(errors**2)) < 0.001


def test_png_holds_the_promised_numbers(tmp_path):
    import cv2

    write_normal_map(np.array([[[0, 0, 1.0], [1, 0, 0], [0, -1, 0], [np.nan, 0, 1]]]), tmp_path / "n.png")
    image = cv2.imread(str(tmp_path / "n.png"), cv2.IMREAD_UNCHANGED)[..., ::-1]
    assert image.dtype == np.uint16
    assert image[0].tolist() == [[32768, 32768, 65535], [65535, 32768, 32768], [32768, 0, 32768], [0, 0, 0]]


def test_lengths_are_made_one_and_short_vectors_left_out(tmp_path):
    write_normal_map(np.array([[[0, 0, 3.0], [0, 0, 0.4], [np.inf, 0, 1], [1e200, 0, 0]]]), tmp_path / "n.npy")
    stored = np.load(tmp_path / "n.npy")
    assert stored.dtype == np.float32
    assert stored[0, 0].tolist() == [0, 0, 1]
    assert np.isnan(stored[0, 1:3]).all()


@pytest.mark.parametrize("suffix", [".png", ".bmp", ".tif"])
def test_eight_bits(tmp_path, suffix):
    normals = _some_normals(holes=False)
    coded = np.round((normals + 1) * 127.5).astype(np.uint8)
    coded[0, :5] = [[0, 0, 0], [127, 127, 127], [128, 128, 128], [255, 255, 255], [128, 128, 255]]
    (tmp_path / f"n{suffix}").write_bytes(_encode(f"n{suffix}", coded))
    back = read_normal_map(tmp_path / f"n{suffix}")
    assert back.mask[0, :5].tolist() == [False, False, False, False, True]
    assert back.mask[1:].all()
    assert np.degrees(angular_error(back.normals, normals)[1:]).max() < 0.4
    assert "uint8" in back.notes[0]


def test_alpha_is_the_mask(tmp_path):
    coded = np.round((_some_normals(holes=False) + 1) * 32767.5).astype(np.uint16)
    alpha = np.full(coded.shape[:2], 65535, dtype=np.uint16)
    alpha[:, :10] = 100
    (tmp_path / "n.png").write_bytes(_encode("n.png", np.dstack([coded, alpha])))
    back = read_normal_map(tmp_path / "n.png")
    assert not back.mask[:, :10].any()
    assert back.mask[:, 10:].all()
    assert any("alpha" in note for note in back.notes)


def test_green_down(tmp_path):
    normals = _some_normals()
    write_normal_map(normals, tmp_path / "n.png", convention="directx")
    assert _worst_degrees(read_normal_map(tmp_path / "n.png").normals * [1, -1, 1], normals) < 0.0016


def test_meshroom_png_by_hand(tmp_path):
    """Both versions of their code on a few normals: toward the camera, right, upward, a slope, background."""
    up, slope = 0.6, np.array([0.48, 0.64, 0.6])
    normals = np.array([[0, 0, 1], [1, 0, 0], [0, up, 0.8], slope])
    foreign = from_canonical(normals, "meshroom")
    for rounded in (np.floor, np.ceil):
        coded = np.zeros((1, 5, 3))
        coded[0, :4, 0] = np.floor(255 * (foreign[:, 0] + 1) / 2)
        coded[0, :4, 1] = -rounded(255 * (foreign[:, 1] + 1) / 2)
        coded[0, :4, 2] = -rounded(255 * foreign[:, 2])
        (tmp_path / "m.png").write_bytes(_encode("m.png", (coded % 256).astype(np.uint8)))
        back = read_normal_map(tmp_path / "m.png", convention="meshroom")
        assert back.mask.tolist() == [[True, True, True, True, False]]
        assert _worst_degrees(back.normals[0, :4], normals) < 1.0


def test_meshroom_png_read_as_usual_is_remarked_upon(tmp_path):
    write_normal_map(_some_normals(), tmp_path / "m.png", convention="meshroom")
    assert any("Meshroom" in note for note in read_normal_map(tmp_path / "m.png").notes)


def test_meshroom_has_eight_bits(tmp_path):
    write_normal_map(_some_normals(), tmp_path / "n.png")
    with pytest.raises(InputError, match="8-bit"):
        read_normal_map(tmp_path / "n.png", convention="meshroom")


@pytest.mark.parametrize("compression", [None, "zlib"])
@pytest.mark.parametrize("planar", ["contig", "separate"])
def test_float_tiff(tmp_path, compression, planar):
    import tifffile

    normals = _some_normals(dtype=np.float32)
    data = normals if planar == "contig" else np.moveaxis(normals, -1, 0)
    tifffile.imwrite(
        tmp_path / "n.tiff", data, photometric="rgb", planarconfig=planar, compression=compression, metadata=None
    )
    assert _worst_degrees(read_normal_map(tmp_path / "n.tiff").normals, normals) < 1e-5


def test_sixteen_bit_lzw_tiff(tmp_path):
    """OpenCV writes TIFF with LZW, which tifffile alone cannot decode."""
    coded = np.round((_some_normals(holes=False) + 1) * 32767.5).astype(np.uint16)
    (tmp_path / "n.tif").write_bytes(_encode("n.tif", coded))
    assert _worst_degrees(read_normal_map(tmp_path / "n.tif").normals, _some_normals(holes=False)) < 0.0016


@pytest.mark.parametrize("names", ["RGB", "XYZ", "N.XYZ", "normal.RGB"])
@pytest.mark.parametrize("dtype", [np.float16, np.float32])
def test_exr_channels(tmp_path, names, dtype):
    import OpenEXR

    normals = np.nan_to_num(_some_normals(dtype=dtype))
    layer, _, letters = names.rpartition(".")
    channels = {
        f"{layer}.{letter}" if layer else letter: np.ascontiguousarray(normals[..., k])
        for k, letter in enumerate(letters)
    }
    with OpenEXR.File({}, channels) as file:
        file.write(str(tmp_path / "n.exr"))
    back = read_normal_map(tmp_path / "n.exr")
    assert np.array_equal(back.mask, np.isfinite(_some_normals()[..., 0]))
    assert _worst_degrees(back.normals, _some_normals()) < (0.05 if dtype == np.float16 else 1e-5)


def test_exr_without_normals(tmp_path):
    import OpenEXR

    with OpenEXR.File({}, {"Z": np.ones((4, 4), dtype=np.float32)}) as file:
        file.write(str(tmp_path / "depth.exr"))
    with pytest.raises(InputError, match="channels Z"):
        read_normal_map(tmp_path / "depth.exr")


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64])
def test_arrays_keep_their_precision(tmp_path, dtype):
    np.save(tmp_path / "n.npy", _some_normals(dtype=dtype))
    back = read_normal_map(tmp_path / "n.npy")
    assert back.normals.dtype == (np.float64 if dtype == np.float64 else np.float32)
    if dtype == np.float64:
        assert _worst_degrees(back.normals, _some_normals()) < 1e-13


def test_short_float_vectors_are_undefined(tmp_path):
    values = _some_normals(holes=False)
    values[0, :4] = [[0, 0, 0], [0, 0, 0.49], [0, 0, 2], [np.inf, 0, 0]]
    np.save(tmp_path / "n.npy", values)
    assert read_normal_map(tmp_path / "n.npy").mask[0, :4].tolist() == [False, False, True, False]


@pytest.mark.parametrize("background", [0.0, 0.5, 1.0])
def test_colours_kept_as_floats(tmp_path, background):
    coded = (_some_normals(holes=False) + 1) / 2
    coded[:2] = background
    np.save(tmp_path / "n.npy", coded)
    back = read_normal_map(tmp_path / "n.npy")
    assert _worst_degrees(back.normals[2:], _some_normals(holes=False)[2:]) < 1e-12
    assert not back.mask[:2].any()
    assert any("decoded as colours" in note for note in back.notes)


def test_first_octant_vectors_are_not_taken_for_colours(tmp_path):
    np.save(tmp_path / "n.npy", np.abs(_some_normals(holes=False)))
    assert _worst_degrees(read_normal_map(tmp_path / "n.npy").normals, np.abs(_some_normals(holes=False))) < 1e-12


def test_archives_by_name(tmp_path):
    normals = _some_normals()
    np.savez(tmp_path / "one.npz", n=normals, mask=np.isfinite(normals[..., 0]))
    assert "'n'" in read_normal_map(tmp_path / "one.npz").notes[0]
    np.savez(tmp_path / "two.npz", a=normals, b=-normals)
    assert _worst_degrees(read_normal_map(tmp_path / "two.npz", variable="b").normals, -normals) < 1e-12
    with pytest.raises(InputError, match="exactly one"):
        read_normal_map(tmp_path / "two.npz")
    with pytest.raises(OptionError, match=r"a \(24, 31, 3\)"):
        read_normal_map(tmp_path / "two.npz", variable="c")


def test_matlab_by_name(tmp_path):
    from scipy.io import savemat

    normals = _some_normals()
    savemat(tmp_path / "n.mat", {"Normal_gt": normals, "other": -normals})
    back = read_normal_map(tmp_path / "n.mat")
    assert _worst_degrees(back.normals, normals) < 1e-12
    assert "Normal_gt" in back.notes[0]
    assert _worst_degrees(read_normal_map(tmp_path / "n.mat", variable="other").normals, -normals) < 1e-12
    savemat(tmp_path / "m.mat", {"N_est": normals, "scale": 3.0})
    assert "N_est" in read_normal_map(tmp_path / "m.mat").notes[0]


def test_matlab_73_says_what_to_do(tmp_path):
    (tmp_path / "n.mat").write_bytes(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM" + bytes(100))
    with pytest.raises(UnreadableFileError, match="-v7"):
        read_normal_map(tmp_path / "n.mat")


def _write_any(path, normals):
    from scipy.io import savemat

    if path.suffix == ".npz":
        np.savez(path, n=normals)
    elif path.suffix == ".mat":
        savemat(path, {"Normal_gt": normals})
    elif path.suffix in (".jpg", ".bmp"):
        path.write_bytes(_encode(path.name, np.round((normals + 1) * 127.5).astype(np.uint8)))
    else:
        write_normal_map(normals, path)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.98])
@pytest.mark.parametrize("suffix", [".png", ".tif", ".exr", ".npy", ".npz", ".mat", ".jpg"])
def test_files_cut_short(tmp_path, suffix, share):
    path = tmp_path / f"cut é{suffix}"
    _write_any(path, _some_normals((64, 64), holes=False))
    assert read_normal_map(path).mask.any()
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(UnreadableFileError, match="cut é"):
        read_normal_map(path)


@pytest.mark.parametrize("suffix", [".png", ".tif", ".exr", ".npy", ".npz", ".mat", ".jpg", ".bmp"])
def test_files_of_another_kind(tmp_path, suffix):
    path = tmp_path / f"text{suffix}"
    path.write_text("not a picture at all, just words\n" * 20)
    with pytest.raises(UnreadableFileError, match="text"):
        read_normal_map(path)


def test_damaged_png_is_found_by_its_check_sums(tmp_path):
    write_normal_map(_some_normals(), tmp_path / "n.png")
    data = bytearray((tmp_path / "n.png").read_bytes())
    data[len(data) // 2] ^= 1
    (tmp_path / "n.png").write_bytes(bytes(data))
    with pytest.raises(UnreadableFileError, match="damaged"):
        read_normal_map(tmp_path / "n.png")


def test_png_without_its_last_rows(tmp_path):
    """Every block is whole, but the pixels are not all there: decoders like to hand out a partly black picture."""
    write_normal_map(_some_normals((64, 64)), tmp_path / "n.png")
    data = (tmp_path / "n.png").read_bytes()
    start = data.index(b"IDAT") - 4
    (length,) = struct.unpack_from(">I", data, start)
    body = b"IDAT" + data[start + 8 : start + 8 + length // 2]
    cut = data[:start] + struct.pack(">I", len(body) - 4) + body + struct.pack(">I", zlib.crc32(body))
    (tmp_path / "n.png").write_bytes(cut + struct.pack(">I", 0) + b"IEND" + struct.pack(">I", zlib.crc32(b"IEND")))
    with pytest.raises(UnreadableFileError):
        read_normal_map(tmp_path / "n.png")


def test_pickles_are_not_opened(tmp_path):
    np.save(tmp_path / "n.npy", np.array({"normal_map": 1}, dtype=object), allow_pickle=True)
    with pytest.raises(UnreadableFileError, match="allow_pickle"):
        read_normal_map(tmp_path / "n.npy")


@pytest.mark.parametrize("name", ["gone.png", "."])
def test_missing_files(tmp_path, name):
    with pytest.raises(MissingFileError, match="normal-map file is needed"):
        read_normal_map(tmp_path / name)


def test_grey_pictures_are_refused(tmp_path):
    grey = np.random.default_rng(0).integers(0, 255, (8, 9), dtype=np.uint8)
    (tmp_path / "g.png").write_bytes(_encode("g.png", grey))
    (tmp_path / "g3.png").write_bytes(_encode("g3.png", np.dstack([grey] * 3)))
    np.save(tmp_path / "two.npy", np.zeros((8, 9, 2)))
    for name in ("g.png", "g3.png", "two.npy"):
        with pytest.raises(InputError) as caught:
            read_normal_map(tmp_path / name)
        assert name in caught.value.given
        assert caught.value.needed
        assert caught.value.remedy


@pytest.mark.parametrize("dtype", [np.int16, np.uint32, np.bool_, np.complex128])
def test_other_types_are_refused(tmp_path, dtype):
    np.save(tmp_path / "n.npy", np.eye(3)[None].astype(dtype))
    with pytest.raises(InputError, match=np.dtype(dtype).name):
        read_normal_map(tmp_path / "n.npy")


def test_maps_without_normals_are_refused(tmp_path):
    np.save(tmp_path / "n.npy", 0.01 * _some_normals())
    with pytest.raises(InputError, match="unit length"):
        read_normal_map(tmp_path / "n.npy")


def test_unknown_names_are_refused(tmp_path):
    (tmp_path / "n.xyz").write_text("x")
    with pytest.raises(OptionError, match=r"\.exr"):
        read_normal_map(tmp_path / "n.xyz")
    with pytest.raises(OptionError, match="'directx'"):
        read_normal_map(tmp_path / "n.xyz", convention="vulkan")
    with pytest.raises(OptionError, match=r"\.exr"):
        write_normal_map(_some_normals(), tmp_path / "n.jpg")
    with pytest.raises(OptionError, match="'directx'"):
        write_normal_map(_some_normals(), tmp_path / "n.png", convention="vulkan")
    write_normal_map(_some_normals(), tmp_path / "n.npy")
    with pytest.raises(OptionError, match="variable"):
        read_normal_map(tmp_path / "n.npy", variable="n")


def test_bad_normals_are_not_written(tmp_path):
    with pytest.raises(InputError):
        write_normal_map(np.zeros((4, 4)), tmp_path / "n.png")
    with pytest.raises(InputError):
        write_normal_map(np.zeros((4, 4, 3), dtype=np.uint8), tmp_path / "n.png")
    with pytest.raises(MissingFileError):
        write_normal_map(_some_normals(), tmp_path / "no" / "n.png")
    assert not list(tmp_path.iterdir())


def test_failed_writing_leaves_the_old_file(tmp_path, monkeypatch):
    write_normal_map(_some_normals(), tmp_path / "n.npy")
    before = (tmp_path / "n.npy").read_bytes()

    def fail(path, *_):
        path.write_bytes(b"half")
        raise OSError("disk full")

    monkeypatch.setattr("psstereo.io.normal_map.WRITERS", {".npy": fail})
    with pytest.raises(OSError, match="disk full"):
        write_normal_map(-_some_normals(), tmp_path / "n.npy")
    assert (tmp_path / "n.npy").read_bytes() == before
    assert [entry.name for entry in tmp_path.iterdir()] == ["n.npy"]
