"""Putting the answer together: images of normals, albedo and depth, and what they mean."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from psstereo.camera import Orthographic
from psstereo.capture import Capture
from psstereo.errors import InputError
from psstereo.flags import Flag, fatal_mask
from psstereo.lights import StrengthUnit
from psstereo.near.alternate import Settled
from psstereo.near.final import FinalFit
from psstereo.near.lamps import lamp_fluxes
from psstereo.near.options import NearOptions, NearResult
from psstereo.near.reflectance import Reflectance
from psstereo.near.view import View
from psstereo.normals.channels import combine_channels
from psstereo.normals.memory import MemoryPlan
from psstereo.results import AlbedoKind, DepthResult, NormalsResult, Outcome
from psstereo.stack import PixelSet
from psstereo.types import FlagArray, FloatArray

__all__ = ["Run", "assemble"]

_MILLIMETRES = ("led_positions_mm.txt", "led_params.txt", "light.mat")
"""Files of lamps whose makers write millimetres."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """What was solved and how.

    Attributes
    ----------
    capture : Capture
        What was measured.
    options : NearOptions
        How it was solved.
    pixels : PixelSet
        Pixels under the mask.
    plan : MemoryPlan
        Where the samples waited.
    gray : str
        How channels became one value.
    valid : (float, float) or None
        Raw values outside of which an observation was left out.
    reflectance : Reflectance
        What the surface was taken for.
    seconds : mapping
        Wall-clock seconds by stage [s].
    """

    capture: Capture
    options: NearOptions
    pixels: PixelSet
    plan: MemoryPlan
    gray: str
    valid: tuple[float, float] | None
    reflectance: Reflectance
    seconds: Mapping[str, float]


def assemble(run: Run, view: View, settled: Settled, final: FinalFit) -> NearResult:
    """Integrate the final normals at the distance that was found, and spread everything over the image.

    Parameters
    ----------
    run : Run
        What was solved and how.
    view : View
        Lines of sight of the full image.
    settled : Settled
        Where the alternation ended.
    final : FinalFit
        Normals at its surface.

    Returns
    -------
    NearResult
        The answer.

    Raises
    ------
    InputError
        If no pixel has a normal.
    """
    normals, albedo, uncertainty, flags = _combined(final)
    lost = int(np.count_nonzero(fatal_mask(flags)))
    if lost == len(flags):
        raise InputError(
            given="No pixel under the mask could be solved.",
            needed="Each pixel needs three lamps that reach it and do not lie in one plane with it.",
            remedy="Check that lamps and images are in the same order, or widen the valid range.",
        )
    with np.errstate(invalid="ignore"):
        flags[(normals * view.rays).sum(axis=1) >= 0] |= np.uint16(Flag.FACING_AWAY)
    depth = _depth(run, view, settled, normals)
    flags[np.isnan(depth.depth[view.mask]) & ~fatal_mask(flags)] |= np.uint16(Flag.NO_DEPTH)
    outcome = Outcome.PARTIAL if lost else Outcome.SOLVED
    if not settled.converged:
        flags |= np.uint16(Flag.NOT_CONVERGED)
        outcome = Outcome.NOT_CONVERGED
    kind, factor = _albedo_unit(run.capture)
    facts = {**_facts(run, settled, final), "pixels_lost": lost}
    scatter, dtype = run.pixels.scatter, run.plan.dtype
    result = NormalsResult(
        normals=scatter(normals.astype(dtype)),
        albedo=scatter((albedo * factor).astype(dtype)),
        uncertainty=scatter(uncertainty.astype(dtype)),
        flags=scatter(flags, int(Flag.OUTSIDE_MASK)),
        albedo_kind=kind,
        outcome=outcome,
        facts=facts,
        seconds=run.seconds,
    )
    return NearResult(normals=result, depth=depth, rounds=settled.rounds, facts=facts)


def _combined(final: FinalFit) -> tuple[FloatArray, FloatArray, FloatArray, FlagArray]:
    """Return normals, albedo, uncertainty and flags of the pixels under the mask."""
    if len(final.channels) > 1:
        normals, albedo, uncertainty, flags = combine_channels(final.channels)
        return normals, albedo, uncertainty, flags
    one = final.channels[0]
    length = np.sqrt((one.scaled * one.scaled).sum(axis=1))
    with np.errstate(invalid="ignore", divide="ignore"):
        return one.scaled / length[:, None], length, one.uncertainty, one.flags.copy()


def _depth(run: Run, view: View, settled: Settled, normals: FloatArray) -> DepthResult:
    """Return the depth that belongs to the final normals, each piece where the alternation had it."""
    found = run.options.integrator.integrate(view.image(normals), view.camera, mask=view.mask)
    labels = found.components[view.mask]
    values = view.coordinate(found.depth[view.mask])
    for label in range(1, int(labels.max()) + 1):
        piece = labels == label
        values[piece] += np.median(settled.q[piece] - values[piece])
    image = view.image(view.depth(values))
    return DepthResult(
        depth=image,
        kind=found.kind,
        unit=_unit(run),
        components=found.components,
        iterations=found.iterations,
        residual=found.residual,
        outcome=found.outcome if settled.converged else Outcome.NOT_CONVERGED,
        facts={
            **found.facts,
            "metric": True,
            "median_distance": float(np.nanmedian(image)),
            "distance_deviation": _deviation(view, settled),
            "rounds": [asdict(one) for one in settled.rounds],
        },
    )


def _deviation(view: View, settled: Settled) -> float:
    """Return the standard deviation of the whole surface's distance that the residuals predict [length]."""
    spread = settled.moved.spread
    return spread * float(np.median(view.depth(settled.q))) if view.central else spread


def _facts(run: Run, settled: Settled, final: FinalFit) -> dict[str, Any]:
    valid, white = run.valid, run.capture.stack.white
    return {
        "solver": "near-lamps",
        "gate": "auto" if run.options.saturation else "shadow",
        "gray": run.gray,
        "clip": None,
        "valid_range": None if valid is None else [value / white for value in valid],
        "lights": len(run.capture.rig),
        "light_condition": None,
        "light_source": run.capture.rig.source,
        "pixels": len(run.pixels),
        "samples_in": "memory" if run.plan.in_memory else "temporary file",
        "sample_bytes": run.plan.sample_bytes,
        "distance_given": run.options.distance,
        "distance_held": run.options.hold_distance,
        "rounds": len(settled.rounds),
        "energy": settled.energy,
        "relative_residual": final.residual,
        "relative_noise": final.noise,
        **run.reflectance.facts(),
        "pixels_glossy": final.glossy,
    }


def _albedo_unit(capture: Capture) -> tuple[AlbedoKind, float]:
    """Return what the albedo means, and the factor from samples over mean flux to it."""
    flux = float(lamp_fluxes(capture.rig, capture.stack.shape[3]).mean())
    if capture.radiance_at_white is not None and capture.rig.strength_unit is StrengthUnit.IRRADIANCE:
        return AlbedoKind.REFLECTANCE, np.pi * capture.radiance_at_white / flux
    return AlbedoKind.RELATIVE, 1.0 / flux


def _unit(run: Run) -> str:
    if run.options.length_unit is not None:
        return run.options.length_unit
    camera = run.capture.camera
    if isinstance(camera, Orthographic):
        return camera.unit
    return "mm" if run.capture.rig.source in _MILLIMETRES else "lamp units"
