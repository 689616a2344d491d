"""Checkpoint, ledger and trajectory files: complete or reported as damaged."""

import json
import os
import re
import shutil
from pathlib import Path

import gsd.hoomd
import numpy as np
import pytest

import sand
from sand.basics.errors import FilesFailed
from sand.basics.state import STEPS
from sand.io.checkpoint import VERSION, newest_checkpoint, read_checkpoint, write_checkpoint
from sand.io.ledger_table import LedgerFile, read_ledger
from sand.io.run_folder import make_folder, read_toml, replace_file, shows_a_run, write_json, write_toml
from sand.io.trajectory import TrajectoryWriter, read_frames

from ...physics.setups import struck_chain
from ..synthetic_trajectories import write_trajectory

pytestmark = pytest.mark.filterwarnings("ignore:grains overlap too deeply")

REFERENCE = Path(__file__).parents[2] / "reference"
ARRAYS, META = read_checkpoint(next((REFERENCE / f"run-v{VERSION}").glob("*.npz")))
META = {name: value for name, value in META.items() if name not in ("format", "version", "sha256")}


def write_state(folder, steps):
    """A checkpoint of this step with the reference state."""
    count = ARRAYS["count"].copy()
    count[STEPS] = steps
    return write_checkpoint(folder, {**ARRAYS, "count": count}, {**META, "steps": steps})


def test_checkpoint_round_trip_is_bit_for_bit(tmp_path):
    """Arrays, types and metadata; the two newest are kept."""
    for steps in (1, 2, 30):
        write_state(tmp_path, steps)
    assert len(list(tmp_path.glob("checkpoint-*.npz"))) == 2
    arrays, meta = newest_checkpoint(tmp_path)
    assert meta["steps"] == 30
    for name in ARRAYS.keys() - {"count"}:
        array = ARRAYS[name]
        assert arrays[name].tobytes() == array.tobytes()
        assert arrays[name].dtype == array.dtype


@pytest.mark.parametrize("damage", ["flip", "truncate", "empty", "text"])
def test_a_damaged_checkpoint_is_refused_and_the_older_one_used(tmp_path, damage):
    """A flipped bit, a truncated, empty or foreign file: one line and the older checkpoint."""
    write_state(tmp_path, 1)
    path = write_state(tmp_path, 2)
    content = bytearray(path.read_bytes())
    if damage == "flip":
        at = content.find(ARRAYS["grains/radius"].tobytes())
        content[at + 7] ^= 1
    cut = {"flip": bytes(content), "truncate": bytes(content[:200]), "empty": b"", "text": b"hello"}[damage]
    path.write_bytes(cut)
    with pytest.raises(sand.BadInput, match=re.escape(str(path))):
        read_checkpoint(path)
    with pytest.warns(UserWarning, match=rf"{path.name}.*now {path.name}.damaged.*continues from .*0001.npz"):
        assert newest_checkpoint(tmp_path)[1]["steps"] == 1
    assert path.with_name(f"{path.name}.damaged").read_bytes() == cut


@pytest.mark.parametrize(
    ("version", "advice"), [(99, "update SAND"), (VERSION - 1, "the development version that wrote")]
)
def test_a_checkpoint_of_another_format_is_refused(tmp_path, monkeypatch, version, advice):
    """One line says what to do; the file stays, and no older one is used instead."""
    monkeypatch.setattr("sand.io.checkpoint.VERSION", version)
    path = write_state(tmp_path, 2)
    monkeypatch.undo()
    write_state(tmp_path, 1)
    for read, source in ((read_checkpoint, path), (newest_checkpoint, tmp_path)):
        with pytest.raises(sand.BadInput, match=rf"format {version}.*{advice}"):
            read(source)
    assert path.exists()


def test_a_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    """The disk fills up during writing: the old content stays, and the message names the file."""
    path = tmp_path / "x.json"
    replace_file(path, b"old")

    def full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(FilesFailed, match=r"x\.json.*No space left.*untouched"):
        replace_file(path, b"new")
    assert path.read_bytes() == b"old"


def test_folders_are_never_overwritten_unasked(tmp_path):
    """A non-empty folder is refused; `overwrite` removes SAND's files only."""
    folder = tmp_path / "run"
    make_folder(folder)
    (folder / "notes.txt").write_text("mine")
    (folder / "summary.json").write_text("{}")
    for overwrite, expected in ((False, "not empty"), (True, "nothing shows that SAND wrote")):
        with pytest.raises(sand.BadInput, match=expected):
            make_folder(folder, overwrite=overwrite)
    assert (folder / "summary.json").exists()
    write_toml(folder / "case.toml", {}, "a run")
    make_folder(folder, overwrite=True)
    assert (folder / "notes.txt").read_text() == "mine"
    assert not (folder / "summary.json").exists()
    with pytest.raises(sand.BadInput, match="is a file"):
        make_folder(folder / "notes.txt")


