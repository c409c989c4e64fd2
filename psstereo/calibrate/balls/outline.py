"""The outline of a ball: from clicks, from a mask, or found in the picture, to a fraction of a pixel.

The rays that touch a ball make a circular cone. With unit rays q of the outline, q · c is the same for all, which is
linear in c: a vector along the axis whose length is one over the cosine of the half angle. Under parallel projection
the same holds of a circle. Either fit is repeated with less weight for points that lie off it, as those of a stand do.
"""

import numpy as np

from psstereo.calibrate.balls.ball import Ball, outline_points
from psstereo.calibrate.viewing import pixel_rays, project
from psstereo.camera import Camera, Orthographic, Pinhole
from psstereo.errors import InputError
from psstereo.types import BoolArray, FloatArray

__all__ = ["ball_from_mask", "ball_from_points", "edge_points", "refine_outline"]

_ANGLES = 720
"""Places on the outline that are looked at."""
_REACH = 0.12
"""How far from the outline an edge is looked for, in radii."""
_CLEAR = 6.0
"""How much steeper than the picture beside it an edge has to be."""
_SUPPORT = 0.35
"""Share of the outline that has to show an edge."""
_SOFT = 1.0
"""Standard deviation of the smoothing before edges are looked for [px]."""
_AROUND = 8
"""What is smoothed beside the places that are looked at, more than the smoothing reaches [px]."""
_LEAST = 0.03
"""Standard error that no outline beats [px]."""


def ball_from_points(
    points: FloatArray, camera: Camera | None = None, *, sigma: float = 1.0, radius: float = 1.0
) -> Ball:
    """Return the ball whose outline runs through points, such as three clicks.

    Parameters
    ----------
    points : float array (n, 2)
        Columns and rows, three or more, spread along the outline [px].
    camera : Camera, optional
        What sees the ball; parallel projection in pixels if absent.
    sigma : float
        Standard error of a point across the outline; found from the points if they are eight or more [px].
    radius : float
        True radius of the ball, for a pinhole [length].

    Returns
    -------
    Ball
        The ball, with the covariance that follows.

    Raises
    ------
    InputError
        If there are fewer than three points, or they lie on a line, at one place, or along so short an arc that the
        circle is not told.
    """
    points = np.asarray(points, np.float64)
    if points.ndim != 2 or points.shape[1:] != (2,) or len(points) < 3 or not np.isfinite(points).all():
        raise InputError(
            given=f"The outline of a ball is given by an array of the shape {points.shape}.",
            needed="Three points or more, each a column and a row.",
            remedy="Click on three places of the outline, far apart from each other.",
        )
    camera = Orthographic() if camera is None else camera
    weights: FloatArray = np.ones(len(points))
    seen, gaps = _fit(points, weights, camera)
    if len(points) >= 8:
        for _ in range(20):
            scale = max(1.4826 * float(np.median(np.abs(gaps))), 1e-3)
            weights = 1.0 / (1.0 + (gaps / (2.385 * scale)) ** 2) ** 2
            seen, gaps = _fit(points, weights, camera)
        sigma = max(float(np.sqrt((weights * gaps * gaps).sum() / max(weights.sum() - 3, 1.0))), _LEAST)
    return _with_covariance(seen, points, weights, sigma=sigma, camera=camera, radius=radius)


def ball_from_mask(mask: FloatArray | BoolArray, camera: Camera | None = None, *, radius: float = 1.0) -> Ball:
    """Return the ball that is white in a mask.

    Parameters
    ----------
    mask : float or bool array (h, w)
        True or bright on the ball; soft edges tell the outline better than hard ones.
    camera : Camera, optional
        What sees the ball; parallel projection in pixels if absent.
    radius : float
        True radius of the ball, for a pinhole [length].

    Returns
    -------
    Ball
        The ball. Its errors are those of the outline's own raggedness, whose neighbours are not independent.

    Raises
    ------
    InputError
        If the mask is empty, or what is white in it is no disc.
    """
    from skimage.measure import find_contours

    values = np.pad(np.asarray(mask, np.float64), 1)
    top = float(values.max()) if np.isfinite(values).all() else 0.0
    contours = find_contours(values, 0.5 * top) if top > 0 else []  # type: ignore[no-untyped-call] # untyped package
    if not contours:
        raise InputError(
            given="The mask of the ball is empty.",
            needed="The ball must be white in it.",
            remedy="Paint the ball white, or give the circle as x,y,r.",
        )
    outline = max(contours, key=len)
    points = np.asarray(outline[:, ::-1] - 1.0)
    ball = ball_from_points(points, camera, radius=radius)
    gaps = _gaps(points, ball.seen, ball.camera)
    if float(np.median(np.abs(gaps))) > 0.03 * ball.seen[2]:
        raise InputError(
            given=f"What is white in the mask lies {np.median(np.abs(gaps)):.1f} px off the best circle, of the radius "
            f"{ball.seen[2]:.1f} px.",
            needed="A ball's mask is a disc.",
            remedy="Mask the ball alone, without its stand, or give the circle as x,y,r.",
        )
    return ball


