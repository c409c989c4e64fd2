"""From a normal map of any origin to depth, mesh and flags, with a word on what stays free."""

import math
import time
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from psstereo.camera import Camera
from psstereo.depth.integrator import Integrator
from psstereo.depth.mesh import triangulate
from psstereo.depth.poisson import Poisson
from psstereo.depth.prior import Prior
from psstereo.depth.scale import with_distance
from psstereo.errors import InputError, OptionError, UnsupportedError
from psstereo.flags import Flag, fatal_mask
from psstereo.kernels.poisson_steps import unit_normals
from psstereo.results import DepthKind, DepthResult, Step
from psstereo.surface_mesh import SurfaceMesh
from psstereo.types import BoolArray, FlagArray, FloatArray, Progress, no_progress

__all__ = ["FreeConstants", "Integration", "free_constants", "integrate_normals", "mark_missing_depth", "prior_step"]

_FLOOR = 1e-3
"""Least uncertainty that is believed, as a share of the median: an error of exactly 0 would weigh infinitely."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Integration:
    """What comes of a normal map.

    Attributes
    ----------
    normals : float array (h, w, 3)
        Unit normals, NaN where there is none or the pixel is outside the mask [1].
    depth : DepthResult
        The depth.
    mesh : SurfaceMesh
        Its triangles.
    flags : uint16 array (h, w)
        Bits of :class:`psstereo.flags.Flag`.
    steps : tuple of Step
        What was done and what was left out.
    """

    normals: FloatArray
    depth: DepthResult
    mesh: SurfaceMesh
    flags: FlagArray
    steps: tuple[Step, ...]


@dataclass(frozen=True, kw_only=True)
class FreeConstants:
    """What normals alone do not tell about a depth map.

    Attributes
    ----------
    kind : {"none", "offset", "scale"}
        What may be added to the heights of a component, or multiplied with its distances.
    count : int
        Number of such constants.
    sentence : str
        The same for a person.
    """

    kind: Literal["none", "offset", "scale"]
    count: int
    sentence: str


def integrate_normals(
    normals: FloatArray,
    camera: Camera,
    integrator: Integrator | None = None,
    *,
    mask: BoolArray | None = None,
    uncertainty: FloatArray | None = None,
    prior: Prior | None = None,
    distance: float | None = None,
    unit: str = "mm",
    progress: Progress = no_progress,
) -> Integration:
    """Integrate a normal map and say of each pixel what became of it.

    Parameters
    ----------
    normals : float array (h, w, 3)
        Normals, x right, y up, z toward the camera; NaN or zero where unknown [1].
    camera : Camera
        The camera of the normal map.
    integrator : Integrator, optional
        Method; :class:`psstereo.depth.Poisson` if absent.
    mask : bool array (h, w), optional
        Pixels wanted; all if absent.
    uncertainty : float array (h, w), optional
        Root-mean-square angle between true and given normals; pixels weigh by its inverse square. Where it is NaN the
        largest known angle is taken, infinite ones are left out, and none counts as less than a thousandth of the
        median [rad].
    prior : Prior, optional
        Depth known beforehand. With `uncertainty`, the smallest angle of the usable pixels replaces ``prior.angle``.
    distance : float, optional
        Median distance, which settles the scale of a pinhole's depth [`unit`].
    unit : str
        Unit of `distance`.
    progress : callable
        Told how far the work is.

    Returns
    -------
    Integration
        Depth and what belongs to it.

    Raises
    ------
    InputError
        If nothing can be integrated, or an array does not fit; see :meth:`Integrator.integrate`.
    OptionError
        If both a prior and a distance are given.
    UnsupportedError
        If the integrator takes no prior, or a distance is given for an orthographic camera.
    """
    method = integrator or Poisson()
    _require_sense(camera, method, prior, distance)
    unit_length, known = _checked(normals, mask)
    facing = _facing(unit_length, known, camera)
    usable = facing if mask is None else facing & mask
    _require_overlap(prior, usable)
    weights: FloatArray | None = None
    if uncertainty is not None:
        weights, angle = _weights(np.asarray(uncertainty, np.float64), usable)
        prior = None if prior is None else replace(prior, angle=angle)
    started = time.perf_counter()
    depth = method.integrate(unit_length, camera, mask=mask, weights=weights, prior=prior, progress=progress)
    seconds = time.perf_counter() - started
    if distance is not None:
        depth = with_distance(depth, distance=distance, unit=unit)
    flags = _flags(known, facing, mask, depth)
    shown = np.where(fatal_mask(flags)[..., None], np.nan, unit_length)
    steps = [
        _weight_step(weights is not None),
        prior_step(prior, depth),
        Step(
            name=f"depth ({method.name})",
            done=True,
            reason=f"{depth.facts['pixels']} pixels; the camera is {camera.name}.",
            seconds=seconds,
        ),
    ]
    started = time.perf_counter()
    mesh = triangulate(depth.depth, camera, normals=shown, components=depth.components)
    size = f"{len(mesh.vertices)} vertices, {len(mesh.faces)} triangles."
    steps.append(Step(name="mesh", done=True, reason=size, seconds=time.perf_counter() - started))
    return Integration(normals=shown, depth=depth, mesh=mesh, flags=flags, steps=tuple(steps))


def free_constants(depth: DepthResult) -> FreeConstants:
    """Say what normals alone have left open about a depth map, and what its numbers are therefore worth.

    Parameters
    ----------
    depth : DepthResult
        Of an integrator, perhaps scaled by :func:`psstereo.depth.with_distance`.

    Returns
    -------
    FreeConstants
        Kind, number and sentence.
    """
    count, facts = int(depth.components.max(initial=0)), depth.facts
    each = "the component" if count == 1 else f"each of the {count} components"
    lost = facts.get("left_out", {}).get("no_prior")
    if lost is not None:
        rest = f" {lost} pixels of components that it does not touch have none." if lost else ""
        return FreeConstants(kind="none", count=0, sentence=f"The prior settles the depth, in {depth.unit}.{rest}")
    if depth.kind is DepthKind.HEIGHT:
        sentence = f"The height offset of {each} is free (mean 0); heights are known in {depth.unit} but for that."
        return FreeConstants(kind="offset", count=count, sentence=sentence)
    median = facts.get("median_distance")
    if median is None:
        sentence = f"The distance scale of {each} is free (geometric mean 1); distances are relative."
        return FreeConstants(kind="scale", count=count, sentence=sentence)
    sentence = f"The median distance, {median:g} {depth.unit}, settles the scale."
    if count > 1:
        sentence += f" How the distances of the {count} components lie to each other stays free."
    return FreeConstants(kind="scale" if count > 1 else "none", count=count - 1, sentence=sentence)


def mark_missing_depth(flags: FlagArray, depth: FloatArray) -> FlagArray:
    """Return flags with NO_DEPTH on pixels inside the mask whose depth is NaN.

    Parameters
    ----------
    flags : uint16 array (h, w)
        Bits of :class:`psstereo.flags.Flag`.
    depth : float array (h, w)
        Depth, NaN where there is none.

    Returns
    -------
    uint16 array (h, w)
        A copy.
    """
    missing = np.isnan(depth) & ((flags & np.uint16(Flag.OUTSIDE_MASK)) == 0)
    return np.asarray(flags | np.where(missing, np.uint16(Flag.NO_DEPTH), np.uint16(0)), np.uint16)


def prior_step(prior: Prior | None, depth: DepthResult) -> Step:
    """Say what a prior did.

    Parameters
    ----------
    prior : Prior or None
        What was known beforehand.
    depth : DepthResult
        What it was fused into.

    Returns
    -------
    Step
        For the record.
    """
    if prior is None:
        return Step(name="prior", done=False, reason="No depth was known beforehand.")
    used = np.isfinite(prior.depth) & np.isfinite(depth.depth)
    error = f"{float(np.median(np.asarray(prior.sigma))):.4g} {prior.unit}"
    off = float(np.sqrt(np.mean((depth.depth[used] - prior.depth[used]) ** 2)))
    reason = (
        f"{np.count_nonzero(used)} pixels have a depth known to {error}; the normals count as known to"
        f" {math.degrees(prior.angle):.3g}°. Root-mean-square difference: {off:.4g} {prior.unit}."
    )
    return Step(name="prior", done=True, reason=reason)


def _require_sense(camera: Camera, method: Integrator, prior: Prior | None, distance: float | None) -> None:
    """Refuse before the work what would be refused after it."""
    if prior is not None and not method.takes_prior:
        raise UnsupportedError(
            given=f"The integrator {method.name} was given a prior depth.",
            needed="It can work from normals alone only.",
            remedy="Use the integrator poisson, or leave the prior out.",
        )
    if distance is None:
        return
    if prior is not None:
        raise OptionError(
            given=f"Both a prior and the distance {distance:g} are given.",
            needed="Either of them settles the scale.",
            remedy="Leave the distance out.",
        )
    if camera.depth_kind is not DepthKind.DISTANCE:
        raise UnsupportedError(
            given=f"The distance {distance:g} is given for a camera that is {camera.name}.",
            needed="Only distances of a pinhole camera have a free scale.",
            remedy="Give the camera matrix K, or the size of a pixel instead of the distance.",
        )
    if not 0 < distance < math.inf:
        raise InputError(
            given=f"The distance is {distance:g}.",
            needed="It must be a positive length.",
            remedy="Measure from the camera to the middle of the surface, along the optical axis.",
        )


def _require_overlap(prior: Prior | None, usable: BoolArray) -> None:
    """Refuse a prior that knows nothing where there are normals; other sizes are told by the integrator."""
    known = None if prior is None else np.isfinite(prior.depth)
    if known is not None and known.shape == usable.shape and usable.any() and not (known & usable).any():
        raise InputError(
            given=f"The prior knows {np.count_nonzero(known)} pixels, none of which has a normal that can be used.",
            needed="At least one pixel with both.",
            remedy="Check that the prior belongs to these pixels, and that the mask leaves some of them in.",
        )


def _weight_step(done: bool) -> Step:
    reason = "Pixels weigh by their inverse variance." if done else "No uncertainty was given: all normals count alike."
    return Step(name="weights", done=done, reason=reason)


def _checked(normals: FloatArray, mask: BoolArray | None) -> tuple[FloatArray, BoolArray]:
    """Return unit normals, zero where there is none, and where there is one."""
    given, wanted = np.asarray(normals), None if mask is None else np.asarray(mask)
    fits = given.ndim == 3 and given.shape[2] == 3 and given.dtype.kind == "f" and given.size > 0
    if not fits or (wanted is not None and (wanted.shape != given.shape[:2] or wanted.dtype != np.bool_)):
        raise InputError(
            given=f"The normals have shape {given.shape} and type {given.dtype}"
            + ("." if wanted is None else f", the mask {wanted.shape} and {wanted.dtype}."),
            needed="Floating-point normals (h, w, 3), and true or false for each pixel.",
            remedy="Read both with psstereo.io, and use the mask that belongs to the normals.",
        )
    return unit_normals(given, 0, given.shape[0])


def _facing(unit: FloatArray, known: BoolArray, camera: Camera) -> BoolArray:
    """Return where there is a normal toward the camera."""
    return np.asarray(known & ((unit * camera.rays(known.shape)).sum(axis=-1) < 0))


def _weights(uncertainty: FloatArray, usable: BoolArray) -> tuple[FloatArray, float]:
    """Return inverse variances, and the standard error of each of the two angles of a pixel that counts most."""
    finite = uncertainty[np.isfinite(uncertainty)] if uncertainty.shape == usable.shape else np.zeros(0)
    if finite.size == 0 or (uncertainty < 0).any():
        raise InputError(
            given=f"The uncertainty has shape {uncertainty.shape}, {finite.size} angles that fit these normals, and "
            f"{np.count_nonzero(uncertainty < 0)} below zero.",
            needed=f"One angle for each of the {usable.shape} pixels, none negative and at least one known.",
            remedy="Use the uncertainty that belongs to these normals, or leave it out.",
        )
    typical = float(np.median(finite)) or float(finite.max()) or 1.0
    angles = np.maximum(np.where(np.isnan(uncertainty), finite.max(), uncertainty), _FLOOR * typical)
    least = float(np.min(angles, where=usable, initial=np.inf))
    least = least if math.isfinite(least) else typical
    return np.asarray((least / angles) ** 2), least / math.sqrt(2.0)


def _flags(known: BoolArray, facing: BoolArray, mask: BoolArray | None, depth: DepthResult) -> FlagArray:
    inside = np.ones(known.shape, np.bool_) if mask is None else np.asarray(mask)
    flags = np.zeros(known.shape, np.uint16)
    for where, flag in (
        (~inside, Flag.OUTSIDE_MASK),
        (inside & ~known, Flag.NOT_FINITE),
        (inside & known & ~facing, Flag.FACING_AWAY),
    ):
        flags[where] |= np.uint16(flag)
    return mark_missing_depth(flags, depth.depth)
