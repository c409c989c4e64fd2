"""Balls found in a picture without being told where: rough circles by their edges' votes, then each one's outline."""

import numpy as np

from psstereo.calibrate.balls.ball import Ball
from psstereo.calibrate.balls.outline import edge_points, refine_outline
from psstereo.camera import Camera, Orthographic, Pinhole
from psstereo.errors import InputError
from psstereo.types import FloatArray

__all__ = ["find_balls"]

_SIDE = 360
"""Longer side of the picture in which circles are voted for [px]."""
_SMALLEST = 0.04
"""Radius over the longer side below which a ball is too small to be of use."""
_CANDIDATES = 12
_NEAR = 0.06
"""How far votes are off, in radii."""
_SUPPORT = 0.4
"""Share of the outline with an edge that makes a circle a ball, when nobody says that it is one."""
_EVEN = 0.75
"""Share of these edges that have to lie on it."""


def find_balls(
    image: FloatArray, count: int = 1, camera: Camera | None = None, *, radius: float = 1.0, name: str = "the picture"
) -> tuple[Ball, ...]:
    """Find balls in a picture in which their outlines are seen.

    Not in pictures of mirror balls under one lamp in the dark, which show the highlight and little else, nor among
    other round things.

    Parameters
    ----------
    image : float array (h, w)
        Brightness.
    count : int
        How many balls to find.
    camera : Camera, optional
        What sees them; parallel projection in pixels if absent.
    radius : float
        True radius of the balls, for a pinhole [length].
    name : str
        Of the picture, for messages.

    Returns
    -------
    tuple of Ball
        The balls, from left to right.

    Raises
    ------
    InputError
        If there are fewer circles whose outlines show an edge along two fifths of them.
    """
    camera = Orthographic() if camera is None else camera
    found: list[tuple[float, Ball]] = []
    for x, y, r in _circles(image):
        try:
            ball = refine_outline(image, _rough(x, y, r, camera, radius), reach=_NEAR)
        except InputError:
            continue
        points, share = edge_points(image, ball, reach=_NEAR / 2)
        even = _evenness(points, ball)
        if share * even >= _SUPPORT and even >= _EVEN and not any(_same(ball, other) for _, other in found):
            found.append((share, ball))
    if len(found) < count:
        raise InputError(
            given=f"{len(found)} ball{'s were' if len(found) != 1 else ' was'} found in {name}; {count} "
            f"{'are' if count != 1 else 'is'} looked for.",
            needed=f"A ball's outline must be seen along {100 * _SUPPORT:.0f} % of it, and its radius be above "
            f"{100 * _SMALLEST:.0f} % of the picture's longer side.",
            remedy="Give the circle as x,y,r, three clicks on its outline, a mask, or a picture under room light.",
        )
    best = sorted(found, key=lambda one: -one[0])[:count]
    return tuple(sorted((ball for _, ball in best), key=lambda ball: float(ball.seen[0])))


def _circles(image: FloatArray) -> list[tuple[float, float, float]]:
    """Return rough circles, best first, each once although it may pass with few votes and with many."""
    import cv2

    values = np.nan_to_num(np.asarray(image, np.float64))
    low, high = np.percentile(values, [1, 99.5])
    if not high > low:
        return []
    factor = min(1.0, _SIDE / max(values.shape))
    gray = (255 * np.clip((values - low) / (high - low), 0, 1) ** 0.5).astype(np.uint8)
    size = (max(1, round(values.shape[1] * factor)), max(1, round(values.shape[0] * factor)))
    small = cv2.GaussianBlur(cv2.resize(gray, size, interpolation=cv2.INTER_AREA), (0, 0), 1.5)
    least = max(6, round(_SMALLEST * max(size)))
    circles: dict[tuple[float, float, float], None] = {}
    for votes in (0.9, 0.7, 0.5):
        got = cv2.HoughCircles(
            small, cv2.HOUGH_GRADIENT_ALT, 1.5, least, param1=150, param2=votes, minRadius=least, maxRadius=max(size)
        )
        if got is None:
            continue
        for x, y, r in np.asarray(got, np.float64).reshape(-1, np.shape(got)[-1])[:_CANDIDATES, :3]:
            circles[(x + 0.5) / factor - 0.5, (y + 0.5) / factor - 0.5, r / factor] = None
    return list(circles)


def _rough(x: float, y: float, r: float, camera: Camera, radius: float) -> Ball:
    limit = 0.9 * float(np.sqrt(camera.fx * camera.fy)) if isinstance(camera, Pinhole) else np.inf
    return Ball(seen=np.array([x, y, min(r, limit)]), camera=camera, radius=radius)


def _evenness(points: FloatArray, ball: Ball) -> float:
    """Return the share of edges that lie within one and a half pixels, or a hundredth of the radius, of the outline."""
    if not len(points):
        return 0.0
    off = np.abs(np.hypot(points[:, 0] - ball.seen[0], points[:, 1] - ball.seen[1]) - ball.seen[2])
    return float((off < max(1.5, 0.01 * ball.seen[2])).mean())


def _same(one: Ball, other: Ball) -> bool:
    gap = float(np.hypot(*(one.seen[:2] - other.seen[:2])))
    return gap < 0.5 * max(float(one.seen[2]), float(other.seen[2]))
