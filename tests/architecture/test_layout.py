"""The shape of the code: small modules, a frozen public list, nothing of one machine, every family in its catalogue."""

import ast
import inspect
import re
import subprocess
from pathlib import Path

import pytest

import psstereo
from psstereo.brdf import BRDFS, Brdf
from psstereo.camera import CAMERAS, Camera
from psstereo.depth import INTEGRATORS, Integrator
from psstereo.io import READERS, WRITERS, Reader, Writer
from psstereo.lights import LIGHTS, Light
from psstereo.normals import NORMAL_SOLVERS, NormalSolver
from psstereo_synth.faults import FAULTS, Fault
from psstereo_synth.patterns import PATTERNS, Pattern
from psstereo_synth.shapes import RELIEFS, Relief

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = (ROOT / "psstereo", ROOT / "synth" / "psstereo_synth", ROOT / "cli" / "psstereo_cli")
MODULES = sorted(path for package in PACKAGES for path in package.rglob("*.py"))

PUBLIC = [
    "angular_error",
    "BRDFS",
    "brightness_constancy",
    "calibrate_from_object",
    "calibrate_known_shape",
    "calibrate_lamps",
    "calibrate_matte_balls",
    "calibrate_mirror_balls",
    "calibrate_sun",
    "Capture",
    "Choices",
    "curvature_from_normals",
    "DepthResult",
    "describe_flags",
    "Directional",
    "Discontinuity",
    "estimate_normals",
    "estimate_strengths",
    "FileStack",
    "find_lights",
    "Flag",
    "GATES",
    "Geometry",
    "height_error",
    "integrate_normals",
    "integrate_tiled",
    "INTEGRATORS",
    "lambertian_images",
    "LeastSquares",
    "Led",
    "LIGHTS",
    "mask_from_brightness",
    "material_map",
    "MemoryStack",
    "NearOptions",
    "NearResult",
    "NORMAL_SOLVERS",
    "normals_from_depth",
    "NormalsResult",
    "Options",
    "Orthographic",
    "Outcome",
    "Pinhole",
    "plan_capture",
    "PlaneSweep",
    "Poisson",
    "Pose",
    "Prior",
    "PsstereoError",
    "radiometry",
    "rate_rig",
    "read_capture",
    "read_elevation",
    "read_normal_map",
    "read_result",
    "read_rig",
    "READERS",
    "recognise",
    "reconstruct",
    "Reconstruction",
    "RectifiedMatcher",
    "refine_lights",
    "refine_terrain",
    "register_frames",
    "relief_from_normals",
    "Response",
    "response_from_exposures",
    "response_from_shading",
    "Rig",
    "RigFile",
    "Robust",
    "shade",
    "ShadedImage",
    "SHADING_METHODS",
    "ShadingResult",
    "solve_near",
    "StrengthUnit",
    "summarise_angles",
    "Sun",
    "triangulate",
    "Truth",
    "ViewImages",
    "with_distance",
    "write_capture",
    "write_diligent",
    "write_elevation",
    "write_mesh",
    "write_normal_map",
    "write_result",
    "write_rig",
    "WRITERS",
]


def tracked_files() -> list[Path]:
    done = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode == 0 and done.stdout:
        return [ROOT / line for line in done.stdout.splitlines()]
    return [p for p in ROOT.rglob("*") if p.is_file() and not any(part.startswith(".") for part in p.parts)]


def test_public_names_are_frozen() -> None:
    assert sorted(psstereo.__all__) == sorted(PUBLIC)


# Modules and names are walked through within a test: a test each would take longer to hand out than to run.


def test_public_names_exist_and_are_documented() -> None:
    members = {name: getattr(psstereo, name) for name in PUBLIC}
    kinds = (inspect.isclass, inspect.isfunction, inspect.ismodule)
    silent = [name for name, one in members.items() if any(is_one(one) for is_one in kinds) and not inspect.getdoc(one)]
    assert not silent


def test_modules_are_small() -> None:
    lengths = {str(path.relative_to(ROOT)): len(path.read_text(encoding="utf-8").splitlines()) for path in MODULES}
    assert len(lengths) > 500
    assert not {name: length for name, length in lengths.items() if length > 400}


def test_modules_and_public_functions_say_what_they_do() -> None:
    silent = []
    for path in MODULES:
        tree = ast.parse(path.read_text(encoding="utf-8"))
        public = [
            node
            for node in tree.body
            if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_")
        ]
        name = str(path.relative_to(ROOT))
        silent += [] if ast.get_docstring(tree) else [name]
        silent += [f"{name}: {node.name}" for node in public if not ast.get_docstring(node)]
    assert not silent


def test_top_level_is_what_the_users_asked_for() -> None:
    visible = {path.name for path in ROOT.iterdir() if not path.name.startswith(".")}
    wanted = {
        "pyproject.toml",
        "psstereo",
        "synth",
        "tests",
        "cli",
        "README.md",
        "DESIGN.md",
        "CHANGELOG.md",
        "LICENSE",
    }
    generated = {"build", "dist", "psstereo-demo"}
    assert wanted <= visible
    assert visible - wanted - generated <= {"docs"}


def test_nothing_belongs_to_one_machine() -> None:
    pattern = re.compile(r"/(?:home|root|work|tmp|Users)/[A-Za-z]")
    guilty = []
    for path in tracked_files():
        if path == Path(__file__).resolve() or path.suffix in {".png", ".npy"}:
            continue
        text = path.read_text(encoding="utf-8", errors="ignore")
        guilty += [f"{path.relative_to(ROOT)}: {m.group(0)}" for m in pattern.finditer(text)]
    assert not guilty


def test_no_photographs_are_kept() -> None:
    heavy = [path for path in tracked_files() if path.is_file() and path.stat().st_size > 300_000]
    assert not heavy


def final_classes(base: type) -> set[type]:
    """Classes below a base, as far as the packages themselves define them."""
    found = set()
    for child in base.__subclasses__():
        found |= final_classes(child) or {child}
    return {c for c in found if c.__module__.startswith(("psstereo.", "psstereo_synth."))}


@pytest.mark.parametrize(
    ("base", "members"),
    [
        (NormalSolver, set(NORMAL_SOLVERS.values())),
        (Integrator, set(INTEGRATORS.values())),
        (Light, set(LIGHTS.values())),
        (Camera, set(CAMERAS.values())),
        (Reader, {type(reader) for reader in READERS.values()}),
        (Writer, {type(writer) for writer in WRITERS.values()}),
        (Brdf, set(BRDFS.values())),
        (Relief, set(RELIEFS.values())),
        (Pattern, set(PATTERNS.values())),
        (Fault, set(FAULTS.values())),
    ],
    ids=lambda value: value.__name__ if isinstance(value, type) else "",
)
def test_every_member_is_in_its_catalogue(base: type, members: set[type]) -> None:
    assert final_classes(base) == members
