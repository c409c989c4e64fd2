"""Every suite of the benchmark, by name."""

import importlib
from collections.abc import Callable
from typing import Any

__all__ = ["SUITES", "TAKE_A_FOLDER", "suite_named"]

SUITES = {
    "quick": "a little of everything in under a minute",
    "normals": "error against time of every solver, and error over noise, lights and the cone they fill",
    "accuracy": "error and time of the gates on scenes with known truth",
    "solvers": "error and time of every solver, matte, with noise and with highlights",
    "lights": "error of every solver under 4 to 96 lights",
    "coverage": "how often the true normal lies inside the 95 % region, over noise, lights and shadows",
    "reading": "a folder of 16-bit images against decoding its files alone, with the memory taken",
    "depth": "integrators on smooth surfaces, cliffs and rectangles, over sizes, and on normal maps with true depth",
    "sfs": "shape from one image: error and time of every method, over sizes, and on captures of the user",
    "matching": "error over numbers of lights, and error and time against OpenCV's StereoSGBM",
    "planner": "what the plan costs in error and time against every single configuration, scene by scene",
    "scaling": "growth of time with pixels, lights and iterations, as fitted slopes",
    "photographs": "every solver on captures of the user with true normals, as DiLiGenT's",
    "stress": "cruel cases: each within a bound fixed beforehand or its trouble told, in double and single precision",
    "forward": "rendering against writing the images, and against Mitsuba where it is installed",
}
"""What each measures; the module and the function of a suite have its name."""

TAKE_A_FOLDER = frozenset({"depth", "photographs", "planner", "sfs"})
"""Suites that measure on data of the user as well, and so take a `folder`."""


def suite_named(name: str) -> Callable[..., Any]:
    """Return the function that runs a suite.

    Parameters
    ----------
    name : str
        One of `SUITES`.

    Returns
    -------
    callable
        Takes rounds, size, lights, threads, a map and a callback for progress; returns records, the baseline's name,
        and what else is to be printed.

    Raises
    ------
    OptionError
        If it is unknown; with the known ones.
    """
    from psstereo.catalogue import choose

    choose(SUITES, name, "suite")
    run: Callable[..., Any] = getattr(importlib.import_module(f"psstereo_cli.suites.{name}"), name)
    return run
