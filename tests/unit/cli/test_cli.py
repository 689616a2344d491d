"""The `sand` command: exit codes, output streams, interruption and resuming."""

import contextlib
import io
import json
import signal
import subprocess
import sys
import time

import pytest

from sand.basics.errors import FilesFailed
from sand.cli import report
from sand.cli.main import main
from sand.cli.progress import Progress
from sand.config.build import simulation_of
from sand.config.case import read_case
from sand.io.checkpoint import newest_checkpoint, read_checkpoint
from sand.simulation.simulation import Simulation

from ...systems import IS_ROOT, keeps_modes, stops_others

CASE = """
[run]
until = "20 ns"
frame_every = "5 ns"
seed = 3
[box]
periodic = "400 nm"
[grains]
number = 8
radius = "10 nm"
material = "iron"
moment = "200 A m^2/kg"
temperature = "300 K"
[forces.contact]
[forces.dipoles]
"""
SAND = [sys.executable, "-m", "sand.cli.main"]


@pytest.fixture
def workdir(tmp_path, monkeypatch):
    """An empty working folder with a case file."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small.toml").write_text(CASE)
    return tmp_path


@pytest.fixture
def done(workdir, capsys):
    """The folder after `sand run small.toml`."""
    assert main(["run", "small.toml", "--quiet"]) == 0
    capsys.readouterr()
    return workdir / "small"


def heavy_modules(*words):
    """The heavy packages that `sand WORDS` imports, in a fresh interpreter."""
    code = (
        "import sys\nfrom sand.cli.main import main\ncode = main(sys.argv[1:])\n"
        "heavy = {'numpy', 'numba', 'pydantic', 'gsd', 'matplotlib', 'pint', 'scipy', 'tqdm'}\n"
        "print(sorted(heavy & set(sys.modules)), file=sys.stderr)\nsys.exit(code)"
    )
    ended = subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    return ended.stderr.strip().splitlines()[-1]


@pytest.mark.parametrize("words", [["--help"], ["run", "--help"], ["cite"], ["--version"], []])
def test_light_commands_import_nothing_heavy(words):
    """Help and citation import no numerical package."""
    assert heavy_modules(*words) == "[]"


@pytest.mark.compiled("dipoles")
def test_info_of_a_run_needs_no_compiler(done):
    """Small files of the folder suffice; neither numba nor the case reader is imported."""
    assert heavy_modules("info", str(done)) == "['numpy']"


@pytest.mark.compiled("dipoles")
def test_output_of_run(workdir, capsys):
    """Grains, box and cut-off with its reason at the start; outcome and files, the figure included, at the end."""
    assert main(["run", "small.toml"]) == 0
    out, err = capsys.readouterr()
    for part in ("8 of iron, radius 10 nm", "periodic 400 nm", "cut-off", "half the box", "contact, dipoles"):
        assert part in out
    for part in ("done", " ns in ", "mean size S", "largest", "energy drift", "wall time", "figure.png", "ledger.csv"):
        assert part in out
    assert "sand: note: contacts of iron" in err
    assert "%|" not in err  # no progress bar where there is no terminal
    assert {p.name for p in (workdir / "small").iterdir()} >= {"case.toml", "summary.json", "figure.png"}


def test_run_prints_settings_that_differ_from_defaults(workdir, capsys):
    """For each force its name and the user's settings."""
    (workdir / "small.toml").write_text(CASE.replace("[forces.contact]", '[forces.contact]\nslip = "reset"'))
    (workdir / "small.toml").open("a").write('[forces.field]\nflux_density = "1 mT"\n')
    assert main(["info", "small.toml"]) == 0
    assert "contact (slip = reset), dipoles, field (flux_density = (0, 0, 1 mT))" in capsys.readouterr().out


