"""The rig of lamps of a capture, out of arrays in any frame."""

import numpy as np

from psstereo.errors import RigError
from psstereo.io.conventions import to_canonical
from psstereo.lights import Led, Rig, StrengthUnit
from psstereo.types import FloatArray

__all__ = ["led_rig"]


def led_rig(
    *,
    positions: FloatArray,
    axes: FloatArray,
    mu: FloatArray,
    flux: FloatArray,
    frame: str,
    source: str,
    strength_unit: StrengthUnit = StrengthUnit.RELATIVE,
) -> Rig:
    """Build the rig in the canonical frame.

    Parameters
    ----------
    positions, axes : float array (m, 3)
        Where the lamps are [length] and their main directions [1].
    mu : float array (m,)
        Exponents of the lobes [1].
    flux : float array (m, c)
        Radiant intensities along the axes [W sr⁻¹], or relative.
    frame : str
        Convention of positions and axes, a key of :data:`psstereo.io.conventions.CONVENTIONS`.
    source : str
        File that they came from.
    strength_unit : StrengthUnit
        Unit of the fluxes.

    Returns
    -------
    Rig
        The lamps.

    Raises
    ------
    RigError
        If a lamp has a position, axis, exponent or flux that cannot be; the message names the file and the lamp.
    """
    points, turned = to_canonical(positions, frame), to_canonical(axes, frame)
    leds = []
    for i in range(len(points)):
        try:
            leds.append(Led(position=points[i], axis=turned[i], mu=float(mu[i]), flux=np.asarray(flux[i])))
        except RigError as error:
            raise RigError(
                given=f"{source}, lamp {i + 1}: {error.given}", needed=error.needed, remedy=error.remedy
            ) from None
    return Rig(tuple(leds), strength_unit, source)
