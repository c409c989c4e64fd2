"""Captures that the contract tests of the writers write, and what has to come back."""

import threading
from pathlib import Path

import numpy as np
import pytest

from psstereo.camera import Pinhole
from psstereo.capture import Capture, Truth
from psstereo.io import WRITERS
from psstereo.lights import Led, Rig, StrengthUnit
from psstereo.stack import ImageStack, MemoryStack
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
