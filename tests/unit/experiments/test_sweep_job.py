"""Sweeps whose runs compute nothing: what is computed when, the table, failures, other processes, messages."""

import csv
import json
import shutil
import sys
import tempfile
import threading
import time
import warnings
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from pathlib import Path

import pytest

import sand
from sand.basics.errors import BadInput, FilesFailed
from sand.cli.main import main
from sand.experiments import sweep_job, sweep_row, sweep_table
from sand.experiments.sweep_case import Expected
from sand.experiments.sweep_cases import SweptCollision
from sand.experiments.sweep_job import SweepJob
from sand.experiments.sweep_row import run_row
from sand.io.lock import CLAIM, FolderLock
from sand.io.run_folder import make_folder, write_json
from sand.io.sweep_files import COST

CASE = """
[target]
kind = "bpca"
grains = 6
radius = "0.1 um"
[projectile]
kind = "grain"
radius = "0.1 um"
[impact]
speed = "3 m/s"
seeds = [4, 5]
"""
VARY = {"vary": {"impact.speed": "lin(2 m/s, 4 m/s, 3)", "target.grains": [3, 6]}}


@pytest.fixture
def case(tmp_path, monkeypatch):
    """A case whose runs give their speed and seed as results; the path, and the runs that were computed."""
    computed = []

    def run(self, seed, folder, observers=()):
        speed = self.case.impact.speed
        if speed == 13.0:
            raise BadInput("stopped by physics: too fast")
        if speed == 14.0:
            raise ValueError("a mistake\nin the code")
        if speed == 15.0:
            raise FilesFailed("cannot write: no space left")
        computed.append((speed, self.case.target.grains, seed))
        pieces = (self.case.target.grains, 1) if speed > 3.0 else (self.case.target.grains + 1,)
        lost = {"rolling": 0.1 * seed / 3.0, "breaking": float("nan")}
        return {"outcome": "stick" if seed == 4 else "bounce", "fragments": pieces, "lost": lost, "made": 1}

    monkeypatch.setattr(SweptCollision, "run", run)
    monkeypatch.setattr(SweptCollision, "expected", lambda self, seed: Expected(2.0, 1e8, 3e6))
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "case.toml"
    path.write_text(CASE)
    return path, computed


def rows(folder):
    """Rows of the table without cost and version."""
    with open(Path(folder) / "sweep.csv", encoding="utf-8") as file:
        return [{k: v for k, v in row.items() if k not in (*COST, "version")} for row in csv.DictReader(file)]


def swept(case, settings=VARY, folder="out", executor=None, **how):
    job = SweepJob(case, folder, settings, **how)
    return job.run(executor)


def test_the_table(case):
    """A row for each combination and seed, in the order of the design: values in SI, results flat, then cost."""
    path, computed = case
    content = swept(path)
    assert {name: content[name] for name in ("runs", "done", "failed", "left")} == {
        "runs": 12,
        "done": 12,
        "failed": 0,
        "left": 0,
    }
    found = rows("out")
    expected = [(v, n, s) for v in (2.0, 3.0, 4.0) for n in (3, 6) for s in (4, 5)]
    assert [(float(r["impact.speed"]), int(r["target.grains"]), int(r["seed"])) for r in found] == expected == computed
    assert list(found[0])[:4] == ["impact.speed", "target.grains", "seed", "state"] and list(found[0])[-1] == "run"
    assert found[8]["fragments"] == "3 1" and found[0]["fragments"] == "4" and found[0]["lost_breaking"] == ""
    assert float(found[1]["lost_rolling"]) == 0.1 * 5 / 3.0  # to the last bit
    assert json.loads(Path("out/sweep.json").read_text())["done"] == 12


def test_nothing_is_computed_twice(case):
    """A finished sweep computes nothing; with more values only the new runs, and earlier ones stay in the table."""
    path, computed = case
    swept(path)
    before = rows("out")
    computed.clear()
    swept(path)
    assert computed == [] and rows("out") == before
    more = {"vary": {"impact.speed": ["4 m/s", 5, "2.0 m/s"], "target.grains": [3, 6]}, "seeds": [4, 6]}
    swept(path, more)
    assert sorted(computed) == sorted(
        [(5.0, n, s) for n in (3, 6) for s in (4, 6)] + [(v, n, 6) for v in (2.0, 4.0) for n in (3, 6)]
    )
    assert len(rows("out")) == 12 + 8 and [r for r in rows("out") if r in before] == sorted(
        before, key=rows("out").index
    )


