"""Captures written in the layout of the DiLiGenT benchmark."""

import os
import shutil
import tempfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import numpy.typing as npt

from psstereo.errors import ExistingResultError, InputError, MissingFileError
from psstereo.types import Array, BoolArray, FloatArray

__all__ = ["write_diligent"]


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
        _write_text(partial / "filenames.txt", names)
        _write_text(partial / "light_directions.txt", [_numbers(row) for row in rows])
        _write_text(partial / "light_intensities.txt", [_numbers(row) for row in strengths])
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
        import scipy.io

        if normals.shape != (*shape, 3):
            raise _wrong(f"The normals have the shape {normals.shape}; the mask, {shape}.", "(h, w, 3)")
        known = np.isfinite(normals).all(axis=2, keepdims=True)
        scipy.io.savemat(folder / "Normal_gt.mat", {"Normal_gt": np.where(known, normals, 0.0).astype(np.float64)})
    if depth is not None:
        if depth.shape != shape:
            raise _wrong(f"The depth has the shape {depth.shape}; the mask, {shape}.", "(h, w)")
        np.savez_compressed(folder / "depth_gt.npz", depth_gt=np.asarray(depth, np.float64))


def _numbers(row: FloatArray) -> str:
    return " ".join(f"{value:.17g}" for value in row)


def _write_text(path: Path, lines: list[str]) -> None:
    # Meshroom loses the last line of a file that does not end in a line end.
    path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8", newline="\n")


def _wrong(given: str, needed: str) -> InputError:
    return InputError(given=given, needed=f"Needed are {needed}.", remedy="Correct the arguments of write_diligent.")
