"""Interruption of every command by Ctrl-C: one line with the command to continue, exit code 130, the same bits."""

import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import sand
from sand.cli.job import InterruptObserver
from sand.cli.main import main
from sand.experiments import collision_job
from sand.io.checkpoint import newest_checkpoint
from sand.io.table import GrowingOutcomes

from ...physics.setups import struck_chain
from ...systems import stops_others

pytestmark = pytest.mark.compiled("contacts")
COLLISION = """
[target]
kind = "chain"
grains = 2
radius = "0.1 um"
[projectile]
kind = "grain"
radius = "0.1 um"
[impact]
speed = "2 m/s"
seeds = [1, 2, 3]
[forces.contact]
"""
BOX = """
[run]
until = "2 ns"
frame_every = "0.2 ns"
[box]
periodic = "300 nm"
[grains]
number = 6
radius = "10 nm"
material = "silica"
temperature = "300 K"
[forces.contact]
"""


@pytest.fixture
def workdir(tmp_path, monkeypatch):
    """An empty folder to work in, with a case of each kind."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "hit.toml").write_text(COLLISION)
    (tmp_path / "box.toml").write_text(BOX)
    return tmp_path


@pytest.fixture(autouse=True)
def _empty_figures(monkeypatch):
    """Figures are empty files: drawing takes longer than everything else."""
    monkeypatch.setattr("sand.plotting.run_figure.run_figure", lambda simulation: None)
    monkeypatch.setattr("sand.plotting.collisions.collision_figure", lambda *_: None)
    monkeypatch.setattr("sand.plotting.run_figure.save", lambda figure, path: path.write_bytes(b""))


def interrupt_when(patch, when):
    """Press Ctrl-C between two steps, once `when(simulation)` holds."""

    def tick(self, simulation):
        if when(simulation):
            os.kill(os.getpid(), signal.SIGINT)

    patch.setattr(InterruptObserver, "tick", tick, raising=False)


def same_run(one, other):
    """True if two folders hold the same run to the last bit."""
    (a, meta_a), (b, meta_b) = newest_checkpoint(one), newest_checkpoint(other)
    assert meta_a["steps"] == meta_b["steps"] and a.keys() == b.keys()
    assert (one / "ledger.csv").read_bytes() == (other / "ledger.csv").read_bytes()
    return all(a[name].tobytes() == b[name].tobytes() for name in a)


def has_formed_a_contact(simulation):
    return simulation.ledger.rows[-1]["made"] > 0


def flies(simulation):
    return simulation.steps > 0


def has_two_frames(simulation):
    return has_formed_a_contact(simulation) and len(simulation.ledger.rows) > 40


@pytest.fixture(scope="module")
def uninterrupted_run(tmp_path_factory):
    """The folder of a collision that was not interrupted."""
    top = tmp_path_factory.mktemp("hit")
    (top / "hit.toml").write_text(COLLISION)
    assert main(["collide", str(top / "hit.toml"), "--seeds", "2", "--out", str(top / "whole"), "--json"]) == 0
    return top / "whole"


@pytest.mark.parametrize("moments", [[has_formed_a_contact], [flies, has_formed_a_contact, has_two_frames]])
def test_interrupted_collision(workdir, uninterrupted_run, capsys, monkeypatch, moments):
    """Interrupted before, during and after the impact, once or several times: same bits and collision.json."""
    words = ["collide", "hit.toml", "--seeds", "2", "--out", "cut"]
    for when in moments:
        with monkeypatch.context() as patch:
            interrupt_when(patch, when)
            assert main(words) == 130
        assert capsys.readouterr().err.splitlines()[-1] == "sand: interrupted; continue with: sand resume cut"
        assert not (workdir / "cut" / "collision.json").exists() and not (workdir / "cut" / "figure.png").exists()
        words = ["resume", "cut", "--threads", "1"]
    assert main(["info", "cut"]) == 0
    assert "continue with  sand resume cut" in capsys.readouterr().out
    assert main(["collide", "hit.toml", "--seeds", "2", "--out", "cut"]) == 2
    assert "sand resume cut" in capsys.readouterr().err
    assert main(["resume", "cut", "--quiet"]) == 0
    ours, theirs = (json.loads((one / "collision.json").read_text()) for one in (workdir / "cut", uninterrupted_run))
    assert ours["collisions"] == theirs["collisions"] and ours["counts"] == theirs["counts"]
    assert same_run(workdir / "cut", uninterrupted_run)
    assert (workdir / "cut" / "figure.png").exists()
    before = (workdir / "cut" / "collision.json").stat().st_mtime_ns
    assert main(["resume", "cut"]) == 0
    assert "cut is finished" in capsys.readouterr().out
    assert (workdir / "cut" / "collision.json").stat().st_mtime_ns == before


def test_killed_collision(workdir, uninterrupted_run, capsys):
    """Without a checkpoint it starts again; with all frames but no outcome it only evaluates the outcome."""
    shutil.copytree(uninterrupted_run, workdir / "late")
    (workdir / "late" / "collision.json").unlink()
    (workdir / "early").mkdir()
    shutil.copy(uninterrupted_run / "collision.toml", workdir / "early")
    for name in ("late", "early"):
        assert main(["resume", name, "--json"]) == 0
        output = json.loads(capsys.readouterr().out)
        assert output["collisions"] == json.loads((uninterrupted_run / "collision.json").read_text())["collisions"]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('"2.0 m/s"', '"3 m/s"'),
        ("grains = 2", "grains = 3"),
        ("[forces.contact]", "[forces.contact]\nslip = 'reset'"),
    ],
)
def test_resume_refuses_a_changed_collision(workdir, uninterrupted_run, capsys, old, new):
    """Another speed, body or force: one line."""
    shutil.copytree(uninterrupted_run, workdir / "cut")
    (workdir / "cut" / "collision.json").unlink()
    path = workdir / "cut" / "collision.toml"
    text = path.read_text().replace("2 m/s", "2.0 m/s")
    assert old in text
    path.write_text(text.replace(old, new))
    assert main(["resume", "cut"]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and "start a new collision in another folder" in err


def test_interrupted_series_of_collisions(workdir, capsys, monkeypatch):
    """Finished collisions are kept and not repeated; collision.json equals that of an uninterrupted job."""
    assert main(["collide", "hit.toml", "--out", "whole", "--json"]) == 0
    capsys.readouterr()
    real = GrowingOutcomes.add

    def add(self, seed, outcome):
        real(self, seed, outcome)
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(GrowingOutcomes, "add", add)
        assert main(["collide", "hit.toml", "--out", "cut", "--seeds", "1-3"]) == 130
    assert capsys.readouterr().err == "sand: interrupted; continue with: sand resume cut\n"
    with (workdir / "cut" / "collisions.jsonl").open("a") as file:
        file.write('{"seed": 2, "outc')  # an incomplete line, as after a kill
    assert main(["info", "cut"]) == 0
    assert "sand resume cut" in capsys.readouterr().out
    done, run = [], collision_job.run_seed

    def counted(text, seed, **options):
        done.append(seed)
        return run(text, seed, **options)

    monkeypatch.setattr(collision_job, "run_seed", counted)
    assert main(["resume", "cut"]) == 0
    assert done == [2, 3] and "outcomes" in capsys.readouterr().out
    ours, theirs = (json.loads((workdir / name / "collision.json").read_text()) for name in ("cut", "whole"))
    assert ours["collisions"] == theirs["collisions"] and ours["counts"] == theirs["counts"]
    assert not (workdir / "cut" / "collisions.jsonl").exists()


def test_resume_refuses_outcomes_of_another_case(workdir, capsys, monkeypatch):
    """A case changed while its job was interrupted: one line, and outcomes are not mixed."""
    monkeypatch.setattr(
        collision_job, "run_seed", lambda text, seed, **options: (_ for _ in ()).throw(KeyboardInterrupt)
    )
    assert main(["collide", "hit.toml", "--out", "cut"]) == 130
    path = workdir / "cut" / "case.toml"
    path.write_text(path.read_text().replace("2 m/s", "3 m/s"))
    capsys.readouterr()
    assert main(["resume", "cut"]) == 2
    assert "holds outcomes of another case" in capsys.readouterr().err


def test_interrupted_growth(workdir, capsys, monkeypatch):
    """Interrupted in the second box: the first is kept, growth.json is written at the end, the bits are the same."""
    assert main(["grow", "box.toml", "--seeds", "1-2", "--out", "whole", "--quiet", "--threads", "1"]) == 0
    with monkeypatch.context() as patch:
        interrupt_when(patch, lambda simulation: simulation.seed == 2 and simulation.time > 0.5e-9)
        assert main(["grow", "box.toml", "--seeds", "1-2", "--out", "cut", "--quiet"]) == 130
    assert capsys.readouterr().err.splitlines()[-1] == "sand: interrupted; continue with: sand resume cut"
    finished = [path for path in (workdir / "cut" / "seed-1").iterdir() if path.name != ".lock"]
    before = {path: path.stat().st_mtime_ns for path in finished}
    assert main(["info", "cut"]) == 0
    assert "sand resume cut" in capsys.readouterr().out
    assert main(["resume", "cut", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["outcomes"] == {"1": "finished", "2": "finished"}
    assert before == {path: path.stat().st_mtime_ns for path in before}
    assert same_run(workdir / "cut" / "seed-2", workdir / "whole" / "seed-2")
    output = json.loads((workdir / "cut" / "growth.json").read_text())
    assert output["seeds"] == [1, 2] and output["boxes"]["seed-2"]["outcome"] == "finished"
    assert main(["resume", "cut"]) == 0
    assert "cut is finished" in capsys.readouterr().out
    assert main(["info", "cut"]) == 0
    assert "sand analyse cut" in capsys.readouterr().out
    for words, part in ((["--until", "1 us"], "--until applies to runs"), ([], "")):
        assert main(["resume", "cut", *words]) == (2 if words else 0)
        assert part in capsys.readouterr().err
    assert main(["run", "box.toml", "--out", "cut"]) == 2
    assert main(["resume", "cut/seed-1", "--workers", "2"]) == 2
    assert "--threads" in capsys.readouterr().err


# --- the figure, and interrupts during start-up ------------------------------------------------------------


def test_interrupted_runs_draw_no_figure(workdir, capsys, monkeypatch):
    """No figure after Ctrl-C; Ctrl-C while a figure is drawn omits it from the finished run."""
    drawn = []

    def slow(simulation):
        drawn.append(simulation)
        os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr("sand.plotting.run_figure.run_figure", slow)
    assert main(["run", "box.toml", "--out", "done"]) == 0
    out, err = capsys.readouterr()
    assert "done" in out and "sand: the figure is not drawn" in err and len(drawn) == 1
    assert json.loads((workdir / "done" / "summary.json").read_text())["outcome"] == "finished"
    interrupt_when(monkeypatch, flies)
    assert main(["run", "box.toml", "--out", "cut"]) == 130
    assert len(drawn) == 1 and "resume with: sand resume cut" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("module", "words"), [("click", ["cite"]), ("numpy", ["info", "box.toml"]), ("pydantic", ["info", "box.toml"])]
)
def test_interrupted_while_modules_are_imported(workdir, module, words):
    """Ctrl-C during imports gives exit code 130, also where an import turns it into another exception."""
    program = (
        "import importlib.abc, os, signal, sys\n"
        "class Finder(importlib.abc.MetaPathFinder):\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        f"        if name == {module!r}:\n"
        "            try:\n"
        "                os.kill(os.getpid(), signal.SIGINT)\n"
        "            except KeyboardInterrupt:\n"
        "                raise ImportError('cut short') from None\n"
        "sys.meta_path.insert(0, Finder())\n"
        "from sand.cli.main import main\n"
        f"sys.exit(main({words!r}))\n"
    )
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (ended.returncode, ended.stderr, ended.stdout) == (130, "sand: interrupted\n", "")


@stops_others
def test_the_exit_code_after_an_interrupt_in_a_string(workdir):
    """Ctrl-C in code that `exec` runs, as in imports of dataclasses, leaves the exit code of `python -m` as it is."""
    program = (
        "import sys\n"
        "import sand.cli.program\n"
        "from sand.cli.main import main\n"
        "def command(words, interrupted):\n"
        "    try:\n"
        "        exec('import signal, time; signal.raise_signal(signal.SIGINT); time.sleep(5.0)')\n"
        "    except KeyboardInterrupt:\n"
        "        return 3\n"
        "sand.cli.program.run_command = command\n"
        "sys.exit(main(['cite']))\n"
    )
    (workdir / "program.py").write_text(program)
    assert subprocess.run([sys.executable, "-m", "program"]).returncode == 3


def test_no_advice_if_the_folder_was_removed(workdir, capsys, monkeypatch):
    """The message advises nothing that cannot be done."""
    interrupt_when(
        monkeypatch, lambda simulation: shutil.rmtree(workdir / "gone", ignore_errors=True) or simulation.steps > 0
    )
    assert main(["run", "box.toml", "--out", "gone"]) in (2, 130)
    err = capsys.readouterr().err
    assert "sand resume" not in err and "has been removed" in err


def test_control_characters_do_not_reach_the_terminal(workdir, capsys):
    """A name that would clear the screen, reverse text or start a new line is shown escaped."""
    name = "a\x1b[2Jb\x9bc\u202ed\ne\x7f.toml"
    (workdir / name).write_text(BOX)
    (workdir / "twisted.toml").write_text(BOX + '["\\u001b[31mred"]\n')
    for words in (
        ["info", name],
        ["info", name + "x"],
        ["info", "twisted.toml"],
        ["resume", name],
        ["run", "--\x1b[2J"],
    ):
        main(words)
        out, err = capsys.readouterr()
        shown = out + err
        assert shown and not {"\x1b", "\x9b", "\u202e", "\x7f", "\r"} & set(shown)
        assert all(line.startswith(("sand: ", "  ", name[:1])) for line in shown.splitlines())
        assert "\\x1b" in shown
    assert main(["info", name, "--json"]) == 0
    assert "\x7f" not in capsys.readouterr().out


@pytest.mark.filterwarnings("ignore:grains overlap too deeply")
@pytest.mark.compiled("contacts")
def test_the_summary_of_an_interrupted_run_is_that_of_its_last_step(tmp_path):
    """Contacts and drift in summary.json are those of the final state, not of the last frame; no new ledger row."""
    sim = struck_chain()
    sim = sand.Simulation(sim.grains, sim.forces, out=tmp_path / "run", frame_every="1 s")

    class Interrupt(sand.Observer):
        def tick(self, simulation):
            if simulation.contacts["pair"].shape[0] > 6:
                signal.raise_signal(signal.SIGINT)

    sim.observers = [Interrupt()]
    with pytest.raises(sand.Interrupted):
        sim.run(until="1 s")
    summary = json.loads((tmp_path / "run" / "summary.json").read_text("utf-8"))
    assert summary["contacts"] == len(sim.contacts["pair"]) > sim.ledger.rows[-1]["contacts"]
    assert len(sim.ledger.rows) == 1
    assert summary["drift"] != 0.0 == sim.ledger.drift
    assert summary["time"] == sim.time > sim.ledger.rows[-1]["time"]


def test_resume_refuses_a_folder_of_case_files(tmp_path, capsys):
    """`sand resume` of a folder with a user's collision case starts nothing."""
    shutil.copy(Path(__file__).parents[3] / "examples" / "collision.toml", tmp_path)
    assert main(["resume", str(tmp_path)]) == 2
    assert "to start it: sand collide" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["collision.toml"]


