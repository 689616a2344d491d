"""Expected cost of a run: steps, wall time, memory and compilation, and the table that runs write."""

import json
import math

import numpy as np
import pytest

import sand
from sand.cli.main import main
from sand.simulation import cost
from sand.theory.contact import contact

CASE = """
[run]
until = "1 us"
[box]
periodic = "1 um"
[grains]
number = 20
radius = "20 nm"
material = "silica"
temperature = "300 K"
[forces.contact]
damping = "critical"
"""
GASES = {
    count: sand.Grains(3e-8 * np.argwhere(np.ones((7, 7, 7)))[:count] * 1.5 - 1e-7, "20 nm", "silica")
    for count in (20, 40, 220)
}


@pytest.fixture(autouse=True)
def table(tmp_path, monkeypatch):
    """An empty table of costs for each test."""
    monkeypatch.setattr(cost, "cache_folder", lambda: tmp_path / "cache" / "code")
    (tmp_path / "cache").mkdir()
    return tmp_path / "cache" / "run-costs.json"


def simulation(count=20, **changes):
    case = {"box": "1 um", "seed": 1} | changes
    return sand.Simulation(GASES[count], [sand.Contact()], **case)


def rows(capsys, *words):
    assert main(["info", *map(str, words)]) == 0
    return dict(line.strip().split("  ", 1) for line in capsys.readouterr().out.splitlines()[1:])


def test_the_step_is_a_fraction_of_the_fastest_period():
    """Δt = 2π/(ω n) with ω² the largest of the four modes of two grains; or the step given."""
    sim = simulation()
    c = contact("silica", "20 nm")
    fastest = min(c.normal_period, c.slide_period, c.roll_period, c.twist_period)
    assert cost.shortest_step(sim) == pytest.approx(fastest / 25.0, rel=1e-9, abs=0.0)
    assert cost.shortest_step(simulation(stepping=sand.Verlet(step="3 ps"))) == 3e-12
    half = simulation(stepping=sand.Verlet(steps_per_period=50.0))
    assert cost.shortest_step(half) == pytest.approx(0.5 * cost.shortest_step(sim), rel=1e-12, abs=0.0)


def test_free_grains_have_the_step_of_their_flight():
    """Without contacts: at most a sixteenth of the smallest radius, and 0.05 rad, in one step."""
    grains = sand.Grains([[0, 0, 0], [1e-6, 0, 0]], 1e-8, "iron", velocity=[[3, 0, 4], [0, 0, 0]], spin=[0, 1e9, 0])
    sim = sand.Simulation(grains)
    assert cost.shortest_step(sim) == pytest.approx(min(1e-8 / 16 / 5, 0.05 / 1e9), rel=1e-12, abs=0.0)


def test_a_measured_run_sets_the_estimate(table, monkeypatch):
    """steps = T/(ratio Δt) and wall time = steps N c for the ratio and cost c of the table; N scales all pairs."""
    sim, end = simulation(), 1e-6
    step = cost.shortest_step(sim)
    rough = cost.expected_cost(sim, end, math.inf)
    assert rough.measured == "" and rough.steps == pytest.approx(end / step, rel=1e-6, abs=0.0) and rough.seconds > 0.0
    kind = cost.kind_of(sim)
    assert kind == "contact jkr; all pairs; verlet; 1 thread"
    one = {"ns_per_grain_step": 50.0, "step_ratio": 2.0, "seconds": 9.0}
    table.write_text(json.dumps({kind: {"20": one, "2000": one | {"ns_per_grain_step": 1e6}}}))
    known = cost.expected_cost(sim, end, math.inf)
    assert known.measured == "a run of 20 grains on this machine" and known.step == pytest.approx(
        2.0 * step, rel=1e-6, abs=0.0
    )
    assert known.seconds == pytest.approx(0.5 * end / step * 20 * 50e-9, rel=1e-6, abs=0.0)
    assert cost.expected_cost(sim, end, 1000).seconds == pytest.approx(1000 * 20 * 50e-9, rel=1e-6, abs=0.0)
    assert cost.expected_cost(sim, math.inf, math.inf).seconds is None
    larger = cost.expected_cost(simulation(40), end, 1000)
    assert larger.seconds == pytest.approx(2 * 1000 * 40 * 50e-9, rel=1e-6, abs=0.0)
    table.write_text('{"a": 3}')
    assert cost.expected_cost(sim, end, math.inf) == rough  # a damaged table is empty


