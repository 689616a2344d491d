"""Runs killed at random times, by SIGKILL (also during writes) or SIGTERM, and resumed end in the same bits."""

import random
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from sand.cli.exits import DONE, INTERRUPTED
from sand.cli.main import main
from sand.io.checkpoint import newest_checkpoint
from sand.io.trajectory import read_frames

from ..systems import KILL, stops_others

CASE = """
[run]
until = "40 ns"
frame_every = "0.4 ns"
seed = 3

[box]
periodic = "0.7 um"

[grains]
kind = "gas"
number = 80
radius = "10 nm"
material = "iron"
moment = "200 A m^2/kg"
temperature = "3000 K"
charge = 1e-19

[forces.contact]

[forces.dipoles]
cutoff = "0.15 um"

[forces.charges]
cutoff = "0.15 um"

[forces.gas]
temperature = "100 K"
pressure = "1 mbar"
"""


CHANGED = """
import sys
from pathlib import Path

import numpy as np

import sand
import sand.simulation.run_writer as writer

writer.CHECKPOINT_EVERY = writer.AT_OUTPUT_EVERY = 0.02
writer.RunWriter.draw = lambda *_: None


class Replace(sand.Updater):
    every = "1.7 ns"

    def act(self, simulation):
        with simulation.change() as state:
            leaving = state.grains.position[:, 0] > 0.165e-6
            state.remove(leaving)
            state.velocity[:, 0] += 0.3
            entry = np.array([-0.15e-6, 1e-9 * (simulation.steps % 150), 0.0])
            if leaving.any() and np.linalg.norm(state.grains.position - entry, axis=1).min() > 30e-9:
                state.add(sand.Grains([entry], "8 nm", "silica"))


folder, updaters = Path(sys.argv[1]), [Replace()]
if list(folder.glob("checkpoint-*.npz")):
    simulation = sand.resume(folder, updaters=updaters)
else:
    iron = {"radius": "10 nm", "material": "iron", "moment": "200 A m^2/kg", "charge": 1e-19}
    grains = sand.setup.gas(40, "0.35 um", temperature="3000 K", seed=5, **iron)
    contact = sand.Contact(damping="critical", damping_ratio=0.2, bath_temperature="100 K")
    forces = [contact, sand.Dipoles(), sand.Charges(), sand.Gas(temperature="100 K", pressure="1 mbar")]
    options = {"seed": 3, "frame_every": "0.2 ns", "out": folder, "overwrite": True, "updaters": updaters}
    simulation = sand.Simulation(grains, [*forces, sand.Field("10 mT")], box="0.35 um", **options)
if simulation.time < 10e-9:
    simulation.run(until="10 ns")
if simulation.time == 10e-9 and simulation.forces[-1].name == "field":
    with simulation.change() as state:
        state.forces = state.forces[:-1]
        state.scale_box(1.02)
simulation.run(until="40 ns", stop="time > 25 ns and contacts >= 3")
"""


OUTPUT = """
import sys
from pathlib import Path

import sand
import sand.simulation.run_writer as writer

writer.CHECKPOINT_EVERY = writer.AT_OUTPUT_EVERY = 0.02
writer.RunWriter.draw = lambda *_: None
folder = Path(sys.argv[1])
iron = {"radius": "10 nm", "material": "iron", "moment": "200 A m^2/kg"}
options = {"seed": 3, "frame_every": "0.2 ns", "out": folder, "overwrite": True}
contact = sand.Contact(damping="critical", damping_ratio=0.2, bath_temperature="100 K")
"""

WALLS = """
box = sand.Box.periodic("0.2 um", "0.2 um", None)
grains = sand.setup.gas(40, box, extent="0.3 um", temperature="3000 K", seed=5, **iron)
walls = [
    sand.Wall([0, 0, "-0.15 um"], [0, 0, 1], "iron", velocity=["1 m/s", 0, "1 m/s"]),
    sand.Wall([0, 0, "0.15 um"], [0, 0, -1], "silica", mass="1e-18 kg", force="1e-10 N"),
]
fresh = lambda: sand.Simulation(grains, [contact, sand.Dipoles(cutoff="90 nm")], box=box, walls=walls, **options)
"""

