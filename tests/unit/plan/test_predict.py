"""Predictions scale with the work, and the machine's speed is kept where it can be."""

import json
from dataclasses import replace

import pytest

from psstereo.normals.exemplar import Exemplar
from psstereo.pipeline import Options
from psstereo.plan import probe as probing
from psstereo.plan.costs import COSTS
from psstereo.plan.facts import Facts
from psstereo.plan.plan import make_plan
from psstereo.plan.predict import predict
from psstereo.plan.probe import Speed, cache_file, machine_speed
from psstereo.plan.trials import Trial

FACTS = Facts(
    images=96, height=512, width=612, channels=3, bits=16, floating=False, saturates=True, pixels=150_000,
    components=1, perspective=False, linear=True, response="linear", dark_frame=False, lamps=False, surveyed=8000,
    misfit=0.0, bright_outliers=0.0, shadowed=0.1, turning=0.0, sample_bytes=57_600_000, decode_seconds=0.01,
)  # fmt: skip
SPEED = Speed(solving=1.0, integrating=1.0)


def cost(facts, options=None, speed=SPEED):
    chosen = options or Options()
    return predict(make_plan(facts, chosen), chosen, speed)


def test_times_follow_the_work():
    one, ten = cost(FACTS), cost(replace(FACTS, pixels=1_500_000, height=5120, sample_bytes=576_000_000))
    for part in ("solve", "mesh", "depth"):
        assert 1.5 < getattr(ten, part) / getattr(one, part) < 10.5  # what is loaded once does not grow
    assert one.memory < ten.memory
    assert one.seconds == pytest.approx(one.read + one.survey + one.solve + one.depth + one.mesh)


def test_threads_share_the_work():
    one, two = cost(FACTS), cost(replace(FACTS, workers=2))
    assert one.read / 2 <= two.read < one.read
    assert one.solve / 2 <= two.solve < one.solve


def test_a_slow_machine_takes_longer():
    slow = cost(FACTS, speed=Speed(solving=3.0, integrating=2.0))
    assert slow.solve == pytest.approx(3 * cost(FACTS).solve)
    assert slow.depth == pytest.approx(2 * cost(FACTS).depth)


def test_what_trials_load_is_loaded_once_and_learning_has_its_price():
    trial = Trial(solver="exemplar", change_deg=1.0, apart_deg=1.0, pixels=128, seconds=0.1)
    tried, asked = cost(replace(FACTS, misfit=0.5, trials=(trial,))), cost(FACTS, Options(solver=Exemplar()))
    assert asked.solve - tried.solve == pytest.approx(COSTS["exemplar"].load)
    assert tried.survey - asked.survey > COSTS["exemplar"].load
    alone = cost(FACTS, Options(solver=Exemplar(shared=0)))
    assert asked.solve - alone.solve == pytest.approx(1500 * 96 * COSTS["exemplar"].learning)
    few = replace(FACTS, pixels=100)
    slow, quick = cost(few, Options(solver=Exemplar())), cost(few, Options(solver=Exemplar(shared=0)))
    assert slow.solve - quick.solve == pytest.approx(100 * 96 * COSTS["exemplar"].readable)


def test_what_is_left_out_costs_nothing():
    only = cost(FACTS, Options(integrator=None))
    assert only.depth == only.mesh == 0
    assert predict(make_plan(replace(FACTS, surveyed=0)), Options(), SPEED) is None


@pytest.fixture
def measured(monkeypatch):
    calls = []
    monkeypatch.setattr(probing, "probe", lambda: calls.append(1) or Speed(solving=2.0, integrating=3.0))
    return calls


def test_the_speed_is_kept(tmp_path, measured):
    path = tmp_path / "deep" / "speed.json"
    assert machine_speed(path) == machine_speed(path) == Speed(solving=2.0, integrating=3.0)
    assert len(measured) == 1


@pytest.mark.parametrize(
    "text",
    ["", "[]", "{", "3", '{"schema": 1}', '{"schema": 2, "machine": {}, "solving": 1, "integrating": 1}', "[" * 99_999],
)
def test_hostile_caches_are_replaced(tmp_path, measured, text):
    path = tmp_path / "speed.json"
    path.write_text(text)
    assert machine_speed(path).solving == 2.0
    assert len(measured) == 1
    assert json.loads(path.read_text())["integrating"] == 3.0


@pytest.mark.parametrize("figure", ["x", None, -1.0, 0.0, 1e9, "nan"])
def test_nonsense_in_the_cache_is_measured_again(tmp_path, measured, figure):
    path = tmp_path / "speed.json"
    machine_speed(path)
    content = json.loads(path.read_text())
    path.write_text(json.dumps(content | {"solving": figure}))
    machine_speed(path)
    assert len(measured) == 2


def test_a_place_that_cannot_be_written_is_no_trouble(tmp_path, measured):
    (tmp_path / "file").write_text("")
    assert machine_speed(tmp_path / "file" / "speed.json").solving == 2.0
    assert len(measured) == 1


def test_the_cache_is_where_caches_go(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(probing.platform, "system", lambda: "Linux")
    assert cache_file() == tmp_path / "psstereo" / "speed.json"
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    monkeypatch.setattr(probing.Path, "home", lambda: tmp_path / "home")
    assert cache_file() == tmp_path / "home" / ".cache" / "psstereo" / "speed.json"


def test_the_probe_gives_sane_figures():
    found = probing.probe()
    assert 0.02 < found.solving < 50
    assert 0.02 < found.integrating < 50
