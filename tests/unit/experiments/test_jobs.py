"""Jobs and long runs: stop signals, wall time, growing tables, standard streams, several processes in one folder."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
import warnings
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import tomli_w

import sand
from sand.basics.errors import warn
from sand.cli.job import InterruptObserver
from sand.cli.main import main
from sand.cli.streams import Output
from sand.compiler.stage import Stage
from sand.experiments import executors
from sand.experiments.executors import results_of
from sand.experiments.growth_boxes import grow
from sand.experiments.job import Job
from sand.experiments.worker import done_apart
from sand.io import lock as lock_files
from sand.io.checkpoint import newest_checkpoint
from sand.io.lock import LOCK, FolderLock
from sand.io.table import GrowingOutcomes, GrowingTable

from ...physics.setups import struck_chain
from ...systems import stops_others

pytestmark = pytest.mark.filterwarnings("ignore:grains overlap too deeply")

BOX = {
    "run": {"until": "4 ns", "frame_every": "0.5 ns"},
    "box": {"periodic": "300 nm"},
    "grains": {"number": 6, "radius": "10 nm", "material": "silica", "temperature": "300 K"},
    "forces": {"contact": {}},
}


@pytest.fixture
def workdir(tmp_path, monkeypatch):
    """An empty folder to work in, with a case of a run; figures are empty."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "box.toml").write_text(tomli_w.dumps(BOX))
    return tmp_path


def content(folder):
    """Ledger, frames and arrays of the last checkpoint of a run."""
    frames = [(f.step, f.time, f.position.tobytes(), f.pair.tobytes()) for f in sand.open(folder).frames]
    arrays, _ = newest_checkpoint(folder)
    return (folder / "ledger.csv").read_text(), frames, {name: one.tobytes() for name, one in arrays.items()}


# --- signals and the wall time ---------------------------------------------------------------------------------------


def test_a_signal_whose_exception_was_lost_stops_a_job():
    """The compiler loses exceptions of its callbacks; a job stops all the same, be it waiting or at work itself."""
    released = threading.Event()
    with InterruptObserver() as interrupts, ThreadPoolExecutor(1) as pool:
        interrupts.received = True
        for executor in (pool, None):
            with pytest.raises(KeyboardInterrupt):
                list(results_of(executor, released.wait, [2.0]))
        released.set()


class Send(sand.Observer):
    """Sends a signal to this process between two steps."""

    def __init__(self, number):
        self.number = number

    def tick(self, simulation):
        signal.raise_signal(self.number)


@stops_others
@pytest.mark.compiled("contacts")
@pytest.mark.parametrize("name", ["SIGUSR1", "SIGUSR2", "SIGHUP", "SIGXCPU"])
def test_signals_of_batch_systems_stop_a_run(tmp_path, name):
    """As SIGTERM does: `Interrupted`, with a checkpoint of the last step."""
    setup, number = struck_chain(), getattr(signal, name)
    simulation = sand.Simulation(setup.grains, setup.forces, out=tmp_path / "run", observers=[Send(number)])
    with pytest.raises(sand.Interrupted) as stopped:
        simulation.run(until="1 s")
    assert newest_checkpoint(tmp_path / "run")[1]["steps"] == stopped.value.result.steps > 0
    assert signal.getsignal(number) is signal.SIG_DFL


@stops_others
@pytest.mark.compiled("contacts")
def test_a_handler_of_the_user_stays():
    """A program that handles SIGUSR1 itself goes on doing so during a run."""
    seen, setup = [], struck_chain()
    before = signal.signal(signal.SIGUSR1, lambda *_: seen.append(1))
    try:
        simulation = sand.Simulation(setup.grains, setup.forces, observers=[Send(signal.SIGUSR1)])
        assert simulation.run(steps=200).outcome is sand.Outcome.FINISHED
    finally:
        signal.signal(signal.SIGUSR1, before)
    assert seen


