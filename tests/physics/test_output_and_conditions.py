"""Cadences of output change no bit; a condition ends a run at a step that output and interruptions do not change."""

import json
import shutil

import numpy as np
import pytest

import sand
from sand.basics.state import CONTACTS, State
from sand.cli.main import main
from sand.io.checkpoint import newest_checkpoint

from .test_killed import content
from .test_reproducibility import gas_simulation, state

CADENCES = (
    {"frame_every": "log(10 per decade, from 1 ps)"},
    {"frame_every": "1000 steps", "row_every": "0.3 ns"},
    {"frame_every": "3 ns", "row_every": "77 steps", "checkpoint_every": "1 ns"},
)


@pytest.mark.compiled("dipoles")
def test_no_cadence_changes_a_bit(tmp_path):
    """Same regular and final states with any cadence; each frame has a row, and times are those asked for."""
    plain = gas_simulation()
    plain.run(until="6 ns")
    for k, cadence in enumerate(CADENCES):
        sim = gas_simulation(out=tmp_path / str(k), **cadence)
        sim.writer.draws = False
        sim.run(until="6 ns")
        assert state(sim) == state(plain)
        assert sim.regular_state.to_arrays()["clock"].tobytes() == plain.regular_state.to_arrays()["clock"].tobytes()
        run = sand.open(tmp_path / str(k))
        frames, rows, steps = run.frames.times.tolist(), run.ledger["time"].tolist(), run.ledger["step"]
        assert set(frames) <= set(rows) and rows == sorted(set(rows)) and rows[-1] == frames[-1] == 6e-9
        if k == 0:
            assert frames == rows and {1e-12, 1e-11, 1e-10, 1e-9} < set(frames)
        elif k == 1:
            assert {n * 0.3e-9 for n in range(1, 20)} <= set(rows)
            assert [run.frames[n].step // 1000 for n in range(1, len(frames) - 1)] == list(range(1, len(frames) - 1))
        else:
            assert frames == [0.0, 3e-9, 6e-9] and (np.diff(steps // 77) <= 1).all()


@pytest.mark.compiled("dipoles")
def test_states_that_an_observer_keeps_do_not_change(monkeypatch):
    """Views, arrays, groups and states of each output stay as they were, whatever of them is kept; motion is the same.

    States at times of output lie in the same memory, one after another, as long as nobody holds any part of them.
    """
    kept: dict = {
        "view": lambda sim: sim.grains.position,
        "array": lambda sim: sim.state.clock,
        "grains": lambda sim: sim.grains,
        "contacts": lambda sim: sim.state.contacts,
        "state": lambda sim: sim.state,
        "nothing": lambda sim: None,
    }

    def numbers(part):
        """Copies of the arrays in what was kept."""
        if isinstance(part, np.ndarray):
            return [part.copy()]
        held = getattr(part, "arrays", part or ())
        return [array.copy() for array in (held() if callable(held) else held)]

    class Keep(sand.Observer):
        def __init__(self, choose):
            self.choose, self.parts, self.then = choose, [], []

        def see(self, simulation, row):
            self.parts.append(self.choose(simulation))
            self.then.append(numbers(self.parts[-1]))

    copies: list = []
    copy = State.copy
    monkeypatch.setattr(State, "copy", lambda self: copies.append(self) or copy(self))
    ends = []
    for name, choose in kept.items():
        keep = Keep(choose)
        copies.clear()
        sim = gas_simulation(frame_every="0.3 ns", observers=[keep])
        sim.run(until="6 ns")
        ends.append(state(sim))
        assert len(keep.parts) == 21
        for part, then in zip(keep.parts[1:], keep.then[1:], strict=True):
            assert all(np.array_equal(one, other) for one, other in zip(numbers(part), then, strict=True)), name
        # arrays of contacts and pairs grow now and then
        assert len(copies) < 10 if name == "nothing" else len(copies) >= 19, name
    assert all(end == ends[0] for end in ends)


@pytest.mark.compiled("dipoles")
def test_a_resumed_run_continues_its_cadences(tmp_path, monkeypatch):
    """Stopped three times between two outputs: the files have the bits of those of an uninterrupted run."""
    cadence = {"frame_every": "log(5 per decade, from 10 ps)", "row_every": "500 steps", "checkpoint_every": "0.7 ns"}
    monkeypatch.setattr("sand.simulation.run_writer.RunWriter.draw", lambda *_: None)
    gas_simulation(out=tmp_path / "whole", **cadence).run(until="6 ns")

    class Interrupt(sand.Observer):
        def __init__(self, time):
            self.time = time

        def tick(self, simulation):
            if simulation.time > self.time:
                raise KeyboardInterrupt

    sim = gas_simulation(out=tmp_path / "parts", observers=[Interrupt(1e-9)], **cadence)
    for time in (2.5e-9, 4.1e-9, 1.0):
        with pytest.raises(KeyboardInterrupt):
            sim.run(until="6 ns")
        sim = sand.resume(tmp_path / "parts", observers=[Interrupt(time)])
    sim.run()
    whole, parts = content(tmp_path / "whole"), content(tmp_path / "parts")
    assert whole[1] == parts[1] and whole[2] == parts[2] and whole[0] == parts[0]
    assert len(whole[2]) < whole[1].count("\n") - 1
    assert not list((tmp_path / "parts").glob("*damaged*"))  # no frame of a row without one is missed


@pytest.mark.compiled("dipoles")
def test_a_condition_ends_at_the_same_step(tmp_path):
    """With any output, after pieces, and as a function: the same step, a multiple of 100 or the end of its cycle.

    The condition holds at that step and not at the check before, which a run of fewer steps shows.
    """
    text = "(contacts >= 1 or clusters < 3) and time > 1 ns"
    ends = []
    for options in ({}, {"frame_every": "0.13 ns", "row_every": "31 steps"}):
        sim = gas_simulation(**options)
        result = sim.run(until="60 ns", stop=text)
        assert result.outcome is sand.Outcome.CONDITION_MET and result.condition == text and text in str(result)
        assert sim.ledger["contacts"][-1] >= 1 and sim.time == sim.regular_state.time < 60e-9
        ends.append(state(sim))
        assert sim.run(stop=text).steps == result.steps  # still met: no step
    pieces = gas_simulation()
    for steps in (1, 1730, 900):
        assert pieces.run(steps=steps, stop=text).outcome is sand.Outcome.FINISHED
    found = pieces.run(until=lambda sim: sim.time > 1e-9 and len(sim.contacts["pair"]) >= 1)
    assert (found.steps, found.condition) == (result.steps, "given")
    assert ends[0] == ends[1] == state(pieces)
    before = gas_simulation()
    before.run(steps=result.steps - 100)
    assert result.steps % 100 < 12 and before.steps % 100 < 12 and not len(before.contacts["pair"])


CASE = """
[run]
stop = "time > 5 ns and clusters <= 6"
until = "200 ns"
frame_every = "5 ns"
[box]
periodic = "300 nm"
[grains]
number = 6
radius = "10 nm"
material = "silica"
temperature = "300 K"
[forces.contact]
"""


@pytest.mark.compiled("contacts")
def test_condition_in_a_case_file(tmp_path, monkeypatch, capsys):
    """Exit code 0 and the condition in summary.json; resumed only with another condition or --until."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sand.simulation.run_writer.RunWriter.draw", lambda *_: None)
    (tmp_path / "box.toml").write_text(CASE)
    assert main(["run", "box.toml", "--out", "run"]) == 0
    output = capsys.readouterr()
    assert "time > 5 ns and clusters <= 6" in output.out and "the condition that ends the run is met" in output.err
    summary = json.loads((tmp_path / "run/summary.json").read_text())
    assert summary["outcome"] == "condition_met" and summary["condition"] == "time > 5 ns and clusters <= 6"
    assert main(["resume", "run"]) == 0
    assert "its condition is met" in capsys.readouterr().out
    assert json.loads((tmp_path / "run/summary.json").read_text()) == summary
    path = tmp_path / "run/case.toml"
    path.write_text(path.read_text().replace("> 5 ns", "> 40 ns"))
    assert main(["resume", "run", "--quiet"]) == 0
    again = json.loads((tmp_path / "run/summary.json").read_text())
    assert again["outcome"] == "condition_met" and 40e-9 < again["time"] < 100e-9
    assert main(["resume", "run", "--until", "120 ns"]) == 0
    assert "is met and no longer applies" in capsys.readouterr().err
    assert newest_checkpoint(tmp_path / "run")[1]["output_time"] == 120e-9


@pytest.mark.compiled("contacts")
def test_a_function_is_given_again(tmp_path):
    """A run that a function ends asks for it when it is resumed."""
    grains = sand.Grains([[0, 0, 0], [0, 1e-6, 0]], "10 nm", "iron", velocity=[[1, 0, 0], [0, 2, 0]])
    sim = sand.Simulation(grains, [sand.Contact()], stepping=sand.Verlet(step="1 ns"), out=tmp_path / "run")
    sim.writer.draws = False
    assert sim.run(until=lambda sim: sim.time > 150e-9).steps == 200
    again = sand.resume(tmp_path / "run")
    with pytest.raises(sand.BadInput, match="a function of a script"):
        again.run()
    assert again.run(until=lambda sim: sim.steps > 250).steps == 300


@pytest.mark.compiled("dipoles")
def test_a_copy_is_independent(tmp_path):
    """It continues with the same bits from a time between two steps, and neither writes files nor changes the other."""
    sim = gas_simulation(out=tmp_path / "run", frame_every="1 ns")
    sim.writer.draws = False
    sim.run(until="2.3 ns")
    before, files = state(sim), {path: path.stat().st_mtime_ns for path in (tmp_path / "run").iterdir()}
    other = sim.copy()
    assert state(other) == before and other.observers == [] and other.writer is None
    other.run(until="4 ns")
    assert state(sim) == before and len(sim.ledger) < len(other.ledger)
    assert files == {path: path.stat().st_mtime_ns for path in (tmp_path / "run").iterdir()}
    sim.run(until="4 ns")
    assert state(sim) == state(other) and sim.ledger.rows == other.ledger.rows
    assert "t = 4 ns" in sim.status() and f"{sim.steps} steps" in sim.status() and "20 clusters" in sim.status()
    assert repr(other) == f"<simulation of 20 grains (contact, dipoles) at t = 4 ns after {sim.steps} steps>"


@pytest.mark.compiled("contacts")
def test_frames_by_time(finished_run_of_frames):
    """The nearest frame; times beyond the ends are refused."""
    frames = finished_run_of_frames
    assert [frames.at(time).time for time in (0.0, "1.4 ns", 1.6e-9, "3 ns")] == [0.0, 1e-9, 2e-9, 3e-9]
    for time in ("3.1 ns", -1e-9):
        with pytest.raises(sand.BadInput, match="has frames from 0 s to 3 ns"):
            frames.at(time)
    with pytest.raises(sand.BadInput, match="time = '1 m' is a length, not a quantity in s"):
        frames.at("1 m")


@pytest.fixture
def finished_run_of_frames(tmp_path):
    """Frames of a run at 0, 1, 2 and 3 ns."""
    grains = sand.Grains([[0, 0, 0], [0, 1e-6, 0]], "10 nm", "iron", velocity=[[1, 0, 0], [0, 2, 0]])
    sim = sand.Simulation(grains, stepping=sand.Verlet(step="1 ns"), out=tmp_path / "run", frame_every="1 ns")
    sim.writer.draws = False
    sim.run(until="3 ns")
    return sand.open(tmp_path / "run").frames


@pytest.mark.compiled("dipoles")
def test_a_run_that_is_killed_after_a_new_setting_can_be_resumed(tmp_path):
    """case.toml has the setting as soon as the next run begins, and a checkpoint, too; the bits are those without."""

    class Copy(sand.Observer):
        """Copies the folder at the first row, as after a kill."""

        def see(self, simulation, row):
            if row["time"] > 2e-9 and not (tmp_path / "killed").exists():
                shutil.copytree(tmp_path / "run", tmp_path / "killed")

    sim = gas_simulation(out=tmp_path / "run", frame_every="1 ns", observers=[Copy()])
    sim.writer.draws = False
    sim.run(until="2 ns")
    sim.frame_every = "2 ns"
    sim.run(until="6 ns")
    resumed = sand.resume(tmp_path / "killed")
    assert resumed.frame_every == 2e-9
    resumed.run(until="6 ns")
    assert state(resumed) == state(sim)


@pytest.mark.compiled("contacts")
def test_new_contacts_take_nothing_of_broken_ones(tmp_path):
    """A contact that breaks may leave a column that is not finite, and the next contact in it can be saved at once."""
    pair = sand.setup.chain(2, radius="0.1 um", material="silica").position * 1.01
    grains = sand.Grains(pair, "0.1 um", "silica", velocity=-pair / np.linalg.norm(pair, axis=1)[:, None])
    sim = sand.Simulation(grains, [sand.Contact()], out=tmp_path / "run")
    sim.writer.draws = False
    contacts = sim.state.contacts
    assert sim.state.count[CONTACTS] == 0 and contacts.kept.shape[1] > 0
    contacts.kept[...] = np.nan
    while sim.state.count[CONTACTS] == 0:
        sim.run(steps=10)
    assert np.isfinite(sim.state.contacts.kept[:, 0]).all()
    assert sand.resume(tmp_path / "run").steps == sim.steps