def test_advice_can_be_followed(tmp_path, capsys, monkeypatch):
    """What `sand collide`, `sand run` and `sand resume` advise about a folder depends on its content."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own").mkdir()
    shutil.copy(Path(__file__).parents[3] / "examples" / "collision.toml", tmp_path / "own" / "case.toml")
    assert main(["collide", "own/case.toml", "--out", "own"]) == 2
    err = capsys.readouterr().err
    assert "own exists and is not empty" in err and "sand resume" not in err
    assert main(["info", "own"]) == 0
    out = capsys.readouterr().out
    assert "sand collide own" in out and "sand resume" not in out
    assert main(["run", "own"]) == 2
    assert "sand run own/case.toml" in capsys.readouterr().err.replace("\\", "/")
    (tmp_path / "empty").mkdir()
    assert main(["resume", "empty"]) == 2
    err = capsys.readouterr().err
    assert "empty holds no checkpoint to resume from" in err and "--from" not in err
    (tmp_path / "begun").mkdir()
    (tmp_path / "begun" / "checkpoint-000000000000001.npz").touch()
    assert main(["run", "begun"]) == 2
    assert "sand resume begun" in capsys.readouterr().err


def test_json_of_an_interrupted_job(workdir, capsys, monkeypatch):
    """With --json, Ctrl-C gives one object with the advice and the exit code."""
    with monkeypatch.context() as patch:
        interrupt_when(patch, lambda simulation: simulation.seed == 2 and simulation.time > 0.5e-9)
        assert main(["grow", "box.toml", "--seeds", "1-2", "--out", "cut", "--json"]) == 130
    output = json.loads(capsys.readouterr().out)
    assert output == {"error": ["interrupted; continue with: sand resume cut"], "exit_code": 130}
