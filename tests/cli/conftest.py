"""What the tests of all commands share: a capture on disk, and the command run inside this process."""

import json
import os
import shutil
import signal
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from psstereo.forward import lambertian_images
from psstereo.io import write_diligent
from psstereo.lights import Rig
from psstereo_cli.app import main
from psstereo_synth import checker, expose, hills, spiral

_ROOT = Path(__file__).resolve().parent.parent.parent


@dataclass(frozen=True)
class Run:
    """What a command left: exit code, stdout, stderr."""

    code: int
    out: str
    err: str

    @property
    def record(self) -> dict[str, Any]:
        """Stdout as the one JSON object that it has to be."""
        record = json.loads(self.out)
        assert isinstance(record, dict)
        return record

    @property
    def text(self) -> str:
        """Stderr with every run of blanks as one, since tables break lines."""
        return " ".join(self.err.split())


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Callable[..., Run]:
    """Return a function that runs the command; C libraries that write to stderr are caught too."""

    def call(*words: object) -> Run:
        monkeypatch.setattr(sys, "argv", ["psstereo", *map(str, words)])
        capfd.readouterr()
        before, code = signal.getsignal(signal.SIGTERM), 0
        try:
            main()
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else int(end.code is not None)
        finally:
            signal.signal(signal.SIGTERM, before)
        caught = capfd.readouterr()
        return Run(code, caught.out, caught.err)

    return call


@pytest.fixture
def environment() -> dict[str, str]:
    """Environment in which a process of its own finds the three packages of this checkout."""
    paths = os.pathsep.join(str(_ROOT / part) for part in ("", "synth", "cli"))
    return {**os.environ, "PYTHONPATH": paths}


@pytest.fixture(scope="session")
def _pristine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write eight noisy 16-bit colour photographs with shadows and some saturated pixels, and their truth."""
    folder = tmp_path_factory.mktemp("pristine") / "capture"
    surface, directions = hills(48, 40, steepness=2.0), spiral(8)
    strengths = np.random.default_rng(5).uniform(0.8, 1.2, (8, 3))
    images = lambertian_images(surface.normals, checker((40, 48), tint=True), Rig.distant(directions, strengths))
    images *= surface.mask[..., None] * 1.1 / images.max()
    write_diligent(
        folder,
        images=expose(images, bits=16, noise=0.002),
        directions=directions,
        intensities=strengths,
        mask=surface.mask,
        normals=np.where(surface.mask[..., None], surface.normals, np.nan),
        depth=np.where(surface.mask, surface.height, np.nan),
    )
    return folder


@pytest.fixture
def folder(_pristine: Path, tmp_path: Path) -> Path:
    """Return a copy of the capture that the test may spoil."""
    return Path(shutil.copytree(_pristine, tmp_path / "capture"))


@pytest.fixture(scope="session")
def _reconstructed() -> list[Path]:
    """Keep the default result of the capture, once somebody has asked for it."""
    return []


@pytest.fixture
def plain(
    run: Callable[..., Run],
    _pristine: Path,
    _reconstructed: list[Path],
    tmp_path: Path,
    tmp_path_factory: pytest.TempPathFactory,
) -> Path:
    """Return a copy of the default result of the capture, which the test may spoil."""
    if not _reconstructed:
        out = tmp_path_factory.mktemp("reconstructed") / "plain"
        assert run("reconstruct", _pristine, "-o", out).code == 0
        _reconstructed.append(out)
    return Path(shutil.copytree(_reconstructed[0], tmp_path / "plain"))
