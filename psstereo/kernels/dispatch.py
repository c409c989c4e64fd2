"""Choosing between a readable reference and its compiled twin."""

import importlib
from collections.abc import Callable
from typing import Any

__all__ = ["kernel"]


def kernel(name: str, function: str, work: float | None, break_even: float) -> Callable[..., Any]:
    """Return a hot loop, compiled if there is enough to do.

    Loading compiled code takes about half a second, which small work never earns back.

    Parameters
    ----------
    name : str
        Module of this package that holds the reference; its twin's name ends in ``_compiled``.
    function : str
        Name of the function, the same in both.
    work : float or None
        Samples to work on; None if not known, taken for little [1].
    break_even : float
        Samples from which the compiled twin is sooner done, loading included; measured, and written in the ledger [1].

    Returns
    -------
    callable
        Either of the two, with the same arguments and results.
    """
    compiled = work is not None and work >= break_even
    module = importlib.import_module(f"psstereo.kernels.{name}{'_compiled' if compiled else ''}")
    found: Callable[..., Any] = getattr(module, function)
    return found
