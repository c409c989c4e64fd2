"""Pictures of balls: linear gray images, cut out of a larger frame or not, and whether a ball stood still in them."""

from dataclasses import dataclass, field, replace

import numpy as np

from psstereo.calibrate.balls.ball import Ball
from psstereo.calibrate.balls.outline import ball_from_points, edge_points
from psstereo.camera import Pinhole
from psstereo.errors import InputError
from psstereo.stack import LINEAR, ImageStack, Response
from psstereo.types import FloatArray, Progress, no_progress

__all__ = ["BallPictures", "require_still"]

_REACH = 0.1
"""How far a ball is followed, in radii."""
_SUPPORT = 0.5
"""Share of the outline that a picture must show for its ball to be followed."""
_SIGMAS = 5.0
"""Standard errors that a ball must have moved to be called moved."""
_MOVED = 0.01
"""Radii that it must have moved besides: less hardly turns a direction by a degree."""
_PARTLY = 0.03
"""The same where less than `_WHOLE` of the outline is seen: what is seen of it, and how sharp, goes with the light."""
_WHOLE = 0.75
"""Share of the outline."""
_SEARCHED = 80.0
"""Radius at which a ball is looked for that is not where it should be [px]."""
_ALIKE = 0.05
"""How much its radius may differ from that of the ball to be taken for it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class BallPictures:
    """The pictures of one ball, one a light.

    Attributes
    ----------
    stack : ImageStack
        The pictures.
    ball : Ball
        The ball as the whole frame shows it.
    corner : (float, float)
        Column and row of the frame where the pictures' first pixel is, if they are cut out [px].
    response : Response
        Camera response to undo.
    dark : float array (h, w, c) or None
        Linear pixel values without any of the lights, to subtract.
    """

    stack: ImageStack
    ball: Ball
    corner: tuple[float, float] = (0.0, 0.0)
    response: Response = LINEAR
    dark: FloatArray | None = field(default=None)

    def __post_init__(self) -> None:
        if self.dark is not None and self.dark.shape != self.stack.shape[1:]:
            raise InputError(
                given=f"The dark image has the shape {self.dark.shape}; the pictures of the ball, "
                f"{self.stack.shape[1:]}.",
                needed="It must have their size and channels.",
                remedy="Take it with the same camera settings, or leave it out.",
            )

    @property
    def local(self) -> Ball:
        """The ball in the pictures' own columns and rows."""
        camera = self.ball.camera
        if isinstance(camera, Pinhole):
            camera = replace(camera, cx=camera.cx - self.corner[0], cy=camera.cy - self.corner[1])
        seen = self.ball.seen - np.array([*self.corner, 0.0])
        return replace(self.ball, seen=seen, camera=camera)

    def linear(self, index: int) -> FloatArray:
        """Return one picture as linear values, float64 (h, w, c), dark subtracted."""
        values = self.response.linearise(self.stack.frame(index), self.stack.white).astype(np.float64)
        return values if self.dark is None else values - self.dark

    def gray(self, index: int) -> FloatArray:
        """Return the mean of one picture's linear channels, (h, w)."""
        return np.asarray(self.linear(index).mean(axis=-1))


def require_still(pictures: BallPictures, progress: Progress = no_progress) -> str:
    """Refuse pictures in which the ball's outline is not always at the same place.

    Pictures that show too little of the outline are passed over, as most of a mirror ball under one lamp are, unless
    they show a ball of the same size within a radius. All are
    compared with their own median, not with the ball as it was given.

    Parameters
    ----------
    pictures : BallPictures
        The pictures.
    progress : callable
        Told how many pictures are done.

    Returns
    -------
    str
        A word on how many pictures were compared.

    Raises
    ------
    InputError
        If the outline of one is elsewhere by five standard errors and a hundredth of the radius, or three hundredths if
        less than three quarters of it are seen.
    """
    ball, names = pictures.local, pictures.stack.names
    followed = []
    for i in range(len(names)):
        progress("outlines", i, len(names))
        image = pictures.gray(i)
        followed.append((i, *_followed(image, ball)))
        if followed[-1][1] is None:
            _require_no_other_place(image, ball, names[i])
    progress("outlines", len(names), len(names))
    found = [(i, one, share) for i, one, share in followed if one is not None]
    if len(found) < 3:
        return f"The outline is seen in {len(found)} pictures, too few to tell whether the ball stood still."
    seen = np.array([one.seen for _, one, _ in found])
    shift = seen - np.median(seen, axis=0)
    sizes = np.hypot(shift[:, 0], shift[:, 1])
    errors = np.array([np.sqrt(np.trace(one.covariance[:2, :2])) for _, one, _ in found])
    limits = np.array([_MOVED if share >= _WHOLE else _PARTLY for _, _, share in found]) * ball.seen[2]
    moved = np.flatnonzero((sizes > _SIGMAS * errors) & (sizes > limits))
    if len(moved):
        worst = moved[sizes[moved].argmax()]
        raise _moved_away(names[found[worst][0]], shift[worst], len(moved) - 1)
    return (
        f"The outline is at the same place in {len(found)} pictures, to {np.sqrt((sizes**2).mean()):.2g} px "
        "(root mean square)."
    )


def _require_no_other_place(image: FloatArray, ball: Ball, name: str) -> None:
    """Refuse a picture that shows a ball of this size farther off than outlines are followed, but within a radius."""
    import cv2

    from psstereo.calibrate.balls.search import find_balls

    x, y, r = ball.seen
    left, top = max(int(x - 2.2 * r), 0), max(int(y - 2.2 * r), 0)
    part = image[top : max(int(y + 2.2 * r), 0), left : max(int(x + 2.2 * r), 0)]
    if min(part.shape) < r:
        return
    scale = min(1.0, _SEARCHED / r)  # a few pixels tell a tenth of a radius
    small = cv2.resize(part, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA) if scale < 1 else part
    try:
        other = find_balls(np.asarray(small, np.float64), 1)[0].seen
    except InputError:
        return
    shift = (other[:2] + 0.5) / scale - 0.5 + np.array([left - x, top - y])
    if abs(other[2] / scale / r - 1.0) < _ALIKE and _REACH * r < np.hypot(*shift) < r:
        raise _moved_away(name, shift, 0)


def _moved_away(name: str, shift: FloatArray, more: int) -> InputError:
    return InputError(
        given=f"In {name} the ball's outline is {shift[0]:+.1f} px to the right and {shift[1]:+.1f} px below its usual "
        "place" + (f", and in {more} more pictures elsewhere too." if more else "."),
        needed="Ball and camera must stand still from picture to picture.",
        remedy="Leave that picture out together with its light, or take the pictures again with both fixed.",
    )


def _followed(image: FloatArray, ball: Ball) -> tuple[Ball | None, float]:
    """Return the ball of one picture, None if too little of its outline is seen for that, and how much is."""
    points, share = edge_points(image, ball, reach=_REACH)
    if share < _SUPPORT:
        return None, share
    try:
        found = ball_from_points(points, ball.camera, radius=ball.radius)
    except InputError:
        return None, share
    off = np.abs(np.hypot(points[:, 0] - found.seen[0], points[:, 1] - found.seen[1]) - found.seen[2])
    share *= float((off < max(2.0, 0.01 * found.seen[2])).mean())
    return (found if share >= _SUPPORT else None), share
