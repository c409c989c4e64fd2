"""Coarse moves between frames under different lights, by correlation of what the light does not change much."""

import numpy as np

from psstereo.types import FloatArray

__all__ = ["coarse_shifts"]

_SMOOTH = 6.0
"""Standard deviation of what counts as shading and is taken out [px]."""
_EVERY = 10
"""Frames up to which all pairs are compared."""
_STEPS = (1, 2, 3, 5)
"""Distances of the pairs that are compared beyond that, in the order of the frames, beside that with the reference."""
_ROUNDS = 20
_FAR = 0.5
"""Disagreement from which a pair loses weight [px]."""


def _detail(frame: FloatArray) -> FloatArray:
    """Return the high-passed logarithm of a frame, within bounds so that edges of shadows do not outweigh the rest.

    Parameters
    ----------
    frame : float array (h, w)
        Light, without NaN.

    Returns
    -------
    float32 array (h, w)
        Between −1 and 1.
    """
    import cv2

    floor = max(0.02 * float(np.quantile(frame, 0.95)), float(np.finfo(np.float32).tiny))
    level = np.log(np.maximum(frame, 0) + floor).astype(np.float32)
    high = level - np.asarray(cv2.GaussianBlur(level, (0, 0), _SMOOTH))
    bound = 3 * max(float(np.median(np.abs(high))), 1e-6)
    return np.asarray(np.clip(high, -bound, bound) / bound, np.float32)


def coarse_shifts(frames: FloatArray, reference: int) -> FloatArray:
    """Return where each frame shows what the reference shows, to about half a pixel.

    Pairs of frames are compared by phase correlation and put together by least squares that doubt pairs which disagree
    with the others, as frames under opposite lights do.

    Parameters
    ----------
    frames : float array (m, h, w)
        Light, without NaN.
    reference : int
        The frame that stays.

    Returns
    -------
    float64 array (m, 2)
        Column and row to add to a place in the reference [px].
    """
    import cv2

    details = [_detail(frame) for frame in frames]
    window = cv2.createHanningWindow((frames.shape[2], frames.shape[1]), cv2.CV_32F)
    rows, right, trust = [], [], []
    for one, other in _pairs(len(frames), reference):
        (along, down), response = cv2.phaseCorrelate(details[one], details[other], window)
        row = np.zeros(len(frames))
        row[[other, one]] = 1.0, -1.0
        rows.append(row)
        right.append((along, down))
        trust.append(max(response, 1e-3))
    matrix, target, weight = np.array(rows), np.array(right), np.array(trust)
    keep = np.arange(len(frames)) != reference
    shifts = np.zeros((len(frames), 2))
    robust = np.ones(len(target))
    for _ in range(_ROUNDS):
        root = np.sqrt(weight * robust)[:, None]
        shifts[keep] = np.linalg.lstsq(matrix[:, keep] * root, target * root, rcond=None)[0]
        left = np.linalg.norm(matrix @ shifts - target, axis=1)
        robust = 1.0 / (1.0 + (left / _FAR) ** 2)
    return shifts


def _pairs(count: int, reference: int) -> list[tuple[int, int]]:
    if count <= _EVERY:
        return [(i, j) for i in range(count) for j in range(i + 1, count)]
    near = {(i, (i + step) % count) for step in _STEPS for i in range(count)}
    return sorted(near | {(reference, i) for i in range(count) if i != reference})
