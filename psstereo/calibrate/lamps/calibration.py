"""Axis, lobe and strength of lamps from a matte plane in a few poses.

A matte plane at known places shows ``I = ρ Φ max(0, a·d)^mu max(0, −d·n) / r²`` with d the unit vector from the lamp to
the point. Its logarithm is linear in ln Φ and mu for a given axis a, which gives a start from a fan of axes; the
rest is Gauss–Newton on brightness itself, in which noise is even.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt

from psstereo.calibrate.lamps.fit import LampFit, PlaneSamples, calibrate_lamp
from psstereo.errors import InputError
from psstereo.io.rig_file import RigQuality
from psstereo.lights import Rig
from psstereo.radiometry.checks import in_range
from psstereo.types import Progress, no_progress

__all__ = ["LampCalibration", "calibrate_lamps"]

_UNSURE_MU, _UNSURE_FLUX, _UNSURE_AXIS = 0.1, 0.05, np.radians(3.0)
"""Standard errors from which the verdict says so."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LampCalibration:
    """Lamps as a rig.

    Attributes
    ----------
    rig : Rig
        The lamps, in the order given.
    quality : RigQuality
        How far to trust them; `strength_error` is that of the flux along the axis.
    fits : tuple of LampFit
        Each lamp with its errors.
    """

    rig: Rig
    quality: RigQuality
    fits: tuple[LampFit, ...]


def calibrate_lamps(
    samples: Sequence[PlaneSamples],
    positions: npt.ArrayLike,
    *,
    brdf: float = 1.0,
    refine_positions: bool = False,
    same_mu: bool = False,
    progress: Progress = no_progress,
) -> LampCalibration:
    """Find axis, exponent and flux of lamps whose positions are known, one set of samples a lamp.

    Not for lamps nearer than about five of their diameters, nor for glossy planes, and not without poses at several
    distances or slants: one frontal plane hardly parts the lobe from the axis, which the errors show.

    Parameters
    ----------
    samples : sequence of PlaneSamples (m,)
        What the plane shows under each lamp, of all poses together.
    positions : float array (m, 3)
        Where the lamps are [length].
    brdf : float
        ρ of the plane, its albedo over π; fluxes are relative if it is left at 1 [sr⁻¹].
    refine_positions : bool
        Whether the brightness may move the lamps too, for positions known to some per cent of their distance.
    same_mu : bool
        Whether all lamps are of one make: their exponents become the mean by inverse variance, and fluxes follow.
    progress : callable
        Told how many lamps have been fitted.

    Returns
    -------
    LampCalibration
        Rig, quality, and each lamp with its errors.

    Raises
    ------
    InputError
        If a lamp lights too few samples, or numbers do not fit.
    """
    places = np.asarray(positions, np.float64)
    if places.shape != (len(samples), 3) or not np.isfinite(places).all() or not len(samples):
        raise InputError(
            given=f"Positions have the shape {places.shape}; samples are given for {len(samples)} lamps.",
            needed="One finite position x, y, z for each lamp.",
            remedy="Measure them, or triangulate them with two mirror balls.",
        )
    rho = float(in_range("BRDF of the plane", brdf, unit="sr⁻¹", exclude_low=True))
    fitted = partial(calibrate_lamp, brdf=rho, refine_position=refine_positions)
    fits = []
    for k, (one, place) in enumerate(zip(samples, places, strict=True)):
        progress("lamps", k, len(samples))
        fits.append(fitted(one, place, name=f"lamp {k + 1}"))
    progress("lamps", len(samples), len(samples))
    if same_mu and len(fits) > 1:
        weights = np.array([1.0 / max(fit.mu_error, 1e-9) ** 2 for fit in fits])
        mu = float((weights * [fit.lamp.mu for fit in fits]).sum() / weights.sum())
        for k, one in enumerate(samples):
            progress("lamps of one make", k, len(samples))
            fits[k] = fitted(one, fits[k].lamp.position, mu=mu, name=f"lamp {k + 1}")
        progress("lamps of one make", len(samples), len(samples))
    return LampCalibration(
        rig=Rig(tuple(fit.lamp for fit in fits), source="a matte plane in several poses"),
        quality=_quality(fits),
        fits=tuple(fits),
    )


def _quality(fits: Sequence[LampFit]) -> RigQuality:
    axis = np.array([fit.axis_error for fit in fits])
    mu = np.array([fit.mu_error for fit in fits])
    flux = np.array([float(fit.flux_error.max()) for fit in fits])
    residual = max(fit.residual for fit in fits)
    moved = [fit.position_covariance for fit in fits]
    advice = []
    if (mu > _UNSURE_MU).any() or (axis > _UNSURE_AXIS).any():
        worst = int(np.argmax(mu / _UNSURE_MU + axis / _UNSURE_AXIS))
        advice.append(
            f"Lamp {worst + 1} is told badly (mu ± {mu[worst]:.2g}, axis ± {np.degrees(axis[worst]):.2g}°): add poses"
            " that reach farther to the side of its beam."
        )
    if (flux > _UNSURE_FLUX).any():
        advice.append("Add poses at other distances: a strength is known to 5 % or worse.")
    if residual > 0.03:
        advice.append(
            "Check that the plane is matte and even, and that ambient light was subtracted: 3 % is unexplained."
        )
    return RigQuality(
        direction_error=axis,
        strength_error=flux,
        position_covariance=np.stack([one for one in moved if one is not None]) if moved[0] is not None else None,
        residual_brightness=residual,
        verdict=f"{len(fits)} lamps: axes to {np.degrees(axis.max()):.2g}°, mu to {mu.max():.2g}, fluxes to"
        f" {100 * flux.max():.2g} % (standard errors of the worst); the plane is explained to {100 * residual:.2g} %.",
        advice=tuple(advice),
    )