def test_a_run_is_recorded(table, monkeypatch):
    """Wall time without compilation over N and the steps; short runs do not count, nor replace much longer ones."""
    clock, compiled = [0.0], [0.0]
    monkeypatch.setattr(cost.time, "monotonic", lambda: clock[0])
    monkeypatch.setattr(cost, "compilation_seconds", lambda: compiled[0])

    class Counted:
        start, forces, box, stepping = np.zeros(10), (), sand.Box.open(), sand.Verlet(step=1e-9)
        _engine = simulation(stepping=sand.Verlet(step=1e-9))._engine
        steps, time = 100, 1e-6

    def run(seconds, steps, compilation=0.0):
        sim = Counted()
        timer = cost.RunTimer(sim)
        clock[0], compiled[0] = clock[0] + seconds + compilation, compiled[0] + compilation
        sim.steps, sim.time = 100 + steps, 1e-6 + 2e-9 * steps
        timer.record()
        return json.loads(table.read_text())[cost.kind_of(sim)]["10"] if table.exists() else None

    assert run(0.5, 1000) is None
    assert run(4.0, 1000, 30.0) == pytest.approx(
        {"ns_per_grain_step": 4e5, "step_ratio": 2.0, "seconds": 4.0}, rel=1e-6, abs=0.0
    )
    assert run(40.0, 1000)["seconds"] == pytest.approx(40.0, rel=1e-6, abs=0.0)
    assert run(2.0, 1000)["seconds"] == pytest.approx(40.0, rel=1e-6, abs=0.0)


def test_memory_grows_with_the_grains():
    """Three copies of at least position, velocity, spin, moment, orientation and loads, about half a kilobyte each."""
    few, many = (cost.expected_cost(simulation(count), 1e-6, math.inf).memory for count in (20, 220))
    assert cost.PROCESS_BYTES < few < many and 200 * 3 * 300 < many - few < 200 * 3 * 10_000


def test_info_of_a_case(tmp_path, capsys, table):
    """Steps, wall time, memory and compilation, for people and for machines; nothing is compiled."""
    (tmp_path / "a.toml").write_text(CASE)
    found = rows(capsys, tmp_path / "a.toml")
    assert found["steps"].strip().startswith("about ") and found["steps"].endswith(" steps")
    assert "rough estimate: no such run was measured" in found["wall time"] and "MB" in found["memory"]
    assert "compilation" in found
    assert main(["info", str(tmp_path / "a.toml"), "--json"]) == 0
    machine = json.loads(capsys.readouterr().out)["cost"]
    assert {"step", "steps", "seconds", "memory", "measured", "compiled", "compilation_seconds"} == machine.keys()
    assert machine["steps"] * machine["step"] == pytest.approx(1e-6, rel=1e-6, abs=0.0) and machine["measured"] is False
    (tmp_path / "b.toml").write_text(CASE.replace('until = "1 us"', 'stop = "clusters == 1"'))
    assert "depends on the condition" in rows(capsys, tmp_path / "b.toml")["wall time"]


@pytest.mark.compiled("contacts")
def test_what_would_be_compiled(tmp_path, monkeypatch):
    """Stages whose code is neither in this process nor on the disk; after a run those that it called are not named."""
    sim = simulation(stepping=sand.Verlet(step="1 ps"))
    sim.run(steps=20)
    after = sim._engine.uncompiled()
    assert not {"the time steps", "the drift of grains", "the list of contact candidates"} & set(after)
    monkeypatch.setattr("sand.compiler.stage.in_cache", lambda compiled, signature: False)
    fresh = sand.Simulation(sim.grains, [sand.Contact(damping="critical", bath_temperature="300 K")], box="1 um")
    missing = fresh._engine.uncompiled()
    assert "the time steps" not in missing and len(missing) == len(set(missing))