def refine_outline(image: FloatArray, ball: Ball, *, name: str = "the image", reach: float = _REACH) -> Ball:
    """Fit a ball's outline to the edges of a picture near it.

    Not where the ball's rim is as dark as what is behind it, as in pictures of a mirror ball under one lamp: take one
    under room light.

    Parameters
    ----------
    image : float array (h, w)
        Brightness.
    ball : Ball
        Where the ball is, roughly.
    name : str
        Of the image, for messages.
    reach : float
        How far off the outline may be, in radii [1].

    Returns
    -------
    Ball
        The ball with the outline and covariance that the edges tell.

    Raises
    ------
    InputError
        If too little of the outline shows an edge.
    """
    share = 0.0
    for step in (reach, reach / 3):
        points, share = edge_points(image, ball, reach=max(step, 3.0 / float(ball.seen[2])))
        if share < _SUPPORT:
            break
        ball = ball_from_points(points, ball.camera, radius=ball.radius)
    if share < _SUPPORT:
        raise InputError(
            given=f"In {name}, {100 * share:.0f} % of the circle x = {ball.seen[0]:.1f}, y = {ball.seen[1]:.1f}, "
            f"r = {ball.seen[2]:.1f} show an edge.",
            needed=f"The outline of a ball must be seen along {100 * _SUPPORT:.0f} % of it.",
            remedy="Take a picture under room light before a plain background, name another circle, or give a mask.",
        )
    return ball


def edge_points(image: FloatArray, ball: Ball, *, reach: float) -> tuple[FloatArray, float]:
    """Return the places near an outline where the picture has an edge along it, and their share of the outline.

    Parameters
    ----------
    image : float array (h, w)
        Brightness.
    ball : Ball
        Where the ball is.
    reach : float
        How far off the outline may be, in radii [1].

    Returns
    -------
    points : float64 array (n, 2)
        Columns and rows [px].
    share : float
        Of the outline that has them, 0 to 1 [1].
    """
    from scipy.ndimage import gaussian_filter, map_coordinates

    angles = 2 * np.pi * np.arange(_ANGLES) / _ANGLES
    # Twice as far on either side as edges are looked for, and ten pixels at least: how rough the picture is there.
    wide = max(2.0 * reach, 10.0 / float(ball.seen[2]))
    scales = np.linspace(1.0 - wide, 1.0 + wide, 2 * max(int(np.ceil(4 * wide * ball.seen[2])), 12) + 1)
    places = outline_points(ball, angles, scales)
    part, corner = _part(image, places)
    soft = gaussian_filter(part, _SOFT)
    near = np.flatnonzero(np.abs(scales - 1.0) <= reach)
    height, width = image.shape
    inner = places[near]
    within = ((inner > 0) & (inner < np.array([width - 1, height - 1]))).all(axis=-1).all(axis=0)
    profile = map_coordinates(soft, [places[..., 1] - corner[1], places[..., 0] - corner[0]], order=1, mode="nearest")
    slope = np.abs(np.gradient(profile, axis=0))
    k = near[slope[near].argmax(axis=0)]
    columns = np.arange(_ANGLES)
    # An edge at the end of what is looked at is none.
    rough = np.maximum(np.median(slope, axis=0), 1e-9 * float(np.abs(soft).max()))
    good = within & (slope[k, columns] > _CLEAR * rough) & (k > near[0]) & (k < near[-1])
    k = np.clip(k, 1, len(scales) - 2)
    before, here, after = slope[k - 1, columns], slope[k, columns], slope[k + 1, columns]
    bend = before - 2 * here + after
    shift = np.where(bend < 0, 0.5 * (before - after) / np.where(bend < 0, bend, -1.0), 0.0)
    low, high = places[k - 1, columns], places[k + 1, columns]
    points = places[k, columns] + 0.5 * shift[:, None] * (high - low)
    return points[good], float(good.mean())