def test_a_further_key(case):
    """A key that was not varied before has in earlier rows the value of the case."""
    path, computed = case
    swept(path, {"vary": {"impact.speed": [2, 3]}})
    swept(path, {"vary": {"impact.speed": [2, 3], "impact.along": ["x", "y"]}})
    assert len(computed) == 8 and sorted(r["impact.along"] for r in rows("out")) == ["x"] * 4 + ["y"] * 4


def test_values_that_are_given_twice(case, capsys):
    """One line says how many runs are the same, and names one: by values in another unit, a random design, or seeds."""
    path, computed = case
    words = ["sweep", str(path), "--quiet", "--out"]
    assert main([*words, "out", "--vary", "impact.speed=2,3,2.0 m/s"]) == 0 and len(computed) == 4
    note = "have the values of others, such as impact.speed = 2.0, seed 4: each is computed once, 4 in all"
    assert capsys.readouterr().err == f"sand: note: 2 of 6 runs {note}\n"
    assert main([*words, "random", "--vary", "target.grains=3,4", "--samples", "9", "--seeds", "1,2,1"]) == 0
    first, second = capsys.readouterr().err.splitlines()
    assert first == "sand: note: --seeds: 1 given more than once; each is used once"
    assert second.startswith("sand: note: 14 of 18 runs have the values of others, such as target.grains = ")
    path.write_text(CASE.replace("[4, 5]", "[4, 5, 4, 6, 6]"))
    computed.clear()
    assert main([*words, "case", "--vary", "impact.speed=2"]) == 0 and len(computed) == 3
    assert capsys.readouterr().err == "sand: note: seeds: 4, 6 given more than once; each is used once\n"


def test_the_order_of_completion_does_not_matter(case):
    """Four threads that end in any order give the same table as this process."""
    path, _ = case
    swept(path)
    with ThreadPoolExecutor(4) as executor:
        swept(path, folder="threads", executor=executor)
    assert rows("threads") == rows("out")


def test_two_processes_in_one_folder(case):
    """Two jobs at once, here in threads: each run is computed once, and the last one writes the whole table."""
    path, computed = case
    jobs = [SweepJob(path, "out", VARY) for _ in range(2)]
    threads = [
        threading.Thread(target=job.run, args=(executor,))
        for job, executor in zip(jobs, [ThreadPoolExecutor(2)] * 2, strict=True)
    ]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
    assert len(computed) == len(set(computed)) == 12
    swept(path, folder="whole")
    assert rows("out") == rows("whole")


def test_another_process_has_just_made_the_folder(case, monkeypatch):
    """A file by which it finds out whether it can write there does not count as one of others."""
    path, _ = case
    seen, real = [], tempfile.NamedTemporaryFile

    def made(**how):
        file = real(**how)
        SweepJob(path, "out", VARY).refuse_others()
        seen.append(file.name)
        return file

    monkeypatch.setattr(tempfile, "NamedTemporaryFile", made)
    make_folder("out", shared=True)
    assert len(seen) == 1


def test_a_run_of_another_process_is_left_to_it(case, monkeypatch):
    """Its folder is locked: after some tries the sweep ends without it, and says that it is left."""
    path, computed = case
    monkeypatch.setattr(sweep_job, "PATIENCE", 2.0)
    monkeypatch.setattr(time, "sleep", lambda seconds: None)
    job = SweepJob(path, "out", VARY)
    place = Path("out/runs") / job.rows[5].name
    place.mkdir(parents=True)
    job.begin()
    claim = FolderLock(place, name=CLAIM)
    content = job.run()
    assert content["left"] == 1 and len(computed) == 11 and not Path("out/sweep.json").exists()
    claim.release()
    assert swept(path)["left"] == 0 and len(computed) == 12


