"""Band-pass relief: heights of what is neither finer nor coarser than wanted, straight from normals."""

import math
from dataclasses import dataclass

import numpy as np

from psstereo.camera import Camera
from psstereo.depth.domain import Domain, make_domain
from psstereo.depth.edges import edge_steps
from psstereo.depth.footprint import distance_of, labels_of
from psstereo.depth.relief_band import ACCEPTED, Band, cut_steps, finer_steps
from psstereo.errors import InputError, OptionError
from psstereo.results import DepthKind, Outcome
from psstereo.types import BoolArray, FloatArray, IntArray, Progress, no_progress

__all__ = ["BandRelief", "relief_from_normals"]


@dataclass(frozen=True, kw_only=True, eq=False)
class BandRelief:
    """Heights of a band of wavelengths.

    Attributes
    ----------
    heights : float64 array (h, w)
        Toward the camera, along the optical axis, about the surface's coarse shape; NaN outside [`unit`].
    unit : str
        Unit of the heights and of the wavelengths.
    shortest, longest : float
        Wavelengths between which heights are kept; 0 for the first if nothing is too fine [`unit`].
    iterations : int
        Iterations of all linear solves together.
    residual : float
        The worst of their relative residuals [1].
    outcome : Outcome
        How the computation ended.
    """

    heights: FloatArray
    unit: str
    shortest: float
    longest: float
    iterations: int
    residual: float
    outcome: Outcome


