"""Captures written in the layout of the DiLiGenT benchmark."""

import os
import shutil
import tempfile
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from psstereo.camera import Pinhole
from psstereo.capture import Capture, Truth
from psstereo.errors import ExistingResultError, InputError, MissingFileError
from psstereo.io.layout_writer import (
    LayoutWriter,
    Save,
    camera_file,
    mask_file,
    numbers,
    rgb,
    sixteen_bits,
    text_file,
    three,
)
from psstereo.io.mat_file import write_mat
from psstereo.io.pictures import write_png
from psstereo.io.write_checks import distant_lights, require_integers, whole_dark
from psstereo.stack import ImageStack
from psstereo.types import Array, BoolArray, FloatArray

__all__ = ["DiligentWriter", "write_diligent"]


class DiligentWriter(LayoutWriter):
    """``filenames.txt``, 16-bit ``001.png …`` of three channels, lights, ``mask.png``, ``Normal_gt.mat``.

    Besides there are ``depth_gt.npz`` for a true depth, ``dark.png`` for a dark image and ``K.txt`` for a pinhole
    camera, which the benchmark itself [1]_ does not have.

    References
    ----------
    .. [1] B. Shi, Z. Mo, Z. Wu, D. Duan, S.-K. Yeung, P. Tan, "A Benchmark Dataset and Evaluation for Non-Lambertian
       and Uncalibrated Photometric Stereo", IEEE Trans. PAMI 41(2), 2019. doi:10.1109/TPAMI.2018.2799222
    """

    name: ClassVar[str] = "diligent"
    summary: ClassVar[str] = "001.png …, filenames.txt, light_directions.txt, light_intensities.txt, Normal_gt.mat"
    holds: ClassVar[frozenset[str]] = frozenset({"normals", "depth"})

    def check_images(self, capture: Capture) -> None:
        """Refuse what is not linear integers."""
        require_integers(capture, self.name)

    def image_name(self, index: int, stack: ImageStack) -> str:
        """See :meth:`LayoutWriter.image_name`."""
        del stack
        return f"{index + 1:03d}.png"

    def image_saver(self, stack: ImageStack) -> Callable[[Path, Array], None]:
        """See :meth:`LayoutWriter.image_saver`."""
        deep = sixteen_bits(stack)
        return lambda path, frame: write_png(path, rgb(deep(frame)))

    def left_out(self, capture: Capture, truth: Truth | None) -> tuple[str, ...]:
        """See :meth:`Writer.left_out`; three lights are written, but their file does not say which way it runs."""
        lost = super().left_out(capture, truth)
        if len(capture.rig) != 3:
            return lost
        return (*lost, "Three lights make a file of 3 × 3 numbers: read it with --lights-layout rows.")

    def parts(self, capture: Capture, truth: Truth | None) -> Mapping[str, Save]:
        """See :meth:`LayoutWriter.parts`."""
        directions, strengths = distant_lights(capture, self.name)
        names = [self.image_name(i, capture.stack) for i in range(len(capture.stack))]
        files: dict[str, Save] = {
            "filenames.txt": text_file(names),
            "light_directions.txt": text_file([numbers(row) for row in directions]),
            "light_intensities.txt": text_file([numbers(row) for row in three(strengths)]),
            "mask.png": mask_file(capture.effective_mask),
        }
        dark = whole_dark(capture, self.name)
        if dark is not None:
            save = self.image_saver(capture.stack)
            files["dark.png"] = lambda path: save(path, dark)
        if isinstance(capture.camera, Pinhole):
            files["K.txt"] = camera_file(capture.camera)
        if truth is not None and truth.normals is not None:
            normals = truth.normals
            files["Normal_gt.mat"] = lambda path: _write_normals(path, normals)
        if truth is not None and truth.depth is not None:
            depth = truth.depth
            files["depth_gt.npz"] = lambda path: _write_depth(path, depth)
        return files