def test_failed_runs(case, capsys):
    """They are named with their message, do not stop the others, are kept, and are computed again on request."""
    path, computed = case
    words = ["sweep", str(path), "--vary", "impact.speed=2,13,14", "--out", "out"]
    assert main(words) == 3
    printed = capsys.readouterr()
    assert "impact.speed = 13.0, seed 4: stopped by physics: too fast" in printed.out
    assert "ValueError: a mistake in the code" in printed.out and "4 failed" in printed.out
    assert [r["state"] for r in rows("out")] == ["done"] * 2 + ["failed"] * 4
    computed.clear()
    assert main([*words, "--quiet"]) == 3 and computed == []  # still failed
    calls = []
    real = SweptCollision.run
    SweptCollision.run = lambda self, *how, **named: calls.append(self.case.impact.speed) or {"outcome": "stick"}
    try:
        assert main([*words, "--retry", "--quiet"]) == 0
    finally:
        SweptCollision.run = real
    assert sorted(calls) == [13.0, 13.0, 14.0, 14.0]
    assert [r["state"] for r in rows("out")] == ["done"] * 6


def test_warnings_that_differ_in_numbers_are_one_note(case, monkeypatch):
    """Each run warns of its own speed, and one of something else: two notes, with the numbers of runs."""
    path, _ = case
    real = SweptCollision.run

    def run(self, seed, folder, observers=()):
        warnings.warn(f"grains at {1.1 * self.case.impact.speed} m/s are fast", UserWarning, stacklevel=1)
        if seed == 5 and self.case.impact.speed == 2.0 and self.case.target.grains == 3:
            warnings.warn("the step is long", UserWarning, stacklevel=1)
        return real(self, seed, folder, observers)

    monkeypatch.setattr(SweptCollision, "run", run)
    with pytest.warns(UserWarning) as noted:
        swept(path)
    texts = [str(one.message) for one in noted]
    assert texts[0].startswith("in 12 runs, for example: grains at ") and texts[1:] == ["in 1 run: the step is long"]


def test_a_full_disk_stops_the_sweep(case):
    """It would let all further runs fail, so no run counts as failed; what was computed stays."""
    path, computed = case
    settings = {"vary": {"impact.speed": [2, 15, 3]}}
    with pytest.raises(FilesFailed, match="no space left"):
        swept(path, settings)
    assert len(rows("out")) == len(computed) == 2


def test_another_version_says_so(case, monkeypatch):
    """Rows name the version that made them."""
    path, _ = case
    swept(path)
    for module in (sweep_row, sweep_table):
        monkeypatch.setattr(module, "version", lambda: "9.9+new")
    with pytest.warns(UserWarning, match=r"out has runs of other versions of SAND: 12 by 0\..*; this one is 9.9\+new"):
        swept(path, {**VARY, "seeds": [7]})
    assert set(sand.open("out").table["version"]) > {"9.9+new"}


def test_a_damaged_row_is_computed_again(case):
    path, computed = case
    swept(path)
    before, row = rows("out"), next(Path("out/runs").glob("*/row.json"))
    row.write_text(row.read_text().replace('"made": 1', '"made": 2'))
    computed.clear()
    with pytest.warns(UserWarning, match="does not match its digest; this run is computed again"):
        swept(path)
    assert len(computed) == 1 and rows("out") == before


class Breaking(Executor):
    """An executor of one process, whose process dies while it computes a run of a certain seed."""

    def __init__(self, folder, seed, times):
        self.folder, self.seed, self.left, self.renewed, self.broken = folder, seed, times, 0, False

    def submit(self, work, *given):
        future, row = Future(), given[-1]
        if self.broken:
            future.set_exception(BrokenExecutor("a process died"))
        elif self.left and row.seed == self.seed:
            self.left, self.broken = self.left - 1, True
            claim = FolderLock(self.folder_of(row), name=CLAIM)  # names this process
            claim.release()
            future.set_exception(BrokenExecutor("a process died"))
        else:
            future.set_result(work(*given))
        return future

    def folder_of(self, row):
        place = Path(self.folder) / "runs" / row.name
        place.mkdir(parents=True, exist_ok=True)
        return place

    def renew(self):
        import os

        self.renewed, self.broken = self.renewed + 1, False
        return {os.getpid(): "by SIGKILL"}