@stops_others
@pytest.mark.compiled("contacts")
def test_a_signal_prevents_further_compilation(workdir, capsys, monkeypatch):
    """A signal while the first stage is made ready: no other stage is, and the run ends with exit code 130."""
    real, made = Stage.address, []

    def address(self, *given):
        made.append(self)
        signal.raise_signal(signal.SIGTERM)
        return real(self, *given)

    monkeypatch.setattr(Stage, "address", address)
    assert main(["run", "box.toml", "--quiet"]) == 130
    assert len(made) == 1
    monkeypatch.undo()
    assert "interrupted" in capsys.readouterr().err


@pytest.mark.compiled("contacts")
@pytest.mark.parametrize("condition", ["wall > 1 ns", "wall > 1e-9 and time > 0.2 ns", "clusters == 0 or wall > 1e-9"])
def test_a_run_in_parts_of_a_wall_time_has_the_same_bits(tmp_path, condition):
    """Stopped by its wall time at each return of the compiled steps: no frame or row is added."""
    setup = struck_chain()
    given = {"frame_every": "0.15 ns"}
    whole = sand.Simulation(setup.grains, setup.forces, out=tmp_path / "whole", **given)
    whole.run(until="0.5 ns", stop="clusters == 0")
    simulation = sand.Simulation(setup.grains, setup.forces, out=tmp_path / "parts", **given)
    outcomes = [simulation.run(until="0.5 ns", stop=condition).outcome]
    while outcomes[-1] is not sand.Outcome.FINISHED and len(outcomes) < 100:
        outcomes.append(sand.resume(tmp_path / "parts").run().outcome)
    assert len(outcomes) > 2 and set(outcomes[:-1]) == {sand.Outcome.WALL_TIME}
    assert content(tmp_path / "parts") == content(tmp_path / "whole")


@pytest.mark.compiled("contacts")
def test_a_condition_that_is_met_ends_a_run_beside_the_wall_time(tmp_path):
    """`clusters == 1 or wall > 1 h`: the run is not continued when the clusters end it, also at its start."""
    setup = struck_chain()
    simulation = sand.Simulation(setup.grains, setup.forces, out=tmp_path / "run")
    result = simulation.run(until="3 ns", stop="clusters >= 1 or wall > 0 s")
    assert result.outcome is sand.Outcome.CONDITION_MET
    assert sand.resume(tmp_path / "run").run().steps == result.steps


def test_wrong_wall_times():
    """A unit of another kind, and a misspelt name: one line each."""
    setup = struck_chain()
    simulation = sand.Simulation(setup.grains, setup.forces)
    for text, part in (("wall > 3 m", "'3 m'"), ("walls == 3", "did you mean 'wall'")):
        with pytest.raises(sand.BadInput, match=part):
            simulation.run(stop=text)


@pytest.mark.compiled("contacts")
@pytest.mark.parametrize("words", [["run", "box.toml"], ["grow", "box.toml", "--seeds", "1-3"]])
def test_the_option_wall_time(workdir, capsys, words):
    """Exit code 4 and how to continue; the resumed run or job has the bits of an undisturbed one."""
    assert main([*words, "--out", "whole", "--quiet"]) == 0
    assert main([*words, "--out", "cut", "--quiet", "--wall-time", "1 ns"]) == 4  # the command has used it already
    said = capsys.readouterr().err
    assert "the wall time of 1 ns is used up" in said
    again = ["resume", "cut"] if "sand resume cut" in said else [*words, "--out", "cut"]
    assert main([*again, "--quiet"]) == 0
    for one in ("", "seed-1", "seed-3"):
        if (workdir / "whole" / one / "ledger.csv").exists():
            assert content(workdir / "cut" / one) == content(workdir / "whole" / one)
    assert main([*words, "--out", "other", "--wall-time", "3 m"]) == 2
    assert "--wall-time" in capsys.readouterr().err


# --- several processes -----------------------------------------------------------------------------------------------


@pytest.mark.compiled("contacts")
def test_two_jobs_share_a_folder(workdir):
    """The second begins and ends while the first runs: both boxes are there, and growth.json lists them."""
    grow(BOX, [1], "both", on_result=lambda *_: grow(BOX, [2], "both"))
    assert json.loads((workdir / "both" / "growth.json").read_text())["seeds"] == [1, 2]
    assert (workdir / "both" / "seed-2" / "summary.json").exists()
    with pytest.raises(sand.BadInput, match=r"different \[box\]"):
        grow(BOX | {"box": {"periodic": "301 nm"}}, [3], "both")