RAMPS = """
times = ["5 ns", "35 ns"]
grains = sand.setup.gas(40, "0.3 um", temperature="3000 K", seed=5, **iron)
weaker = sand.Contact(
    damping="critical", damping_ratio=sand.Ramp([0.2, 0.4], times), surface_energy_factor=sand.Ramp([1.0, 0.7], times)
)
gas = sand.Gas(temperature="100 K", pressure=sand.Ramp(["1 mbar", "1 bar"], times))
field = sand.Field(sand.Ramp(["10 mT", "0 T"], times))
fresh = lambda: sand.Simulation(grains, [weaker, sand.Dipoles(), gas, field], box="0.3 um", **options)
"""

DRIVEN = """
grains = sand.setup.gas(40, "0.3 um", temperature="3000 K", seed=5, **iron)
driven = [sand.Driven([3, 5]), sand.Driven([7], velocity=["10 m/s", 0, 0], spin=[0, 1e8, 0])]
forces = [contact, sand.Dipoles(), sand.Gas(temperature="100 K", pressure="1 mbar")]
fresh = lambda: sand.Simulation(grains, forces, box="0.3 um", driven=driven, **options)
"""

ENDING = """
simulation = sand.resume(folder) if list(folder.glob("checkpoint-*.npz")) else fresh()
simulation.run(until="40 ns")
"""

SCRIPTS = {
    "changes, an updater and a condition": CHANGED,
    "walls": OUTPUT + WALLS + ENDING,
    "ramps": OUTPUT + RAMPS + ENDING,
    "driven grains": OUTPUT + DRIVEN + ENDING,
}


def script_run(script, folder):
    """A process that runs a script, or goes on with its run."""
    return subprocess.Popen([sys.executable, "-c", script, str(folder)], stderr=subprocess.PIPE)


def sand_command(*words):
    """A `sand` process that writes a checkpoint every 0.05 s."""
    script = (
        "import sys; import sand.simulation.run_writer as r; "
        "r.CHECKPOINT_EVERY = 0.05; r.RunWriter.draw = lambda *_: None; "
        "from sand.cli.main import main; sys.exit(main(sys.argv[1:]))"
    )
    return subprocess.Popen([sys.executable, "-c", script, *words], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)


def content(folder):
    """Checkpoint arrays, ledger and frames."""
    arrays, _ = newest_checkpoint(folder)
    frames = read_frames(folder / "trajectory.gsd")
    return (
        {name: array.tobytes() for name, array in arrays.items()},
        (folder / "ledger.csv").read_text(),
        [(f.step, f.time, f.position.tobytes(), f.pair.tobytes()) for f in frames],
    )


@pytest.fixture(scope="module")
def undisturbed_run(tmp_path_factory):
    """Folder of a run without interruptions, and its wall time [s]."""
    parent = tmp_path_factory.mktemp("whole")
    (parent / "case.toml").write_text(CASE)
    folder = parent / "run"
    begun = time.monotonic()
    assert sand_command("run", str(parent / "case.toml"), "--out", str(folder), "--quiet").wait() == 0
    return parent, folder, time.monotonic() - begun


def killed_and_resumed(undisturbed_run, tmp_path, rng, kills, kind=KILL):
    """Stop a run and each of its resumes by a signal after a random time, then let the last one finish."""
    parent, _, seconds = undisturbed_run
    folder = tmp_path / "run"
    job = sand_command("run", str(parent / "case.toml"), "--out", str(folder), "--quiet")
    flushed = 0
    for _ in range(kills):
        try:
            job.wait(timeout=rng.uniform(0.3, 1.0) * seconds)
        except subprocess.TimeoutExpired:
            job.send_signal(kind)
            ended = 1 if sys.platform == "win32" else -kind
            assert job.wait() in (ended, INTERRUPTED, DONE), job.stderr.read()
        if not list(folder.glob("checkpoint-*.npz")):
            shutil.rmtree(folder, ignore_errors=True)
            job = sand_command("run", str(parent / "case.toml"), "--out", str(folder), "--quiet")
            continue
        frames = read_frames(folder / "trajectory.gsd")
        assert len(frames) >= flushed
        flushed = len(frames)
        job = sand_command("resume", str(folder), "--quiet")
    errors = job.communicate()[1].decode()
    assert job.returncode == 0, errors
    return folder