def test_a_worker_that_dies_is_replaced(case):
    """Twice: the table is that of an undisturbed sweep. Three times at the same run: this run counts as failed."""
    path, _ = case
    swept(path, folder="whole")
    executor = Breaking("out", 5, 2)
    with pytest.warns(UserWarning, match="a worker process died \\(by SIGKILL\\); the sweep goes on"):
        swept(path, executor=executor)
    assert executor.renewed == 2 and rows("out") == rows("whole")
    with pytest.warns(UserWarning, match="a worker process died"):
        content = swept(path, {"vary": {"impact.speed": [7]}}, folder="lost", executor=Breaking("lost", 5, 9))
    assert content["failed"] == 1 and "the process that computed it died 3 times" in str(content["failures"])
    said = []
    with pytest.warns(UserWarning, match="a worker process died"):
        SweepJob(path, "said", {"seeds": [5, 6]}).run(
            Breaking("said", 5, 9), progress=lambda *given: said.append(given)
        )
    assert len([line for *_, line in said if line]) == 1


def test_dry_run_and_cost(case, capsys):
    """The runs are listed and their cost is said: 12 runs of 2 s by 2 workers, 2 × 100 MB, 12 × 3 MB and their rows."""
    path, computed = case
    words = ["sweep", str(path), "--vary", "impact.speed=lin(2,4,3)", "--vary", "target.grains=3,6", "--workers", "2"]
    assert main([*words, "--dry-run"]) == 0
    out = capsys.readouterr().out
    assert computed == [] and not Path("case-sweep").exists()
    assert "impact.speed = 2.0, target.grains = 3, seed = 4" in out and "12, 12 left" in out
    assert "about 12 s by 2 workers" in out and "about 200 MB" in out and "about 36.1 MB" in out
    assert main([*words, "--dry-run", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert len(found["runs"]) == 12 and found["expected"]["seconds"] == pytest.approx(24.0, abs=1e-9)


def test_a_disk_that_is_too_small(case, monkeypatch, capsys):
    path, computed = case
    monkeypatch.setattr(SweptCollision, "expected", lambda self, seed: Expected(2.0, 1e8, 1e18))
    assert main(["sweep", str(path), "--seeds", "2"]) == 2
    assert "the files of all runs need about 2e+09 GB, and " in capsys.readouterr().err and computed == []
    assert main(["sweep", str(path), "--seeds", "2", "--files", "none", "--quiet"]) == 0


def test_errors_of_a_set_up_come_before_the_first_run(case, monkeypatch):
    """All of them, with the values; a value that occurs once is among what is set up."""

    def expected(self, seed):
        if self.case.impact.speed == 3.0:
            raise BadInput("the bodies do not fit")
        return Expected(2.0, 1e8, 3e6)

    path, computed = case
    monkeypatch.setattr(SweptCollision, "expected", expected)
    with pytest.raises(BadInput, match=r"case.toml: impact.speed = 3.0, seed \d: the bodies do not fit"):
        swept(path, {"vary": {"impact.speed": [*range(4, 40), 3, *range(40, 60)]}})
    assert computed == []


def test_sweep_in_a_case_file(case, capsys):
    """[sweep] has the settings; options replace those of the same key. Other commands refuse the file."""
    path, computed = case
    path.write_text(
        CASE + '[sweep]\nseeds = 1\nout = "there"\n[sweep.vary]\nimpact.speed = [2, 3]\ntarget.grains = [3, 6]\n'
    )
    assert main(["sweep", str(path), "--vary", "impact.speed=7", "--quiet"]) == 0
    assert computed == [(7.0, 3, 1), (7.0, 6, 1)] and len(rows("there")) == 2
    assert main(["collide", str(path)]) == 2
    assert f"this is a case for `sand sweep`; use: sand sweep {path}" in capsys.readouterr().err
    assert main(["info", str(path)]) == 0
    out = capsys.readouterr().out
    assert "4 of sand collide" in out and "impact.speed" in out and f"sand sweep {path}" in out


def test_resume_and_info(case, capsys):
    """`sand resume DIR` computes what is left, with the seeds of the case; `sand info DIR` tells how far it is."""
    path, computed = case
    job = SweepJob(path, "out", VARY)
    job.begin()
    assert main(["info", "out"]) == 0
    assert "running, or interrupted" in capsys.readouterr().out
    assert main(["resume", "out", "--quiet"]) == 0 and len(computed) == 12
    assert main(["info", "out"]) == 0
    assert "finished: 12 of 12 done, 0 failed" in capsys.readouterr().out
    assert main(["resume", "out"]) == 0
    assert "out is finished; its results are in out/sweep.csv" in capsys.readouterr().out


def test_options_keep_the_random_design_of_the_case(case, capsys):
    """`--samples` and `--design-seed` change only these; without a design in the case it is a Latin hypercube."""
    path, _ = case
    vary = '[sweep.vary]\n"impact.speed" = "lin(2 m/s, 4 m/s)"\n'
    path.write_text(f'{CASE}[sweep]\ndesign = "sobol"\nsamples = 4\n{vary}')
    for words in (["--samples", "8"], ["--design-seed", "3"]):
        assert main(["sweep", str(path), *words, "--out", words[1], "--quiet"]) == 0
    text = [Path(folder, "case.toml").read_text() for folder in "83"]
    assert all('design = "sobol"' in one for one in text) and "samples = 8" in text[0] and "design_seed = 3" in text[1]
    path.write_text(CASE + "[sweep]\n" + vary)
    assert SweepJob(path, settings={"samples": 8}).section.design == "latin hypercube"


def test_boxes_of_growth(case, capsys):
    """Each box is a run: those of the written case have the same names, and no run is computed twice."""
    given = "[grains]\nnumber = 4\nradius = '0.1 um'\n[box]\nperiodic = '4 um'\n[run]\nuntil = '1 ns'\n[grow]\nseeds = "
    path = Path("grow.toml")
    path.write_text(given + "[3, 5]")
    job = SweepJob(path, "out", {"vary": {"grains.number": [4, 5]}})
    job.begin()
    again = SweepJob("out/case.toml", "out", resume=True)
    assert job.seeds == [3, 5] and [row.name for row in again.rows] == [row.name for row in job.rows]
    path.write_text(given + "3")
    assert main(["sweep", "grow.toml", "--vary", "grains.number=4,5"]) == 2
    assert "grow.toml: grow.seeds = 3 must be " in capsys.readouterr().err


def test_python_call_open_and_plot(case):
    """The call, with the content of a case in place of a file; what `sand.open` and `sand plot` make of the folder."""
    import tomllib

    _, computed = case
    found = sand.experiments.sweep(tomllib.loads(CASE), VARY["vary"], seeds=3, folder="out")
    assert len(computed) == 18 and found.keys == ["impact.speed", "target.grains"]
    again = sand.open("out")
    assert repr(again) == "<sweep in out: 18 runs over impact.speed, target.grains>"
    assert again.table["impact.speed"].dtype == float and again.table["target.grains"].dtype == int
    assert set(again.table["lost_rolling"]) == {0.1 * seed / 3.0 for seed in (1, 2, 3)}
    assert again.results[:2] == ["outcome", "fragments"] and again.shown == ["outcome"]
    with pytest.raises(BadInput, match="is not the folder of a run"):
        again.run(0).frames  # noqa: B018
    assert main(["plot", "out", "--what", "outcome,lost_rolling", "--quiet"]) == 0
    assert Path("out/plots/lost_rolling.png").exists()
    assert main(["plot", "out", "--what", "outcom"]) == 2


def test_parquet(case):
    """The same table, with types."""
    parquet = pytest.importorskip("pyarrow.parquet")
    path, _ = case
    swept(path, parquet=True)
    table = parquet.read_table("out/sweep.parquet")
    assert table.num_rows == 12 and table["impact.speed"].to_pylist()[0] == 2.0
    assert table["lost_breaking"].null_count == 12


def test_parquet_goes_on(case, monkeypatch):
    """A table that is there is written again, also without the option; without pyarrow nothing is computed."""
    path, computed = case
    SweepJob(path, "out", VARY).begin()
    Path("out/sweep.parquet").touch()
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    for folder, parquet in (("out", False), ("new", True)):
        with pytest.raises(BadInput, match="--parquet needs "):
            swept(path, folder=folder, parquet=parquet)
    assert computed == []


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ["--vary", "impact.speed=-1,fast"],
            ("impact.speed = -1 must be above 0 m/s", "impact.speed = 'fast' is not a"),
        ),
        (["--vary", "impact.speeed=1"], ("there is no such key; [impact] has: speed, ",)),
        (["--vary", "impact.seeds=1"], ("impact.seeds: give seeds as --seeds, the folder as --out, or in [sweep]",)),
        (["--vary", "impact.speed=1", "--vary", "impact.speed=2"], ("--vary impact.speed is given twice; give all",)),
        (["--vary", "impact.speed"], ("--vary 'impact.speed' must be KEY=VALUES",)),
        (["--seeds", "x"], ("--seeds 'x' must be whole numbers",)),
        (["--seeds", "10000000"], ("seeds = 10000000 must be a number of seeds",)),
        (
            ["--vary", "impact.speed=1", "--design-seed", "3"],
            ("sweep: design_seed = 3 is not used by design = 'every",),
        ),
        (["--vary", "impact.speed=1", "--out", "case.toml"], ("case.toml is a file; give another folder with --out",)),
        (
            ["--vary", "impact.speed=1", "--out", "."],
            (". holds a case of `sand collide` that has not been run, no sweep; give another folder with --out",),
        ),
        (
            ["--vary", "impact.speed=1", "--out", "job"],
            ("job holds collisions of `sand collide`, no sweep; give another folder",),
        ),
        (
            ["--vary", "impact.speed=1", "--out", "sweep"],
            ("sweep holds a sweep of another case, with different [target",),
        ),
        (["--vary", "target.grains=0"], ("target.grains = 0 must be a whole number of at least 1",)),
    ],
)
def test_wrong_input(case, words, message, capsys):
    """One line each, before anything is computed."""
    path, computed = case
    Path("job").mkdir()
    Path("job/case.toml").write_text("# Written by SAND: settings\n" + CASE)
    Path("sweep").mkdir()
    Path("sweep/case.toml").write_text(
        "# Written by SAND: x\n" + CASE.replace("bpca", "bcca") + "[sweep]\nseeds = [1]\n"
    )
    assert main(["sweep", str(path), *words]) == 2
    said = capsys.readouterr().err
    assert all(text in said for text in message) and len(said.splitlines()) == len(message) and computed == []


