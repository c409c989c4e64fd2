"""Lights from mirror balls: outlines and highlights in, a rig with its errors and a verdict out."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from psstereo.calibrate.balls.highlight import Highlight, find_highlight
from psstereo.calibrate.balls.pictures import BallPictures, require_still
from psstereo.calibrate.balls.triangulate import Reach, Triangulation, triangulate_lamps
from psstereo.camera import Camera, Orthographic
from psstereo.errors import InputError
from psstereo.io.rig_file import RigQuality
from psstereo.lights import Led, Rig
from psstereo.types import FloatArray, Progress, no_progress

__all__ = ["MirrorCalibration", "calibrate_mirror_balls"]

_POOR = np.radians(1.0)
"""Error of a direction from which a larger ball is advised."""
_WIDE = 0.04
"""Radius of a highlight's clipped core over that of the ball from which another exposure is advised."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MirrorCalibration:
    """Lights that mirror balls have shown.

    Attributes
    ----------
    rig : Rig
        Directional lights, or lamps at positions if the balls tell them.
    quality : RigQuality
        How far to trust them.
    camera : Camera
        That the balls were seen by.
    lamps : Triangulation
        All that was found of the lamps.
    highlights : tuple of tuple of Highlight or None
        One row a picture, one entry a ball; None where a ball does not show a lamp.
    notes : tuple of str
        What was done and left out, a sentence each.
    """

    rig: Rig
    quality: RigQuality
    camera: Camera
    lamps: Triangulation
    highlights: tuple[tuple[Highlight | None, ...], ...]
    notes: tuple[str, ...]


def calibrate_mirror_balls(
    pictures: Sequence[BallPictures],
    *,
    strengths: npt.ArrayLike | None = None,
    reach: Reach | None = None,
    source: str = "mirror balls",
    progress: Progress = no_progress,
) -> MirrorCalibration:
    """Find the lights of a capture by the highlights on mirror balls.

    One ball gives directions. Two or more that stand apart give positions of lamps that are near, or the word that they
    cannot tell. A mirror ball tells nothing of strengths, since its highlights are clipped or depend on the lamp's
    size: measure those with a matte ball or a white card, or leave them to the object's own images. Not for lamps with
    a large face, nor for scratched or dented balls.

    Parameters
    ----------
    pictures : sequence of BallPictures
        One entry a ball, all with the same lights in the same order and the same camera. Balls that stand in the same
        pictures share a stack.
    strengths : array (m,) or (m, c), optional
        Of the lights at the middle of the balls, all 1 if absent [relative].
    reach : Reach, optional
        NEAR or DISTANT to decide it beforehand; the highlights decide if absent.
    source : str
        Where the balls came from, for the record.
    progress : callable
        Told how many pictures are done.

    Returns
    -------
    MirrorCalibration
        Lights, their errors, and what was seen.

    Raises
    ------
    InputError
        If a picture shows no highlight, two, or a patch; if a ball moved; if there is no ball, or numbers of pictures
        differ; if positions are asked for and a lamp is seen in one ball only or not in front of infinity.
    """
    _require_alike(pictures)
    stack = pictures[0].stack
    notes = [f"Ball {k + 1}: {require_still(one, progress)}" for k, one in enumerate(pictures)]
    rows = []
    for i in range(len(stack)):
        progress("highlights", i, len(stack))
        rows.append(_row(pictures, i, notes))
    progress("highlights", len(stack), len(stack))
    pixels = np.full((len(rows), len(pictures), 2), np.nan)
    covariance = np.tile(np.eye(2), (len(rows), len(pictures), 1, 1))
    for i, row in enumerate(rows):
        for k, one in enumerate(row):
            if one is not None:
                pixels[i, k] = one.pixel + np.array(pictures[k].corner)
                covariance[i, k] = one.covariance
    balls = tuple(one.ball for one in pictures)
    _require_positions(pixels, reach)
    lamps = triangulate_lamps(balls, pixels, covariance, reach=reach)
    if lamps.reach is Reach.NEAR and lamps.positions is not None and not np.isfinite(lamps.positions).all():
        raise _no_positions("a lamp came out behind infinity")
    rig = _rig(lamps, len(rows), strengths, source)
    quality = RigQuality(
        direction_error=lamps.direction_error,
        position_covariance=lamps.covariance,
        residual_angle=lamps.residual,
        verdict=_verdict(lamps, len(balls)),
        advice=_advice(lamps, pictures, rows),
    )
    return MirrorCalibration(
        rig=rig, quality=quality, camera=balls[0].camera, lamps=lamps, highlights=tuple(rows), notes=tuple(notes)
    )


