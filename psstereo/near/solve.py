"""From a capture under near lamps to normals, albedo and metric depth.

Where a lamp is near, the direction and strength of its light depend on where the surface is, and where the surface is
follows from the normals: neither comes first. Here they alternate [1]_. At a surface, every pixel has its own light
vectors and gets its normal by a robust fit; the normals are integrated; and the constants that integration leaves free
move to where the photometric energy is least, for fall-off tells how far the lamps are. The same at several image
sizes, coarse ones first, from the best of many distances. That fit is of Lambert's law; where it leaves more than
noise, :mod:`psstereo.near.reflectance` goes on with glossy materials.

References
----------
.. [1] Y. Quéau, B. Durix, T. Wu, D. Cremers, F. Lauze, J.-D. Durou, "LED-based Photometric Stereo: Modeling,
   Calibration and Numerical Solution", J. Math. Imaging Vis. 60, 2018. doi:10.1007/s10851-017-0761-1
"""

import time
from dataclasses import replace

import numpy as np

from psstereo.camera import Orthographic
from psstereo.capture import Capture
from psstereo.errors import InputError, OptionError
from psstereo.near.alternate import Alternation, Settled
from psstereo.near.assemble import Run, assemble
from psstereo.near.final import final_fit
from psstereo.near.lamps import lamp_array, lamp_fluxes, require_metric
from psstereo.near.level import Level, coarse_level, fine_level, image_factors, refined
from psstereo.near.options import NearOptions, NearResult, Round
from psstereo.near.reflectance import require_enough, settle_reflectance
from psstereo.near.search import find_distance, require_distance, require_lamps_outside
from psstereo.normals.memory import plan_memory
from psstereo.stack import Conversion, MemoryStore, PixelSet, SpillStore, gather, gray_weights
from psstereo.types import FloatArray, Map, Progress, no_progress

__all__ = ["solve_near"]

_ROUNDS_OF_WORK = 150
"""Rounds of reweighting that a typical run makes on the full image, the coarse ones included."""

_NEARLY_WHITE = 0.98
"""Share of full scale from which a value counts as saturated."""


def solve_near(
    capture: Capture,
    options: NearOptions | None = None,
    *,
    over: Map = map,
    progress: Progress = no_progress,
) -> NearResult:
    """Recover normals, albedo and metric depth from a capture under lamps at known positions.

    Cast shadows and narrow highlights are outvoted where enough lamps are left. From sixteen lamps on, surfaces that
    are not matte are taken for sums of exemplar materials where a sample of the pixels speaks for it. The relief must
    be moderate, below about a third of the distance to the lamps. The depth has the unit of the lamps' positions.

    Do not use it for lamps so far away that their light is parallel: nothing then tells the distance, and it is refused
    where its standard deviation exceeds a tenth of it. Give the distance and hold it, or use a solver for distant
    lights. Do not use it for brushed metal, hair or cloth, nor for metal under lamps of a narrow cone, whose distance
    and material look alike. Do not use it where the depth jumps: choose an integrator that can take that, or a mask for
    each piece.

    Parameters
    ----------
    capture : Capture
        Images, lamps (:class:`psstereo.lights.Led`), camera, mask; its dark image is subtracted.
    options : NearOptions, optional
        How.
    over : map-like
        Executes images and blocks of pixels, such as the ``map`` of a thread pool.
    progress : callable
        Told how far it is.

    Returns
    -------
    NearResult
        Normals, depth, and the rounds. Not converged if the full image's rounds met the limit.

    Raises
    ------
    UnsupportedError
        If lights are not all lamps, or the camera is of another kind than pinhole and orthographic.
    RigError
        If there are fewer than four lamps, all on a line, or inside or behind the object.
    InputError
        If images are black, sizes disagree, no pixel can be solved, or the light does not tell the distance.

    Examples
    --------
    >>> import numpy as np
    >>> from psstereo.camera import Pinhole
    >>> from psstereo.lights import Led, Rig
    >>> from psstereo.stack import MemoryStack
    >>> camera = Pinhole(fx=40, fy=40, cx=5.5, cy=5.5)
    >>> points = camera.points(np.full((12, 12), 300.0))
    >>> places = [[90, 0, 0], [-90, 0, 0], [0, 90, -20], [0, -90, -20], [60, 60, 10]]
    >>> lamps = [Led(position=np.array(s), axis=[0, 0, -1], mu=1.0, flux=1e5) for s in places]
    >>> images = [lamp.irradiance(points, np.array([0, 0, 1.0])) for lamp in lamps]
    >>> capture = Capture(stack=MemoryStack(np.stack(images)), rig=Rig(tuple(lamps)), camera=camera)
    >>> result = solve_near(capture, NearOptions(length_unit="mm"))
    >>> round(float(np.median(result.depth.depth)), 1), result.depth.unit
    (300.0, 'mm')
    """
    chosen = options or NearOptions()
    started = time.perf_counter()
    lamps = lamp_array(capture.rig)
    require_enough(chosen, len(lamps))
    require_metric(capture.camera)
    start = _start(capture, chosen)
    pixels = PixelSet.from_mask(capture.effective_mask)
    channels = gray_weights(chosen.gray, capture.stack.shape[3])
    conversion = _conversion(capture, channels.matrix, chosen)
    frames = (capture.dark is not None) + (capture.flat is not None)
    undoing = (0 if capture.response.is_linear else 8) + 8 * frames
    plan = plan_memory(capture.stack, pixels, len(channels.matrix), chosen.max_memory, chosen.workers, undoing=undoing)
    alternation = Alternation(
        lamps=lamps,
        integrator=chosen.integrator,
        hold=start if chosen.hold_distance else None,
        work=float(len(lamps)) * len(pixels) * _ROUNDS_OF_WORK,
        over=over,
    )
    with (MemoryStore if plan.in_memory else SpillStore)(plan.shape, plan.dtype) as store:
        largest = gather(capture.stack, pixels, conversion, store, over=over, progress=progress)
        _require_light(largest, capture.stack.names)
        read = time.perf_counter()
        fine = fine_level(store, capture.camera, capture.effective_mask, plan.tile)
        settled = _descend(alternation, fine, pixels, options=chosen, start=start, progress=progress)
        settled, reflectance = settle_reflectance(alternation, fine, pixels, settled, options=chosen, progress=progress)
        require_lamps_outside(lamps, fine.view, settled.q)
        require_distance(alternation, fine, settled)
        final = final_fit(alternation, fine, settled.q, settled.fit, reflectance)
    run = Run(
        capture=capture,
        options=chosen,
        pixels=pixels,
        plan=plan,
        gray=channels.name,
        valid=conversion.valid,
        reflectance=reflectance,
        seconds={"read": read - started, "solve": time.perf_counter() - read},
    )
    return assemble(run, fine.view, settled, final)


