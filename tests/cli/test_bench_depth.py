"""``psstereo bench depth``, on surfaces of its own and on a folder of the user's."""

import numpy as np

from psstereo.io import write_normal_map
from psstereo.io.pictures import write_png
from psstereo_synth.reliefs import RELIEFS, relieved


def object_folder(place):
    surface = relieved("smooth", 48, 40)
    place.mkdir(parents=True)
    write_normal_map(np.where(surface.mask[..., None], surface.normals, np.nan), place / "normal_map.png")
    write_png(place / "mask.png", np.where(surface.mask, 255, 0).astype(np.uint8))
    (place / "K.txt").write_text("900 0 24\n0 900 20\n0 0 1\n")
    np.savez(place / "depth_gt.npz", depth_gt=np.where(surface.mask, 900.0 - surface.height, np.nan))


def test_surfaces_and_a_folder_are_measured(run, tmp_path, monkeypatch):
    from psstereo_cli.suites import depth as suite

    # As without --size, but small: growth is measured only then.
    monkeypatch.setattr(suite, "_GROWTH", (16, 20, 24))
    monkeypatch.setattr(suite, "dimensions", lambda _size: (40, 32))
    object_folder(tmp_path / "maps" / "vase")
    done = run("bench", "depth", "--repeats", "1", "--folder", tmp_path / "maps", "--json")
    assert done.code == 0
    rows = done.record["rows"]
    assert {row["problem"] for row in rows} == {*RELIEFS, "rectangle", "vase", "disc 16", "disc 20", "disc 24"}
    errors = {(row["problem"], row["method"]): row["error"] for row in rows}
    assert errors["smooth", "poisson"]["rmse"] < 0.05
    assert errors["vase", "poisson"]["mean"] < 0.5
    assert not errors["rectangle", "bare transform"]
    assert done.record["table"]["columns"][0] == "surface"
    (slope,) = done.record["slopes"]
    assert (slope["method"], slope["axis"]) == ("poisson", "pixels")


def test_folders_that_do_not_fit_are_refused(run, tmp_path):
    done = run("bench", "forward", "--folder", tmp_path)
    assert done.code == 3
    assert "Only depth, photographs, planner, sfs" in done.text
    done = run("bench", "depth", "--size", "16x16", "--repeats", "1", "--folder", tmp_path)
    assert done.code == 3
    assert "depth_gt.npz" in done.text
