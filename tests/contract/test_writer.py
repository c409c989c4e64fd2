"""What every writer of captures promises: what is written comes back, whole or not at all."""

import json
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from psstereo.camera import Orthographic, Pinhole
from psstereo.capture import Capture, Truth
from psstereo.errors import (
    ExistingResultError,
    InputError,
    MissingFileError,
    OptionError,
    PsstereoError,
    UnsupportedError,
)
from psstereo.io import WRITERS, Choices, read_capture, recognise, write_capture
from psstereo.io.layout_writer import LayoutWriter
from psstereo.lights import Led, Light, Rig, StrengthUnit
from psstereo.stack import ImageStack, MemoryStack, Response
from psstereo_synth import checker, hills, lambertian_capture, spiral

SHAPE = (14, 19)
COUNT = 7
NEAR = {"luces", "near-ps"}
DISTANT = sorted(set(WRITERS) - NEAR)
READER_OF = {"luces": "near-led", "near-ps": "near-led"}
COLOURED = {"diligent", "luces", "sdm-unips"}  # gray images get three equal channels
HOLDS = {
    "capture": {"normals", "depth", "albedo", "visibility"},
    "diligent": {"normals", "depth"},
    "lp": set(),
    "sdm-unips": {"normals"},
    "luces": {"normals", "depth"},
    "near-ps": set(),
    "meshroom": set(),
}
every_writer = pytest.mark.parametrize("name", WRITERS)
EPS = 1e-15


def distant(name, *, bits=16, coloured=True, white=None, count=COUNT):
    """Return a capture under suns whose strengths differ where the layout can say so."""
    surface = hills(SHAPE[1], SHAPE[0])
    albedo = checker(SHAPE, tint=coloured)
    lights = spiral(count, max_tilt=1.2)
    rng = np.random.default_rng(5)
    strengths = np.full((count, 3 if coloured else 1), 1e3 / 3)
    if name != "lp":
        strengths = strengths * rng.uniform(0.5, 2, strengths.shape)
    capture, truth = lambertian_capture(surface, albedo, lights, strengths, bits=bits, name='Été "1"\t\x7f\\')
    return finished(capture, truth, white)


def near(*, bits=16, coloured=True, white=None, count=COUNT):
    """Return a capture under lamps, seen through a pinhole."""
    rng = np.random.default_rng(6)
    far, truth = distant("near", bits=bits, coloured=coloured, count=count)
    channels = far.stack.shape[3]
    lamps = tuple(
        Led(
            position=rng.normal(size=3) * 100 / 3,
            axis=rng.normal(size=3) - [0, 0, 4],
            mu=float(rng.uniform(0, 2)),
            flux=rng.uniform(1, 9, channels),
        )
        for _ in range(count)
    )
    camera = Pinhole(fx=1000 / 3, fy=1000 / 3, cx=9.1, cy=6.7)
    capture = Capture(
        stack=far.stack,
        rig=Rig(lamps, StrengthUnit.IRRADIANCE),
        camera=camera,
        mask=far.mask,
        radiance_at_white=far.radiance_at_white,
        name=far.name,
    )
    depth = np.where(far.mask, 300 - truth.depth / 7, np.nan)
    return finished(capture, Truth(normals=truth.normals, depth=depth, albedo=truth.albedo), white)


def finished(capture, truth, white):
    """Give the capture a mask with a hole and the truth a visibility; `white` cuts the values to fewer bits."""
    mask = capture.effective_mask.copy()
    mask[3:5, 4:9] = False
    stack = capture.stack
    if white is not None:
        values = np.rint(stack.read() / stack.white * white).astype(np.uint16)
        stack = MemoryStack(values, white=white)
    visibility = np.random.default_rng(7).uniform(0, 1, (len(capture.stack), *SHAPE))
    capture = Capture(
        stack=stack,
        rig=capture.rig,
        camera=capture.camera,
        mask=mask,
        radiance_at_white=capture.radiance_at_white,
        name=capture.name,
    )
    return capture, Truth(normals=truth.normals, depth=truth.depth, albedo=truth.albedo, visibility=visibility)


def sample(name, **options):
    return near(**options) if name in NEAR else distant(name, **options)


def changed(capture, **parts):
    names = ("stack", "rig", "camera", "mask", "response", "dark", "radiance_at_white", "name")
    return Capture(**{**{n: getattr(capture, n) for n in names}, **parts})