def assert_same_as_undisturbed(undisturbed_run, folder):
    ours, theirs = content(folder), content(undisturbed_run[1])
    assert ours[1] == theirs[1]
    assert ours[2] == theirs[2]
    assert ours[0].keys() == theirs[0].keys()
    different = [name for name in ours[0] if ours[0][name] != theirs[0][name]]
    assert different == []


@pytest.mark.compiled("listed")
def test_killed_once(tmp_path):
    """Contacts, list, r-RESPA cycles and gas; killed in its middle: same bits in checkpoint, ledger and frames."""
    case, whole, folder = tmp_path / "case.toml", tmp_path / "whole", tmp_path / "run"
    case.write_text(CASE)
    assert main(["run", str(case), "--out", str(whole), "--quiet"]) == DONE
    arrays, _ = newest_checkpoint(whole)
    assert arrays["contacts/pair"].shape[1] > 5  # the run has contacts that could be lost
    assert np.isfinite(arrays["long_range/anchor"]).all()
    job = sand_command("run", str(case), "--out", str(folder), "--quiet")
    while job.poll() is None and not any(not one.stem.endswith("0" * 15) for one in folder.glob("checkpoint-*.npz")):
        time.sleep(0.002)
    job.send_signal(KILL)
    job.communicate()
    assert job.returncode not in (DONE, INTERRUPTED)
    assert main(["resume", str(folder), "--quiet"]) == DONE
    assert_same_as_undisturbed((None, whole), folder)


@stops_others
@pytest.mark.validate
def test_terminated_twice(undisturbed_run, tmp_path):
    """SIGTERM ends a run after the current step with a checkpoint; same bits after two of them."""
    assert_same_as_undisturbed(
        undisturbed_run, killed_and_resumed(undisturbed_run, tmp_path, random.Random(2), 2, signal.SIGTERM)
    )


@pytest.mark.validate
@pytest.mark.parametrize("seed", range(25))
@pytest.mark.parametrize("kind", [KILL, pytest.param(signal.SIGTERM, marks=stops_others)])
def test_stopped_four_times(undisturbed_run, tmp_path, seed, kind):
    """Four stops in each of twenty-five runs, by either signal: same bits."""
    assert_same_as_undisturbed(
        undisturbed_run, killed_and_resumed(undisturbed_run, tmp_path, random.Random(100 + seed), 4, kind)
    )


@pytest.fixture(scope="module", params=SCRIPTS)
def undisturbed_script(request, tmp_path_factory):
    """Script of a run, the folder of this run without interruptions, and the number of its frames."""
    script, folder = SCRIPTS[request.param], tmp_path_factory.mktemp("script") / "run"
    job = script_run(script, folder)
    errors = job.communicate()[1].decode()
    assert job.returncode == 0, errors
    frames = read_frames(folder / "trajectory.gsd")
    assert len(frames[-1].pair) >= 3
    if script is CHANGED:
        assert len({frame.id.tobytes() for frame in frames}) >= 3
        assert frames[-1].time < 40e-9 and len(frames[-1].materials) == 2
    if WALLS in script:
        assert "wall_contacts" in (folder / "ledger.csv").read_text()
        arrays, _ = newest_checkpoint(folder)
        assert arrays["wall_contacts/pair"].shape[1] >= 2
    return script, folder, len(frames)


@pytest.mark.validate
@pytest.mark.parametrize("moment", range(1, 11))
def test_killed_scripts(undisturbed_script, tmp_path, moment):
    """Walls; ramps; driven grains; changes of everything: killed after each eleventh of the rows, same bits."""
    script, _, rows = undisturbed_script
    folder, ledger = tmp_path / "run", tmp_path / "run" / "ledger.csv"
    job = script_run(script, folder)
    while job.poll() is None and not (ledger.exists() and len(ledger.read_text().splitlines()) > rows * moment / 11):
        time.sleep(0.002)
    assert job.poll() is None
    job.send_signal(KILL)
    job.communicate()
    job = script_run(script, folder)
    errors = job.communicate()[1].decode()
    assert job.returncode == 0, errors
    assert_same_as_undisturbed(undisturbed_script, folder)
