"""Cross-sections: replay, executors, interruptions, the command, errors."""

import json
import os
import subprocess
import sys
import time
from concurrent.futures import Executor, Future

import numpy as np
import pytest

import sand
from sand.cli.main import main
from sand.experiments.executors import executor_for
from sand.experiments.scattering import cross_sections as scattering
from sand.experiments.scattering.flights import COLUMNS, fly, replay
from sand.experiments.scattering.maps import probability_map
from sand.experiments.scattering.sampling import Task

from ...systems import KILL

GRAINS = {"radius": "10 nm", "material": "iron", "moment": "200 A m^2/kg", "temperature": "100 K"}
CASE = """
[projectile]
radius = "10 nm"
material = "iron"
moment = "200 A m^2/kg"

[flight]
temperature = "100 K"
speed = [1, 2]
speed_unit = "thermal"
start = "4 b_max"

[measure]
relative_error = 0.05
seed = 3
"""


class ReversingExecutor(Executor):
    """Runs tasks when results are requested, the last first."""

    def __init__(self):
        self.waiting = []

    def submit(self, function, /, *args, **options):
        future = Future()
        self.waiting.append((future, function, args))
        if len(self.waiting) >= 1:
            for one, work, given in reversed(self.waiting):
                if not one.done():
                    one.set_result(work(*given))
        return future


def numbers(found):
    """Everything that does not depend on wall time."""
    output = found.to_dict()
    output.pop("seconds")
    return json.dumps({k: np.asarray(v).tolist() for k, v in output.items()})


@pytest.fixture
def here():
    return scattering.cross_section(
        **GRAINS, speed=1, speed_unit="thermal", start="4 b_max", relative_error=0.05, seed=3
    )


@pytest.mark.compiled("scattering")
def test_replay_of_one_trajectory(here):
    """A row of a batch of 200 and its replay: the same end, time and distance, to the bit."""
    pair = scattering.flight(**GRAINS, speed=1, speed_unit="thermal", start="4 b_max", spin="kT/2")
    width = float(here.profile[0, 1])
    rows = fly(pair, [Task(5, 100, 300)], width, seed=9)
    for k in (0, 77, 199):
        alone = replay(pair, 5, 100 + k, width, seed=9)
        row = dict(zip(COLUMNS, rows[k], strict=True))
        assert alone.time[-1] == row["time"]
        assert alone.time.size == row["steps"] + 1
        assert alone.impact_parameter == row["impact_parameter"]
        assert ("hit", "miss").index(alone.end) == row["end"]


@pytest.mark.compiled("scattering")
def test_any_split_gives_the_same_numbers(here, monkeypatch):
    """Batches of 64 in reverse order: the bits of one batch after the other.  Other seeds, other numbers."""
    pair = scattering.flight(**GRAINS, speed=1, speed_unit="thermal", start="4 b_max")
    monkeypatch.setattr(scattering, "MOST", 64)
    again = scattering.measure(pair, relative_error=0.05, seed=3, executor=ReversingExecutor())
    assert numbers(again) == numbers(here)
    other = scattering.measure(pair, relative_error=0.05, seed=4)
    assert numbers(other) != numbers(here)


@pytest.mark.validate
def test_on_a_cluster_that_loses_a_worker(here, monkeypatch):
    """dask.distributed with two workers, one killed after the first batch: the same numbers."""
    distributed = pytest.importorskip("distributed", reason="dask is an extra; the test extra brings it")
    monkeypatch.setattr(scattering, "MOST", 32)
    pair = scattering.flight(**GRAINS, speed=1, speed_unit="thermal", start="4 b_max")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, host="127.0.0.1", dashboard_address=None
    ) as cluster:
        victim = next(iter(cluster.workers.values()))
        killed = []

        def kill(rows):
            if not killed:
                killed.append(victim.pid)
                os.kill(victim.pid, KILL)

        with executor_for(scheduler=cluster.scheduler_address) as executor:
            found = scattering.measure(pair, relative_error=0.05, seed=3, executor=executor, keep=kill)
        assert killed
    assert numbers(found) == numbers(here)


@pytest.mark.compiled("scattering")
def test_resume_computes_missing_trajectories_only(here):
    """With the rows of half the trajectories the other half is computed; the same result."""
    pair = scattering.flight(**GRAINS, speed=1, speed_unit="thermal", start="4 b_max")
    rows, later = [], []
    undisturbed = scattering.measure(pair, relative_error=0.05, seed=3, keep=lambda new: rows.extend(new.tolist()))
    again = scattering.measure(
        pair, relative_error=0.05, seed=3, known=rows[::2], keep=lambda new: later.extend(new.tolist())
    )
    assert numbers(again) == numbers(undisturbed) == numbers(here)
    assert len(later) == len(rows) - len(rows[::2])


@pytest.mark.compiled("scattering")
def test_hit_map():
    """Hits where σ has them: P = 1 in the middle, 0 beyond b_max; all trajectories are listed."""
    trajectories = [scattering.flight(**GRAINS, speed=v, speed_unit="thermal", start="4 b_max") for v in (0.5, 2)]
    found = probability_map(trajectories, cells=6, per_cell=16)
    assert (found.flights == 16).all()
    assert (found.probability[:, 0] == 1.0).all()
    assert (found.probability[:, 5] == 0.0).all()
    low, high = found.interval()
    assert (low <= found.probability).all() and (found.probability <= high).all()
    assert len(found.to_rows()) == 12
    assert found.edges[:, -1] == pytest.approx(1.2 * found.capture, rel=1e-12, abs=0.0)