class Without(Executor):
    """An executor whose worker lacks SAND."""

    def submit(self, work, *given):
        future = Future()
        future.set_exception(ModuleNotFoundError("No module named 'sand'", name="sand"))
        return future


def test_a_worker_without_the_package(case):
    """One line says so; the sweep can be continued."""
    path, computed = case
    with pytest.raises(BadInput, match="a worker or the scheduler lacks the package sand; install sand-dust"):
        swept(path, executor=Without())
    assert swept(path)["done"] == len(computed) == 12


def test_growth_of_a_sweep_is_drawn(case, monkeypatch, capsys):
    """`--what growth` takes the speed of the key and columns of results, and does not average over another key."""
    rows, run = [], SweptCollision.run

    def with_growth(self, seed, folder, observers=()):
        found = {"impact_parameter": 1e-8, "reach": 4e-7, "growth_efficiency": 0.5, "kind": "mass transfer"}
        return run(self, seed, folder, observers) | found

    monkeypatch.setattr(SweptCollision, "run", with_growth)
    monkeypatch.setattr("sand.plotting.collisions.growth_figure", lambda given, title: rows.extend(given))
    monkeypatch.setattr("sand.plotting.run_figure.figure_bytes", lambda *_: b"")
    words = ["sweep", "case.toml", "--seeds", "2", "--files", "none", "--quiet"]
    assert main([*words, "--vary", "impact.speed=1,2", "--out", "speeds"]) == 0
    assert main(["plot", "speeds", "--what", "growth", "--quiet"]) == 0
    assert sorted((row["speed"], row["seed"], row["kind"]) for row in rows) == [
        (speed, seed, "mass transfer") for speed in (1.0, 2.0) for seed in (1, 2)
    ]
    assert main([*words, "--vary", "target.grains=2,3", "--out", "sizes"]) == 0
    capsys.readouterr()
    assert main(["plot", "sizes", "--what", "growth"]) == 2
    assert "would average over target.grains; give columns" in capsys.readouterr().err
    assert main([*words, "--vary", "impact.impact_parameter=0 b,0.5 b", "--out", "parameters"]) == 0
    capsys.readouterr()
    assert main(["plot", "parameters", "--what", "growth"]) == 2
    assert "needs a sweep over impact.speed" in capsys.readouterr().err


