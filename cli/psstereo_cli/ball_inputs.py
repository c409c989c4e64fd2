"""From words to balls and their pictures: circles, clicks, masks, files of circles, or a search."""

import math
from pathlib import Path
from typing import TYPE_CHECKING

from psstereo.errors import InputError, MissingFileError, OptionError

if TYPE_CHECKING:
    from psstereo.calibrate.balls import Ball, BallPictures
    from psstereo.camera import Camera
    from psstereo.stack import FileStack, Response
    from psstereo.types import FloatArray

__all__ = ["ball_pictures", "parse_box"]

_OTHER = ("mask", "ref", "dark", "ambient", "flat", "outline")
"""Pictures beside those of the lights: names that begin or, after a point, end like this."""


def ball_pictures(
    folders: list[Path],
    words: list[str],
    *,
    origin: str,
    outlines: list[Path],
    corners: list[str],
    camera: "Camera",
    radius: float,
    response: "Response",
    dark: Path | None,
) -> tuple[list["BallPictures"], tuple[str, ...]]:
    """Return the pictures of each ball, and how it was found.

    Parameters
    ----------
    folders : list of Path
        One for all balls, or one a ball.
    words : list of str
        What was said of each ball; empty to look for masks and files of circles, and then for a ball.
    origin : str
        ``top-left`` or ``bottom-left``, of circles in numbers or files.
    outlines : list of Path
        Pictures in which outlines are seen, one for all or one a ball; empty for none.
    corners : list of str
        X,Y of each folder's first pixel in the whole frame; empty if nothing was cut out.
    camera : Camera
        Of the whole frame.
    radius : float
        True radius of the balls [length].
    response : Response
        Camera response to undo.
    dark : Path or None
        Picture without any of the lights.

    Returns
    -------
    pictures : list of BallPictures
        One entry a ball.
    notes : tuple of str
        A sentence on each.
    """
    from psstereo.calibrate.balls import BallPictures
    from psstereo.io.parts import read_dark
    from psstereo_cli.execution import parse_floats

    count = max(len(folders), len(words), 1)
    for what, given in (("folders", folders), ("--outline", outlines), ("--corner", corners)):
        if len(given) not in {0, 1, count} or (what == "folders" and not given):
            raise OptionError(
                given=f"{len(given)} {what} are given for {count} balls.",
                needed="One for all balls, or one for each.",
                remedy="Give as many as there are --ball options, in their order.",
            )
    if origin not in ("top-left", "bottom-left"):
        raise OptionError(
            given=f"The origin is {origin!r}.", needed="top-left or bottom-left.", remedy="Leave it out for top-left."
        )
    stacks = [_stack(folder) for folder in folders]
    pictures, notes = [], []
    for k in range(count):
        folder, stack = folders[k % len(folders)], stacks[k % len(folders)]
        x, y = parse_floats(corners[k % len(corners)], 2, "corner") if corners else (0.0, 0.0)
        level = None if dark is None else read_dark(dark, stack, response)
        plain = _Place(stack, _shifted(camera, x, y), radius, origin)
        said = words[k] if k < len(words) else None
        ball, note = plain.ball(said, folder, outlines[k % len(outlines)] if outlines else None)
        whole = _whole(ball, camera, x, y)
        pictures.append(BallPictures(stack=stack, ball=whole, corner=(x, y), response=response, dark=level))
        notes.append(f"Ball {k + 1} in {folder.resolve().name}: {note}")
    return pictures, tuple(notes)


def parse_box(words: str) -> tuple[int, int, int, int]:
    """Return four whole numbers: first column and row, last column and row."""
    from psstereo_cli.execution import parse_floats

    numbers = parse_floats(words, 4, "box X0,Y0,X1,Y1")
    if not all(math.isfinite(one) for one in numbers):
        raise OptionError(
            given=f"The box is {words!r}.",
            needed="Four finite numbers: first column and row, last column and row.",
            remedy="Count them in pixels from the top left, from 0.",
        )
    a, b, c, d = (round(one) for one in numbers)
    return a, b, c, d


