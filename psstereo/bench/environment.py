"""What a measurement depends on besides the code: versions, processors, memory."""

import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

__all__ = ["machine", "memory_now", "peak_memory", "versions"]

_PACKAGES = ("psstereo", "numpy", "scipy", "opencv-contrib-python-headless")
_STATUS = Path("/proc/self/status")


def versions() -> dict[str, str]:
    """Return the versions that decide the numbers."""
    found = {"python": platform.python_version()}
    for name in _PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found


def machine() -> dict[str, str | int]:
    """Return what kind of machine this is, without anything that names it."""
    count = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return {"system": platform.system(), "architecture": platform.machine(), "processors": count}


def peak_memory() -> int | None:
    """Return the largest memory that this process has held [byte], None where the system does not tell."""
    peak = _status("VmHWM")
    if peak is not None:
        return peak
    try:
        import resource
    except ImportError:  # Windows
        return None
    largest = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return largest if platform.system() == "Darwin" else largest * 1024


def memory_now() -> int | None:
    """Return the memory that this process holds [byte], None where the system does not tell."""
    return _status("VmRSS")


def _status(key: str) -> int | None:
    """Read a line of Linux's account; unlike getrusage's it does not begin with the parent's peak."""
    try:
        lines = _STATUS.read_text(encoding="ascii").splitlines()
    except OSError:
        return None
    found = [line.split()[1] for line in lines if line.startswith(f"{key}:")]
    return int(found[0]) * 1024 if found else None
