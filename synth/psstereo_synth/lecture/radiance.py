"""Radiance along a ray, measured through a tube."""

import numpy as np

from psstereo.radiometry import apparent_radiance, field_radius, transmittance, tube_solid_angle
from psstereo_synth.lecture.example import Example, largest_of, largest_relative
from psstereo_synth.lecture.radiometer import APERTURE, LENGTH, STOP, reading
from psstereo_synth.lecture.statements import STATEMENTS

__all__ = ["radiance"]

_LEVEL = 500.0
"""Radiance of wall and lamp [W m⁻² sr⁻¹]."""
_LAMP = 0.01
"""Radius of the lamp, which fills the field of view up to 8 m away [m]."""
_FOG = 0.02
"""Extinction [m⁻¹]."""
_DISTANCES = (1.0, 2.0, 5.0, 20.0, 50.0, 100.0, 200.0)
"""From the outer opening to the source [m]."""


def radiance() -> Example:
    """Measure a wall in clear air, the same wall in fog, and a lamp, from nearer and from farther.

    *Statement.* A radiometer looks through a tube. Twice as far from a wall, each patch of the wall sends it a quarter
    of the power, but four times as many patches are in view: the reading stays. Radiance belongs to the ray, and in
    clear air nothing along the ray changes it. Fog takes the same share out of every metre, so that
    exp(−σ d) is left (Beer and Lambert).

    *Where it stops being true.* The ray's radiance stays; the *reading* is a mean over the field of view, and once the
    source is smaller than that, the dark around it is part of the mean. Then the reading falls with the source's
    solid angle, as 1/d²: why stars are faint, though their surface is as bright as a sun's. And fog that is lit
    itself adds light to the ray, which exp(−σ d) knows nothing of.

    Returns
    -------
    Example
        The error is relative to the readings expected: L, L exp(−σ d), and L min(1, Ω / Ω_field). The tube is not
        infinitely thin, and (b/d)² = 1e-6 of it remains.
    """
    way = np.array(_DISTANCES)
    wide = (2.0 * field_radius(APERTURE, STOP, LENGTH, way)).tolist()
    wall = [reading(_LEVEL, size, s) for size, s in zip(wide, _DISTANCES, strict=True)]
    fog = [reading(_LEVEL, size, s, extinction=_FOG) for size, s in zip(wide, _DISTANCES, strict=True)]
    lamp = [reading(_LEVEL, _LAMP, s) for s in _DISTANCES]
    field = tube_solid_angle(STOP, LENGTH)
    share = tube_solid_angle(_LAMP, way + LENGTH) / field
    error = largest_of(
        largest_relative(wall, np.full(way.shape, _LEVEL)),
        largest_relative(fog, _LEVEL * transmittance(way + LENGTH, _FOG)),
        largest_relative(lamp, apparent_radiance(_LEVEL, share * field, field)),
    )
    # Rays aslant have a longer way through the fog: σ d (a + b)² / 2t² at most.
    tolerance = 2.0 * STOP**2 / LENGTH**2 + _FOG * max(_DISTANCES) * (APERTURE + STOP) ** 2
    return Example(
        title="Radiance along a ray",
        statement=STATEMENTS["radiance"],
        columns=(
            "distance [m]",
            "wall [W m⁻² sr⁻¹]",
            "wall in fog [W m⁻² sr⁻¹]",
            "L exp(−σ d)",
            "lamp [W m⁻² sr⁻¹]",
            "Ω lamp / Ω field",
        ),
        rows=tuple(
            zip(
                (way + LENGTH).tolist(),
                wall,
                fog,
                (_LEVEL * transmittance(way + LENGTH, _FOG)).tolist(),
                lamp,
                share.tolist(),
                strict=True,
            )
        ),
        largest_error=error,
        tolerance=tolerance,
        holds=error <= tolerance,
        notes=(f"L = {_LEVEL:g} W m⁻² sr⁻¹, σ = {_FOG:g} m⁻¹, field of view {float(field):.3e} sr",),
    )