def write_diligent(
    folder: str | os.PathLike[str],
    *,
    images: Array | Iterable[Array],
    directions: npt.ArrayLike,
    intensities: npt.ArrayLike,
    mask: BoolArray,
    normals: FloatArray | None = None,
    depth: FloatArray | None = None,
    compression: int = 3,
) -> None:
    """Write ``filenames.txt``, 16-bit ``001.png …``, lights, ``mask.png`` and what is known of the surface.

    Images of 8 bits are stretched to 16 (value · 257), gray ones get three equal channels. Lights are written with 17
    digits, so that they come back to the last bit. The folder appears whole or not at all.

    Parameters
    ----------
    folder : path
        Folder to write; it must not exist yet, or be empty.
    images : array (m, h, w, 3) or iterable of arrays (h, w), (h, w, 1) or (h, w, 3)
        Linear pixel values, uint16 or uint8, channels R, G, B; of an iterable one image is held at a time.
    directions : array (m, 3)
        Toward the lights, x right, y up, z toward the camera [1].
    intensities : array (m,) or (m, 3)
        Strengths of the lights by which the values are to be divided.
    mask : bool array (h, w)
        The object.
    normals : float array (h, w, 3), optional
        True normals, same frame, zero or NaN where unknown [1].
    depth : float array (h, w), optional
        True depth, NaN where unknown.
    compression : int
        PNG compression, 0 (none) to 9.

    Raises
    ------
    ExistingResultError
        If the folder exists and is not empty.
    MissingFileError
        If the folder above does not exist.
    InputError
        If counts, sizes or types do not fit each other.
    """
    target = Path(folder)
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise ExistingResultError(
            given=f"{target} exists already.",
            needed="A new or empty folder.",
            remedy="Remove it, or choose another name.",
        )
    if not target.parent.is_dir():
        raise MissingFileError(
            given=f"The folder {target.parent} does not exist.",
            needed="The capture is written into a folder that exists.",
            remedy="Create it first.",
        )
    rows, strengths = _lights(directions, intensities)
    marked = np.asarray(mask)
    if marked.dtype != np.bool_ or marked.ndim != 2:
        raise _wrong(f"The mask has the shape {marked.shape} and type {marked.dtype}.", "booleans (h, w)")
    partial = Path(tempfile.mkdtemp(prefix=f".{target.name}.", dir=target.parent))
    try:
        names = _write_images(partial, images, marked.shape, len(rows), compression)
        text_file(names)(partial / "filenames.txt")
        text_file([numbers(row) for row in rows])(partial / "light_directions.txt")
        text_file([numbers(row) for row in strengths])(partial / "light_intensities.txt")
        _write_png(partial / "mask.png", marked.astype(np.uint8) * np.uint8(255), compression)
        _write_surface(partial, marked.shape, normals, depth)
        partial.chmod(0o755)
        if target.is_dir():
            target.rmdir()
        partial.rename(target)
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def _lights(directions: npt.ArrayLike, intensities: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    rows, strengths = np.asarray(directions, np.float64), np.asarray(intensities, np.float64)
    strengths = np.repeat(strengths[:, None], 3, axis=1) if strengths.ndim == 1 else strengths
    strengths = np.repeat(strengths, 3, axis=1) if strengths.shape[1:] == (1,) else strengths
    if rows.ndim != 2 or rows.shape[1] != 3 or strengths.shape != rows.shape:
        raise _wrong(
            f"Directions have the shape {rows.shape} and intensities {strengths.shape}.", "(m, 3), and (m,) or (m, 3)"
        )
    if not (np.isfinite(rows).all() and np.isfinite(strengths).all()):
        raise _wrong("Light directions or intensities are not finite.", "finite numbers")
    return rows, strengths


def _write_images(
    folder: Path, images: Array | Iterable[Array], shape: tuple[int, ...], count: int, compression: int
) -> list[str]:
    names: list[str] = []
    for image in images:
        frame = np.asarray(image)
        frame = frame[..., None] if frame.ndim == 2 else frame
        if frame.shape[:2] != shape or frame.shape[2:] not in ((1,), (3,)) or frame.dtype not in (np.uint8, np.uint16):
            raise _wrong(
                f"Image {len(names) + 1} has the shape {frame.shape} and type {frame.dtype}; the mask, {shape}.",
                "uint8 or uint16 of the mask's size with one or three channels",
            )
        deep = frame.astype(np.uint16) * np.uint16(257) if frame.dtype == np.uint8 else frame
        deep = np.broadcast_to(deep, (*shape, 3))
        names.append(f"{len(names) + 1:03d}.png")
        _write_png(folder / names[-1], np.ascontiguousarray(deep[..., ::-1]), compression)
    if len(names) != count or count == 0:
        raise _wrong(f"There are {len(names)} images and {count} lights.", "one light for each image")
    return names


def _write_png(path: Path, pixels: Array, compression: int) -> None:
    import cv2

    if not 0 <= compression <= 9:
        raise _wrong(f"The PNG compression is {compression}.", "0 to 9")
    done, data = cv2.imencode(".png", pixels, [cv2.IMWRITE_PNG_COMPRESSION, compression])
    if not done:
        raise _wrong(f"An image of the shape {pixels.shape} could not be coded as PNG.", "a size that PNG can hold")
    data.tofile(path)


def _write_surface(folder: Path, shape: tuple[int, ...], normals: FloatArray | None, depth: FloatArray | None) -> None:
    if normals is not None:
        if normals.shape != (*shape, 3):
            raise _wrong(f"The normals have the shape {normals.shape}; the mask, {shape}.", "(h, w, 3)")
        _write_normals(folder / "Normal_gt.mat", normals)
    if depth is not None:
        if depth.shape != shape:
            raise _wrong(f"The depth has the shape {depth.shape}; the mask, {shape}.", "(h, w)")
        _write_depth(folder / "depth_gt.npz", depth)


def _write_normals(path: Path, normals: FloatArray) -> None:
    known = np.isfinite(normals).all(axis=2, keepdims=True)
    write_mat(path, {"Normal_gt": np.where(known, normals, 0.0).astype(np.float64)})


def _write_depth(path: Path, depth: FloatArray) -> None:
    np.savez_compressed(path, depth_gt=np.asarray(depth, np.float64))


def _wrong(given: str, needed: str) -> InputError:
    return InputError(given=given, needed=f"Needed are {needed}.", remedy="Correct the arguments of write_diligent.")
