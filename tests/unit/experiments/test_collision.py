"""Collisions: known outcomes, many seeds, case files and the command."""

import json
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest
from matplotlib.figure import Figure

import sand
from sand.cli.collide import collision_rows
from sand.cli.main import main
from sand.experiments import collision
from sand.experiments.collision import (
    Ending,
    approach,
    collide,
    collide_many,
    expected_end,
    latest_end,
    prepare,
)
from sand.experiments.collision_case import read_collision
from sand.experiments.collision_job import CollisionJob
from sand.experiments.collision_outcome import collision_title
from sand.io.bodies import read_body
from sand.setup import bpca, chain, grain
from sand.theory import contact

R = 1e-7


def two(seed):
    """Grains that do not depend on the seed."""
    return grain(radius=R, material="silica"), grain(radius=R, material="silica")


@pytest.mark.compiled("contacts")
def test_two_grains_stick_or_bounce():
    """Below v_s one body remains; above it two that separate at √(v² − v_s²) (1 %), and E_cycle is dissipated."""
    numbers = contact("silica", R)
    slow, _ = collide(*two(0), speed=0.9 * numbers.sticking_speed)
    assert (slow.outcome, slow.fragments, slow.largest_remnant) == ("stick", (2,), 1.0)
    fast, _ = collide(*two(0), speed=2 * numbers.sticking_speed)
    assert (fast.outcome, fast.fragments) == ("bounce", (1, 1))
    assert fast.rebound == pytest.approx(numbers.rebound_speed(2 * numbers.sticking_speed), rel=0.01, abs=0.0)
    assert sum(fast.lost.values()) == pytest.approx(numbers.cycle_energy, rel=1e-3, abs=0.0)
    assert fast.impact_energy == pytest.approx(4 * numbers.cycle_energy, rel=1e-3, abs=0.0)
    assert (fast.made, fast.broken, fast.contacts_before, fast.contacts_after) == (1, 1, 0, 0)
    assert fast.quiet
    assert (slow.kind, slow.growth_efficiency, slow.second_remnant) == ("sticking", 1.0, 0.0)
    assert (fast.kind, fast.growth_efficiency, fast.second_remnant) == ("bouncing", 0.0, 0.5)
    assert fast.break_energy == pytest.approx(numbers.break_energy, rel=1e-6, abs=0.0)
    assert fast.roll_energy == pytest.approx(numbers.roll_energy_clamped, rel=1e-6, abs=0.0)
    assert (fast.reach, fast.grains_before) == (pytest.approx(2.0 * R, rel=1e-9, abs=0.0), (1, 1))
    assert (fast.filling_before, slow.coordination_before, slow.coordination_after) == ((1.0, 1.0), (0.0, 0.0), 1.0)


@pytest.mark.compiled("contacts")
def test_a_fast_grain_breaks_a_chain():
    """100 m/s against 7 grains of 0.2 µm: more than two fragments, every grain accounted for."""
    result, sim = collide(
        chain(7, radius=R, material="silica"), grain(radius=R, material="silica"), speed=100.0, along="y"
    )
    assert result.outcome == "fragment"
    assert sum(result.fragments) == 8
    assert result.contacts_before == 6
    assert result.gyration_before[1] == 0.0
    assert result.kind == "fragmentation" and result.coordination_before == (12 / 7, 0.0)
    assert result.growth_efficiency == max(result.fragments) - 7  # of equal grains: exact
    assert result.second_remnant == pytest.approx(sorted(result.fragments)[-2] / 8, rel=1e-9, abs=0.0)
    chain_gyration = np.sqrt((sim.start.position[:7, 0] ** 2).mean())
    assert result.gyration_before[0] == pytest.approx(chain_gyration, rel=1e-6, abs=0.0)


