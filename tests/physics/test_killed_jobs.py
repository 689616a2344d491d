"""Jobs of two worker processes with six tasks, stopped at any moment: what is left, and the resume."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import sand
from sand.cli.exits import BAD_INPUT, DONE, INTERRUPTED
from sand.cli.main import main
from sand.io.checkpoint import newest_checkpoint
from sand.io.sweep_files import COST
from sand.io.trajectory import read_frames

from ..cases import COMPRESSION
from ..systems import KILL

pytestmark = [
    pytest.mark.filterwarnings("ignore:the rate,"),
    pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes of a group are listed in /proc"),
    pytest.mark.compiled("contacts"),
]

CASES = {
    "grow": """
[run]
until = "20 ns"
frame_every = "1 ns"
[box]
periodic = "0.25 um"
[grains]
number = 30
radius = "10 nm"
material = "silica"
temperature = "300 K"
[forces.contact]
[grow]
seeds = [1, 2, 3, 4, 5, 6]
""",
    "collide": """
[target]
kind = "bpca"
grains = 6
radius = "0.1 um"
[projectile]
kind = "bpca"
grains = 3
radius = "0.1 um"
[impact]
speed = "3 m/s"
end = "rest"
seeds = [1, 2, 3, 4, 5, 6]
[forces.contact]
""",
    "scatter": """
[projectile]
radius = "10 nm"
material = "iron"
moment = "200 A m^2/kg"
[flight]
temperature = "100 K"
speed = [1, 2]
speed_unit = "thermal"
start = "10 b_max"
[measure]
job = "cross-section"
relative_error = 0.01
seed = 3
""",
}
CASES["compress"] = COMPRESSION.replace("1 m/s", "0.2 m/s").replace("[1, 2]", "[1, 2, 3, 4, 5, 6]")
CASES["elastic"] = f"""
[aggregate]
kind = "lattice"
shape = [4, 4, 4]
radius = "0.1 um"
material = "ice"
[elastic]
box = {4 * (2e-7 - sand.theory.contact("ice", "0.1 um").rest_overlap)!r}
strains = [1e-6, 1e-5, 1e-4]
sound = false
seeds = [1, 2, 3, 4, 5, 6]
[forces.contact]
"""
CASES["sweep"] = f"{CASES['collide']}[sweep]\nseeds = 2\n[sweep.vary]\nimpact.speed = [2, 3, 4]\n"
RESULTS = {"grow": "growth.json", "collide": "collision.json", "scatter": "results.csv", "sweep": "sweep.csv"}
RESULTS["compress"] = RESULTS["elastic"] = "laboratory.json"
WAYS = ("Ctrl-C", "SIGTERM", "parent killed", "worker killed")


def start(command, path, folder):
    """A job in a process group of its own, as a terminal starts it; its workers draw nothing."""
    words = [command, str(path)] if command == "resume" else [command, str(path), "--out", str(folder)]
    script = (
        "import sys, sand.plotting.run_figure as r, sand.plotting.collisions, sand.plotting.scattering as s\n"
        "r.save = lambda figure, path: None; s.sigma_figure = sand.plotting.collisions.collision_figure = print\n"
        "from sand.simulation.run_writer import RunWriter; RunWriter.draw = lambda *_: None\n"
        "from sand.cli.main import main\n"
        "if __name__ == '__main__': sys.exit(main(sys.argv[1:]))"
    )
    return subprocess.Popen(
        [sys.executable, "-c", script, *words, "--workers", "2", "--quiet"],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )


def group(number):
    """Ids of the processes of a group that run."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            state, _, one = path.read_text().rpartition(")")[2].split()[:3]
            found += [int(path.parent.name)] if int(one) == number and state not in "ZX" else []
    return found


def workers(job):
    """Ids of the worker processes of a job."""
    found = []
    for one in group(job.pid):
        with contextlib.suppress(OSError):
            found += [one] if b"spawn_main" in Path(f"/proc/{one}/cmdline").read_bytes() else []
    return found


def wait_until(condition, seconds=120.0):
    """Wait for a condition; the time is a limit for broken code only."""
    end = time.monotonic() + seconds
    while not (met := condition()) and time.monotonic() < end:
        time.sleep(0.02)
    assert met


def begun(command, folder, rows=0):
    """Whether the first results of a job are in its folder, and so many rows of them."""
    if command == "sweep":
        return len(list(folder.glob("runs/*/row.json"))) >= max(rows, 1)
    names = {"collide": "collisions.jsonl", "scatter": "flights.csv", "elastic": "loaded.jsonl"}
    path = folder / names.get(command, "seed-2/ledger.csv")
    return path.exists() and len(path.read_text().splitlines()) >= rows


def results(command, folder):
    """The numbers of a finished job, without wall times."""
    if command == "sweep":
        table = sand.open(folder).table
        return {name: column.tolist() for name, column in table.items() if name not in COST}
    if command == "scatter":
        return [(folder / name).read_text() for name in ("results.csv", "flights.csv")]
    found = json.loads((folder / RESULTS[command]).read_text())
    if command == "collide":
        return found["collisions"]
    if command in ("compress", "elastic"):
        return [(folder / "results.csv").read_text(), found["runs"]]
    boxes = [folder / f"seed-{seed}" for seed in found["seeds"]]
    frames = [read_frames(box / "trajectory.gsd") for box in boxes]
    return [
        [(box / "ledger.csv").read_text() for box in boxes],
        [{name: a.tobytes() for name, a in newest_checkpoint(box)[0].items()} for box in boxes],
        [[(f.step, f.time, f.position.tobytes(), f.pair.tobytes()) for f in each] for each in frames],
    ]