def relief_from_normals(
    normals: FloatArray,
    camera: Camera,
    *,
    longest: float,
    shortest: float = 0.0,
    mask: BoolArray | None = None,
    components: IntArray | None = None,
    distance: float | FloatArray | None = None,
    unit: str | None = None,
    steepest: float = math.radians(80.0),
    threads: int = 1,
    progress: Progress = no_progress,
) -> BandRelief:
    r"""Return heights with wavelengths between two lengths, such as the strokes of an inscription.

    Depth from normals drifts over long distances, by errors that do not matter at all for what is written on the
    surface. Here the coarse shape never comes about: each linear system sees no farther than about the longest
    wavelength. With the Laplacian of the pixel grid L and t = L (L + λ)⁻¹ (a screened Poisson equation, λ = (2π / Λ)²
    in the limit of small pixels), a wave of wavelength ℓ keeps

        t(ℓ, Λ) = 1 / (1 + (ℓ / Λ)²),   s(t) = 3 t² − 2 t³,   transfer = s(t(ℓ, longest)) · (1 − s(t(ℓ, shortest)))

    of its amplitude and all of its phase: one half at either edge of the band, 0.90 twice and 0.97 three times as far
    inside, 0.10 and 0.03 as far outside, then falling with the fourth power. Between edges that are close together
    less is left: 0.81 in the middle of a band of 1 : 4, 0.96 of 1 : 10. Waves of eight pixels are right within 1 %,
    of five within 4 %, waves of three lose a quarter. A single groove has long waves too: of a width b at half its
    depth, it keeps 0.50 of the depth if `longest` is 4 b, 0.72 if 8 b, 0.85 if 17 b, and, measured from the rim that
    it gets instead, 0.70, 0.90 and 0.97.

    The first power of t is applied to the slopes, so that an inclined plane is taken away up to its borders. Where the
    coarse shape bends, the mask's border shows an error of about longest² / (50 · radius of the bend), twice that in
    corners; a sixth of it is left from longest / 5 to longest / 2. Silhouettes bend most: expect nothing right beside
    them.

    Wavelengths are measured across the optical axis, at the distance of the pixel: on a surface inclined by θ a wave
    appears shorter by cos θ along the slope, and heights along the normal are smaller by cos θ. The skew of a pinhole's
    pixels is not regarded in them.

    Do not use it for broad shape, which is taken away on purpose, nor on a mask narrower than `longest`. It reads
    normals at a jump of the depth for a slope; give `components` that are cut there.

    Parameters
    ----------
    normals : float array (h, w, 3)
        Normals, x right, y up, z toward the camera; NaN where unknown [1].
    camera : Camera
        The camera of the normal map.
    longest : float
        Longest wavelength to keep, four pixels or more [`unit`].
    shortest : float
        Shortest one, two pixels or more, below `longest`; 0 to keep all that is fine [`unit`].
    mask : bool array (h, w), optional
        Pixels wanted; all if left out.
    components : int array (h, w), optional
        Connected components; pixels of different ones are no neighbours, and 0 is left out.
    distance : float or float array (h, w), optional
        Distance along the optical axis, which central projection needs; NaN where unknown [`unit`].
    unit : str, optional
        Unit of `distance`, beside it only; heights of an orthographic camera are in the camera's unit.
    steepest : float
        Pixels whose normal is inclined to the ray by more are left out: their slopes are mostly noise [rad].
    threads : int
        Threads at most; the result does not depend on it.
    progress : callback, optional
        Told how many of the linear systems are solved.

    Returns
    -------
    BandRelief
        Heights, NaN at pixels left out.

    Raises
    ------
    InputError
        If shapes or types do not fit, no pixel can be used, or distance and camera do not belong together.
    OptionError
        If the wavelengths or the inclination are not such as said.

    Examples
    --------
    >>> import numpy as np
    >>> from psstereo.camera import Orthographic
    >>> x = np.arange(120.0)
    >>> slope = 0.3 + 0.01 * 2 * np.pi / 12 * np.cos(2 * np.pi * x / 12)   # a plane with waves of 0.01 mm
    >>> normals = np.broadcast_to(np.stack([-slope, 0 * x, 0 * x + 1], axis=-1), (5, 120, 3))
    >>> found = relief_from_normals(normals, Orthographic(pixel_size=1.0, length_unit="mm"), longest=60.0)
    >>> round(float(np.abs(found.heights[2, 48:72]).max()), 3)
    0.01
    """
    if not 0 < steepest < 0.5 * math.pi:
        raise OptionError(
            given=f"The steepest inclination is {steepest}.",
            needed="It must lie between 0 and a right angle.",
            remedy="Leave it out to use 80 degrees.",
        )
    domain = make_domain(normals, camera, mask, None)
    away = distance_of(domain, camera, distance, unit)
    if domain.kind is DepthKind.DISTANCE and distance is None:
        raise InputError(
            given="The camera is a pinhole, and no distance is given.",
            needed="Wavelengths on the surface need its distance.",
            remedy="Give the depth map or one distance, with its unit.",
        )
    wanted = domain.inside & _gentle(domain, steepest) & np.isfinite(away)
    if components is not None:
        wanted &= labels_of(np.ones(domain.shape, np.bool_), components)[domain.window] > 0
    if not wanted.any():
        raise InputError(
            given="No pixel has a normal that is not too steep, a distance and a component.",
            needed="At least one is needed.",
            remedy="Check the mask and the distance, or allow steeper pixels.",
        )
    band = Band.make(domain, away, wanted, shortest, longest, threads=threads, progress=progress)
    steps = edge_steps(domain, slant_exponent=0.0, threads=threads)
    values = band.run(finer_steps(cut_steps(steps, domain, wanted, components)))
    heights = np.full(domain.shape, np.nan)
    sense = -away if domain.kind is DepthKind.DISTANCE else 1.0
    heights[domain.window] = np.where(wanted, sense * values, np.nan)
    return BandRelief(
        heights=heights,
        unit=unit or camera.unit,
        shortest=shortest,
        longest=longest,
        iterations=band.iterations,
        residual=band.residual,
        outcome=Outcome.SOLVED if band.residual <= ACCEPTED else Outcome.NOT_CONVERGED,
    )


def _gentle(domain: Domain, steepest: float) -> BoolArray:
    """Return the pixels that are not inclined to their ray by more."""
    if domain.kind is not DepthKind.DISTANCE:
        return np.asarray(domain.normals[..., 2] >= math.cos(steepest))
    toward = -np.sum(domain.normals * domain.places, axis=-1)
    return np.asarray(toward >= math.cos(steepest) * np.linalg.norm(domain.places, axis=-1))
