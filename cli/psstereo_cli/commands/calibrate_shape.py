"""``psstereo calibrate shape``: lights from a matte object whose shape is known in the image."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from psstereo_cli.calibration_options import PinholeMatrix, RigOut
from psstereo_cli.options import Format, Json, Lights, LightsLayout, Mask, Overwrite, Threads

if TYPE_CHECKING:
    from psstereo.camera import Camera
    from psstereo.capture import Capture
    from psstereo.types import BoolArray, FloatArray

__all__ = ["calibrate_shape"]

_PIXELS = 20000
"""Pixels used: four numbers a light need no more."""


def calibrate_shape(
    folder: Annotated[Path, typer.Argument(help="Capture of the object: images; lights only with --strengths-only.")],
    out: RigOut,
    sphere: Annotated[str | None, typer.Option(help="COLUMN,ROW,RADIUS of a matte ball, in pixels.")] = None,
    normals: Annotated[
        Path | None, typer.Option(help="Normal map of the object in the images (.npy, .png, .exr, …), OpenGL colours.")
    ] = None,
    depth: Annotated[Path | None, typer.Option(help="Depth of the object in the images (.npy, .tif, …).")] = None,
    mesh: Annotated[
        Path | None,
        typer.Option(help="Mesh in the camera's frame, x right, y up, z toward the camera (.ply, .obj, .stl, .glb)."),
    ] = None,
    matrix: PinholeMatrix = None,
    pixel_size: Annotated[
        float | None, typer.Option(help="Under parallel projection, length of a pixel, in the unit of depth or mesh.")
    ] = None,
    ambient: Annotated[
        bool, typer.Option("--ambient/--no-ambient", help="Whether ambient light is found too, or was subtracted.")
    ] = True,
    strengths_only: Annotated[
        bool, typer.Option("--strengths-only", help="Keep the directions of the capture: all that a plane allows.")
    ] = False,
    layout: Format = None,
    lights: Lights = None,
    lights_layout: LightsLayout = None,
    mask: Mask = None,
    threads: Threads = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Find lights from an even matte object of known shape.

    Example: `psstereo calibrate shape ball-photos -o rig.toml --sphere 612,480,210`

    From a board whose lights are known but for their strengths: `psstereo calibrate shape board -o rig.toml --depth
    board.npy --strengths-only`
    """
    from psstereo.calibrate.shape import calibrate_known_shape
    from psstereo.io.rig_file import RigFile
    from psstereo.io.rig_writer import require_rig_place
    from psstereo_cli.cameras import described_camera
    from psstereo_cli.console import progress_bars
    from psstereo_cli.execution import available_threads, threaded
    from psstereo_cli.loading import load_capture
    from psstereo_cli.rig_saving import save_rig

    require_rig_place(out, overwrite=overwrite)
    camera = None if matrix is None and pixel_size is None else described_camera(matrix, pixel_size)
    with progress_bars() as progress, threaded(threads or available_threads()) as over:
        capture, _ = load_capture(
            folder, layout=layout, lights=lights, unknown_lights=not strengths_only and lights is None,
            lights_layout=lights_layout, mask=mask, truth=False, over=over, progress=progress,
        )  # fmt: skip
        known = _normals(capture, camera or capture.camera, sphere, normals, depth, mesh)
        values, inside = _samples(capture, known)
    import numpy as np

    found = calibrate_known_shape(
        values,
        known[inside],
        places=np.argwhere(inside),
        ambient=ambient,
        directions=capture.rig.directions if strengths_only else None,
    )
    rig = RigFile(
        rig=found.rig,
        names=capture.stack.names,
        camera=camera,
        response=capture.response,
        quality=found.quality,
        provenance=(
            f"From {np.count_nonzero(inside)} pixels of {folder.name}, whose shape is"
            f" {sphere or next(path.name for path in (normals, depth, mesh) if path is not None)}.",
        ),
    )
    save_rig(out, rig, overwrite=overwrite, as_json=as_json, facts={"ambient": found.ambient.tolist()})


def _normals(
    capture: "Capture",
    camera: "Camera",
    sphere: str | None,
    normals: Path | None,
    depth: Path | None,
    mesh: Path | None,
) -> "FloatArray":
    """Return the normals of the shape that was named."""
    import numpy as np

    from psstereo.calibrate.shape import sphere_normals
    from psstereo.errors import InputError, OptionError
    from psstereo_cli.execution import parse_floats

    if sum(one is not None for one in (sphere, normals, depth, mesh)) != 1:
        raise OptionError(
            given="The shape is given "
            + ("not at all." if not any((sphere, normals, depth, mesh)) else "more than once."),
            needed="One of --sphere, --normals, --depth and --mesh.",
            remedy="A ball needs its middle and radius in the image: --sphere COLUMN,ROW,RADIUS.",
        )
    if sphere is not None:
        column, row, radius = parse_floats(sphere, 3, "sphere (COLUMN,ROW,RADIUS)")
        return sphere_normals(capture.shape, (column, row), radius)
    if normals is not None:
        from psstereo.io.normal_map import read_normal_map

        found = read_normal_map(normals)
        answer = np.where(found.mask[..., None], np.asarray(found.normals, np.float64), np.nan)
        if answer.shape[:2] != capture.shape:
            raise InputError(
                given=f"The normal map {normals.name} has {answer.shape[:2]} pixels, the images {capture.shape}.",
                needed="One normal for each pixel of the images.",
                remedy="Crop or render it to the images' size.",
            )
        return answer
    if depth is not None:
        from psstereo.depth import normals_from_depth
        from psstereo.io.value_map import read_value_map

        read = read_value_map(depth, capture.shape, what="depth", names=("depth", "heights"))
        return normals_from_depth(np.where(read.no_data, np.nan, np.asarray(read.values, np.float64)), camera)
    return _of_mesh(Path(str(mesh)), camera, capture.shape)


def _of_mesh(path: Path, camera: "Camera", shape: tuple[int, int]) -> "FloatArray":
    import trimesh

    from psstereo.calibrate.shape import mesh_normals
    from psstereo.errors import MissingFileError, UnreadableFileError

    if not path.is_file():
        raise MissingFileError(given=f"{path} is not there.", needed="A mesh.", remedy="Check the name.")
    try:
        mesh = trimesh.load_mesh(path, process=False)
        vertices, faces = mesh.vertices, mesh.faces
    except Exception as error:
        raise UnreadableFileError(
            given=f"{path.name} cannot be read as a mesh ({type(error).__name__}).",
            needed="Triangles as .ply, .obj, .stl or .glb.",
            remedy="Export it anew.",
        ) from None
    return mesh_normals(vertices, faces, camera, shape)


def _samples(capture: "Capture", known: "FloatArray") -> "tuple[FloatArray, BoolArray]":
    """Return brightness (m, p, c) and where in the image these pixels are."""
    from dataclasses import replace

    import numpy as np

    from psstereo.errors import InputError
    from psstereo.normals.thinning import sample_grid

    inside = np.isfinite(known).all(axis=-1) & capture.effective_mask
    if not inside.any():
        raise InputError(
            given="The shape and the mask have no pixel in common.",
            needed="A shape in register with the images.",
            remedy="Check its place, or use --mask none.",
        )
    step = max(1, int(np.ceil(np.sqrt(np.count_nonzero(inside) / _PIXELS))))
    thin = np.zeros_like(inside)
    thin[::step, ::step] = inside[::step, ::step]
    inside = thin if thin.any() else inside
    grid = sample_grid(replace(capture, mask=inside), gray="per-channel", limit=int(inside.size), strengths=False)
    return np.moveaxis(grid.values, 0, -1), inside