def _part(image: FloatArray, places: FloatArray) -> tuple[FloatArray, tuple[int, int]]:
    """Return the part of an image that places need, with what smoothing reaches, and its first column and row."""
    cuts = []
    for axis, size in enumerate(image.shape[::-1]):
        known = np.nan_to_num(places[..., axis])  # behind a pinhole is nowhere
        low, high = known.min(), known.max()
        first = int(np.clip(np.floor(low) - _AROUND, 0, max(size - _AROUND, 0)))
        cuts.append(slice(first, int(np.clip(np.ceil(high) + _AROUND, min(_AROUND, size), size))))
    return np.asarray(image[cuts[1], cuts[0]], np.float64), (cuts[0].start, cuts[1].start)


def _fit(points: FloatArray, weights: FloatArray, camera: Camera) -> tuple[FloatArray, FloatArray]:
    """Return the outline (3,) through weighted points, and how far they lie off it [px]."""
    root = np.sqrt(weights)
    if isinstance(camera, Pinhole):
        rays = pixel_rays(camera, points)[1]
        axis = _solve(root[:, None] * rays, root)
        length = float(np.sqrt(axis @ axis))
        if not length > 1.0:
            raise _untold(points)
        focal = float(np.sqrt(camera.fx * camera.fy))
        sine = float(np.sqrt((length - 1.0) * (length + 1.0))) / length
        seen = np.array([*project(camera, axis), focal * sine])
    else:
        middle = points.mean(axis=0)
        local = points - middle
        scale = float(np.abs(local).max()) or 1.0
        local = local / scale
        square = (local * local).sum(axis=1)
        design = np.concatenate([local, np.ones((len(local), 1))], axis=1)
        a, b, c = _solve(root[:, None] * design, root * square)
        seen = np.array([middle[0] + scale * a / 2, middle[1] + scale * b / 2, 0.0])
        seen[2] = scale * np.sqrt(max(c + (a * a + b * b) / 4, 0.0))
    if not (np.isfinite(seen).all() and 0 < seen[2] < 1e6):
        raise _untold(points)
    return seen, _gaps(points, seen, camera)


def _solve(design: FloatArray, side: FloatArray) -> FloatArray:
    found, _, rank, values = np.linalg.lstsq(design, side, rcond=None)
    if rank < 3 or values[-1] < 1e-7 * values[0]:
        raise _untold(design)
    return np.asarray(found)


def _untold(points: FloatArray) -> InputError:
    return InputError(
        given=f"No circle runs through the {len(points)} points of an outline: they lie on a line or at one place.",
        needed="Three points or more that are far apart on the outline.",
        remedy="Click on places a third of the way round from each other.",
    )


def _gaps(points: FloatArray, seen: FloatArray, camera: Camera) -> FloatArray:
    """Return how far points lie outside of an outline [px]."""
    if isinstance(camera, Pinhole):
        focal = float(np.sqrt(camera.fx * camera.fy))
        axis = pixel_rays(camera, seen[:2])[1]
        rays = pixel_rays(camera, points)[1]
        across = np.cross(rays, axis)
        sine = np.sqrt((across * across).sum(axis=-1))
        return np.asarray(focal * np.arctan2(sine, rays @ axis) - focal * np.arcsin(min(seen[2] / focal, 1.0)))
    return np.asarray(np.hypot(points[:, 0] - seen[0], points[:, 1] - seen[1]) - seen[2])


def _with_covariance(
    seen: FloatArray, points: FloatArray, weights: FloatArray, *, sigma: float, camera: Camera, radius: float
) -> Ball:
    """Return the ball with the covariance of a fit to points of one standard error."""
    step = 1e-4 * seen[2]
    slopes = np.stack(
        [
            (_gaps(points, seen + step * e, camera) - _gaps(points, seen - step * e, camera)) / (2 * step)
            for e in np.eye(3)
        ],
        axis=1,
    )
    normal = slopes.T @ (weights[:, None] * slopes)
    if np.linalg.cond(normal) > 1e10:
        raise _untold(points)
    # Neighbours on an edge err together: no outline counts for more than some thirty independent places.
    shared = max(1.0, float(weights.sum()) / 32.0)
    return Ball(seen=seen, covariance=sigma**2 * shared * np.linalg.inv(normal), camera=camera, radius=radius)
