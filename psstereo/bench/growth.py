"""How much memory an estimate takes, measured in a process of its own: ``python -m psstereo.bench.growth FOLDER``."""

import json
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from psstereo.bench.environment import memory_now, peak_memory
from psstereo.io import Choices, read_capture
from psstereo.normals import LeastSquares, estimate_normals

__all__ = ["measure_growth"]


def measure_growth(folder: Path, threads: int, max_memory: int | None) -> dict[str, int | None]:
    """Estimate normals once and return by how much the process grew.

    Parameters
    ----------
    folder : Path
        A capture.
    threads : int
        Threads.
    max_memory : int or None
        Bound for arrays [byte].

    Returns
    -------
    dict
        ``before`` (imports done), ``peak``, ``grown`` and ``samples``, the masked stack as floats [byte].
    """
    import cv2  # noqa: F401 loaded before the measurement starts, as are the next ones
    import scipy.io  # noqa: F401
    import threadpoolctl  # noqa: F401

    before = memory_now()
    capture, _ = read_capture(folder, choices=Choices(truth=False))
    with ThreadPoolExecutor(threads) as pool:
        result = estimate_normals(capture, LeastSquares(), max_memory=max_memory, workers=threads, over=pool.map)
    peak = peak_memory()
    grown = None if before is None or peak is None else peak - before
    return {"before": before, "peak": peak, "grown": grown, "samples": int(result.facts["sample_bytes"])}


if __name__ == "__main__":
    bound = int(sys.argv[3]) if len(sys.argv) > 3 else None
    sys.stdout.write(json.dumps(measure_growth(Path(sys.argv[1]), int(sys.argv[2]), bound)) + "\n")
