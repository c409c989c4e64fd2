"""The response of a capture from its own shading."""

import numpy as np

from psstereo.calibrate.response.fit import ResponseFit
from psstereo.calibrate.response.shading import response_from_shading
from psstereo.capture import Capture
from psstereo.errors import InputError
from psstereo.types import FloatArray, Map, Progress, no_progress

__all__ = ["response_of_capture"]

_PIXELS = 6000


def response_of_capture(capture: Capture, *, over: Map = map, progress: Progress = no_progress) -> ResponseFit:
    """Find the gamma curve under which Lambert's law fits a capture's photographs.

    Parameters
    ----------
    capture : Capture
        Photographs with known distant lights, at least five; values as the camera gave them.
    over : map-like
        Executes images.
    progress : callable
        Told how far reading and searching are.

    Returns
    -------
    ResponseFit
        The exponent and its error.

    Raises
    ------
    InputError
        If a response is undone already, values are floats without a full scale, or too few pixels are lit.
    UnsupportedError
        If a light is near, or no exponent fits.
    """
    stack = capture.stack
    if not capture.response.is_linear or not stack.saturates or capture.flat is not None:
        raise InputError(
            given=f"The values of {capture.name} are no longer as the camera gave them.",
            needed="Photographs with a full scale, without a response or a flat field that is undone.",
            remedy="Take the response and the flat field out of the description, and calibrate again.",
        )
    inside = np.flatnonzero(capture.effective_mask)
    chosen = inside[np.unique(np.linspace(0, len(inside) - 1, min(len(inside), _PIXELS)).astype(int))]
    m, _, _, channels = stack.shape
    values = np.zeros((channels, m, len(chosen)))

    def shares(index: int) -> FloatArray:
        return np.asarray(stack.frame(index).reshape(-1, channels)[chosen].T / stack.white, np.float64)

    for index, one in enumerate(over(shares, range(m))):
        values[:, index] = one
        progress("looking at images", index + 1, m)
    dark = None if capture.dark is None else capture.dark.reshape(-1, channels)[chosen].T / stack.white
    step = 1.0 / stack.white if stack.dtype.kind == "u" else 1e-4
    return response_from_shading(
        values,
        capture.rig.directions,
        capture.rig.strengths(channels),
        dark=dark,
        step=max(step, 1e-4),
        progress=progress,
    )