def _require_alike(pictures: Sequence[BallPictures]) -> None:
    counts = [len(one.stack) for one in pictures]
    if not pictures or len(set(counts)) != 1:
        raise InputError(
            given=f"There are {len(pictures)} balls with {', '.join(map(str, counts)) or 'no'} pictures.",
            needed="One ball or more, each in one picture for each light.",
            remedy="Name folders of the same lights in the same order.",
        )
    if any(one.ball.camera != pictures[0].ball.camera for one in pictures):
        raise InputError(
            given="The balls are seen by different cameras.",
            needed="One camera, so that lamps have one frame.",
            remedy="Give the frame's camera to all of them, and the corner of each that is cut out of it.",
        )
    _require_apart([one.ball.seen for one in pictures])


def _require_apart(seen: Sequence[FloatArray]) -> None:
    """Refuse balls of which one would hide the middle of the other: it is one ball twice, or corners are missing."""
    for k, one in enumerate(seen):
        for i in range(k):
            apart = float(np.hypot(*(one[:2] - seen[i][:2])))
            if apart < max(one[2], seen[i][2]):
                raise InputError(
                    given=f"Balls {i + 1} and {k + 1} are {apart:.4g} px apart in the frame, less than the radius of "
                    f"{max(one[2], seen[i][2]):.4g} px.",
                    needed="Balls at different places of one frame, none before the other.",
                    remedy="Name each ball once; for pictures cut out of the frame, say where each was (--corner X,Y).",
                )


def _row(pictures: Sequence[BallPictures], index: int, notes: list[str]) -> tuple[Highlight | None, ...]:
    """Return the highlights of one light; the first ball's reason is told if there is none in any."""
    row: list[Highlight | None] = []
    reasons: list[InputError] = []
    for k, one in enumerate(pictures):
        white = one.stack.white if one.stack.saturates else np.inf
        try:
            row.append(find_highlight(one.gray(index), one.local, white=white, name=one.stack.names[index]))
        except InputError as error:
            reasons.append(error)
            row.append(None)
            notes.append(f"Ball {k + 1} was left out of picture {index + 1}: {error.given}")
    if len(reasons) == len(pictures):
        raise reasons[0]
    return tuple(row)


def _require_positions(pixels: FloatArray, reach: Reach | None) -> None:
    twice = np.isfinite(pixels[..., 0]).sum(axis=1) >= 2
    if reach is Reach.NEAR and not twice.all():
        raise _no_positions(f"light {int(np.flatnonzero(~twice)[0]) + 1} is seen in one ball only")


def _no_positions(why: str) -> InputError:
    return InputError(
        given=f"Positions of the lamps are asked for, but {why}.",
        needed="Each lamp must be seen in two balls that stand apart, and rays must meet in front of them.",
        remedy="Ask for directions, or put the balls farther apart.",
    )


