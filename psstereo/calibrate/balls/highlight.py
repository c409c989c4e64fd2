"""The highlight of a lamp on a mirror ball, to a fraction of a pixel, with its error.

Seen along parallel rays a mirror ball shows equal solid angles of its surroundings on equal areas of the picture
(nearly so through a pinhole). The mean of the reflected rays, weighted by brightness, is then the middle of the lamp,
however large it looks and however far out on the ball it is; the mean of the *pixels* is not, since a ball squeezes
what it shows toward its rim. Streaks, flare and halos pull a mean about. A smooth window about as wide as the core
keeps them out, and how much other windows and levels move the mean is taken for its error.
"""

from dataclasses import dataclass

import numpy as np

from psstereo.calibrate.balls.ball import Ball, inside
from psstereo.calibrate.balls.mirror_ball import mirrored_pixels, reflected_rays
from psstereo.calibrate.viewing import Homogeneous
from psstereo.errors import InputError
from psstereo.types import BoolArray, FloatArray, IntArray

__all__ = ["Highlight", "find_highlight"]

_WITHIN = 0.985
"""Share of the radius that is looked at: what is farther out shows the lamps' reflections on the table."""
_FAINT = 8.0
"""Noise that the brightest place has to exceed, in standard deviations."""
_DARK = 0.02
"""Share of full scale that it has to exceed."""
_BROAD = 0.1
"""Share of the ball above half of the peak from which it is no mirror that is seen."""
_RIVAL = 0.5
"""Light of a second bright place, over that of the first, from which the two cannot be told apart."""
_WHITE = 0.98
"""Share of full scale from which a pixel counts as clipped."""
_CORE = 0.9
"""Share of the peak above which the core of a highlight lies."""
_WINDOW = 1.5
"""Standard deviation of the window, in radii of the core, and as many pixels more: a spot of a pixel needs its blur."""
_FLOOR = 0.02
"""Error that no picture beats: pixels are no points [px]."""
_BLOWN = 0.05
"""Error of a clipped highlight, whose middle is only that of its outline, in radii of its core."""
_ROUNDS = 60


@dataclass(frozen=True, kw_only=True, eq=False)
class Highlight:
    """Where a mirror ball shows a lamp.

    Attributes
    ----------
    pixel : float64 array (2,)
        Column and row [px].
    covariance : float64 array (2, 2)
        Of their errors [px²].
    peak : float
        Brightness above the ball's own, in the image's numbers [1].
    core : float
        Radius of a disc of the size of the core, or of what is clipped if that is more [px].
    clipped : int
        Pixels of it at full scale.
    rival : float
        Light of the second brightest place over that of this one [1].
    """

    pixel: FloatArray
    covariance: FloatArray
    peak: float
    core: float
    clipped: int
    rival: float


@dataclass(frozen=True, eq=False)
class _Patch:
    """The part of the picture with the ball: brightness above its own, columns, rows, and what can be seen in it."""

    light: FloatArray
    columns: FloatArray
    rows: FloatArray
    visible: BoolArray
    own: float
    noise: float


def find_highlight(image: FloatArray, ball: Ball, *, white: float, name: str = "the image") -> Highlight:
    """Find the highlight of one lamp on a mirror ball.

    Not for lamps that look large, such as windows and panels: beyond a tenth of the ball they are refused.

    Parameters
    ----------
    image : float array (h, w)
        Linear brightness.
    ball : Ball
        The ball.
    white : float
        Full scale; infinite if the image has none.
    name : str
        Of the image, for messages.

    Returns
    -------
    Highlight
        Its place, and how sure that is.

    Raises
    ------
    InputError
        If the ball is not in the picture, shows nothing bright, shows a bright patch as large as those of a matte ball,
        or two highlights of about the same light.
    """
    from scipy import ndimage

    patch = _patch(image, ball, name)
    smooth = ndimage.gaussian_filter(np.where(patch.visible, patch.light, 0.0), 1.0)
    peak = float(smooth.max(where=patch.visible, initial=0.0))
    scale = white if np.isfinite(white) else float(np.abs(image).max())
    if not peak > max(_FAINT * patch.noise / 2, _DARK * scale):
        raise InputError(
            given=f"On the ball in {name} nothing is brighter than {peak:.3g} above the ball's own "
            f"brightness (noise {patch.noise:.2g}, full scale {scale:.4g}).",
            needed="A mirror ball shows each lamp as a bright spot.",
            remedy="Check that the circle lies on the ball (its origin is the top left), that the lamp was on, and that"
            " the image belongs to this ball; a matte ball is for `psstereo calibrate matte`. Or leave the image out.",
        )
    spots, count = ndimage.label((smooth > 0.5 * peak) & patch.visible)
    main, rival = _spots(patch, spots, count)
    _require_single(patch, spots == main, rival, ball, name)
    first = (smooth > _CORE * peak) & (spots == main)
    if not first.any():
        first = spots == main
    return _located(patch, ball, first, spots == main, peak=peak, white=white, rival=rival)