@pytest.mark.draws
@pytest.mark.compiled("scattering")
def test_the_command(tmp_path, capsys):
    """Two speeds: files, figure, JSON; the folder is not overwritten; resuming computes no trajectory."""
    case, out = tmp_path / "case.toml", tmp_path / "out"
    case.write_text(CASE)
    assert main(["scatter", str(case), "--out", str(out), "--json"]) == 0
    output = json.loads(capsys.readouterr().out)
    assert [round(one["c"], 1) for one in output["cross_sections"]] == [1.0, 1.0]
    assert output["versions"]["numba"] and output["seed"] == 3
    assert {p.name for p in out.iterdir()} == {
        ".lock",
        "case.toml",
        "flights.csv",
        "results.csv",
        "scattering.json",
        "figure.png",
    }
    assert (out / "figure.png").stat().st_size > 10_000
    before = {p.name: p.read_bytes() for p in out.iterdir()}
    assert main(["scatter", str(case), "--out", str(out)]) == 2
    assert "sand resume" in capsys.readouterr().err
    assert main(["scatter", str(case), "--out", str(out), "--resume"]) == 0
    assert "sigma = " in capsys.readouterr().out
    for name in ("flights.csv", "results.csv", "figure.png"):
        assert (out / name).read_bytes() == before[name]
    for path, expected in ((case, "scattering case"), (out, "results.csv"), (out / "scattering.json", "sigma = ")):
        assert main(["info", str(path)]) == 0
        assert expected in capsys.readouterr().out
    case.write_text(CASE.replace("seed = 3", "seed = 4"))
    assert main(["scatter", str(case), "--out", str(out), "--resume"]) == 2
    assert "another case" in capsys.readouterr().err


@pytest.mark.validate
def test_killed_job_is_resumed(tmp_path):
    """Killed, with an incomplete last line: resumed, its files equal those of an undisturbed job."""
    case = tmp_path / "case.toml"
    case.write_text(CASE.replace("[1, 2]", "[1, 1.5, 2]").replace("0.05", "0.01").replace('"4 b_max"', '"20 b_max"'))
    undisturbed, cut = tmp_path / "whole", tmp_path / "cut"
    assert main(["scatter", str(case), "--out", str(undisturbed), "--quiet"]) == 0
    job = subprocess.Popen([sys.executable, "-m", "sand.cli.main", "scatter", str(case), "--out", str(cut), "--quiet"])
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and job.poll() is None:
        if (cut / "flights.csv").exists() and (cut / "flights.csv").stat().st_size > 2e4:
            break
        time.sleep(0.005)
    job.kill()
    job.wait()
    assert (cut / "flights.csv").stat().st_size < 0.9 * (undisturbed / "flights.csv").stat().st_size
    assert not (cut / "scattering.json").exists()
    with open(cut / "flights.csv", "a") as file:
        file.write("0,3,77,1,3.3e-")
    assert main(["resume", str(cut), "--quiet"]) == 0
    for name in ("flights.csv", "results.csv"):
        assert (cut / name).read_bytes() == (undisturbed / name).read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("address", "expected"), [("127.0.0.1:8786", "tcp://"), ("tcp://127.0.0.1:9", "does not answer")]
)
def test_a_scheduler_that_does_not_answer(tmp_path, capsys, monkeypatch, address, expected):
    """One line, exit code 2, nothing written."""
    from sand.experiments import executors

    monkeypatch.setattr(executors, "ANSWER", 0.5)
    case = tmp_path / "case.toml"
    case.write_text(CASE)
    assert main(["scatter", str(case), "--out", str(tmp_path / "out"), "--scheduler", address]) == 2
    lines = [line for line in capsys.readouterr().err.strip().splitlines() if line.startswith("sand:")]
    assert len(lines) == 1 and expected in lines[0]
    assert not (tmp_path / "out").exists()


class Done(Future):
    """A future that has its result."""

    def __init__(self):
        super().__init__()
        self.set_result(None)


@pytest.mark.compiled("scattering")
def test_a_worker_that_dies(tmp_path, capsys, monkeypatch):
    """One line with the command to continue, exit code 2; then the rest is computed."""
    from concurrent.futures import process

    case, out = tmp_path / "case.toml", tmp_path / "out"
    case.write_text(CASE)

    def submit(_pool, _in_worker, work, *_given):
        if work is not int:  # the task by which processes are started
            raise process.BrokenProcessPool("a process was killed")
        return Done()

    with monkeypatch.context() as patch:
        patch.setattr(process.ProcessPoolExecutor, "submit", submit)
        assert main(["scatter", str(case), "--out", str(out), "--workers", "2"]) == 2
    output = capsys.readouterr().err
    assert "a worker process died" in output
    assert "sand resume" in output
    assert main(["scatter", str(case), "--out", str(out), "--resume", "--quiet"]) == 0


@pytest.mark.compiled("scattering")
def test_a_flight_that_cannot_be_computed_is_refused():
    """One line, once the first flights are computed."""
    with pytest.raises(sand.BadInput, match="cannot be computed") as caught:
        scattering.cross_section(**GRAINS, speed=1e-30)
    assert len(caught.value.problems) == 1