@pytest.mark.compiled("dipoles")
def test_run_as_json_prints_the_summary_alone(workdir, capsys):
    """--json: one object, the content of summary.json and the folder."""
    assert main(["run", "small.toml", "--json", "--out", "there"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == {**json.loads((workdir / "there" / "summary.json").read_text()), "folder": "there"}
    assert printed["outcome"] == "finished"


@pytest.mark.compiled("dipoles")
def test_quiet_run_prints_nothing_to_stdout(workdir, capsys):
    """--quiet leaves notes on stderr, nothing else."""
    assert main(["run", "small.toml", "--quiet"]) == 0
    out, err = capsys.readouterr()
    assert out == ""
    assert all(line.startswith("sand: note: ") for line in err.splitlines())


@pytest.mark.compiled("dipoles")
def test_options_override_the_case(workdir, capsys):
    """--until takes text with a unit or SI seconds, as in a case; --seed and --out override the case."""
    assert main(["run", "small.toml", "--until", "6 ns", "--seed", "7", "--json"]) == 0
    first = json.loads(capsys.readouterr().out)
    assert main(["run", "small.toml", "--until", "6e-9", "--seed", "7", "--json", "--out", "again"]) == 0
    second = json.loads(capsys.readouterr().out)
    assert first["time"] == second["time"] == pytest.approx(6e-9, rel=1e-2, abs=0.0)
    assert first["seed"] == 7
    case = read_case(workdir / "again" / "case.toml")
    assert (case.run.until, case.run.seed) == (6e-9, 7)


@pytest.mark.compiled("dipoles")
def test_a_case_may_end_at_a_number_of_steps(workdir, capsys):
    """[run] steps: the run takes that many; `sand resume` then has nothing to do."""
    (workdir / "small.toml").write_text(CASE.replace('until = "20 ns"', "steps = 500"))
    assert main(["run", "small.toml"]) == 0
    assert "to step 500" in capsys.readouterr().out
    assert main(["resume", "small"]) == 0
    assert "has reached its planned end" in capsys.readouterr().out
    assert main(["resume", "small", "--until", "20 ns", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["steps"] > 500


# --- wrong input ----------------------------------------------------------------------------------------


def test_every_mistake_of_a_case_is_a_line(workdir, capsys):
    """Two errors, two lines, each with the name of the file; no folder is created."""
    (workdir / "small.toml").write_text(CASE.replace("10 nm", "10 ns").replace("seed", "sead"))
    assert main(["run", "small.toml"]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2
    assert all(line.startswith("sand: small.toml: ") for line in lines)
    assert not (workdir / "small").exists()


def test_errors_of_combined_settings_name_the_file(workdir, capsys):
    """A box too small for its grains is found when grains are placed; the line names the case."""
    (workdir / "small.toml").write_text(CASE.replace("400 nm", "30 nm"))
    for command in ("run", "info"):
        assert main([command, "small.toml"]) == 2
        assert capsys.readouterr().err.startswith("sand: small.toml: a box of 30 nm is too small")
    assert not (workdir / "small").exists()


@pytest.mark.compiled("dipoles")
def test_a_used_folder_is_refused_and_untouched(done, capsys):
    """An earlier run is not replaced without --overwrite; the line says how to continue it."""
    before = {p: (p.stat().st_mtime_ns, p.read_bytes()) for p in done.iterdir()}
    assert main(["run", "small.toml"]) == 2
    err = capsys.readouterr().err
    assert "--overwrite" in err
    assert "sand resume small" in err
    assert {p: (p.stat().st_mtime_ns, p.read_bytes()) for p in done.iterdir()} == before


@pytest.mark.compiled("dipoles")
def test_overwrite_replaces_the_run_and_nothing_else(done, capsys):
    """--overwrite removes the files of the earlier run and keeps other files."""
    (done / "thoughts.txt").write_text("mine")
    assert main(["run", "small.toml", "--overwrite", "--seed", "9", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["seed"] == 9
    assert (done / "thoughts.txt").read_text() == "mine"


@pytest.mark.compiled("dipoles")
def test_overwrite_never_replaces_the_case_it_reads(done, capsys):
    """`sand run small/case.toml --out small --overwrite` would delete its own input: refused."""
    text = (done / "case.toml").read_text()
    assert main(["run", "small/case.toml", "--out", "small", "--overwrite"]) == 2
    assert "would replace the case file" in capsys.readouterr().err
    assert (done / "case.toml").read_text() == text


@pytest.mark.skipif(IS_ROOT, reason="root may write everywhere")
@keeps_modes
def test_a_folder_without_permission(workdir, capsys):
    """One line before anything is computed."""
    (workdir / "locked").mkdir(mode=0o500)
    assert main(["run", "small.toml", "--out", "locked/run"]) == 2
    assert "no permission in" in capsys.readouterr().err


@pytest.mark.compiled("dipoles")
def test_a_full_disk_gives_one_line(workdir, capsys, monkeypatch):
    """Files that cannot be written: exit code 2, one line, no traceback."""

    def full(*_):
        raise FilesFailed("cannot write small/summary.json: No space left on device")

    monkeypatch.setattr("sand.simulation.run_writer.write_json", full)
    assert main(["run", "small.toml", "--quiet"]) == 2
    assert "sand: cannot write small/summary.json: No space left" in capsys.readouterr().err


# --- internal errors and interruptions --------------------------------------------------------------------


def test_an_internal_error_is_one_line_unless_debug(workdir, capsys, monkeypatch):
    """Exit code 1 and how to see more; --debug, before or after the command, shows the traceback."""

    def broken(_path):
        raise ZeroDivisionError("float\ndivision")

    monkeypatch.setattr("sand.config.case.read_case", broken)
    assert main(["run", "small.toml", "--json"]) == 1
    out, err = capsys.readouterr()
    assert err.startswith("sand: internal error (ZeroDivisionError: float division); run again with --debug")
    assert json.loads(out)["exit_code"] == 1
    for words in (["--debug", "run", "small.toml"], ["run", "small.toml", "--debug"]):
        with pytest.raises(ZeroDivisionError):
            main(words)


def test_interrupted_before_anything_ran(workdir, capsys, monkeypatch):
    """Ctrl-C while the case is read: 130, one line."""

    def slow(_path):
        raise KeyboardInterrupt

    monkeypatch.setattr("sand.config.case.read_case", slow)
    assert main(["run", "small.toml"]) == 130
    assert capsys.readouterr().err == "sand: interrupted\n"


@pytest.mark.compiled("dipoles")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_before_the_first_step(workdir, capsys, monkeypatch, number):
    """Ctrl-C or SIGTERM during compilation: 130, and the same command works afterwards."""

    def slow(_self, _until=None, **_):
        signal.raise_signal(number)
        time.sleep(5.0)

    with monkeypatch.context() as patch:
        patch.setattr("sand.simulation.simulation.Simulation.run", slow)
        assert main(["run", "small.toml", "--quiet"]) == 130
        assert "interrupted before the first step" in capsys.readouterr().err
    assert main(["run", "small.toml", "--quiet"]) == 0


@pytest.mark.compiled("dipoles")
def test_an_interrupt_swallowed_by_the_compiler_ends_the_run(workdir, capsys, monkeypatch):
    """Ctrl-C in a callback of the compiler: the exception is lost there; the run ends all the same."""
    real = Simulation.run

    def swallow(self, *words, **options):
        with contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
            time.sleep(5.0)
        return real(self, *words, **options)

    monkeypatch.setattr(Simulation, "run", swallow)
    assert main(["run", "small.toml", "--quiet"]) == 130
    assert "interrupted before the first step" in capsys.readouterr().err
    assert not list((workdir / "small").glob("checkpoint-*"))


def test_a_closed_pipe_is_no_error(workdir):
    """`sand info … | head -0`: nothing on stderr."""
    with subprocess.Popen([*SAND, "cite"], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as started:
        started.stdout.close()
        assert started.stderr.read() == b""
        assert started.wait() == 0


@pytest.mark.compiled("dipoles")
def test_a_run_stopped_by_an_outcome(workdir, capsys):
    """A fixed step that is too long: exit code 3, one sentence, the grains, a readable checkpoint."""
    (workdir / "small.toml").write_text(CASE + '[stepping]\nstep = "10 ns"\n')
    assert main(["run", "small.toml"]) == 3
    err = capsys.readouterr().err
    assert "stopped by physics at t = " in err
    assert "step is too long (grains " in err
    path = err.strip().rsplit(" ", 1)[1]
    assert read_checkpoint(workdir / path)[1]["until"] == 2e-8
    assert main(["run", "small.toml", "--json", "--overwrite"]) == 3
    summary = json.loads(capsys.readouterr().out)
    assert summary["outcome"] == "too_fast"
    assert len(summary["grains_concerned"]) >= 1
    assert main(["info", "small"]) == 0
    assert "step is too long (grains" in capsys.readouterr().out


def same_state(one, other):
    """True if the newest checkpoints of two runs hold the same bits."""
    (a, meta_a), (b, meta_b) = newest_checkpoint(one), newest_checkpoint(other)
    assert meta_a["steps"] == meta_b["steps"]
    assert a.keys() == b.keys()
    return all(a[name].tobytes() == b[name].tobytes() for name in a)


@stops_others
@pytest.mark.compiled("dipoles")
@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.validate)])
def test_interrupted_and_resumed_run_is_bit_for_bit(workdir, capsys, number):
    """Exit code 130 with time and advice; `sand resume` gives the bits of an uninterrupted run."""
    words = [*SAND, "run", "small.toml", "--until", "1 s"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(words, **pipes) as started:
        ledger = workdir / "small" / "ledger.csv"
        for _ in range(1200):  # until it takes steps; during compilation it would end at once
            if started.poll() is not None or (ledger.exists() and ledger.read_text().count("\n") > 3):
                break
            time.sleep(0.05)
        started.send_signal(number)
        try:
            _, err = started.communicate(timeout=60)
        finally:
            started.kill()
    assert started.returncode == 130, err
    last = err.splitlines()[-1]
    assert last.startswith("sand: interrupted at t = ")
    assert last.endswith("resume with: sand resume small")
    meta = newest_checkpoint(workdir / "small")[1]
    assert meta["steps"] > 0
    assert main(["info", "small"]) == 0
    assert "sand resume small" in capsys.readouterr().out
    end = str(meta["time"] + 5e-8)
    assert main(["resume", "small", "--until", end, "--quiet"]) == 0
    assert "instead of 1 s" in capsys.readouterr().err
    assert main(["run", "small.toml", "--until", end, "--out", "whole", "--quiet"]) == 0
    assert same_state(workdir / "small", workdir / "whole")


# --- resume and info -------------------------------------------------------------------------------------


@pytest.mark.compiled("dipoles")
def test_resume_of_a_finished_run(done, capsys):
    """Nothing to do: exit code 0, no file changed; a later end continues; an earlier end is refused."""
    before = (done / "summary.json").read_bytes()
    assert main(["resume", "small"]) == 0
    assert "has reached its planned end" in capsys.readouterr().out
    assert main(["resume", "small", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["outcome"] == "finished"
    assert main(["resume", "small", "--until", "10 ns"]) == 2
    assert "is not later than 20" in capsys.readouterr().err
    assert (done / "summary.json").read_bytes() == before
    assert main(["resume", "small", "--until", "30 ns"]) == 0
    assert " to 30 ns, a frame every 5 ns" in capsys.readouterr().out


@pytest.mark.compiled("dipoles")
def test_resume_after_damage(done, capsys):
    """A damaged checkpoint is skipped; if none is intact, each is named."""
    newest = max(done.glob("checkpoint-*.npz"))
    newest.write_bytes(newest.read_bytes()[:100])
    assert main(["resume", "small", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["outcome"] == "finished"
    for path in done.glob("checkpoint-*.npz"):
        path.write_bytes(b"no")
    assert main(["resume", "small"]) == 2
    assert len(capsys.readouterr().err.splitlines()) >= 2


@pytest.mark.compiled("dipoles")
@pytest.mark.parametrize(
    ("name", "kind", "part"),
    [
        ("", "run", "mean size S"),
        ("case.toml", "case", "8 of iron"),
        ("trajectory.gsd", "trajectory", "frames"),
        ("summary.json", "summary", "mean size S"),
        ("ledger.csv", "ledger", "dissipated"),
        ("checkpoint-000000000000000.npz", "checkpoint", "0 s after 0 steps"),
    ],
)
def test_info_knows_every_file_of_a_run(done, capsys, name, kind, part):
    """Text for users; with --json one object that names the kind of file."""
    assert main(["info", str(done / name)]) == 0
    assert part in capsys.readouterr().out
    assert main(["info", str(done / name), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["kind"] == kind


@pytest.mark.compiled("dipoles")
def test_info_describes_grains_and_forces_of_a_folder_as_of_its_case(done, capsys):
    """The same lines, also without a summary; and the warnings of the run."""

    def lines(*words):
        assert main(["info", *words]) == 0
        rows = (line.strip().partition("  ") for line in capsys.readouterr().out.splitlines())
        return {label: text.strip() for label, _, text in rows}

    case, run = lines(str(done / "case.toml")), lines(str(done))
    assert "8 of iron, radius 10 nm, moment" in case["grains"] and case["forces"].startswith("contact, dipoles")
    assert {name: run[name] for name in ("grains", "forces", "boundary")}.items() <= case.items()
    assert run["warning"].startswith(("contacts of iron grains", "moments of iron grains"))
    (done / "summary.json").unlink()
    assert {name: lines(str(done))[name] for name in ("grains", "forces")}.items() <= case.items()


@pytest.mark.compiled("dipoles")
def test_info_of_a_run_that_was_killed(done, capsys):
    """Without a summary the ledger gives the last time."""
    (done / "summary.json").unlink()
    assert main(["info", "small"]) == 0
    out = capsys.readouterr().out
    assert "running, or killed" in out
    assert " ns after " in out
    assert "sand resume small" in out


@pytest.mark.parametrize(
    ("line", "code", "part"),
    [
        ('until = "3 ns"', 0, "planned end  3 ns"),
        ('stop = "clusters == 1"', 0, "ends if  clusters == 1"),
        ('until = "3 m"', 2, "case.toml: run: until = '3 m' is a length, not a quantity in s"),
        ("until = [1]", 2, "case.toml: run: until = [1]"),
        ("stop = 3", 2, "case.toml: run.stop must be text"),
    ],
)
def test_info_after_the_end_was_edited(workdir, capsys, line, code, part):
    """The end of a run may be changed in its case.toml, in the forms of a case file, before it is resumed."""
    (workdir / "case.toml").write_text(CASE.replace('until = "20 ns"', line))
    assert main(["info", "."]) == code
    out, err = capsys.readouterr()
    assert part in " ".join((out if code == 0 else err).split(" ")).replace("    ", "  ").replace("   ", "  ")
    assert len(err.splitlines()) == (code != 0)


@pytest.mark.parametrize("name", ["summary.json", "ledger.csv", "trajectory.gsd", "checkpoint-000000000000000.npz"])
@pytest.mark.parametrize("content", [b"", b"{", b"{}", b"a,b\n1,2\n", b"\xff\x00"])
def test_info_of_broken_files(workdir, capsys, name, content):
    """A file with other content than its name says: one line with its name, exit code 2; the same for its folder."""
    (workdir / "case.toml").write_text(CASE)
    (workdir / name).write_bytes(content)
    assert main(["info", name]) == 2
    err = capsys.readouterr().err
    assert name in err
    assert len(err.splitlines()) == 1
    if name in ("summary.json", "ledger.csv"):
        assert main(["info", "."]) == 2
        assert name in capsys.readouterr().err


def test_cite_names_version_and_paper(capsys):
    """As text and as JSON."""
    assert main(["cite"]) == 0
    assert "Dominik C., Nübold H. (2002)" in capsys.readouterr().out
    assert main(["cite", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["version"]


# --- progress --------------------------------------------------------------------------------------------


class Terminal(io.StringIO):
    """Records what is drawn."""

    def isatty(self):
        return True


@pytest.mark.compiled("dipoles")
@pytest.mark.parametrize("by", ["until", "steps"])
def test_progress_shows_time_and_numbers(workdir, monkeypatch, by):
    """Physical time, rate, clusters, S and drift, for an end time or a number of steps."""
    monkeypatch.setattr(sys, "stderr", terminal := Terminal())
    simulation = simulation_of(read_case("small.toml"), None)
    ends = {"until": [2e-8, 4e-8], "steps": [400, 400]}[by]
    bar = Progress(*((4e-8, float("inf")) if by == "until" else (float("inf"), 800)))
    simulation.observers.append(bar)
    for end in ends:
        simulation.run(**{by: end})
        time.sleep(0.25)  # the bar is drawn at most ten times a second
        bar.tick(simulation)
    bar.finish()
    drawn = terminal.getvalue()
    for part in ("%|", " ns ", " clusters, S = ", "drift ", "s/s" if by == "until" else "steps/s"):
        assert part in drawn


@pytest.mark.compiled("dipoles")
def test_progress_of_a_resumed_run_has_numbers_from_the_start(done, monkeypatch):
    """Until the first frame the last row of the ledger is shown."""
    from sand.config.build import resume

    monkeypatch.setattr(sys, "stderr", terminal := Terminal())
    simulation = resume(done)
    bar = Progress(1e-7, float("inf"))
    bar.tick(simulation)
    bar._bar.refresh()
    bar.finish()
    assert " clusters, S = " in terminal.getvalue()
    assert " 20%" in terminal.getvalue()


def lines_of_progress(monkeypatch, capsys, updates, total=1.0, rate=1.0):
    """What is printed, without a terminal, when the position grows by these steps, one in `rate` seconds."""
    clock = [0.0]
    monkeypatch.setattr("sand.cli.report.time.monotonic", lambda: clock[0])
    with report.progress_bar(total, False) as bar:
        bar.set_description_str("drawing maps")
        for step in updates:
            clock[0] += rate
            bar.update(step)
    return capsys.readouterr().err.splitlines()


def test_progress_in_a_log(monkeypatch, capsys):
    """Without a terminal: a line each 30 s or 5 % of the work, whichever comes first; none within a second."""
    slow = lines_of_progress(monkeypatch, capsys, [1e-4] * 100)
    assert slow[0] == "sand: 0%, drawing maps, 30 s, 2 h 46 min left" and len(slow) == 3
    quick = lines_of_progress(monkeypatch, capsys, [1 / 64] * 64, rate=3.0)
    assert quick[0] == "sand: 6%, drawing maps, 12 s, 3 min 00 s left" and len(quick) == 16
    assert lines_of_progress(monkeypatch, capsys, [0.1] * 9, rate=0.1) == []
    unknown = lines_of_progress(monkeypatch, capsys, [1000.0] * 90, total=None)
    assert unknown == ["sand: drawing maps, 30 s", "sand: drawing maps, 1 min 00 s", "sand: drawing maps, 1 min 30 s"]


@pytest.mark.compiled("dipoles")
def test_a_run_in_a_log_says_what_it_does(workdir, monkeypatch, capsys):
    """Lines with simulated time, speed, clusters, S and drift, and a line before the figure is drawn."""
    monkeypatch.setattr("sand.cli.report.LINE_AT_LEAST", 0.0)
    assert main(["run", "small.toml"]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert "sand: drawing the figure …" in lines
    assert any("%, " in line and " ns, " in line and " clusters, S = " in line and "s/s" in line for line in lines)
    assert main(["run", "small.toml", "--quiet", "--overwrite"]) == 0
    assert not any("clusters" in line or "drawing" in line for line in capsys.readouterr().err.splitlines())