@pytest.mark.compiled("contacts")
def test_a_miss():
    """An impact parameter beyond the sum of radii: two bodies, no loss."""
    result, _ = collide(*two(0), speed=1.0, impact_parameter="1.1 b")
    assert (result.outcome, result.made, result.rebound) == ("miss", 0, pytest.approx(1.0, rel=1e-6, abs=0.0))
    assert sum(result.lost.values()) == 0.0


def test_a_time_that_is_no_good_end():
    """A warning in one line: too early for a contact, or far beyond the outcome, with steps of both; no other one.

    The steps of an end at 5 s are those of the usual end in proportion to the times, as all have the same length.
    """
    start = approach(*two(0), speed=1.0, impact_parameter=0.0, along="x", seed=None)
    usual, latest = expected_end(start), latest_end(start)
    with pytest.warns(UserWarning) as noted:
        simulation = prepare(start, ending=Ending("5 s"))
    (text,) = (str(one.message) for one in noted)
    few, many = (simulation.expected_cost(time).steps for time in (usual, 5.0))
    assert many / few == pytest.approx(5.0 / usual, rel=0.01, abs=0.0)
    assert text.startswith(f"end = 5 s takes about {many:.2g} steps and ") and "; outcomes are usually decided" in text
    assert f", after about {few:.2g} steps and " in text and text.count("\n") == 0
    with pytest.warns(UserWarning, match="is before the earliest possible contact, at .* will be undecided"):
        prepare(start, ending=Ending(0.5 * start.flight))
    for end in ("outcome", "rest", 1.01 * start.flight, usual, latest):  # without a warning
        prepare(start, ending=Ending(end))


@pytest.mark.compiled("contacts")
@pytest.mark.filterwarnings("ignore:end = .* is before the earliest possible contact")
def test_an_end_before_the_first_contact(capsys):
    """Bodies that would touch are undecided, not a miss; a title and a row of the command say so."""
    start = approach(*two(0), speed=1.0, impact_parameter=0.0, along="x", seed=None)
    result, _ = collide(*two(0), speed=1.0, end=0.5 * start.flight)
    assert (result.outcome, result.kind, result.quiet, result.made) == ("undecided", "undecided", False, 0)
    assert collision_title([result.to_dict()], "X") == "Collision of X at 1 m/s, head-on: no contact yet"
    (_, text), (_, counts) = collision_rows([result.to_dict()])
    assert text.startswith("undecided: no contact formed; stopped before") and counts == "1 × undecided"
    made_up = result.to_dict() | {"outcome": "stick", "made": 3, "moved": 7, "broken": 1}
    (_, text), _ = collision_rows([made_up])
    assert "; contacts 3 formed, 1 broken, 7 slips; " in text  # the words of `sand run`
    later, _ = collide(*two(0), speed=1.0, impact_parameter="1.1 b", end=2.0 * expected_end(start))
    assert (later.outcome, later.kind, later.quiet) == ("miss", "miss", True)


@pytest.mark.compiled("listed")
@pytest.mark.filterwarnings("ignore:gas")
def test_a_gas_that_stops_the_bodies(monkeypatch):
    """Bodies that a gas brings to rest before they touch are undecided; in a thin gas, bodies that pass are a miss.

    A grain stops after the distance v τ, here a tenth of the gap.  The latest end is shortened.
    """
    monkeypatch.setattr(collision, "LONGEST", 100.0)
    start = approach(*two(0), speed=1.0, impact_parameter=0.0, along="x", seed=None)
    thin = sand.Gas(temperature="10 K", density=1e-9, brownian=False)
    density = 1e-9 * thin.shortest_time(start.grains) / (0.1 * start.flight)
    dense = sand.Gas(temperature="10 K", density=density, brownian=False)
    stopped, sim = collide(*two(0), speed=1.0, forces=[sand.Contact(), dense])
    assert np.abs(sim.grains.velocity).max() < 1e-3
    assert (stopped.outcome, stopped.kind, stopped.quiet) == ("undecided", "undecided", False)
    passed, _ = collide(*two(0), speed=1.0, impact_parameter="1.1 b", forces=[sand.Contact(), thin])
    assert (passed.outcome, passed.kind, passed.quiet) == ("miss", "miss", True)
    assert passed.end == "the bodies recede, and are farther apart than at the start"


