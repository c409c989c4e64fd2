"""What a command derives from normals and depth when it is asked to."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from psstereo.camera import Camera
    from psstereo.depth.given_normals import Integration
    from psstereo.io.derived_files import Derived
    from psstereo.types import Progress

__all__ = ["derive"]


def derive(
    result: "Integration",
    camera: "Camera",
    *,
    relief: str | None,
    curvature: float | None,
    threads: int,
    progress: "Progress",
) -> "Derived":
    """Return elevation, and relief and curvature if they were asked for.

    Parameters
    ----------
    result : Integration
        Normals and depth.
    camera : Camera
        Their camera.
    relief : str or None
        ``SHORTEST,LONGEST`` wavelengths, in the unit of the depth.
    curvature : float or None
        Smoothing of the curvature [px].
    threads : int
        Threads at most.
    progress : callable
        Told how far the work is.

    Returns
    -------
    Derived
        What is to be written.
    """
    from psstereo.camera import Orthographic
    from psstereo.depth import curvature_from_normals, relief_from_normals
    from psstereo.io.derived_files import Derived
    from psstereo.results import DepthKind
    from psstereo_cli.execution import parse_floats

    depth = result.depth
    known: dict[str, Any] = {"components": depth.components}
    if depth.kind is DepthKind.DISTANCE:
        known |= {"distance": depth.depth, "unit": depth.unit}
    found: dict[str, Any] = {}
    if relief is not None:
        shortest, longest = parse_floats(relief, 2, "relief (SHORTEST,LONGEST)")
        band = relief_from_normals(
            result.normals,
            camera,
            longest=longest,
            shortest=shortest,
            mask=depth.components > 0,
            threads=threads,
            progress=progress,
            **known,
        )
        found |= {"relief": band.heights, "relief_unit": band.unit}
    if curvature is not None:
        bent = curvature_from_normals(result.normals, camera, mask=depth.components > 0, smoothing=curvature, **known)
        kinds = {"mean": bent.mean, "gaussian": bent.gaussian, "largest": bent.largest, "smallest": bent.smallest}
        found |= {"curvature": kinds, "curvature_unit": bent.unit}
    size = camera.pixel_size if isinstance(camera, Orthographic) else None
    return Derived(elevation=depth, pixel_size=size, **found)