class _Place:
    """Where a ball is looked for."""

    def __init__(self, stack: "FileStack", camera: "Camera", radius: float, origin: str) -> None:
        self.stack, self.camera, self.radius, self.origin = stack, camera, radius, origin

    def ball(self, said: str | None, folder: Path, outline: Path | None) -> tuple["Ball", str]:
        """Return the ball in the pictures' own columns and rows, and a sentence on it."""
        from psstereo.calibrate.balls import refine_outline

        picture = None if outline is None else _gray(outline, self.stack)
        found, note = self._rough(said, folder, picture, outline)
        if picture is not None and outline is not None and not note.startswith("found"):
            found = refine_outline(picture, found, name=outline.name)
            note += f", fitted to its outline in {outline.name}"
        x, y, r = found.seen
        error = float(found.covariance.diagonal().mean() ** 0.5)
        return found, f"{note}: x = {x:.2f}, y = {y:.2f}, r = {r:.2f} ± {error:.2g} px."

    def _rough(
        self, said: str | None, folder: Path, picture: "FloatArray | None", outline: Path | None
    ) -> tuple["Ball", str]:
        if said is None:
            said = _beside(folder) if outline is None else "auto"
        numbers = _numbers(said)
        if numbers is not None:
            return self._of_numbers(numbers, said), "given"
        if said == "auto":
            return self._searched(picture, outline)
        path = Path(said)
        if not said or not path.is_file():
            raise MissingFileError(
                given=f"The ball is given as {said!r}, which is neither numbers nor a file.",
                needed="x,y,r; or columns and rows of three clicks; a mask; a file with x, y and r; or auto.",
                remedy="Check the name, or write the numbers, such as 253.5,148,119.5.",
            )
        return self._of_file(path)

    def _of_numbers(self, numbers: tuple[float, ...], said: str, origin: str | None = None) -> "Ball":
        import numpy as np

        from psstereo.calibrate.balls import Ball, ball_from_points

        if len(numbers) != 3 and (len(numbers) < 6 or len(numbers) % 2):
            raise OptionError(
                given=f"The ball is given as {said!r}.",
                needed="Three numbers x,y,r; or column and row of three or more clicks on its outline.",
                remedy="Write it such as 253.5,148,119.5, or 134,148,253,28,372,148.",
            )
        values = np.array(numbers)
        places = values[:2] if len(values) == 3 else values.reshape(-1, 2)
        if (origin or self.origin) == "bottom-left":
            # Such files count from 1, and rows upward.
            places = places * np.array([1.0, -1.0]) + np.array([-1.0, float(self.stack.shape[1])])
        if len(values) == 3:
            return Ball(seen=np.array([*places, values[2]]), camera=self.camera, radius=self.radius)
        return ball_from_points(places, self.camera, radius=self.radius)

    def _of_file(self, path: Path) -> tuple["Ball", str]:
        from psstereo.calibrate.balls import ball_from_mask
        from psstereo.io.mask_file import read_mask
        from psstereo.io.text import read_table
        from psstereo.stack.decode import IMAGE_SUFFIXES

        if path.suffix.lower() in IMAGE_SUFFIXES:
            shape = (self.stack.shape[1], self.stack.shape[2])
            try:
                read_mask(path, shape)  # its refusals are about masks
            except InputError as error:
                remedy = "Paint the ball white in a mask of the pictures' size, or give the circle as x,y,r."
                raise type(error)(given=error.given, needed=error.needed, remedy=remedy) from None
            return ball_from_mask(_gray(path, self.stack), self.camera, radius=self.radius), f"masked by {path.name}"
        numbers = tuple(float(x) for x in read_table(path).values.ravel())
        # Circles in files are those of PSBox, whose origin is at the bottom left.
        return self._of_numbers(numbers, path.name, "bottom-left"), f"read from {path.name}"

    def _searched(self, picture: "FloatArray | None", outline: Path | None) -> tuple["Ball", str]:
        import numpy as np

        from psstereo.calibrate.balls import find_balls

        if picture is None:
            picture = np.max([self.stack.frame(i).mean(axis=-1) for i in range(len(self.stack))], axis=0)
        name = "the brightest of all pictures" if outline is None else outline.name
        found = find_balls(picture, 1, self.camera, radius=self.radius, name=name)[0]
        return found, f"found in {name}"


def _stack(folder: Path) -> "FileStack":
    from psstereo.io.parts import images_in
    from psstereo.stack import FileStack

    if not folder.is_dir():
        raise MissingFileError(
            given=f"{folder} is no folder.",
            needed="A folder with the pictures of the ball, one a light.",
            remedy="Check its name.",
        )
    files = tuple(
        path
        for path in images_in(folder)
        if not path.stem.lower().startswith(_OTHER) and not path.stem.lower().endswith(tuple(f".{x}" for x in _OTHER))
    )
    if not files:
        raise InputError(
            given=f"{folder} holds no pictures.",
            needed="The pictures of the ball, one a light.",
            remedy="Name the folder that holds them.",
        )
    return FileStack(files)


def _beside(folder: Path) -> str:
    """Return the mask or file of a circle that lies beside the pictures, else ``auto``."""
    from psstereo.io.parts import images_in

    masks = [path for path in images_in(folder) if path.stem.lower() == "mask" or path.stem.lower().endswith(".mask")]
    circle = folder / "circle_data.txt"
    if len(masks) == 1:
        return str(masks[0])
    return str(circle) if circle.is_file() else "auto"


def _numbers(said: str) -> tuple[float, ...] | None:
    try:
        return tuple(float(part) for part in said.split(","))
    except ValueError:
        return None


def _gray(path: Path, stack: "FileStack") -> "FloatArray":
    import numpy as np

    from psstereo.stack import FileStack

    one = FileStack((path,))
    if one.shape[1:3] != stack.shape[1:3]:
        raise InputError(
            given=f"{path.name} is {one.shape[2]} × {one.shape[1]} pixels; the pictures, {stack.shape[2]} × "
            f"{stack.shape[1]}.",
            needed="The same size, so that the ball is at the same place.",
            remedy="Cut it as the pictures were.",
        )
    return np.asarray(one.frame(0).mean(axis=-1), np.float64)


def _shifted(camera: "Camera", x: float, y: float) -> "Camera":
    from dataclasses import replace

    from psstereo.camera import Pinhole

    return replace(camera, cx=camera.cx - x, cy=camera.cy - y) if isinstance(camera, Pinhole) else camera


def _whole(ball: "Ball", camera: "Camera", x: float, y: float) -> "Ball":
    from dataclasses import replace

    return replace(ball.moved(x, y), camera=camera)
