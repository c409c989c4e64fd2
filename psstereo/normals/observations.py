"""Observations that a person leaves out: a mask an image, or an edited stack of verdicts."""

import numpy as np

from psstereo.errors import InputError
from psstereo.normals.verdict import OUTSIDE, TAKING_PART, Verdict, VerdictArray
from psstereo.types import Array, BoolArray, IntArray

__all__ = ["checked_mask", "count_left_out", "may_take_part"]

_KNOWN = np.zeros(256, np.bool_)
_KNOWN[[*Verdict, OUTSIDE]] = True
_TAKES_PART = np.zeros(256, np.bool_)
_TAKES_PART[list(TAKING_PART)] = True


def checked_mask(mask: Array | None, shape: tuple[int, int, int]) -> BoolArray | VerdictArray | None:
    """Return a mask of observations with one row an image, or say why it is none.

    Parameters
    ----------
    mask : bool or uint8 array (m, h, w) or None
        True where an observation may take part; or verdicts.
    shape : (int, int, int)
        Images, rows and columns of the capture.

    Returns
    -------
    bool or uint8 array (m, h · w) or None
        A view.

    Raises
    ------
    InputError
        If it has another shape or type, or holds numbers that are no verdicts.
    """
    if mask is None:
        return None
    stack = np.asarray(mask)
    if stack.shape != shape or stack.dtype not in (np.dtype(np.bool_), np.dtype(np.uint8)):
        raise InputError(
            given=f"The observation mask has the shape {stack.shape} and the type {stack.dtype}.",
            needed=f"One entry an observation, {shape}: true or false, or a verdict as uint8.",
            remedy="Start from the verdicts that a run on the same images wrote with --verdicts.",
        )
    if stack.dtype == np.uint8:
        found = np.flatnonzero(np.logical_or.reduce([np.bincount(one.ravel(), minlength=256) > 0 for one in stack]))
        strange = [int(code) for code in found if not _KNOWN[code]]
        if strange:
            raise InputError(
                given=f"The observation mask holds {strange[0]}, which is no verdict.",
                needed=f"The codes {', '.join(f'{int(v)} {v.name}' for v in Verdict)}, and {OUTSIDE} outside.",
                remedy="Correct it, or give an array of true (may take part) and false.",
            )
    return stack.reshape(len(stack), -1)


def may_take_part(mask: BoolArray | VerdictArray) -> BoolArray:
    """Return which observations a mask or a stack of verdicts lets take part, of the same shape."""
    return np.asarray(mask if mask.dtype == np.bool_ else _TAKES_PART[mask], np.bool_)


def count_left_out(mask: BoolArray | VerdictArray, indices: IntArray) -> IntArray:
    """Return how many observations of each image are left out among some pixels.

    Parameters
    ----------
    mask : bool or uint8 array (m, h · w)
        As :func:`checked_mask` returns it.
    indices : int array (p,)
        The pixels.

    Returns
    -------
    int array (m,)
        Counts.
    """
    return np.array([len(indices) - np.count_nonzero(may_take_part(one[indices])) for one in mask], np.int64)