def rows_after_checkpoint(box):
    """Whether the ledger of a run has rows that a resumed run computes again."""
    steps = np.loadtxt(box / "ledger.csv", delimiter=",", skiprows=1, ndmin=2)[:, 0]
    return steps[-1] > newest_checkpoint(box)[1]["steps"]


@pytest.fixture(scope="module")
def whole(request, tmp_path_factory):
    """Command and case, results of an undisturbed job, and its duration [s] after its first results."""
    command, parent = request.param, tmp_path_factory.mktemp("whole")
    case = parent / "case.toml"
    case.write_text(CASES[command])
    job = start(command, case, parent / "job")
    wait_until(lambda: begun(command, parent / "job") or job.poll() is not None)
    began = time.monotonic()
    said = job.communicate(timeout=300)[0]
    assert job.returncode == DONE, said
    return command, case, results(command, parent / "job"), time.monotonic() - began


def stop(job, way, worker):
    """Stop a job as a terminal, a batch system, or the kernel does, which kills one of its workers."""
    if way == "Ctrl-C":
        os.killpg(job.pid, signal.SIGINT)
    elif way == "SIGTERM":
        job.send_signal(signal.SIGTERM)
    elif way == "parent killed":
        job.send_signal(KILL)
    else:
        with contextlib.suppress(ProcessLookupError):  # it may just have ended
            os.kill(worker, KILL)


def stop_and_check(job, folder, way):
    """Stop a job: all processes end, with the code and the line of this way, and what they have saved is complete."""
    if job.poll() is None and (found := workers(job)):
        stop(job, way, found[0])
        said = job.communicate(timeout=120)[0]
        wait_until(lambda: not group(job.pid))
        code = {"parent killed": -KILL, "worker killed": BAD_INPUT}.get(way, INTERRUPTED)
        assert job.returncode in (code, DONE), said
        assert way == "parent killed" or job.returncode == DONE or f"sand resume {folder}" in said
        assert "Traceback" not in said
    unsaved = [box for box in folder.glob("seed-*") if list(box.glob("checkpoint-*")) and rows_after_checkpoint(box)]
    assert len(unsaved) <= (way == "worker killed")  # the box of the worker that was killed


@pytest.mark.parametrize(
    ("command", "way"),
    [
        ("grow", "Ctrl-C"),
        ("collide", "worker killed"),
        pytest.param("collide", "parent killed", marks=pytest.mark.validate),
        ("scatter", "SIGTERM"),
        ("sweep", "parent killed"),
        ("compress", "worker killed"),
        ("elastic", "SIGTERM"),
    ],
)
def test_stopped_once(tmp_path, command, way):
    """In its middle, with two workers; the job resumed in this process has the results of an undisturbed one here."""
    case, folder, undisturbed = (tmp_path / name for name in ("case.toml", "job", "undisturbed"))
    case.write_text(CASES[command])
    assert main([command, str(case), "--out", str(undisturbed), "--workers", "1", "--quiet"]) == DONE
    job = start(command, case, folder)
    wait_until(lambda: begun(command, folder, rows=7 if command in ("grow", "compress") else 2))
    assert job.poll() is None and workers(job)
    stop_and_check(job, folder, way)
    assert job.returncode != DONE
    if command == "grow":
        saved = [newest_checkpoint(box) for box in folder.glob("seed-*") if list(box.glob("checkpoint-*"))]
        assert way == "worker killed" or any(meta["steps"] > 0 for _, meta in saved)
    assert main(["resume", str(folder), "--workers", "1", "--quiet"]) == DONE
    assert results(command, folder) == results(command, undisturbed)


@pytest.mark.validate
def test_a_sweep_that_loses_two_workers(tmp_path):
    """New processes go on with the sweep, which ends by itself, with the results of an undisturbed one."""
    case, folder, undisturbed = (tmp_path / name for name in ("case.toml", "job", "undisturbed"))
    case.write_text(CASES["sweep"])
    assert main(["sweep", str(case), "--out", str(undisturbed), "--workers", "1", "--quiet"]) == DONE
    job = start("sweep", case, folder)
    for rows in (1, 3):
        wait_until(lambda rows=rows: begun("sweep", folder, rows=rows) and workers(job))
        assert job.poll() is None
        os.kill(workers(job)[0], KILL)
    said = job.communicate(timeout=300)[0]
    assert job.returncode == DONE, said
    assert said.count("a worker process died (by SIGKILL); the sweep goes on with new ones") == 1  # each note once
    assert results("sweep", folder) == results("sweep", undisturbed)


@pytest.mark.validate
@pytest.mark.parametrize("whole", CASES, indirect=True)
@pytest.mark.parametrize("moment", [k / 11 for k in range(1, 11)])
@pytest.mark.parametrize("way", WAYS)
def test_stopped_at_ten_moments(whole, tmp_path, way, moment):
    """At each eleventh of the job; the resumed job, in processes of its own, has the results of the undisturbed one."""
    command, case, expected, seconds = whole
    folder = tmp_path / "job"
    job = start(command, case, folder)
    wait_until(lambda: begun(command, folder))
    with contextlib.suppress(subprocess.TimeoutExpired):
        job.wait(0.8 * moment * seconds)
    stop_and_check(job, folder, way)
    again = start("resume", folder, folder)
    said = again.communicate(timeout=300)[0]
    assert again.returncode == DONE, said
    assert results(command, folder) == expected
