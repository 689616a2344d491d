"""`sand view`: HTML files, addresses, waiting for a run, wrong arguments."""

import json
import re
import threading
import urllib.request

import pytest

import sand
from sand.cli import view as view_command
from sand.cli.main import main
from sand.viewer import browser

from ..pages import blocks
from ..synthetic_trajectories import write_trajectory

pytestmark = pytest.mark.usefixtures("bundle")


@pytest.mark.compiled("fields")
def test_the_command_writes_a_file(finished_run, tmp_path, capsys):
    """Existing files are kept without --overwrite; prints the size; slices and thinning apply."""
    target = tmp_path / "out.html"
    words = ["view", str(finished_run[0]), "--html", str(target)]
    assert main([*words, "--json"]) == 0
    output = json.loads(capsys.readouterr().out)
    assert output == {"file": str(target), "bytes": target.stat().st_size}
    assert main(words) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert main([*words, "--overwrite", "--every", "2", "--frames", "1:"]) == 0
    assert "MB" in capsys.readouterr().out
    manifest, _, packets = blocks(target)
    assert len(packets) == 3 and manifest["steps"] == [sand.open(finished_run[0]).frames[k].step for k in (1, 3, 5)]
    assert "one frame of 2" in manifest["note"] and manifest["field"]["directions"]


@pytest.mark.compiled("fields")
def test_a_large_file_gives_a_warning(finished_run, tmp_path, capsys, monkeypatch):
    """Above 100 MB the line advises what to do."""
    monkeypatch.setattr("sand.cli.report.LARGE", 1e3)
    assert main(["view", str(finished_run[0]), "--html", str(tmp_path / "a.html"), "--quiet"]) == 0
    output = capsys.readouterr()
    assert "--every" in output.err and output.out == ""


@pytest.mark.compiled("fields")
def test_without_the_page(finished_run, bundle, capsys):
    """An installation without the bundle says so in one line."""
    (bundle / "grainview.js").unlink()
    assert main(["view", str(finished_run[0])]) == 2
    assert "not part of this installation" in capsys.readouterr().err


@pytest.mark.compiled("fields")
@pytest.mark.parametrize("form", [[], ["--json"], ["--quiet"]])
def test_the_command_serves(finished_run, capsys, monkeypatch, form):
    """It prints the address, answers there while waiting, and Ctrl-C ends it with exit code 0."""
    got = {}

    def wait():
        got["out"], got["err"] = capsys.readouterr()
        (url,) = re.findall(r"http://127\.0\.0\.1:\d+/[\w-]+/", got["out"])
        with urllib.request.urlopen(url + "manifest", timeout=10) as reply:
            got["manifest"] = json.load(reply)
        raise KeyboardInterrupt

    monkeypatch.setattr(view_command, "_wait", wait)
    monkeypatch.setenv("SSH_CONNECTION", "a b c d")
    ended = []
    monkeypatch.setattr(browser, "remove_redirects", lambda: ended.append(True))
    before = threading.active_count()
    assert main(["view", str(finished_run[0]), *form]) == 0
    assert got["manifest"]["grains"] == 6 and ended
    output = got["err"] + capsys.readouterr().err
    assert ("ssh -L" in output and "ended" in output) if not form else output == ""
    assert threading.active_count() <= before + 2
    if form == ["--json"]:
        assert list(json.loads(got["out"])) == ["url"]


@pytest.mark.compiled("fields")
def test_waiting_for_the_first_frame(finished_run, tmp_path, capsys):
    """An empty folder, as during compilation; then a case, then a trajectory: the page has its frames."""
    run = tmp_path / "run"
    run.mkdir()

    def begin():
        (run / "case.toml").write_bytes((finished_run[0] / "case.toml").read_bytes())
        # both frames at once, because a page may be written after the first frame
        write_trajectory(tmp_path / "made.gsd", [[(0, 1)], []], 3).rename(run / "trajectory.gsd")

    later = threading.Timer(1.0, begin)
    later.start()
    assert main(["view", str(run), "--html", str(tmp_path / "a.html")]) == 0
    later.join()
    assert len(blocks(tmp_path / "a.html")[2]) == 2
    assert "waiting up to 60 s" in capsys.readouterr().err


@pytest.mark.slow
def test_waiting_ends_without_a_run(tmp_path, capsys, monkeypatch):
    """After the time limit: one line with what to look for; a run that has ended is not waited for."""
    monkeypatch.setattr(view_command, "WAIT", 0.5)
    (tmp_path / "case.toml").write_text("")
    assert main(["view", str(tmp_path), "--quiet"]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1 and "has no frame after" in lines[0]
    (tmp_path / "summary.json").write_text("{}")
    assert main(["view", str(tmp_path)]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1 and "no trajectory.gsd" in lines[0]


def test_waiting_can_be_interrupted(tmp_path, monkeypatch):
    """Ctrl-C before there is a page: as for all commands."""

    def pressed(_):
        raise KeyboardInterrupt

    monkeypatch.setattr(view_command.time, "sleep", pressed)
    (tmp_path / "run").mkdir()
    assert main(["view", str(tmp_path / "run")]) == 130
