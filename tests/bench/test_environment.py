"""What a measurement depends on besides the code."""

import json
import os
import platform
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

from psstereo.bench import environment, machine, peak_memory, versions
from psstereo.bench.environment import memory_now

_ROOT = Path(__file__).resolve().parent.parent.parent


def test_versions_are_those_that_run():
    found = versions()
    assert found["python"] == platform.python_version()
    assert found["numpy"] == np.__version__
    assert found["scipy"] == version("scipy")


def test_a_package_that_is_absent_is_named_so(monkeypatch):
    monkeypatch.setattr(environment, "_PACKAGES", ("no-such-package-at-all",))
    assert versions()["no-such-package-at-all"] == "not installed"


def test_the_machine_is_described_but_not_named():
    found = machine()
    assert set(found) == {"system", "architecture", "processors"}
    assert found["processors"] >= 1
    assert platform.node() not in (found["system"], found["architecture"])


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux keeps this account")
def test_memory_follows_what_is_held():
    before, peak = memory_now(), peak_memory()
    assert 10**7 < before <= peak
    held = np.ones(200_000_000 // 8)
    assert memory_now() - before > 0.8 * held.nbytes
    assert peak_memory() >= memory_now() * 0.99
    del held
    assert peak_memory() >= peak  # a peak never sinks


def test_without_an_account_the_system_is_asked_otherwise(monkeypatch, tmp_path):
    monkeypatch.setattr(environment, "_STATUS", tmp_path / "nothing")
    assert memory_now() is None
    if sys.platform != "win32":
        assert 10**7 < peak_memory() < 10**12  # in bytes, not kilobytes or pages
    else:
        assert peak_memory() is None


@pytest.mark.slow
def test_growth_is_measured_in_a_process_of_its_own(tmp_path):
    from psstereo.io import write_diligent
    from psstereo_synth import demo_capture

    capture, _ = demo_capture(64, lights=6)
    write_diligent(
        tmp_path / "c",
        images=(capture.stack.frame(i) for i in range(6)),
        directions=capture.rig.directions,
        intensities=np.ones(6),
        mask=capture.mask,
    )
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(str(_ROOT / p) for p in ("", "synth", "cli"))}
    for more in ((), ("30000000",)):
        done = subprocess.run(
            [sys.executable, "-m", "psstereo.bench.growth", str(tmp_path / "c"), "2", *more],
            capture_output=True,
            text=True,
            check=True,
            env=env,
        )
        found = json.loads(done.stdout)
        assert found["samples"] == int(capture.mask.sum()) * 6 * 4
        if sys.platform == "linux":
            assert found["peak"] >= found["before"] > 0
            assert found["grown"] == found["peak"] - found["before"]
