"""The result folder: arrays for programs, pictures for people, and a record of how they came about."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from psstereo.errors import InputError, MissingFileError, UnreadableFileError
from psstereo.io.atomic import RECORD, new_folder
from psstereo.io.derived_files import Derived, write_derived
from psstereo.io.mesh_file import write_mesh
from psstereo.io.normal_map import write_normal_map
from psstereo.io.pictures import albedo_picture, depth_picture, write_png
from psstereo.io.verdict_files import write_verdicts
from psstereo.results import DepthKind, DepthResult, NormalsResult
from psstereo.surface_mesh import SurfaceMesh
from psstereo.types import Array, FlagArray, FloatArray

__all__ = ["SavedResult", "read_result", "write_integration", "write_result"]


@dataclass(frozen=True, kw_only=True, eq=False)
class SavedResult:
    """What a result folder holds.

    Attributes
    ----------
    normals : float array (h, w, 3)
        Unit normals, NaN where unknown [1].
    albedo : float array (h, w) or (h, w, c) or None
        Albedo.
    depth : float array (h, w) or None
        Depth; the record says of which kind and unit.
    record : mapping
        Content of ``run.json``.
    """

    normals: FloatArray
    albedo: FloatArray | None
    depth: FloatArray | None
    record: Mapping[str, Any]


def write_result(
    folder: Path,
    normals: NormalsResult,
    *,
    depth: DepthResult | None = None,
    mesh: SurfaceMesh | None = None,
    mesh_suffixes: Iterable[str] = (".ply", ".glb"),
    record: Mapping[str, Any],
    report: str | None = None,
    overwrite: bool = False,
) -> None:
    """Write a result folder; it appears whole or not at all.

    Parameters
    ----------
    folder : Path
        Where; it must be new, empty, or with `overwrite` an earlier result.
    normals : NormalsResult
        Becomes ``normals.npy``, ``albedo.npy``, ``uncertainty.npy`` [deg], ``flags.npy``; two pictures. Verdicts
        become ``verdicts.npz`` and the folder ``verdicts``, see :mod:`psstereo.io.verdict_files`.
    depth : DepthResult, optional
        Becomes ``depth.npy``, ``depth.png``.
    mesh : SurfaceMesh, optional
        Becomes ``mesh`` with each of the suffixes.
    mesh_suffixes : iterable of str
        Formats of the mesh; one that needs triangles is left out if there are none.
    record : mapping
        Becomes ``run.json``.
    report : str, optional
        Becomes ``report.html``.
    overwrite : bool
        Whether an earlier result may be replaced.

    Raises
    ------
    ExistingResultError
        If something is in the way.
    """
    with new_folder(folder, overwrite=overwrite) as work:
        _save(work / "normals.npy", normals.normals, np.float32)
        _save(work / "albedo.npy", normals.albedo, np.float32)
        _save(work / "uncertainty.npy", np.degrees(normals.uncertainty), np.float32)
        _save(work / "flags.npy", normals.flags, np.uint16)
        write_normal_map(normals.normals, work / "normals.png")
        write_png(work / "albedo.png", albedo_picture(_showable(normals.albedo)))
        if normals.verdicts is not None:
            write_verdicts(work, normals.verdicts)
        _write_surface(work, depth, mesh, mesh_suffixes)
        _write_record(work, record)
        if report is not None:
            (work / "report.html").write_text(report, encoding="utf-8", errors="backslashreplace")


def write_integration(
    folder: Path,
    normals: FloatArray,
    flags: FlagArray,
    *,
    depth: DepthResult,
    mesh: SurfaceMesh,
    mesh_suffixes: Iterable[str] = (".ply", ".glb"),
    derived: Derived | None = None,
    record: Mapping[str, Any],
    overwrite: bool = False,
) -> None:
    """Write a result folder for normals that came from elsewhere, without albedo; it appears whole or not at all.

    Parameters
    ----------
    folder : Path
        Where; it must be new, empty, or with `overwrite` an earlier result.
    normals : float array (h, w, 3)
        Becomes ``normals.npy`` and ``normals.png``; NaN where there is none [1].
    flags : uint16 array (h, w)
        Becomes ``flags.npy``.
    derived : Derived, optional
        Becomes files of its own, see :mod:`psstereo.io.derived_files`.
    depth, mesh, mesh_suffixes, record, overwrite
        As for :func:`write_result`.

    Raises
    ------
    ExistingResultError
        If something is in the way.
    """
    with new_folder(folder, overwrite=overwrite) as work:
        _save(work / "normals.npy", normals, np.float32)
        _save(work / "flags.npy", flags, np.uint16)
        write_normal_map(normals, work / "normals.png")
        _write_surface(work, depth, mesh, mesh_suffixes)
        if derived is not None:
            write_derived(work, derived)
        _write_record(work, record)


def _write_surface(work: Path, depth: DepthResult | None, mesh: SurfaceMesh | None, suffixes: Iterable[str]) -> None:
    if depth is not None:
        _save(work / "depth.npy", depth.depth, np.float32)
        near_is_small = depth.kind is DepthKind.DISTANCE
        write_png(work / "depth.png", depth_picture(depth.depth, near_is_small=near_is_small))
    if mesh is not None:
        for suffix in suffixes:
            if len(mesh.faces) or suffix != ".glb":
                write_mesh(mesh, work / f"mesh{suffix}", unit=None if depth is None else depth.unit)


def _write_record(work: Path, record: Mapping[str, Any]) -> None:
    text = json.dumps(record, indent=1, ensure_ascii=False, allow_nan=False)
    # A file name that is no UTF-8 comes as lone surrogates; written as \\uXXXX they are valid JSON.
    (work / RECORD).write_bytes((text + "\n").encode("utf-8", "backslashreplace"))


def _save(path: Path, array: Array, dtype: type[np.generic]) -> None:
    np.save(path, np.asarray(array, dtype), allow_pickle=False)


def _showable(albedo: FloatArray) -> FloatArray:
    """Return albedo of one or three channels."""
    return albedo if albedo.ndim == 2 or albedo.shape[2] == 3 else albedo.mean(axis=2)


def read_result(folder: Path) -> SavedResult:
    """Read a result folder.

    Parameters
    ----------
    folder : Path
        Written by :func:`write_result`.

    Returns
    -------
    SavedResult
        Its arrays and record.

    Raises
    ------
    MissingFileError
        If it is not there or is no result folder.
    UnreadableFileError
        If a file in it is damaged.
    """
    if not (folder / RECORD).is_file() or not (folder / "normals.npy").is_file():
        raise MissingFileError(
            given=f"{folder} is not a result folder: {RECORD} or normals.npy is missing.",
            needed="A folder that psstereo reconstruct wrote.",
            remedy="Check the name.",
        )
    try:
        record = json.loads((folder / RECORD).read_text(encoding="utf-8"))
    except (ValueError, OSError) as error:
        raise _damaged(folder / RECORD, error) from None
    if not isinstance(record, dict):
        raise _damaged(folder / RECORD, ValueError("it is no JSON object"))
    normals = _load(folder / "normals.npy")
    if normals is None or normals.ndim != 3 or normals.shape[2] != 3:
        raise InputError(
            given=f"{folder / 'normals.npy'} has the shape {None if normals is None else normals.shape}.",
            needed="Normals are (h, w, 3).",
            remedy="Run the reconstruction again.",
        )
    albedo, depth = _load(folder / "albedo.npy"), _load(folder / "depth.npy")
    return SavedResult(normals=normals, albedo=albedo, depth=depth, record=record)


def _load(path: Path) -> Array | None:
    if not path.is_file():
        return None
    try:
        return np.asarray(np.load(path, allow_pickle=False))
    except (ValueError, OSError, EOFError) as error:
        raise _damaged(path, error) from None


def _damaged(path: Path, error: Exception) -> UnreadableFileError:
    return UnreadableFileError(
        given=f"{path} cannot be read: {error}.",
        needed="A whole result folder.",
        remedy="Run the reconstruction again with --overwrite.",
    )