def test_bodies_that_have_parted():
    """Along the path they part when they recede beyond their first distance; bodies that come back have not."""
    start = approach(*two(0), speed=1.0, impact_parameter="1.1 b", along="x", seed=None)
    for factor, speed, parted in ((0.5, 1.0, False), (-0.9, 1.0, False), (-1.1, 1.0, True), (-1.1, -1.0, False)):
        later = start.grains.copy()
        later.arrays.position[0] *= factor
        later.arrays.velocity[0] *= speed
        assert start.has_parted(later) == parted


@pytest.mark.compiled("dipoles")
def test_looks_with_long_cycles(monkeypatch):
    """r-RESPA cycles of up to 300 steps: there is a look at the first end of a cycle from each thousandth step on.

    Looks every step find the ends of all cycles.  Some looks are more than 100 steps after a thousandth step.
    """
    looks = []
    monkeypatch.setattr(collision, "why_ended", lambda simulation, *_: looks.append(simulation.steps) or "")
    monkeypatch.setattr(collision, "LONGEST", 40.0)
    bodies = [chain(3, radius=R, material="silica", moment=1e-19) for _ in range(2)]
    how = {"forces": [sand.Contact(), sand.Dipoles()], "stepping": sand.Verlet(far_steps=300), "end": "rest"}
    _, sim = collide(*bodies, speed=1.0, **how)
    found = looks[1:-1]  # without those of the start and the end
    looks.clear()
    monkeypatch.setattr(collision, "LOOK_EVERY", 1)
    collide(*bodies, speed=1.0, **how)
    assert sim.steps > 5000
    assert found == [next(s for s in looks[1:] if s >= 1000 * k) for k in range(1, sim.steps // 1000 + 1)]
    assert max(step % 1000 for step in found) > 100


def aggregates(seed):
    """Two small aggregates for a seed."""
    return tuple(bpca(8, radius=R, material="silica", seed=2 * seed + k) for k in range(2))


@pytest.mark.compiled("contacts", "small")
def test_any_executor_gives_the_same_numbers():
    """In this process, in threads and in processes: the same results in the order of the seeds."""
    here = collide_many(aggregates, [3, 1, 2], speed=2.0, end="rest")
    assert [r.seed for r in here] == [3, 1, 2]
    assert here[0] != here[1]
    with ThreadPoolExecutor(2) as pool:
        assert collide_many(aggregates, [3, 1, 2], pool, speed=2.0, end="rest") == here


CASE = """
[target]
kind = "bpca"
grains = 8
radius = "0.1 um"
[projectile]
kind = "grain"
radius = "0.1 um"
[impact]
speed = "2 m/s"
end = "rest"
seeds = [1, 2]
[forces.contact]
"""


@pytest.mark.validate
@pytest.mark.compiled("contacts", "small")
def test_a_case_in_processes(tmp_path):
    """Worker processes read the case themselves and give the results of the parent."""
    path = tmp_path / "hit.toml"
    path.write_text(CASE)
    here = CollisionJob(path, tmp_path / "here").run()["collisions"]
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        assert CollisionJob(path, tmp_path / "there").run(pool)["collisions"] == here


@pytest.mark.draws
@pytest.mark.compiled("contacts", "small")
def test_the_command(tmp_path, capsys, monkeypatch):
    """Many seeds: collision.json and a figure; one seed: a run folder; an existing folder is refused."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "hit.toml").write_text(CASE)
    assert main(["collide", "hit.toml", "--json"]) == 0
    message = json.loads(capsys.readouterr().out)
    assert len(message["collisions"]) == 2
    assert sum(message["counts"].values()) == 2
    assert (tmp_path / "hit" / "figure.png").stat().st_size > 10_000
    assert json.loads((tmp_path / "hit" / "collision.json").read_text()) == message
    assert main(["collide", "hit.toml"]) == 2
    assert "not empty" in capsys.readouterr().err
    monkeypatch.setattr("sand.plotting.collisions.collision_figure", lambda *_, **__: Figure(figsize=(1.0, 1.0)))
    assert main(["collide", "hit.toml", "--seeds", "2", "--out", "one"]) == 0
    assert "seed 2" in capsys.readouterr().out
    monkeypatch.setattr("sand.cli.report.LINE_AT_LEAST", 0.0)
    assert main(["collide", "hit.toml", "--overwrite"]) == 0
    assert {"1 of 2 collisions", "2 of 2 collisions"} <= {
        part for line in capsys.readouterr().err.splitlines() for part in line.split(", ")
    }
    monkeypatch.setattr("sand.cli.report.LINE_EVERY", 0.0)
    assert main(["collide", "hit.toml", "--seeds", "2", "--out", "one", "--overwrite"]) == 0
    assert " ns, " in (err := capsys.readouterr().err) and "clusters, S = " in err
    assert (tmp_path / "one" / "trajectory.gsd").exists()
    assert json.loads((tmp_path / "one" / "collision.json").read_text())["collisions"][0] == message["collisions"][1]


@pytest.mark.compiled("contacts", "small")
def test_bodies_from_files(tmp_path):
    """Text columns in nanometres and the last frame of a trajectory collide like built bodies."""
    built = bpca(8, radius=R, material="silica", seed=3)
    lines = "\n".join(" ".join(f"{1e9 * x:.17g}" for x in row) for row in built.position)
    (tmp_path / "body.txt").write_text(f"# x y z in nm\n\n{lines}\n")
    body = read_body(tmp_path / "body.txt", sand.SILICA, R, "1 nm")
    assert body.position == pytest.approx(built.position, abs=1e-18)
    sim = sand.Simulation(built, [sand.Contact()], out=tmp_path / "run")
    sim.run(steps=10)
    again = read_body(tmp_path / "run" / "trajectory.gsd", sand.SILICA)
    assert again.position == pytest.approx(built.position, abs=1e-6 * R)
    assert again.radius == pytest.approx(built.radius, rel=1e-6, abs=0.0)
    path = tmp_path / "hit.toml"
    old = 'kind = "bpca"\ngrains = 8\nradius = "0.1 um"'
    path.write_text(
        CASE.replace(old, f'kind = "file"\nfile = "{tmp_path}/body.txt"\nlength = "1 nm"\nradius = "0.1 um"')
    )
    outcome, _ = read_collision(path).run(1)
    assert outcome.contacts_before == 7


def test_the_title_of_a_figure():
    """Bodies, speed, impact parameter and outcome of one collision; numbers and ranges of several."""
    bodies = [sand.setup.chain(n, radius="0.1 um", material=m) for n, m in ((3, "silica"), (1, "iron"), (2, "silica"))]
    one = [{"impact_parameter": 2e-6, "speed": 1.5, "outcome": "fragment"}]
    two = [*one, {"impact_parameter": 1e-6, "speed": 1.5, "outcome": "stick"}]
    given = {"speed": 1.5, "impact_parameter": "0.15 um", "along": "y", "seed": None}
    start = approach(bodies[0], bodies[1], **given)
    assert start.impact_parameter == pytest.approx(1.5e-7, rel=1e-12, abs=0.0)
    assert start.bodies() == "3 grains of silica + 1 grain of iron"
    assert approach(bodies[0], bodies[2], **given).bodies() == "3 + 2 grains of silica"
    text = "at 1.5 m/s, impact parameter"
    assert collision_title(one, "X") == f"Collision of X {text} 2 µm: they break up"
    assert collision_title(two, "X") == f"2 collisions of X {text} 1 µm to 2 µm"
    head_on = [one[0] | {"impact_parameter": 1e-25, "outcome": "stick"}]
    assert collision_title(head_on, "X") == "Collision of X at 1.5 m/s, head-on: they stick"
