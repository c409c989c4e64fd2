"""``--rig``: the lights of one calibration on the photographs of another object."""

import shutil

import numpy as np

from psstereo import read_capture
from psstereo.io.rig_file import RigFile, RigQuality
from psstereo.io.rig_writer import write_rig


def test_a_rig_takes_the_place_of_the_folders_own_lights(run, folder, tmp_path):
    capture, _ = read_capture(folder)
    rig = tmp_path / "my rig.toml"
    quality = RigQuality(verdict="Good to 0.5°.")
    write_rig(rig, RigFile(rig=capture.rig, names=capture.stack.names, quality=quality, provenance=("By a ball.",)))
    bare = tmp_path / "bare"
    shutil.copytree(folder, bare)
    for name in ("light_directions.txt", "light_intensities.txt"):
        (bare / name).unlink()
    whole = run("reconstruct", folder, "-o", tmp_path / "a", "--normals-only", "--no-report", "--json")
    with_rig = run("reconstruct", bare, "-o", tmp_path / "b", "--rig", rig, "--normals-only", "--no-report", "--json")
    assert (whole.code, with_rig.code) == (0, 0)
    a, b = (np.load(tmp_path / name / "normals.npy") for name in "ab")
    np.testing.assert_allclose(a, b, atol=1e-6)
    assert with_rig.record["capture"]["lights"] == "my rig.toml"
    notes = " ".join(with_rig.record["capture"]["notes"])
    assert "Good to 0.5°." in notes
    assert "By a ball." in notes
    assert "unknown" not in notes
    told = run("info", bare, "--rig", rig, "--json")
    assert told.record["lights"]["source"] == "my rig.toml"


def test_two_sources_of_lights_and_files_that_are_no_rigs_are_refused(run, folder, tmp_path):
    lights = folder / "light_directions.txt"
    done = run("reconstruct", folder, "-o", tmp_path / "a", "--rig", lights)
    assert done.code == 3
    assert "not valid TOML" in done.text
    capture, _ = read_capture(folder)
    rig = tmp_path / "rig.toml"
    write_rig(rig, RigFile(rig=capture.rig))
    done = run("reconstruct", folder, "-o", tmp_path / "a", "--rig", rig, "--lights", lights)
    assert done.code == 3
    assert "Both --rig and --lights" in done.text
    write_rig(rig, RigFile(rig=capture.rig.select(range(5))), overwrite=True)
    done = run("reconstruct", folder, "-o", tmp_path / "a", "--rig", rig)
    assert done.code == 3
    assert "has 5 lights" in done.text
    assert not (tmp_path / "a").exists()