@pytest.mark.compiled("contacts")
def test_a_box_that_is_written_by_another_process_is_waited_for(workdir, monkeypatch):
    """As by a worker whose parent was killed; after a while it is an error of one line."""
    (workdir / "both" / "seed-1").mkdir(parents=True)
    held = FolderLock(workdir / "both" / "seed-1")
    threading.Timer(0.5, held.release).start()
    grow(BOX, [1], "both")
    held = FolderLock(workdir / "both" / "seed-1")
    monkeypatch.setattr("sand.experiments.growth_boxes.PATIENCE", 0.1)
    with pytest.raises(sand.BadInput, match="writes to"):
        grow(BOX, [1], "both")
    held.release()


@pytest.mark.compiled("contacts")
def test_a_damaged_summary_of_a_box_is_written_again(workdir):
    """With a changed number, and with a changed name of the digest, which would switch the check off."""
    grow(BOX, [1], "g")
    path = workdir / "g" / "seed-1" / "summary.json"
    text = path.read_text()
    for old, new in (('"steps": ', '"steps": 1'), ('"sha256"', '"sha255"')):
        path.write_text(text.replace(old, new))
        with pytest.warns(UserWarning, match="does not match its digest; the end of this run is computed again"):
            grow(BOX, [1], "g")
        assert json.loads(path.read_text())["steps"] == json.loads(text)["steps"]


def failing_work(item):
    """Work with a warning."""
    warn(f"item {item}")
    return 2 * item


@pytest.mark.filterwarnings("default")
def test_warnings_of_other_processes_are_issued_here():
    """`done_apart` returns the texts, each once; in the same process they are issued as ever."""
    assert done_apart(-1, lambda item: [failing_work(item) for _ in range(2)], 3) == ([6, 6], ["item 3"])
    with pytest.warns(UserWarning, match=r"item [12]") as seen, ThreadPoolExecutor(1) as executor:
        assert sorted(results_of(executor, failing_work, [1, 2])) == [(1, 2), (2, 4)]
    assert len(seen) == 2
    assert list(results_of(None, abs, [-1, 2])) == [(-1, 1), (2, 2)]


@pytest.mark.compiled("contacts")
def test_boxes_on_a_cluster(workdir, capsys):
    """`sand grow --scheduler` with a dask worker: all boxes, as with worker processes."""
    distributed = pytest.importorskip("distributed", reason="dask is an extra; the test extra brings it")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, protocol="tcp", host="127.0.0.1", dashboard_address=None
    ) as cluster:
        words = ["--seeds", "1-2", "--out", "g", "--quiet", "--scheduler", cluster.scheduler_address]
        assert main(["grow", "box.toml", *words]) == 0
    assert json.loads((workdir / "g" / "growth.json").read_text())["seeds"] == [1, 2]


# --- where the file system has no locks ------------------------------------------------------------------------------


@pytest.fixture
def _without_locks(monkeypatch):
    import errno

    import filelock

    def fails(self):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(filelock.FileLock, "_acquire", fails)


@pytest.mark.usefixtures("_without_locks")
@pytest.mark.filterwarnings("ignore:the file system of")
def test_without_locks_a_process_that_runs_is_recognised(tmp_path, monkeypatch):
    """By the lock file: of this machine and alive, it is refused; ended, or released, it is not."""
    first = FolderLock(tmp_path)
    with pytest.raises(sand.BadInput, match="another simulation of this process"):
        FolderLock(tmp_path)
    first.release()
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    monkeypatch.setattr(lock_files.os, "getpid", lambda: ended.pid)
    left = FolderLock(tmp_path)
    monkeypatch.undo()
    assert left.is_held