def test_others_do_not_replace_a_sweep(case, capsys):
    """A run or collision with --overwrite leaves a sweep as it is, also one without a table, or without a row."""
    path, _ = case
    SweepJob(path, "out", VARY).run()
    shutil.copytree("out", "rows")
    Path("rows/sweep.csv").unlink()
    Path("rows/case.toml").unlink()
    SweepJob(path, "begun", VARY).begin()
    for folder in ("out", "rows", "begun"):
        before = {one: one.read_bytes() for one in Path(folder).rglob("*") if one.is_file()}
        text = f"{folder} holds a sweep, which is not replaced: give another folder, or remove it"
        for overwrite in (True, False):
            with pytest.raises(BadInput, match=text):
                make_folder(folder, overwrite=overwrite)
        assert main(["collide", str(path), "--out", folder, "--overwrite"]) == 2
        assert text in capsys.readouterr().err
        assert before == {one: one.read_bytes() for one in Path(folder).rglob("*") if one.is_file()}


def test_what_a_folder_holds(case, capsys):
    """`sand.open` of a folder without a run, and a sweep into that of another command, name what is in it."""
    path, _ = case
    job = SweepJob(path, "begun", VARY)
    job.begin()
    message = "begun holds a sweep, whose table is not written yet; to continue it: sand resume begun"
    run_row(job.command, job.content, "begun", True, job.rows[0])
    with pytest.raises(BadInput, match=message):
        sand.open("begun")
    job.run()
    with pytest.raises(BadInput, match="begun holds a sweep; give the folder of one of its runs, begun/runs/NAME"):
        sand.open(["begun"])
    shutil.copytree("begun", "figure/results")
    with pytest.raises(BadInput, match="figure holds results of sand reproduce; their table is in figure/results"):
        sand.open("figure")
    assert len(sand.open("figure/results").table["run"]) == 12
    written = "# Written by SAND: settings\n"
    for name, texts in {
        "empty": {},
        "new": {"case.toml": CASE},
        "one": {"case.toml": written + "[run]\nuntil = 1", "collision.toml": written + CASE},
        "many": {"case.toml": written + CASE},
        "gas": {"case.toml": written + "[run]\nuntil = 1"},
    }.items():
        Path(name).mkdir()
        for file, text in texts.items():
            Path(name, file).write_text(text)
    said = {"empty": r"no trajectory.gsd in it; it is empty", "new": "a case of `sand collide` that has not been run"}
    for name, text in said.items():
        with pytest.raises(BadInput, match=text):
            sand.open(name)
    held = {
        "one": "a collision of `sand collide`",
        "many": "collisions of `sand collide`",
        "gas": "a run of `sand run`",
    }
    for name, text in held.items():
        assert main(["sweep", str(path), "--seeds", "2", "--out", name]) == 2
        assert f"{name} holds {text}, no sweep; give another folder with --out" in capsys.readouterr().err
    assert main(["collide", str(path), "--out", "one"]) == 2
    assert (
        "or --overwrite to replace what is in it, a collision of `sand collide`; or continue it: sand resume one"
        in (capsys.readouterr().err)
    )