def test_a_trajectory_shows_a_run(tmp_path):
    """One of SAND alone is overwritten; a GSD file of another program, or any other content, is not."""
    path = write_trajectory(tmp_path / "trajectory.gsd", [[(0, 1)]], 4)
    assert shows_a_run(tmp_path)
    path.unlink()
    with gsd.hoomd.open(path, "w") as file:
        file.append(gsd.hoomd.Frame())
    assert not shows_a_run(tmp_path)
    path.write_bytes(b"\xff" * 100)
    assert not shows_a_run(tmp_path)


def test_json_and_toml(tmp_path):
    """NumPy numbers become plain numbers, NaN becomes null, floats survive TOML to the last bit."""
    write_json(tmp_path / "a.json", {"x": np.float64(1.5), "n": np.int64(3), "bad": float("nan"), "l": [np.inf]})
    assert json.loads((tmp_path / "a.json").read_text()) == {"x": 1.5, "n": 3, "bad": None, "l": [None]}
    values = {"run": {"until": 0.1 + 0.2, "tiny": 5e-324}}
    write_toml(tmp_path / "a.toml", values, "a comment")
    assert read_toml(tmp_path / "a.toml") == values


def test_the_ledger_file_begins_with_the_rows_it_is_given(tmp_path):
    """A restart rewrites the file; an incomplete last line is ignored; numbers are exact to the last bit."""
    path = tmp_path / "ledger.csv"
    file = LedgerFile(path, ["step", "x"])
    for step in (0, 5, 9):
        file.append({"step": step, "x": 0.1 * step})
    with open(path, "a") as torn:
        torn.write("12")
    assert [row["step"] for row in read_ledger(path)] == [0, 5, 9]
    LedgerFile(path, ["step", "x"], read_ledger(path)[:2])
    assert read_ledger(path) == [{"step": 0, "x": 0.0}, {"step": 5, "x": 0.5}]


@pytest.mark.validate
def test_trajectory_round_trip(tmp_path):
    """Positions to float32 of a radius, moments and times to the last bit, contacts as bonds; GSD reads it."""
    sim = struck_chain(moment="200 A m^2/kg")
    sim = sand.Simulation(sim.grains, sim.forces, out=tmp_path / "run", frame_every="0.1 ns")
    sim.run(until="0.5 ns")
    frames = read_frames(tmp_path / "run" / "trajectory.gsd")
    assert len(frames) == len(sim.ledger) == 6
    last = frames[-1]
    assert last.time == sim.time
    assert last.step == sim.state.steps
    assert last.position == pytest.approx(sim.grains.position, abs=1e-6 * 1e-8 * 20)
    assert (last.moment == sim.grains.moment).all()
    assert last.radius == pytest.approx(sim.grains.radius, rel=1e-6, abs=0.0)
    assert (last.pair == sim.contacts["pair"]).all()
    assert last.box.is_open
    with gsd.hoomd.open(str(tmp_path / "run" / "trajectory.gsd"), "r") as file:
        assert file[-1].particles.types == ["iron"]
        assert len(sim.contacts["pair"]) == file[-1].bonds.N