def everything(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def assert_same_values(got: ImageStack, wanted: ImageStack):
    """Images are the same after the layout's scaling, which keeps every integer apart."""
    assert got.shape[:3] == wanted.shape[:3]
    for i in range(len(wanted)):
        image = got.frame(i)
        assert image.shape[2] in (wanted.shape[3], 3)
        back = np.rint(image.astype(np.float64) * (wanted.white / got.white))
        np.testing.assert_array_equal(back, np.broadcast_to(wanted.frame(i), image.shape))


def assert_same_rig(got: Rig, wanted: Rig, *, relative=False):
    assert len(got) == len(wanted)
    for a, b in zip(got.lights, wanted.lights, strict=True):
        assert type(a) is type(b)
        if isinstance(a, Led):
            np.testing.assert_allclose(a.position, b.position, rtol=EPS, atol=0)
            np.testing.assert_allclose(a.axis, b.axis, rtol=EPS, atol=EPS)
            assert a.mu == b.mu
            np.testing.assert_allclose(a.flux, np.broadcast_to(b.flux, a.flux.shape), rtol=EPS, atol=0)
        else:
            np.testing.assert_allclose(a.direction, b.direction, rtol=EPS, atol=EPS)
            if not relative:
                np.testing.assert_allclose(a.strength, np.broadcast_to(b.strength, a.strength.shape), rtol=EPS, atol=0)


@every_writer
def test_has_a_name_and_a_summary(name):
    assert WRITERS[name].name == name
    assert WRITERS[name].summary


@every_writer
@pytest.mark.parametrize("coloured", [True, False])
@pytest.mark.parametrize(("bits", "white"), [(16, None), (8, None), (16, 1023), (16, 4095), (16, 16383)])
def test_comes_back_as_it_was(name, coloured, bits, white, tmp_path):
    wanted, truth = sample(name, bits=bits, coloured=coloured, white=white)
    lost = write_capture(wanted, tmp_path / "Éte 1", name, truth=truth)
    assert recognise(tmp_path / "Éte 1")[0].format == READER_OF.get(name, name)
    got, found = read_capture(tmp_path / "Éte 1")
    assert_same_values(got.stack, wanted.stack)
    assert got.stack.shape[3] == (3 if coloured or name in COLOURED else 1)
    assert_same_rig(got.rig, wanted.rig, relative=name == "lp")
    np.testing.assert_array_equal(got.mask, wanted.mask)
    assert got.camera == wanted.camera
    assert got.dark is None
    inside = wanted.mask
    parts = HOLDS[name]
    assert (found is None) == (not parts)
    for part in ("normals", "depth", "albedo", "visibility"):
        value = getattr(found, part, None)
        assert (value is not None) == (part in parts)
    if "normals" in parts:
        exact = name in ("capture", "diligent")
        atol = 4e-16 if exact else np.sqrt(3) / 2 / 32767.5
        np.testing.assert_allclose(found.normals[inside], truth.normals[inside], rtol=0, atol=atol)
    if "depth" in parts:
        np.testing.assert_array_equal(found.depth, truth.depth)
    if "albedo" in parts:
        np.testing.assert_array_equal(found.albedo, truth.albedo)
        assert found.albedo.dtype == truth.albedo.dtype
    if "visibility" in parts:
        np.testing.assert_array_equal(found.visibility, truth.visibility.astype(np.float32))
    said = " ".join(lost)
    for part in {"normals", "depth", "albedo", "visibility"} - parts:
        assert part in said
    assert (said == "") == (name == "capture")
    if name == "capture":
        assert got.name == wanted.name
        assert got.radiance_at_white == wanted.radiance_at_white
        assert got.rig.strength_unit is wanted.rig.strength_unit
        assert (got.stack.dtype, got.stack.white) == (wanted.stack.dtype, wanted.stack.white)
        assert got.stack.read().tobytes() == wanted.stack.read().tobytes()


@every_writer
def test_writes_the_files_that_it_announces_and_ends_its_lines(name, tmp_path):
    capture, truth = sample(name)
    told = []
    write_capture(capture, tmp_path / "x", name, truth=truth, progress=lambda *words: told.append(words))
    files = everything(tmp_path / "x")
    assert set(files) == WRITERS[name].file_names(capture, truth)
    for file, data in files.items():
        if Path(file).suffix in (".txt", ".toml", ".json", ".lp"):
            assert data.endswith(b"\n")
            assert not data.endswith(b"\n\n")
            assert b"\r" not in data
            assert not any(line != line.rstrip() for line in data.decode().split("\n"))
    assert told == [("writing images", i + 1, COUNT) for i in range(COUNT)]


@every_writer
def test_any_number_of_threads_gives_the_same_bytes(name, tmp_path):
    capture, truth = sample(name, count=23)
    write_capture(capture, tmp_path / "one", name, truth=truth)
    with ThreadPoolExecutor(4) as pool:
        write_capture(capture, tmp_path / "four", name, truth=truth, over=pool.map)
    assert everything(tmp_path / "one") == everything(tmp_path / "four")


@every_writer
def test_without_a_mask_and_with_little_truth(name, tmp_path):
    capture, truth = sample(name)
    capture = changed(capture, mask=None)
    write_capture(capture, tmp_path / "x", name, truth=Truth(depth=truth.depth) if name == "luces" else None)
    got, found = read_capture(tmp_path / "x")
    assert got.effective_mask.all()
    assert (found is None) == (name != "luces")
    assert_same_values(got.stack, capture.stack)


class Failing(ImageStack):
    """Raises for one image, after others have been given out; counts how often each is asked for."""

    def __init__(self, stack, bad):
        self.stack, self.bad = stack, bad
        self.shape, self.dtype, self.white = stack.shape, stack.dtype, stack.white
        self.saturates, self.names = stack.saturates, stack.names
        self.asked = []
        self.lock = threading.Lock()

    def frame(self, index):
        with self.lock:
            self.asked.append(index)
        if index == self.bad:
            raise RuntimeError("the lamp broke")
        return self.stack.frame(index)


@every_writer
@pytest.mark.parametrize("threads", [0, 3])
def test_a_failing_image_leaves_nothing_behind(name, threads, tmp_path):
    capture, truth = sample(name)
    broken = changed(capture, stack=Failing(capture.stack, 4))
    with ThreadPoolExecutor(max(threads, 1)) as pool, pytest.raises(RuntimeError, match="the lamp broke"):
        write_capture(broken, tmp_path / "a" / "x", name, truth=truth, over=pool.map if threads else map)
    assert [p for p in tmp_path.rglob("*") if p != tmp_path / "a"] == []


@every_writer
def test_each_image_is_asked_for_once(name, tmp_path):
    capture, truth = sample(name)
    stack = Failing(capture.stack, None)
    write_capture(changed(capture, stack=stack), tmp_path / "x", name, truth=truth)
    assert sorted(stack.asked) == list(range(COUNT))


@every_writer
def test_an_interruption_leaves_nothing_behind(name, tmp_path):
    capture, truth = sample(name)

    def interrupt(_stage, done, _total):
        if done == 2:
            raise KeyboardInterrupt

    with ThreadPoolExecutor(3) as pool, pytest.raises(KeyboardInterrupt):
        write_capture(capture, tmp_path / "x", name, truth=truth, over=pool.map, progress=interrupt)
    assert list(tmp_path.iterdir()) == []


@every_writer
def test_an_image_unlike_its_promise_is_refused(name, tmp_path):
    capture, truth = sample(name)

    class Odd(Failing):
        def frame(self, index):
            image = super().frame(index)
            return image[:-1] if index == 3 else image

    with pytest.raises(InputError, match=r"image 4 has the shape"):
        write_capture(changed(capture, stack=Odd(capture.stack, None)), tmp_path / "x", name, truth=truth)
    assert list(tmp_path.iterdir()) == []


@every_writer
def test_replaces_only_a_folder_of_the_same_files_and_only_if_asked(name, tmp_path):
    capture, truth = sample(name)
    target = tmp_path / "x"
    target.mkdir()
    write_capture(capture, target, name, truth=truth)
    first = everything(target)
    with pytest.raises(ExistingResultError, match="earlier capture"):
        write_capture(capture, target, name, truth=truth)
    assert everything(target) == first
    again = changed(capture, stack=MemoryStack(capture.stack.read()[::-1]))
    (target / ".DS_Store").write_text("")
    write_capture(again, target, name, truth=truth, overwrite=True)
    second = everything(target)
    assert set(second) == set(first)
    assert second != first
    assert [p.name for p in tmp_path.iterdir()] == ["x"]


@every_writer
@pytest.mark.parametrize("overwrite", [False, True])
def test_never_replaces_what_is_not_its_own(name, overwrite, tmp_path):
    capture, truth = sample(name)
    target = tmp_path / "x"

    def refused(match):
        before = everything(tmp_path)
        with pytest.raises(PsstereoError, match=match):
            write_capture(capture, target, name, truth=truth, overwrite=overwrite)
        assert everything(tmp_path) == before

    write_capture(capture, target, name, truth=truth)
    (target / "notes of mine.txt").write_text("mine")
    refused("notes of mine")
    (target / "notes of mine.txt").unlink()
    (target / "mine").mkdir()
    refused("holds mine,")
    (target / "mine").rmdir()
    last = sorted(everything(target))[-1]
    (target / last).rename(tmp_path / "moved")
    refused("does not hold")
    (tmp_path / "moved").replace(target / last)
    fewer = sample(name, count=COUNT - 1)
    with pytest.raises(ExistingResultError):
        write_capture(fewer[0], target, name, truth=fewer[1], overwrite=overwrite)
    target = tmp_path / "moved"
    target.write_text("mine")
    refused("is a file")
    target = tmp_path / "moved" / "y"
    refused("is a file")


def test_a_link_in_the_folder_is_not_ours(tmp_path):
    capture, truth = sample("capture")
    write_capture(capture, tmp_path / "x", truth=truth)
    (tmp_path / "x" / "truth").rename(tmp_path / "elsewhere")
    (tmp_path / "x" / "truth").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(ExistingResultError, match="truth"):
        write_capture(capture, tmp_path / "x", truth=truth, overwrite=True)
    assert (tmp_path / "elsewhere" / "normals.npy").is_file()


# What a layout cannot hold is refused before anything is written.


class Glow(Light):
    """Light from everywhere, which no file of lights holds."""

    name = "glow"
    positional = False

    @property
    def channels(self):
        return 1

    def directions(self, points):
        return np.full(np.shape(points), np.nan)

    def irradiance(self, points, normals):
        return np.ones((*np.shape(points)[:-1], 1))

    def beams(self, points, count):
        yield from ()

    def moved(self, rotation, translation):
        return self


@pytest.fixture
def refuse(tmp_path):
    """Return what checks that a capture is refused before an image is asked for or anything is written."""

    def check(capture, truth, name, kind, match):
        untouched = changed(capture, stack=Failing(capture.stack, None))
        with pytest.raises(kind, match=match) as caught:
            write_capture(untouched, tmp_path / "x", name, truth=truth)
        assert caught.value.needed
        assert caught.value.remedy
        assert list(tmp_path.iterdir()) == []
        assert untouched.stack.asked == []

    return check


@every_writer
def test_the_wrong_kind_of_lights(name, refuse):
    capture, truth = sample(name)
    glow = Rig((*capture.rig.lights[1:], Glow()))
    refuse(changed(capture, rig=glow), truth, name, UnsupportedError, "glow")
    other = (distant("capture") if name in NEAR else near())[0].rig
    mixed = Rig((*capture.rig.lights[1:], other.lights[0]))
    refuse(changed(capture, rig=mixed), truth, name, UnsupportedError, f"Light {COUNT} is")
    if name != "capture":
        refuse(changed(capture, rig=other), truth, name, UnsupportedError, "Light 1 is")


@pytest.mark.parametrize("name", sorted(NEAR))
def test_lamps_need_a_pinhole(name, refuse):
    capture, truth = near()
    refuse(changed(capture, camera=Orthographic()), truth, name, UnsupportedError, "orthographic")


def test_luces_needs_one_focal_length_and_a_depth(refuse):
    capture, truth = near()
    for odd in ({"fy": 400.0}, {"skew": 0.1}):
        camera = Pinhole(**{"fx": 333.0, "fy": 333.0, "cx": 9.0, "cy": 6.0, **odd})
        refuse(changed(capture, camera=camera), truth, "luces", UnsupportedError, "focal length")
    for depth in (None, np.full(SHAPE, np.nan)):
        refuse(capture, Truth(depth=depth), "luces", InputError, "no true depth")


@pytest.mark.parametrize("name", sorted(set(WRITERS) - {"capture"}))
def test_floats_responses_and_levels_need_our_own_layout(name, refuse):
    capture, truth = sample(name)
    values = capture.stack.read()
    for dtype in (np.float32, np.float64):
        floats = changed(capture, stack=MemoryStack(values.astype(dtype) / 65535))
        refuse(floats, truth, name, UnsupportedError, f"float{dtype().itemsize * 8}")
    refuse(changed(capture, response=Response("srgb")), truth, name, UnsupportedError, "srgb")
    for white in (0.0, -3.0, np.nan, 65536.0):
        odd = changed(capture, stack=MemoryStack(values, white=white))
        refuse(odd, truth, name, InputError, "full scale")
    dark = np.full((*SHAPE, 3), 0.5)
    refuse(changed(capture, dark=dark), truth, name, UnsupportedError, "dark image")


@every_writer
def test_images_of_many_channels(name, refuse):
    capture, truth = sample(name, coloured=False)
    many = changed(capture, stack=MemoryStack(np.repeat(capture.stack.read(), 5, axis=3)))
    refuse(many, Truth(depth=truth.depth), name, UnsupportedError, "5 channels")
    two = changed(capture, stack=MemoryStack(np.repeat(capture.stack.read(), 2, axis=3)))
    refuse(two, Truth(depth=truth.depth), name, UnsupportedError, "2 channels")


@every_writer
def test_strengths_for_other_channels(name, refuse):
    capture, truth = sample(name)
    gray = changed(capture, stack=MemoryStack(capture.stack.read()[..., :1]))
    refuse(gray, Truth(depth=truth.depth), name, InputError, "3 channels")


@every_writer
@pytest.mark.parametrize("part", ["normals", "depth", "albedo", "visibility"])
def test_truth_of_other_sizes(name, part, refuse):
    capture, truth = sample(name)
    parts = {"depth": truth.depth, part: getattr(truth, part)[:-1]}
    refuse(capture, Truth(**parts), name, InputError, f"true {part} have the shape")
    whole = {"depth": truth.depth, part: np.ones_like(getattr(truth, part), dtype=np.int64)}
    refuse(capture, Truth(**whole), name, InputError, "int64")


@every_writer
def test_truth_without_a_normal(name, refuse):
    capture, truth = sample(name)
    for nothing in (0.0, np.nan):
        normals = np.full((*SHAPE, 3), nothing)
        refuse(capture, Truth(depth=truth.depth, normals=normals), name, InputError, "everywhere")


@pytest.mark.parametrize(("name", "most"), [("lp", 1000), ("near-ps", 9999)])
def test_too_many_images(name, most, refuse):
    capture, _ = sample(name)
    for count, fits in ((most, True), (most + 1, False)):
        images = np.broadcast_to(np.uint8(1), (count, 1, 1, 3))
        many = Capture(stack=MemoryStack(images), rig=Rig((capture.rig.lights[0],) * count), camera=capture.camera)
        if fits:
            WRITERS[name].check(many, None)
        else:
            refuse(many, None, name, UnsupportedError, f"{count} images")


def test_rti_knows_lights_of_one_strength_before_the_object_only(refuse):
    capture, _ = distant("lp")
    behind = np.vstack([capture.rig.directions[1:], [[1.0, 0.2, 0.0]]])
    refuse(changed(capture, rig=Rig.distant(behind)), None, "lp", UnsupportedError, f"Light {COUNT} has z")
    odd = Rig.distant(capture.rig.directions, np.arange(1.0, COUNT + 1))
    refuse(changed(capture, rig=odd), None, "lp", UnsupportedError, "strengths from 1 to 7")


@pytest.mark.parametrize("bad", ["", "  \t", "\ud800"])
def test_names_that_no_text_holds(bad, refuse):
    capture, truth = sample("capture")
    refuse(changed(capture, name=bad), truth, "capture", InputError, "name of the capture")
    if not bad.strip():
        camera = Orthographic(pixel_size=0.1, length_unit=bad)
        refuse(changed(capture, camera=camera), truth, "capture", InputError, "unit of length")


def test_an_unknown_layout_is_refused(tmp_path):
    capture, _ = sample("capture")
    with pytest.raises(OptionError, match=r"diligant.*Did you mean diligent"):
        write_capture(capture, tmp_path / "x", "diligant")
    assert list(tmp_path.iterdir()) == []


# Our own layout loses nothing.


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("white", [None, 1.0, 0.1])
def test_floats_come_back_to_the_last_bit(dtype, channels, white, tmp_path):
    values = np.random.default_rng(1).normal(size=(4, *SHAPE, channels)).astype(dtype)
    values[0, 0, 0] = np.nan
    values[1, 0, 0] = np.finfo(dtype).tiny
    values[2, 0, 0] = np.inf
    capture = Capture(stack=MemoryStack(values, white=white), rig=Rig.distant(spiral(4)))
    write_capture(capture, tmp_path / "x")
    got, truth = read_capture(tmp_path / "x")
    assert truth is None
    assert got.stack.dtype == dtype
    assert got.stack.read().tobytes() == values.tobytes()
    assert got.stack.white == capture.stack.white
    assert got.stack.saturates == capture.stack.saturates


def test_a_white_level_of_a_fraction(tmp_path):
    capture = Capture(stack=MemoryStack(np.ones((3, 2, 2), np.uint8), white=200 / 3), rig=Rig.distant(spiral(3)))
    write_capture(capture, tmp_path / "x")
    assert read_capture(tmp_path / "x")[0].stack.white == 200 / 3


@pytest.mark.parametrize("near_lamps", [False, True])
@pytest.mark.parametrize("response", [Response("srgb"), Response("gamma", 2.2)])
@pytest.mark.parametrize(
    "camera", [Orthographic(pixel_size=1 / 3, length_unit="µm"), Pinhole(fx=1e3 / 3, fy=333, cx=9.1, cy=6.7, skew=0.1)]
)
def test_camera_response_and_dark_image(near_lamps, response, camera, tmp_path):
    capture, truth = near() if near_lamps else distant("capture")
    dark = np.random.default_rng(2).uniform(0, 99, (*SHAPE, 3))
    for exact in (dark, dark.astype(np.float32)):
        wanted = changed(capture, camera=camera, response=response, dark=exact)
        write_capture(wanted, tmp_path / "x", truth=truth, overwrite=True)
        got, _ = read_capture(tmp_path / "x")
        assert got.camera == camera
        assert got.response == response
        assert got.dark.tobytes() == exact.tobytes()
        assert_same_rig(got.rig, wanted.rig)


def test_truth_keeps_its_precision(tmp_path):
    capture, truth = distant("capture", coloured=False)
    given = {part: getattr(truth, part).astype(np.float32) for part in ("normals", "depth", "albedo", "visibility")}
    write_capture(capture, tmp_path / "x", truth=Truth(**given))
    found = read_capture(tmp_path / "x")[1]
    assert found.normals.dtype == found.albedo.dtype == found.visibility.dtype == np.float32
    np.testing.assert_array_equal(found.depth, given["depth"])
    np.testing.assert_array_equal(found.albedo, given["albedo"])
    for part in ("normals", "depth", "albedo"):
        assert np.load(tmp_path / "x" / "truth" / f"{part}.npy").tobytes() == given[part].tobytes()
    assert read_capture(tmp_path / "x", choices=Choices(truth=False))[1] is None


@pytest.mark.parametrize("name", ["diligent", "near-ps"])
@pytest.mark.parametrize("white", [None, 4095])
def test_a_dark_image_of_whole_numbers(name, white, tmp_path):
    capture, truth = sample(name, white=white)
    dark = np.random.default_rng(3).integers(0, 99, (*SHAPE, 3)).astype(np.float32)
    write_capture(changed(capture, dark=dark), tmp_path / "x", name, truth=truth)
    got, _ = read_capture(tmp_path / "x")
    np.testing.assert_array_equal(np.rint(got.dark * (capture.stack.white / got.stack.white)), dark)
    assert len(got.stack) == COUNT


# The files are as other programs read them.


def test_a_pinhole_for_distant_lights(tmp_path):
    camera = Pinhole(fx=1e3 / 3, fy=333.0, cx=9.1, cy=6.7, skew=1 / 7)
    for name in DISTANT:
        capture, _ = distant(name)
        write_capture(changed(capture, camera=camera), tmp_path / name, name)
        assert read_capture(tmp_path / name)[0].camera == camera


def test_the_led_file_of_luces(tmp_path):
    capture, truth = near(coloured=False)
    write_capture(capture, tmp_path / "x", "luces", truth=truth)
    lines = (tmp_path / "x" / "led_params.txt").read_text().splitlines()
    assert lines[0] == "N_img nrows ncols f x0 y0 mean_distance sfull:[Lpos Ldir Phi mu 0]"
    head = [float(word) for word in lines[1].split()]
    assert head[:3] == [COUNT, *SHAPE]
    assert head[3:6] == [capture.camera.fx, capture.camera.cx, capture.camera.cy]
    assert head[6] == pytest.approx(truth.depth[capture.mask].mean(), rel=1e-14)
    led = capture.rig.lights[2]
    row = [float(word) for word in lines[4].split()]
    assert row[:3] == (led.position * [1, -1, -1]).tolist()
    assert row[3:6] == (led.axis * [1, -1, -1]).tolist()
    assert row[6:] == [led.flux[0]] * 3 + [led.mu, 0]
    assert len(lines) == 2 + COUNT


def test_the_mat_files_of_near_ps(tmp_path):
    import scipy.io

    capture, _ = near()
    write_capture(capture, tmp_path / "x", "near-ps")
    light = scipy.io.loadmat(tmp_path / "x" / "light.mat")
    led = capture.rig.lights[3]
    assert light["S"][3].tolist() == (led.position * [1, -1, -1]).tolist()
    assert light["Dir"][3].tolist() == (led.axis * [1, -1, -1]).tolist()
    assert light["mu"].shape == (COUNT, 1)
    assert light["Phi"].shape == (COUNT, 3)
    assert scipy.io.loadmat(tmp_path / "x" / "camera.mat")["K"].tolist() == capture.camera.matrix.tolist()


def test_the_list_of_rti(tmp_path):
    capture, _ = distant("lp")
    write_capture(capture, tmp_path / "x", "lp")
    lines = (tmp_path / "x" / "lights.lp").read_text().splitlines()
    assert lines[0] == str(COUNT)
    for i, line in enumerate(lines[1:]):
        name, *vector = line.split(" ")
        assert name == f"{i + 1:04d}.png"
        assert all("e" not in word for word in vector)
        np.testing.assert_allclose([float(word) for word in vector], capture.rig.directions[i], rtol=0, atol=EPS)


def test_the_lights_of_meshroom(tmp_path):
    capture, _ = distant("meshroom")
    write_capture(capture, tmp_path / "x", "meshroom")
    lights = json.loads((tmp_path / "x" / "lights.json").read_text())["lights"]
    text = np.loadtxt(tmp_path / "x" / "light_directions.txt")
    matrix = np.loadtxt(tmp_path / "x" / "convertionMatrix.txt")
    powers = np.loadtxt(tmp_path / "x" / "light_intensities.txt")
    for i, light in enumerate(lights):
        assert set(light) == {"viewId", "type", "direction", "intensity"}
        assert (light["viewId"], light["type"]) == (str(i + 1), "directional")
        assert all(isinstance(word, str) for word in (*light["direction"], *light["intensity"]))
        direction = [float(word) for word in light["direction"]]
        assert direction == (capture.rig.directions[i] * [1, -1, -1]).tolist()
        assert direction == (matrix @ text[i]).tolist()
        assert [float(word) for word in light["intensity"]] == powers[i].tolist()
    (tmp_path / "x" / "light_directions.txt").unlink()
    (tmp_path / "x" / "light_intensities.txt").unlink()
    got, _ = read_capture(tmp_path / "x")
    assert got.rig.source == "lights.json"
    assert_same_rig(got.rig, capture.rig)
    write_capture(capture, tmp_path / "y", "sdm-unips")
    choices = Choices(lights=tmp_path / "x" / "lights.json")
    assert_same_rig(read_capture(tmp_path / "y", choices=choices)[0].rig, capture.rig)


def test_three_lights_of_diligent_want_a_word(tmp_path):
    capture, _ = distant("diligent", count=3)
    lost = write_capture(capture, tmp_path / "x", "diligent")
    assert "--lights-layout rows" in lost[-1]
    with pytest.raises(InputError, match="3 × 3"):
        read_capture(tmp_path / "x")
    got, _ = read_capture(tmp_path / "x", choices=Choices(lights_layout="rows"))
    assert_same_rig(got.rig, capture.rig)


def test_an_sdm_folder_without_lights_says_so(tmp_path):
    capture, truth = distant("sdm-unips")
    folder = tmp_path / "cat.data"
    write_capture(capture, folder, "sdm-unips", truth=truth)
    (folder / "light_directions.txt").unlink()
    assert recognise(folder)[0].format == "sdm-unips"
    with pytest.raises(MissingFileError, match="--lights"):
        read_capture(folder)


def test_every_layout_says_what_it_holds():
    for name, writer in WRITERS.items():
        assert isinstance(writer, LayoutWriter)
        assert writer.holds & {"normals", "depth", "albedo", "visibility"} == HOLDS[name]
