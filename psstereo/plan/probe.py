"""How fast the machine at hand is, beside the one on which costs were measured; told once and kept."""

import json
import os
import platform
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

__all__ = ["Speed", "cache_file", "machine_speed", "probe"]

_SCHEMA = 2
_SOLVING, _INTEGRATING = 0.82e-3, 26e-3
"""Times of the two pieces of work on the machine of the costs [s]."""
_LIGHTS, _PIXELS, _SIDE = 24, 4096, 96
_REPEATS = 16
_FINE = 1e-4
"""Step of a clock that is fine enough [s]."""
_SLOWEST = 100.0
"""Ratio beyond which a figure is taken for nonsense."""


@dataclass(frozen=True, kw_only=True)
class Speed:
    """Times beside those of the reference machine; above 1 is slower.

    Attributes
    ----------
    solving : float
        Of least squares on samples [1].
    integrating : float
        Of integration [1].
    """

    solving: float
    integrating: float


def cache_file() -> Path:
    """Return where the figures are kept: in the user's folder for caches."""
    base = os.environ.get("LOCALAPPDATA" if platform.system() == "Windows" else "XDG_CACHE_HOME")
    folder = Path(base) if base and Path(base).is_absolute() else Path.home() / ".cache"
    return folder / "psstereo" / "speed.json"


def machine_speed(path: Path | None = None) -> Speed:
    """Return the kept figures, or measure and keep them.

    Parameters
    ----------
    path : Path, optional
        Where they are kept; :func:`cache_file` if absent.

    Returns
    -------
    Speed
        The figures. A file that cannot be read, is of another version or of another machine, or holds nonsense, is
        replaced; one that cannot be written is no trouble.
    """
    place = cache_file() if path is None else path
    kept = _read(place)
    if kept is not None:
        return kept
    found = probe()
    partial = place.with_name(f".{place.name}.{os.getpid()}.part")
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        partial.write_text(json.dumps({"schema": _SCHEMA, "machine": _machine(), **asdict(found)}), "utf-8")
        partial.replace(place)
    except OSError:  # a read-only home: it is measured again the next time
        pass
    return found


def probe() -> Speed:
    """Measure, in less than a second.

    Returns
    -------
    Speed
        The lower quartile of some rounds of each piece of work: neither the luckiest moment nor one that others took.
    """
    from threadpoolctl import threadpool_limits

    from psstereo.camera import Orthographic
    from psstereo.depth import Poisson
    from psstereo.lights import Rig
    from psstereo.normals import LeastSquares, Samples

    around = np.arange(_LIGHTS) * 2.399963  # the golden angle
    rig = Rig.distant(np.stack([0.6 * np.cos(around), 0.6 * np.sin(around), 1.0 + 0.02 * np.arange(_LIGHTS)], axis=1))
    across = np.linspace(-0.7, 0.7, _SIDE)
    x, y = np.meshgrid(across, across)
    normals = np.dstack([x, y, np.sqrt(1.0 - 0.5 * (x * x + y * y))])
    values = np.maximum(rig.directions @ normals.reshape(-1, 3)[:_PIXELS].T, 0.0)
    solver, integrator = LeastSquares(), Poisson()
    state, samples, camera = solver.prepare(rig), Samples(values), Orthographic()
    with threadpool_limits(1, user_api="blas"):
        solving = _usual(lambda: solver.solve(state, samples))
        integrating = _usual(lambda: integrator.integrate(normals, camera))
    return Speed(solving=solving / _SOLVING, integrating=integrating / _INTEGRATING)


def _usual(work: Any) -> float:
    return sorted(_timed(work) for _ in range(_REPEATS))[_REPEATS // 4]


def _timed(work: Any) -> float:
    """Return the time of a piece of work: that of the processor where it is told finely, since others work as well."""
    fine = time.get_clock_info("process_time").resolution < _FINE
    clock = time.process_time if fine else time.perf_counter
    started = clock()
    work()
    return clock() - started


def _machine() -> dict[str, str]:
    """Return what the figures depend on, without anything that names the machine."""
    return {
        "architecture": platform.machine(),
        "processors": str(os.cpu_count()),
        "python": platform.python_version(),
        "numpy": np.__version__,
    }


def _read(path: Path) -> Speed | None:
    try:
        content = json.loads(path.read_text("utf-8"))
        if content["schema"] != _SCHEMA or content["machine"] != _machine():
            return None
        figures = [float(content[name]) for name in ("solving", "integrating")]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None
    if not all(1 / _SLOWEST < one < _SLOWEST for one in figures):
        return None
    return Speed(solving=figures[0], integrating=figures[1])
