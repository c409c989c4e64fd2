"""Normal maps that do not fit into memory: depth from file to file."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from psstereo.camera import Camera
    from psstereo.depth import Integrator

__all__ = ["integrate_large", "too_large"]

_NEEDED = 85
"""What a pixel takes when a map is integrated at once [byte]."""


def too_large(path: Path, bound: int) -> bool:
    """Say whether a normal map is beyond a bound of memory; only ``.npy`` tells its size without being decoded.

    Parameters
    ----------
    path : Path
        The normal map.
    bound : int
        Bound for arrays [byte].

    Returns
    -------
    bool
        Whether it has to be integrated in tiles.

    Raises
    ------
    UnsupportedError
        If the bound is given and the file is of another kind.
    MissingFileError, UnreadableFileError
        If it is not there or damaged.
    """
    import numpy as np

    from psstereo.errors import UnreadableFileError, UnsupportedError
    from psstereo.io.text import require_file

    if path.suffix.lower() != ".npy":
        raise UnsupportedError(
            given=f"A bound of memory was given, and the normal map {path.name} is no .npy file.",
            needed="Tiles are read from .npy files alone, in the axes x right, y up, z toward the camera.",
            remedy="Convert the map, or leave --max-memory out.",
        )
    require_file(path)
    try:
        shape = np.load(path, mmap_mode="r", allow_pickle=False).shape
    except (ValueError, OSError, EOFError) as error:
        raise UnreadableFileError(
            given=f"{path} cannot be opened: {error}.", needed="A complete .npy file.", remedy="Save it again."
        ) from None
    return len(shape) >= 2 and shape[0] * shape[1] * _NEEDED > bound


def integrate_large(
    path: Path,
    out: Path,
    camera: "Camera",
    method: "Integrator",
    convention: str,
    bound: int,
    *,
    unused: Mapping[str, Any],
    overwrite: bool,
) -> tuple[dict[str, Any], bool]:
    """Integrate a normal map in tiles and write a result folder with its depth.

    Parameters
    ----------
    path, out : Path
        Normal map and result folder.
    camera : Camera
        The camera.
    method : Integrator
        Poisson's.
    convention : str
        Axes of the map; only our own.
    bound : int
        Bound for arrays [byte].
    unused : mapping
        Options that tiles know nothing of, None where not given.
    overwrite : bool
        Whether an earlier result may be replaced.

    Returns
    -------
    dict, bool
        The record, and whether the iteration converged.

    Raises
    ------
    UnsupportedError
        If something was asked for that tiles do not know.
    """
    import json
    import time

    import numpy as np

    from psstereo.bench import peak_memory, versions
    from psstereo.depth import Poisson, integrate_tiled
    from psstereo.errors import UnsupportedError
    from psstereo.io.atomic import RECORD, new_folder
    from psstereo.results import DepthResult
    from psstereo_cli.console import progress_bars
    from psstereo_cli.record import depth_entry, finite

    asked = [name for name, value in unused.items() if value is not None]
    asked += [] if isinstance(method, Poisson) else [f"the integrator {method.name}"]
    asked += [] if convention == "opengl" else [f"--convention {convention}"]
    if asked or not isinstance(method, Poisson):
        raise UnsupportedError(
            given=f"The normal map exceeds the bound of memory, and {', '.join(asked)} was given.",
            needed="Tiles know none of it: they take normals in our own axes and Poisson's equations.",
            remedy="Leave it out, mark pixels to leave out as NaN in the map, or give a larger --max-memory.",
        )
    started = time.perf_counter()
    with new_folder(out, overwrite=overwrite) as work, progress_bars() as progress:
        found = integrate_tiled(
            path,
            camera,
            out=work / "depth.npy",
            components=work / "components.npy",
            integrator=method,
            dtype="float32",
            max_memory=bound,
            progress=progress,
        )
        labels = np.load(work / "components.npy", mmap_mode="r", allow_pickle=False)
        depth = DepthResult(
            depth=found.depth,
            kind=found.kind,
            unit=found.unit,
            components=labels,
            iterations=found.iterations,
            residual=found.residual,
            outcome=found.outcome,
            facts=found.facts,
        )
        height, width = found.depth.shape
        reason = f"{width} × {height} normals in tiles; mesh and pictures were left out."
        step = {"name": "depth (poisson)", "done": True, "reason": reason, "seconds": time.perf_counter() - started}
        record = dict(
            finite(
                {
                    "schema": 1,
                    "command": "integrate",
                    "input": {"name": path.name, "width": width, "height": height, "notes": [], "warnings": []},
                    "normals": {"frame": "x right, y up, z toward the camera", "flags": {}},
                    "depth": depth_entry(depth),
                    "mesh": None,
                    "steps": [step],
                    "peak_memory_bytes": peak_memory(),
                    "versions": versions(),
                }
            )
        )
        text = json.dumps(record, indent=1, ensure_ascii=False, allow_nan=False)
        (work / RECORD).write_bytes((text + "\n").encode("utf-8", "backslashreplace"))
    return record, found.outcome.converged
