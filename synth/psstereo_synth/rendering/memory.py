"""Refusing scenes that cannot fit into the machine, before it begins to swap."""

import os

import numpy as np

from psstereo.errors import InputError
from psstereo_synth.scenes import Scene

__all__ = ["require_memory"]

_GEOMETRY = 200
"""Points, normals, directions, depth and the work on one image, at least [byte a pixel]."""
_VISIBILITY = np.dtype(np.float32).itemsize


def require_memory(scene: Scene) -> None:
    """Refuse a scene whose images are larger than the machine's memory.

    Parameters
    ----------
    scene : Scene
        What is to be rendered.

    Raises
    ------
    InputError
        If they are, as far as the machine tells.
    """
    available = _physical()
    values = np.dtype(scene.sensor.dtype).itemsize * max(light.channels for light in scene.lights)
    pixels = scene.size[0] * scene.size[1] * len(scene.viewpoints)
    needed = pixels * (_GEOMETRY + len(scene.lights) * (values + _VISIBILITY))
    if available is not None and needed > available:
        raise InputError(
            given=f"{len(scene.lights)} images of {scene.size[1]} × {scene.size[0]} pixels from "
            f"{len(scene.viewpoints)} viewpoints take more than {needed / 1e9:.1f} GB.",
            needed=f"They have to fit into the machine's memory of {available / 1e9:.1f} GB.",
            remedy="Ask for a smaller size or for fewer lights.",
        )


def _physical() -> int | None:
    """Return the machine's memory, None if the system does not tell [byte]."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return None