def test_methods_of_an_unfinished_sweep(case, capsys):
    """All values of the design, and how many runs are done, failed and left; also once the folder `runs` is removed."""
    path, _ = case
    job = SweepJob(path, "out", {"vary": {"impact.speed": [2, 13], "target.grains": [3, 6]}})
    job.begin()
    for row in (job.rows[0], job.rows[1], job.rows[-1]):
        run_row(job.command, job.content, "out", True, row)
    values = "impact.speed = (2, 13), target.grains = (3, 6), seed = (4, 5) (SI units)"
    assert main(["methods", "out"]) == 0
    assert f"varied {values}; 2 of 8 runs are done, 1 failed, 5 left." in capsys.readouterr().out
    job.run()
    swept(path, {"vary": {"impact.speed": 7}})  # a further value
    shutil.rmtree("out/runs")
    assert main(["methods", "out"]) == 0
    values = "impact.speed = (2, 7, 13), target.grains = (3, 6), seed = (4, 5) (SI units)"
    found = capsys.readouterr().out.split("varied ")[1]
    assert found.startswith(f"{values}; 6 of 10 runs are done, 4 failed.")


def test_resume_of_a_sweep_with_failed_runs(case, capsys):
    """A finished sweep of which runs failed is named as such, with the exit code of a failed run."""
    path, _ = case
    content = SweepJob(path, "out", VARY).run()
    write_json(Path("out/sweep.json"), {**content, "done": 11, "failed": 1})
    assert main(["resume", "out"]) == 3
    assert "1 of its 12 runs failed: to compute them again, sand sweep with --retry" in capsys.readouterr().out
