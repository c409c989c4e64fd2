"""The lights as seen from the camera: each a dot in the disc that is the hemisphere's view from above."""

import html
from collections.abc import Sequence

import numpy as np

from psstereo.types import FloatArray

__all__ = ["light_plot"]

_SIZE = 300
_RADIUS = 130


def light_plot(directions: FloatArray, names: Sequence[str]) -> str:
    """Return the lights as SVG.

    Parameters
    ----------
    directions : float array (m, 3)
        Unit vectors toward the lights [1].
    names : sequence of str
        What the dots say when the pointer rests on them.

    Returns
    -------
    str
        ``<svg>…</svg>``: the middle is light from the camera, the rim light from the side; hollow dots are lights
        behind the surface.
    """
    middle = _SIZE / 2
    rings = "".join(
        f'<circle cx="{middle}" cy="{middle}" r="{_RADIUS * np.sin(np.radians(angle)):.1f}" class="ring"/>'
        f'<text x="{middle + 3}" y="{middle - _RADIUS * np.sin(np.radians(angle)) - 2:.1f}">{angle}°</text>'
        for angle in (30, 60, 90)
    )
    dots = []
    for place, (x, y, z) in enumerate(np.asarray(directions, np.float64)):
        label = html.escape(
            f"{place + 1}: {names[place]}, {np.degrees(np.arctan2(np.hypot(x, y), z)):.0f}° off the view"
        )
        kind = "light" if z > 0 else "light behind"
        dots.append(
            f'<circle cx="{middle + _RADIUS * x:.1f}" cy="{middle - _RADIUS * y:.1f}" r="4" class="{kind}">'
            f"<title>{label}</title></circle>"
        )
    return f'<svg viewBox="0 0 {_SIZE} {_SIZE}" width="{_SIZE}" height="{_SIZE}">{rings}{"".join(dots)}</svg>'