def _start(capture: Capture, options: NearOptions) -> float | None:
    """Return the value of q to begin with."""
    if options.distance is None:
        return None
    if isinstance(capture.camera, Orthographic):
        return options.distance
    if not options.distance > 0:
        raise OptionError(
            given=f"The distance is {options.distance}.",
            needed="The distance of a pinhole camera's object is a positive length.",
            remedy="Measure from the camera to the middle of the object, or leave it out to have it searched for.",
        )
    return float(np.log(options.distance))


def _conversion(capture: Capture, matrix: FloatArray, options: NearOptions) -> Conversion:
    stack = capture.stack
    flux = lamp_fluxes(capture.rig, stack.shape[3])
    valid = None
    if options.valid_range is not None:
        low, high = options.valid_range
        if not low < high:
            raise InputError(
                given=f"The valid range is {low} to {high}.",
                needed="The lower end must be below the upper one.",
                remedy="Give shares of full scale such as 0.01,0.98.",
            )
        valid = (low * stack.white, high * stack.white)
    elif options.saturation and stack.saturates:
        valid = (-np.inf, _NEARLY_WHITE * stack.white)
    # Fluxes of millions would make samples that float32 holds, but whose squares it does not: one common factor less.
    factors = matrix[None] * (flux.mean() / flux[:, None]) / stack.white
    return Conversion(factors=factors, response=capture.response, dark=capture.dark, flat=capture.flat, valid=valid)


def _require_light(largest: FloatArray, names: tuple[str, ...]) -> None:
    black = np.flatnonzero(~(largest > 0))
    if len(black):
        raise InputError(
            given=f"{names[black[0]]} shows nothing brighter than black under the mask"
            + (f", and neither do {len(black) - 1} others." if len(black) > 1 else "."),
            needed="Each lamp must light some part of the object.",
            remedy="Leave it out together with its lamp, or check the mask, the exposure and the dark image.",
        )


def _descend(
    alternation: Alternation,
    fine: Level,
    pixels: PixelSet,
    *,
    options: NearOptions,
    start: float | None,
    progress: Progress,
) -> Settled:
    """Find the distance on a coarse image, and refine the surface up to the full one."""
    factors = image_factors(len(pixels))
    level = fine if factors[0] == 1 else coarse_level(fine, pixels, fine.view.camera, factors[0])
    settled = find_distance(alternation, level, start, progress)
    q, rounds = settled.q, list[Round](settled.rounds)
    for number, factor in enumerate(factors):
        if number > 0:
            finer = fine if factor == 1 else coarse_level(fine, pixels, fine.view.camera, factor)
            q, level = refined(level, q, finer), finer
        tolerance = options.tolerance if factor == 1 else 3.0 * options.tolerance
        settled = alternation.run(level, q, tolerance=tolerance, limit=options.max_rounds)
        q = settled.q
        rounds.extend(settled.rounds)
        progress("alternating", number + 1, len(factors))
    return replace(settled, rounds=tuple(rounds))