def test_foreign_files_are_named(tmp_path):
    """A file that is not a trajectory, and a missing one."""
    path = tmp_path / "trajectory.gsd"
    with pytest.raises(sand.BadInput, match="there is no file"):
        read_frames(path)
    path.write_bytes(b"not a trajectory" * 100)
    with pytest.raises(sand.BadInput, match="not a trajectory"):
        read_frames(path)
    TrajectoryWriter(path).close()
    whole = path.read_bytes()
    for size in (0, 3, 50, len(whole) // 3):
        path.write_bytes(whole[:size])
        with pytest.raises(sand.BadInput, match=r"cut off.*sand resume") as message:
            read_frames(path)
        assert str(message.value).count(str(path)) == 1


@pytest.mark.compiled("small")
def test_the_reference_checkpoint_is_read(tmp_path):
    """The folder made by tests/reference/make_checkpoint.py has the recorded time and contacts."""
    folder = tmp_path / "run"
    shutil.copytree(Path(__file__).parents[2] / "reference" / f"run-v{VERSION}", folder)
    sim = sand.resume(folder)
    assert 3e-11 < sim.time < 6e-11
    assert len(sim.contacts["pair"]) == 3


@pytest.mark.validate
def test_the_reference_checkpoint_is_continued(tmp_path):
    """The same folder runs to its end."""
    folder = tmp_path / "run"
    shutil.copytree(Path(__file__).parents[2] / "reference" / f"run-v{VERSION}", folder)
    sim = sand.resume(folder)
    assert 3e-11 < sim.time < 6e-11
    assert len(sim.contacts["pair"]) == 3
    result = sim.run(until="80 ps")
    assert result.outcome is sand.Outcome.FINISHED
    assert result.drift < 1e-3


@pytest.mark.compiled("contacts")
def test_case_and_ledger_are_restored_from_the_checkpoint(tmp_path):
    """Without case.toml and ledger.csv a run resumes and both are restored; a changed case is refused."""
    folder = tmp_path / "run"
    sim = struck_chain()
    sim = sand.Simulation(sim.grains, sim.forces, out=folder, frame_every="0.1 ns")
    sim.run(until="0.5 ns")
    case, ledger = (folder / "case.toml").read_text(), (folder / "ledger.csv").read_text()
    (folder / "case.toml").unlink()
    (folder / "ledger.csv").write_text("step,time\n7,nonsense")
    assert sand.resume(folder).ledger.rows == sim.ledger.rows
    with pytest.warns(UserWarning, match="did not hold what the run had written"):
        sand.resume(folder).run()
    assert (folder / "case.toml").read_text() == case
    assert (folder / "ledger.csv").read_text() == ledger
    (folder / "case.toml").write_text(case.replace("density = ", "density = 1"))
    with pytest.raises(sand.BadInput, match=r"\[materials\] is not what the run began with.*--from"):
        sand.resume(folder)
    for wrong in (
        case + "\n[neighbours]\n",
        case.replace("frame_every = ", "frame_every = 1"),
        "[run]\nuntil = 1e-9\n",
    ):
        (folder / "case.toml").write_text(wrong)
        with pytest.raises(sand.BadInput):
            sand.resume(folder)
    (folder / "case.toml").write_text(case.replace("until = 5e-10", 'until = "0.6 ns"'))  # the end time may change
    assert sand.resume(folder).run().time >= 6e-10
    (folder / "case.toml").write_text("grains = 3\n")
    with pytest.raises(sand.BadInput, match=r"case\.toml"):
        sand.resume(folder)


@pytest.mark.validate
def test_forces_and_columns_keep_the_order_of_the_script(tmp_path):
    """For any order of the forces, each energy of a resumed ledger is in its own column."""
    grains = sand.Grains([[0, 0, 0], [3e-6, 0, 0]], 1e-6, "silica", charge=1e-17)
    forces = [sand.Gravity([0, 0, -9.81]), sand.ElectricField([0, 0, 1000.0]), sand.Contact()]
    settings = {"frame_every": 1e-8, "stepping": sand.Verlet(step=1e-9)}
    sim = sand.Simulation(grains, forces, out=tmp_path / "run", **settings)
    sim.run(until=3e-8)
    again = sand.resume(tmp_path / "run")
    assert [force.name for force in again.forces] == ["gravity", "electric", "contact"]
    assert again.ledger.rows == sim.ledger.rows
    again.run(until=5e-8)
    whole = sand.Simulation(grains, forces, **settings)
    whole.run(until=5e-8)
    assert (again.grains.position == whole.grains.position).all()
    assert again.ledger["electric"].tolist() == whole.ledger["electric"].tolist()


@pytest.mark.compiled("contacts")
def test_frames_of_another_history_are_replaced(tmp_path):
    """Frames after the checkpoint that differ in any bit (other machine, damage) are rewritten."""
    sim = struck_chain()
    true = sand.Simulation(sim.grains, sim.forces, out=tmp_path / "true", frame_every="0.1 ns")
    true.run(until="1 ns")
    first = sand.Simulation(sim.grains, sim.forces, out=tmp_path / "run", frame_every="0.1 ns")
    first.run(until="0.5 ns")
    good = {path: path.read_bytes() for path in (tmp_path / "run").glob("checkpoint-*.npz")}
    first.state.grains.arrays.velocity[0, 0] += 10.0
    first.run(until="1 ns")
    for late in (tmp_path / "run").glob("checkpoint-*.npz"):
        late.unlink()
    for path, state in good.items():
        path.write_bytes(state)
    again = sand.resume(tmp_path / "run")
    again.run(until="1 ns")
    ours, theirs = (
        [(f.step, f.position.tobytes(), f.velocity.tobytes()) for f in read_frames(tmp_path / name / "trajectory.gsd")]
        for name in ("run", "true")
    )
    assert ours == theirs


@pytest.mark.compiled("contacts")
def test_an_unrepairable_trajectory_is_renamed(tmp_path):
    """The checkpoint suffices: the damage is reported, the file renamed, a new one started."""
    sim = struck_chain()
    sim = sand.Simulation(sim.grains, sim.forces, out=tmp_path / "run", frame_every="0.1 ns")
    sim.run(until="0.3 ns")
    sim.writer._trajectory.close()
    (tmp_path / "run" / "trajectory.gsd").write_bytes(b"rubbish" * 1000)
    with pytest.warns(UserWarning, match="cannot be repaired"):
        sand.resume(tmp_path / "run").run(until="0.5 ns")
    assert (tmp_path / "run" / "trajectory.gsd.damaged").read_bytes().startswith(b"rubbish")
    assert len(read_frames(tmp_path / "run" / "trajectory.gsd")) == 2