def _patch(image: FloatArray, ball: Ball, name: str) -> _Patch:
    """Cut the ball out of an image."""
    mask = inside(ball, (image.shape[0], image.shape[1]), _WITHIN)
    size = int(np.count_nonzero(mask))
    if size < 50:
        raise InputError(
            given=f"The circle x = {ball.seen[0]:.1f}, y = {ball.seen[1]:.1f}, r = {ball.seen[2]:.1f} covers {size} "
            f"pixels of {name}, which is {image.shape[1]} × {image.shape[0]}.",
            needed="The ball must be in the picture and at least some ten pixels wide.",
            remedy="Check the circle: x counts columns from the left and y rows from the top, unless another origin is "
            "named.",
        )
    rows, columns = np.nonzero(mask)
    box = np.s_[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
    values, visible = image[box].astype(np.float64), mask[box] & np.isfinite(image[box])
    own = float(np.median(values[visible]))
    noise = 1.4826 * float(np.median(np.abs(values[visible] - own)))
    v, u = np.indices(values.shape, dtype=np.float64)
    return _Patch(values - own, u + columns.min(), v + rows.min(), visible, own, noise)


def _spots(patch: _Patch, spots: IntArray, count: int) -> tuple[int, float]:
    """Return the number of the spot with the most light, and the light of the second over its own."""
    light = np.bincount(spots.ravel(), np.where(patch.visible, patch.light, 0.0).ravel(), count + 1)
    light[0] = 0.0
    order = np.argsort(-light, kind="stable")
    return int(order[0]), float(light[order[1]] / light[order[0]]) if count > 1 else 0.0


def _require_single(patch: _Patch, spot: BoolArray, rival: float, ball: Ball, name: str) -> None:
    share = np.count_nonzero(spot) / np.count_nonzero(patch.visible)
    if share > _BROAD:
        raise InputError(
            given=f"The bright patch on the ball in {name} covers {100 * share:.0f} % of it.",
            needed=f"A mirror ball shows a lamp as a spot, below {100 * _BROAD:.0f} %.",
            remedy="Use `psstereo calibrate matte` for a matte ball; for a mirror, expose less or use a smaller lamp.",
        )
    if rival > _RIVAL:
        raise InputError(
            given=f"The ball in {name} shows two highlights, the second with {100 * rival:.0f} % of the first one's "
            "light.",
            needed="One lamp an image, so that it is clear which highlight belongs to it.",
            remedy="Switch other lamps off and cover windows, paint the other highlight black in the image, or leave "
            "the image out.",
        )


def _located(
    patch: _Patch, ball: Ball, first: BoolArray, spot: BoolArray, *, peak: float, white: float, rival: float
) -> Highlight:
    """Return the highlight around a core."""
    core = max(float(np.sqrt(np.count_nonzero(first) / np.pi)), 1.0)
    ring = reflected_rays(ball.camera, *ball.sphere, np.stack([patch.columns, patch.rows], axis=-1))[1]
    light = np.where(patch.visible & np.isfinite(ring[..., 0]), patch.light, 0.0)
    ring = np.nan_to_num(ring)
    start = np.array([patch.columns[first].mean(), patch.rows[first].mean()])
    width = _WINDOW * (core + 1.0)
    found = _windowed(patch, ball, light, ring, start=start, width=width)
    others = [_windowed(patch, ball, light, ring, start=start, width=factor * width) for factor in (2 / 3, 3 / 2)]
    others += [_mean(ball, np.where(spot & (light > level * peak), 1.0, 0.0), ring) for level in (0.5, 0.9)]
    drift = np.array([other - found for other in others if np.isfinite(other).all()])
    weight = _window(patch, found, width)
    total = float((weight * light).sum())
    distance = np.hypot(patch.columns - found[0], patch.rows - found[1])
    noise = patch.noise * float(np.sqrt(((weight * distance) ** 2).sum() / 2)) / total
    clipped = int(np.count_nonzero(spot & (patch.light + patch.own >= _WHITE * white))) if np.isfinite(white) else 0
    core = max(core, float(np.sqrt(clipped / np.pi)))
    blown = _BLOWN * core if clipped else 0.0
    variance = _FLOOR**2 + noise**2 + blown**2 + float((drift * drift).mean()) if drift.size else np.inf
    return Highlight(
        pixel=found,
        covariance=variance * np.eye(2),
        peak=peak,
        core=core,
        clipped=clipped,
        rival=rival,
    )


def _window(patch: _Patch, middle: FloatArray, width: float) -> FloatArray:
    square = (patch.columns - middle[0]) ** 2 + (patch.rows - middle[1]) ** 2
    return np.asarray(np.exp(-0.5 * square / (width * width)))


def _windowed(
    patch: _Patch, ball: Ball, light: FloatArray, rays: FloatArray, *, start: FloatArray, width: float
) -> FloatArray:
    """Return the place that is the middle of the light in a window around itself."""
    place = start
    for _ in range(_ROUNDS):
        moved = _mean(ball, _window(patch, place, width) * light, rays)
        if not np.isfinite(moved).all():
            break
        step = float(np.hypot(*(moved - place)))
        place = moved
        if step < 1e-4:
            break
    return place


def _mean(ball: Ball, weights: FloatArray, rays: FloatArray) -> FloatArray:
    """Return where the mean of the reflected rays is seen [px]."""
    total = np.einsum("ij,ijk->k", weights, rays)
    length = float(np.sqrt(total @ total))
    if not length > 0:
        return np.full(2, np.nan)
    centre, radius = ball.sphere
    lamp = Homogeneous(centre, total / length, np.array(0.0))
    return mirrored_pixels(ball.camera, centre, np.array(radius), lamp)
