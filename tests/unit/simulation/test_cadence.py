"""Cadences of output and conditions that end a run: what is read, what is refused, and when outputs are due."""

import itertools
import math
import os
import signal

import numpy as np
import pytest

import sand
from sand.config.case import check_case
from sand.simulation.cadence import Schedule, chosen_cadence, read_cadence
from sand.simulation.condition import read_condition

CASE = {"run": {"until": "1 us"}, "grains": {"number": 2, "radius": "10 nm"}, "box": {"periodic": "1 um"}}


@pytest.mark.parametrize(
    ("given", "setting"),
    [
        (2e-9, 2e-9),
        ("50 ns", 50e-9),
        ("1000 steps", "1000 steps"),
        ("log(10 per decade, from 1 ns)", "log(10 per decade, from 1e-09 s)"),
        ("30 s wall", "30.0 s wall"),
    ],
)
def test_settings_are_read_back(given, setting):
    """The setting in SI, as in case.toml, gives the same cadence."""
    cadence = read_cadence(given, "checkpoint_every", wall_time=True)
    assert cadence.setting == setting and read_cadence(setting, "checkpoint_every", wall_time=True) == cadence


def test_logarithmic_outputs():
    """t_k = t_0 10^(k/n): equal ratios to rounding, decades exact to the last bit, and continued at any time."""
    cadence = read_cadence("log(4 per decade, from 1 ns)", "frame_every")
    schedule, times = Schedule(cadence, 0.0), []
    while schedule.next(1e-6) < 1e-6:
        times.append(schedule.due)
        schedule.advance(schedule.due)
    assert times[::4] == [1e-9, 1e-8, 1e-7] and len(times) == 12
    ratios = [b / a for a, b in itertools.pairwise(times)]
    assert ratios == pytest.approx([10**0.25] * 11, rel=1e-14, abs=0.0)
    for before, after in itertools.pairwise(times):
        assert Schedule(cadence, before).due == Schedule(cadence, 1.1 * before, last=before).due == after


def test_outputs_by_steps():
    """At multiples of the number of steps, or the end of a cycle beyond one; never by time."""
    schedule = Schedule(read_cadence("100 steps", "row_every"), 0.0, 250)
    assert schedule.step_due == 300 and schedule.due == math.inf and schedule.next(1.0) == 1.0
    schedule.advance(1e-9, 305)
    assert schedule.step_due == 400 and not schedule.is_due(1.0, 399) and schedule.is_due(0.0, 404)


@pytest.mark.parametrize(
    ("text", "holds"),
    [
        ("clusters == 1", False),
        ("clusters != 1", True),
        ("clusters<=5 and time>1 us", True),
        ("clusters < 5 or total >= -2 aJ and time < 1 us", False),
        ("(clusters == 5 or total > 0) and time < 1 ms", True),
        ("time >= 2e-6", True),
        ("time > 2 us", False),
        ("momentum_x > 1 ng m/s", False),
    ],
)
def test_what_a_condition_says(text, holds):
    """Compared in SI; `and` before `or`: false or (true and false) is false, with the row below."""
    row = {"clusters": 5, "time": 2e-6, "total": 0.0, "momentum_x": 1e-15}
    assert read_condition(text).holds(row) is holds


def test_energies_of_the_forces_of_a_case_are_known():
    """A condition may use the column of each of its forces, and of no other."""
    run = {"stop": "magnetic < -1 aJ and field < 1 aJ and coulomb == 0"}
    with pytest.raises(sand.BadInput, match=r"run: .*unknown quantity 'coulomb'") as caught:
        check_case({**CASE, "run": run, "forces": {"field": {"flux_density": "1 mT"}}}, "some.toml")
    assert len(caught.value.problems) == 1


def falling(**options):
    """Two grains that fly apart, in a simulation that chooses its cadence unless it is given."""
    grains = sand.Grains([[0, 0, 0], [1e-7, 0, 0]], "10 nm", "iron", velocity=[[0, 0, 0], [1, 0, 0]])
    return sand.Simulation(grains, [sand.Contact()], **options)


def test_a_chosen_cadence_belongs_to_one_run():
    """200 frames for each run to a time; kept only for the same end, to which an interrupted run goes on."""
    first = chosen_cadence(0.0, 1e-9)
    assert first == (pytest.approx(5e-12, rel=1e-12, abs=0.0), 1e-9) and chosen_cadence(4e-10, 1e-9, first) == first
    # 201 intervals of time 0 to the end, of which 200.8 lie in the run
    assert chosen_cadence(1e-9, 1e-6, first) == (pytest.approx(1e-6 / 201, rel=1e-12, abs=0.0), 1e-6)
    assert chosen_cadence(1e-9, math.inf, first) is None is chosen_cadence(1e-9, 1e-9, None)


@pytest.mark.compiled("contacts")
def test_a_second_run_has_a_cadence_of_its_own():
    """A long run after a short one has 200 further frames, not as many as the cadence of the first would give."""
    sim = falling()
    sim.run(until="1 ns")
    sim.run(until="1 us")
    times = sim.ledger["time"]
    assert len(times) == 1 + 200 + 201 and sim.frame_every is None
    assert times[201:] == pytest.approx(1e-6 / 201 * np.arange(1, 202), rel=1e-9, abs=0.0)
    sim.run(steps=50)
    assert len(sim.ledger) == 403, "a run without an end in time has frames at its ends only"
    given = falling(frame_every="0.5 ns")
    given.run(until="1 ns")
    given.run(until="10 ns")
    assert len(given.ledger) == 1 + 20, "a cadence of the user stays"


@pytest.mark.compiled("contacts")
def test_a_resumed_run_keeps_the_chosen_cadence_to_its_end(tmp_path):
    """Interrupted and resumed in another process, all frames are those of one run; a later end has its own cadence."""
    whole = falling()
    whole.run(until="100 ns")
    part = falling(out=tmp_path / "run")
    part.writer.draws = False
    with pytest.raises(sand.Interrupted):
        part.observers = [_Interrupts()]
        part.run(until="100 ns")
    assert 10 < len(part.ledger) < 150
    resumed = sand.resume(tmp_path / "run")
    resumed.writer.draws = False
    resumed.run()
    assert resumed.ledger["time"].tolist() == whole.ledger["time"].tolist()
    resumed = sand.resume(tmp_path / "run")
    resumed.writer.draws = False
    resumed.run(until="10 us")
    assert len(resumed.ledger) == 201 + 201 and "frame_every" not in (tmp_path / "run" / "case.toml").read_text("utf-8")


@pytest.mark.compiled("contacts")
def test_frames_do_not_change_the_motion():
    """The same bits in one run with its 200 frames, in three runs with cadences of their own, and without frames."""
    ends = []
    for pieces in (["100 ns"], ["1 ns", "40 ns", "100 ns"]):
        sim = falling()
        for until in pieces:
            sim.run(until=until)
        ends.append(sim.regular_state.grains.position)
    rare = falling(frame_every="1 s")
    rare.run(until="100 ns")
    assert (ends[0] == ends[1]).all() and (ends[0] == rare.regular_state.grains.position).all()


class _Interrupts(sand.Observer):
    """Sends SIGINT to this process at the hundredth row."""

    def see(self, simulation, row):
        if len(simulation.ledger) == 100:
            os.kill(os.getpid(), signal.SIGINT)