def _rig(lamps: Triangulation, count: int, strengths: npt.ArrayLike | None, source: str) -> Rig:
    distant = Rig.distant(lamps.directions, strengths, source=source)
    if lamps.positions is None:
        return distant
    channels = distant.lights[0].channels
    arms = lamps.positions - lamps.middle
    square = (arms * arms).sum(axis=1)
    each = distant.strengths(channels)
    # The lobe is not told by mirror balls: as strong in every direction, and as strong in the middle as was given.
    leds = [
        Led(position=lamps.positions[i], axis=-lamps.directions[i], mu=0.0, flux=each[i] * square[i])
        for i in range(count)
    ]
    return Rig(tuple(leds), source=source)


def _verdict(lamps: Triangulation, balls: int) -> str:
    error = np.degrees(np.sqrt((lamps.direction_error**2).mean()))
    count = len(lamps.directions)
    start = f"{count} light{'s' * (count != 1)}, directions within ±{error:.2g}° (root mean square)"
    if balls == 1:
        return f"{start}, as one ball tells them; whether the lamps are near, one ball cannot tell."
    apart = "" if lamps.residual is None else f" The balls disagree by {np.degrees(lamps.residual):.2g}°."
    chance = "" if lamps.probability is None else f" (probability {lamps.probability:.2g} that chance does that)"
    if lamps.reach is Reach.NEAR and lamps.positions is not None and lamps.weakest_error is not None:
        distance = np.sqrt(((lamps.positions - lamps.middle) ** 2).sum(axis=1))
        share = np.median(lamps.weakest_error / distance)
        between = f"{distance.min():.4g} to {distance.max():.4g}"
        return (
            f"{start}: the balls see near lamps{chance}, {between} away; their distance"
            f" is known worst, ±{100 * share:.2g} %.{apart}"
        )
    if lamps.reach is Reach.DISTANT and lamps.least_distance is not None:
        beyond = lamps.least_distance / lamps.spread
        return f"{start}: the lamps are distant, beyond {beyond:.3g} times the balls' spread.{apart}"
    if lamps.least_distance is None:
        return f"{start}; the balls share too few lamps to tell whether these are near."
    return (
        f"{start}: the balls cannot tell whether the lamps are near or far{chance}; all are beyond "
        f"{lamps.least_distance / lamps.spread:.2g} times the balls' spread.{apart}"
    )


def _advice(
    lamps: Triangulation, pictures: Sequence[BallPictures], rows: Sequence[Sequence[Highlight | None]]
) -> tuple[str, ...]:
    advice = []
    radius = min(float(one.ball.seen[2]) for one in pictures)
    # What balls disagree about beyond their own errors is not a matter of size.
    worst = float(np.sqrt((lamps.direction_error**2).mean())) / lamps.enlarged
    if worst > _POOR:
        advice.append(
            f"Ball too small: ±{np.degrees(worst):.1f}° at a radius of {radius:.0f} px; one twice as large in the "
            "picture halves that."
        )
    wide = [
        (one.core / pictures[k].ball.seen[2], i)
        for i, row in enumerate(rows)
        for k, one in enumerate(row)
        if one is not None and one.clipped > 0
    ]
    broad = [(share, i) for share, i in wide if share > _WIDE]
    if broad:
        share, i = max(broad)
        advice.append(
            f"Highlights are clipped, the widest core has {100 * share:.0f} % of the ball's radius (picture {i + 1}): "
            "expose less, so that its middle is told better."
        )
    if len(pictures) == 1:
        advice.append("A second ball, as far from the first as the object is large, tells whether the lamps are near.")
    elif lamps.reach is Reach.UNTOLD:
        advice.append("Put the balls farther apart, or use larger ones, to learn how far away the lamps are.")
    if len(pictures) > 1 and isinstance(pictures[0].ball.camera, Orthographic) and lamps.reach is not Reach.NEAR:
        advice.append(
            "The camera was taken for infinitely far away; if it is not, its own perspective hides that lamps are near:"
            " give its matrix."
        )
    if lamps.enlarged > 2.0:
        advice.append(
            f"The balls disagree {lamps.enlarged:.1f} times as much as their highlights' errors: check the outlines."
        )
    return tuple(advice)
