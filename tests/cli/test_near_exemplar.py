"""The command with exemplar materials under near lamps."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from psstereo.brdf import Ggx
from psstereo.io import write_capture
from tests.cli.test_near_lamps import sixteen_bits
from tests.unit.near.near_scenes import dome, pinhole_sphere, shoot_glossy


@pytest.fixture(scope="module")
def glossy(tmp_path_factory: Any) -> Path:
    camera, depth, normals, mask = pinhole_sphere(18)
    plastic = Ggx(albedo=[0.4], f0=[0.05], roughness=[0.45])
    capture = shoot_glossy(camera, depth, normals, mask, dome(18), brdf=plastic)
    folder = Path(tmp_path_factory.mktemp("glossy")) / "in"
    write_capture(sixteen_bits(capture), folder, "near-ps")
    return folder


def steps(done: Any) -> dict[str, Any]:
    return {one["name"]: one for one in done.record["steps"]}


def test_the_solver_is_taken_under_lamps_and_its_options_with_it(run: Any, glossy: Path, tmp_path: Path) -> None:
    done = run("reconstruct", glossy, "-o", tmp_path / "out", "--solver", "exemplar", "--option", "shared=0", "--json")
    assert done.code in (0, 4), done.err  # so few pixels may hop between two answers for ever
    assert done.record["normals"]["reflectance"] == "exemplar"
    assert steps(done)["near lamps"]["done"]
    step = steps(done)["non-Lambertian solving"]
    assert step["done"]
    assert "own" in step["reason"]


def test_a_saved_plan_does_what_the_command_would_and_an_edited_one_what_it_says(
    run: Any, glossy: Path, tmp_path: Path
) -> None:
    assert run("plan", glossy, "-o", tmp_path / "plan.json", "--json").code == 0
    followed = run("reconstruct", glossy, "-o", tmp_path / "a", "--plan", tmp_path / "plan.json", "--json")
    assert followed.code in (0, 4), followed.err
    run("reconstruct", glossy, "-o", tmp_path / "b", "--json")
    one, other = (np.load(tmp_path / name / "normals.npy") for name in "ab")
    assert np.array_equal(one, other, equal_nan=True)
    plan = json.loads((tmp_path / "plan.json").read_text())
    next(s for s in plan["stages"] if s["name"] == "near lamps")["options"]["reflectance"] = "lambert"
    (tmp_path / "edited.json").write_text(json.dumps(plan))
    edited = run("reconstruct", glossy, "-o", tmp_path / "c", "--plan", tmp_path / "edited.json", "--json")
    assert edited.code == 0, edited.err
    assert edited.record["normals"]["reflectance"] == "lambert"
    assert not steps(edited)["non-Lambertian solving"]["done"]


@pytest.mark.parametrize("more", [("--solver", "robust"), ("--solver", "exemplar", "--gate", "none")])
def test_what_near_lamps_cannot_have_is_refused(run: Any, glossy: Path, tmp_path: Path, more: tuple[str, ...]) -> None:
    done = run("reconstruct", glossy, "-o", tmp_path / "out", *more)
    assert done.code == 3
    assert not (tmp_path / "out").exists()