@pytest.mark.compiled("contacts")
@pytest.mark.usefixtures("_without_locks")
@pytest.mark.filterwarnings("ignore:the file system of")
@pytest.mark.parametrize("way", ["lock file", "checkpoint"])
def test_a_run_stops_if_another_process_takes_its_folder(tmp_path, way):
    """A process of another machine writes its name, or a checkpoint of a later step: this run writes nothing more."""
    setup, folder, after = struck_chain(), tmp_path / "run", []

    class Take(sand.Observer):
        def see(self, simulation, row):
            if row["time"] < 0.5e-9 or after:
                return
            if way == "lock file":
                (folder / LOCK).write_text("\0" + "1 elsewhere 0\n")
            else:
                (folder / "checkpoint-000000000999999.npz").write_bytes(b"")
            after.append({path.name: path.read_bytes() for path in folder.glob("[lc]*")})

    given = {"frame_every": "0.1 ns", "checkpoint_every": "0.1 ns", "observers": [Take()]}
    simulation = sand.Simulation(setup.grains, setup.forces, out=folder, **given)
    with pytest.raises(sand.BadInput, match="another process has begun to write to"):
        simulation.run(until="2 ns")
    assert {path.name: path.read_bytes() for path in folder.glob("[lc]*")} == after[0]


# --- the base class of jobs ------------------------------------------------------------------------------------------


class Squares(Job):
    """A job of four tasks, two of them equal, that counts what it computes and stops before a task."""

    COMMAND, RESULTS, KEPT, PARTS = "square", "squares.json", "squares.jsonl", "squares"
    computed, stops_before = (), None

    def tasks(self):
        return [3, 1, 2, 3]

    def work(self):
        return self.square

    def square(self, task, observers=()):
        if task == self.stops_before:
            raise KeyboardInterrupt
        self.computed = (*self.computed, task)
        return {"square": self.content["factor"] * task**2}

    def results(self, outcomes):
        return {"squares": [one["square"] for one in outcomes]}


def test_a_job_keeps_what_is_finished(workdir):
    """Stopped before its third task, a job computes that one alone when it goes on; results are as without a stop."""
    path, folder = workdir / "squares.toml", workdir / "squares"
    path.write_text("factor = 2\n")
    job, seen = Squares(path), []
    job.stops_before = 2
    with pytest.raises(KeyboardInterrupt):
        job.run(progress=lambda text, part: seen.append((text, part)))
    assert seen == [(f"{n} of 3 squares", n / 3) for n in range(3)] and job.folder.resolve() == folder
    assert {one.name for one in folder.iterdir()} == {"case.toml", "squares.jsonl", LOCK}
    with pytest.raises(sand.BadInput, match="exists and is not empty"):
        Squares(path).run()
    again = Squares(folder / "case.toml", folder, resume=True)
    assert again.run() == (found := {"squares": [18, 2, 8, 18], "sand": sand.__version__})
    assert json.loads((folder / "squares.json").read_text()) == found
    assert job.computed == (3, 1) and again.computed == (2,)
    assert {one.name for one in folder.iterdir()} == {"case.toml", "squares.json", LOCK}
    whole = Squares(path, workdir / "whole")
    with ThreadPoolExecutor(2) as pool:
        assert whole.run() == Squares(path, workdir / "there").run(pool) == found
    assert whole.computed == (3, 1, 2)


def test_a_job_refuses_a_folder_of_another_case(workdir):
    """The case of the folder, and that of the outcomes kept in it: one line each; two processes exclude each other."""
    path, folder = workdir / "squares.toml", workdir / "squares"
    path.write_text("factor = 2\n")
    job = Squares(path)
    job.stops_before = 1
    with pytest.raises(KeyboardInterrupt):
        job.run()
    path.write_text("factor = 3\n")
    with pytest.raises(sand.BadInput, match="is another case than the one given"):
        Squares(path, folder, resume=True).run()
    (folder / "case.toml").write_text("factor = 3\n")
    with pytest.raises(sand.BadInput, match="holds outcomes of another case"):
        Squares(path, folder, resume=True).run()
    held = FolderLock(folder)
    with pytest.raises(sand.BadInput, match="another simulation of this process"):
        Squares(path, folder, resume=True).run()
    held.release()


# --- growing tables --------------------------------------------------------------------------------------------------


def damaged(path):
    """For every third byte after the first line: the file with this byte changed, for the block of a loop."""
    whole = path.read_bytes()
    for k in range(whole.index(b"\n") + 1, len(whole), 3):
        for value in (whole[k] ^ 1, 0xFF):
            path.write_bytes(whole[:k] + bytes([value]) + whole[k + 1 :])
            yield k
    path.write_bytes(whole)


