"""Power through a tube: radiance times area times solid angle."""

import numpy as np

from psstereo.radiometry import disc_etendue, tube_power, tube_solid_angle
from psstereo_synth.lecture.example import Example
from psstereo_synth.lecture.statements import STATEMENTS

__all__ = ["tube"]

_RADIANCE = 1000.0
"""Of what is seen through the tube [W m⁻² sr⁻¹]."""
_SIZES = ((0.01, 1.0), (0.02, 1.0), (0.01, 2.0), (0.02, 4.0), (0.1, 1.0), (1.0, 1.0), (1.0, 0.1))
"""Radius and length of the tubes [m]."""
_THIN = 0.02
"""Largest radius over length of what is called a thin tube here [1]."""


def tube() -> Example:
    """Work out the power through round tubes, thin and wide.

    *Statement.* Look through a tube of radius r and length d at something of radiance L. The near end has the area
    A = π r²; from there the far end fills the solid angle Ω ≈ π r² / d²; and the power that comes through is

        Φ = L A Ω ≈ L π² r⁴ / d².

    Twice the radius gives sixteen times the power: four times as many places, from each of which four times as many
    directions lead out. Twice the length leaves a quarter. What is seen may stand at any distance, if it fills the
    tube's end.

    *Where it stops being true.* In a wide tube points off the axis see less than the middle does, and rays run
    aslant, so that L A Ω promises too much: by 5/4 (r/d)² at first, 53 % where r = d. The exact power is L times the
    étendue of the two ends. As d → 0 it tends to L A π, not to L A 2π: of the whole
    hemisphere an opening gets π L, the cosine's doing.

    Returns
    -------
    Example
        The error is that of L A Ω against the exact power, in tubes that are thin, r / d ≤ 0.02.
    """
    radius, length = np.array(_SIZES).T
    solid = tube_solid_angle(radius, length)
    power = tube_power(_RADIANCE, np.pi * radius**2, solid)
    exact = _RADIANCE * disc_etendue(radius, radius, length)
    excess = power / exact - 1.0
    error = float(np.max(np.abs(excess[radius / length <= _THIN])))
    tolerance = 1.25 * _THIN**2
    return Example(
        title="Power through a tube",
        statement=STATEMENTS["tube"],
        columns=("r [m]", "d [m]", "Ω [sr]", "L A Ω [W]", "L π² r⁴/d² [W]", "exact [W]", "L A Ω too large by [1]"),
        rows=tuple(
            zip(
                radius.tolist(),
                length.tolist(),
                solid.tolist(),
                power.tolist(),
                (_RADIANCE * np.pi**2 * radius**4 / length**2).tolist(),
                exact.tolist(),
                excess.tolist(),
                strict=True,
            )
        ),
        largest_error=error,
        tolerance=tolerance,
        holds=error <= tolerance,
        notes=(f"L = {_RADIANCE:g} W m⁻² sr⁻¹; thin: r / d ≤ {_THIN}",),
    )
