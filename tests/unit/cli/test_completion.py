"""Completion of words in a shell: commands, options, runs and case files."""

import os
import shutil
import subprocess
import sys

import pytest

from sand.cli.completion import SHELLS, VARIABLE
from sand.cli.main import main

from .test_cli import heavy_modules


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A run, a case file, a folder with another case file, and a text."""
    monkeypatch.chdir(tmp_path)
    for name in ("first", "first-again", "other", ".hidden"):
        (tmp_path / name).mkdir()
    for name in ("first/case.toml", "first-again/trajectory.gsd", "gas.toml", "notes.txt", "other/case two.toml"):
        (tmp_path / name).write_text("")
    return tmp_path


def completed(words, capsys, monkeypatch):
    """Types and values that the shell is given for the last of the words, as it is given them by bash."""
    monkeypatch.setenv(VARIABLE, "bash_complete")
    monkeypatch.setenv("COMP_WORDS", "\n".join(["sand", *words]))
    monkeypatch.setenv("COMP_CWORD", str(len(words)))
    assert main([]) == 0
    return [line.split(",", 1) for line in capsys.readouterr().out.splitlines()]


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["sca"], ["scatter"]),
        (["resume", ""], ["first", "first-again", "other/"]),
        (["resume", "first"], ["first", "first-again"]),
        (["run", ""], ["gas.toml", "first/", "first-again/", "other/"]),
        (["run", "first/"], ["first/case.toml"]),
        (["info", ""], ["first", "first-again", "gas.toml", "other/"]),
        (["analyse", "first", "fi"], ["first", "first-again"]),
        (
            ["new", "x", "--for", ""],
            [
                "run",
                "magnetic",
                "collide",
                "scatter",
                "grow",
                "encounters",
                "compress",
                "stretch",
                "shear",
                "elastic",
                "sweep",
            ],
        ),
        (["plot", "first", "--dp"], ["--dpi"]),
        (["run", "x", "--until", "1kg", "--import", "nowhere", "--over"], ["--overwrite"]),
        (["completion", ""], list(SHELLS)),
    ],
)
def test_words_are_completed(words, expected, folder, capsys, monkeypatch):
    """Runs, case files and the folders on the way to others; options and their words; wrong words before do no harm."""
    assert completed(words, capsys, monkeypatch) == [["plain", word] for word in expected]


@pytest.mark.parametrize(
    ("words", "kind"),
    [
        (["run", "--out", ""], "dir"),  # any folder
        (["run", "other/"], "file"),  # the shell quotes the blank
        (["resume", "oth"], "dir"),
        (["build", "bpca", "--out", ""], "file"),
        (["resume", "nowhere/x"], "dir"),
    ],
)
def test_other_paths_are_left_to_the_shell(words, kind, folder, capsys, monkeypatch):
    """The shell completes files or folders by itself."""
    assert completed(words, capsys, monkeypatch) == [[kind, words[-1]]]


def test_no_module_of_the_user_is_run(folder, capsys, monkeypatch):
    """Completion after --import FILE does not import the file."""
    (folder / "mine.py").write_text("raise SystemExit('imported')")
    assert completed(["run", "--import", "mine.py", "--over"], capsys, monkeypatch) == [["plain", "--overwrite"]]


def test_completion_imports_nothing_heavy(monkeypatch):
    """It answers after imports of a tenth of a second."""
    monkeypatch.setenv(VARIABLE, "bash_complete")
    monkeypatch.setenv("COMP_WORDS", "sand\nresume\n")
    monkeypatch.setenv("COMP_CWORD", "2")
    assert heavy_modules("resume") == "[]"


@pytest.mark.parametrize("shell", SHELLS)
def test_the_script_is_printed(shell, capsys):
    """It asks `sand` by the variable to which `sand` answers."""
    assert main(["completion", shell]) == 0
    script = capsys.readouterr().out
    assert f"{VARIABLE}={shell}_complete" in script


@pytest.mark.skipif(sys.platform == "win32" or shutil.which("bash") is None, reason="needs bash")
def test_bash_completes(folder):
    """The script in bash: the function that it registers for `sand` gives the runs."""
    program = folder / "bin"
    program.mkdir()
    (program / "sand").write_text(f'#!/bin/sh\nexec "{sys.executable}" -m sand.cli.main "$@"\n')
    (program / "sand").chmod(0o755)
    code = (
        'eval "$(sand completion bash)"; complete -p sand; COMP_WORDS=(sand resume fi); COMP_CWORD=2; '
        '_sand_completion sand; echo "${COMPREPLY[@]}"'
    )
    given = os.environ | {"PATH": f"{program}{os.pathsep}{os.environ['PATH']}"}
    ended = subprocess.run(["bash", "-c", code], capture_output=True, text=True, env=given)
    assert ended.stdout.splitlines() == ["complete -o nosort -F _sand_completion sand", "first first-again"], (
        ended.stderr
    )