def test_changed_rows_of_a_table_are_dropped(tmp_path):
    """One or two rows are missing, with a warning, the others are as they were."""
    rows = [[1, 0.1], [2, 0.2], [3, 1e-300]]
    GrowingTable(tmp_path / "a.csv", ("number", "size")).add(rows)
    for _ in damaged(tmp_path / "a.csv"):
        with warnings.catch_warnings(record=True) as seen:
            warnings.simplefilter("always")
            found = GrowingTable(tmp_path / "a.csv", ("number", "size"), resume=True).rows
        assert 1 <= len(found) < 3 and all(row in rows for row in found)
        assert seen or len(found) == 2  # a last row without an end of line counts as incomplete
    found = np.loadtxt(tmp_path / "a.csv", delimiter=",", skiprows=1)
    assert (found[:, :2] == rows).all()


def test_changed_outcomes_are_dropped(tmp_path):
    """Lines of collisions.jsonl: as for a table."""
    file = GrowingOutcomes(tmp_path / "a.jsonl", {"speed": 1.0})
    given = {seed: {"outcome": "stick", "drift": 0.1 * seed} for seed in (1, 2, 3)}
    for seed, outcome in given.items():
        file.add(seed, outcome)
    for _ in damaged(tmp_path / "a.jsonl"):
        with warnings.catch_warnings(record=True) as seen:
            warnings.simplefilter("always")
            found = GrowingOutcomes(tmp_path / "a.jsonl", {"speed": 1.0}, resume=True).found
        assert len(found) >= 1 and all(given[seed] == outcome for seed, outcome in found.items())
        assert seen or len(found) >= 2  # 0.30000000000000005 is the same number as 0.30000000000000004


# --- standard streams ------------------------------------------------------------------------------------------------


def test_a_stream_without_a_reader():
    """The first error is kept, and nothing is raised, then and later."""
    reader, writer = os.pipe()
    output = Output(writer)
    assert output.write(b"heard") == 5 and os.read(reader, 9) == b"heard"
    os.close(reader)
    for _ in range(2):
        assert output.write(b"lost") == 4
    assert isinstance(output.problem, BrokenPipeError)
    os.close(writer)


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no full device")
@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "redirect", "code"),
    [
        ("cite", ">/dev/full", 2),
        ("cite", "2>&-", 0),
        ("info nowhere", "2>/dev/full", 2),
        pytest.param("info box.toml", ">/dev/full", 2, marks=pytest.mark.validate),
        pytest.param("info box.toml", "2>&-", 0, marks=pytest.mark.validate),
    ],
)
def test_full_and_closed_streams(workdir, words, redirect, code):
    """Lost results are an error of files, lost messages are not; no internal error."""
    command = f"{sys.executable} -m sand.cli.main {words} {redirect}"
    done = subprocess.run(command, shell=True, capture_output=True, text=True)
    assert done.returncode == code
    assert ("cannot write to standard output: No space left on device" in done.stderr) == (redirect == ">/dev/full")
    assert "internal error" not in done.stderr + done.stdout


@pytest.mark.skipif(os.name == "nt", reason="a shell with pipes")
@pytest.mark.compiled("contacts")
def test_a_run_goes_on_without_a_reader(workdir):
    """`sand run … 2>&1 | head -1`: the run finishes."""
    command = f"{{ {sys.executable} -m sand.cli.main run box.toml --out d 2>&1; echo $? > code; }} | head -1"
    assert subprocess.run(command, shell=True, capture_output=True, text=True).stdout
    end = time.monotonic() + 60
    while not (workdir / "code").exists() and time.monotonic() < end:
        time.sleep(0.05)
    assert (workdir / "code").read_text().strip() == "0" and (workdir / "d" / "summary.json").exists()


def test_several_threads_start_processes():
    """Each block begins with the environment of new processes, and the last one restores that of this process."""
    found, before = [], dict(os.environ)

    def start():
        for _ in range(20):
            with executors.starting_processes():
                time.sleep(1e-3)  # another thread is active meanwhile
                found.append(os.environ.get(executors.SAFE_PATH))

    threads = [threading.Thread(target=start) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == ["1"] * 80 and dict(os.environ) == before
