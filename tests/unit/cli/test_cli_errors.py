"""All errors of a command line at once, and the options that every command has."""

import click
import pytest

from sand.cli import parsing
from sand.cli.main import main
from sand.cli.program import COMMANDS, sand

NAMES = sorted(sand.commands)
WITHOUT_RESULTS = {"cite", "completion", "methods"}
"""Commands that print what they are asked for and nothing else."""


@pytest.fixture(autouse=True)
def empty_folder(tmp_path, monkeypatch):
    """Work in an empty folder, in which nothing may be written."""
    monkeypatch.chdir(tmp_path)
    yield
    assert not list(tmp_path.iterdir())


def test_help_wins(capsys):
    """--help beside errors prints the help, exit code 0."""
    assert main(["run", "--foo", "--help"]) == 0
    assert "Usage: sand run" in capsys.readouterr().out


def test_words_after_two_hyphens_are_arguments(capsys):
    """`--` ends the options: what follows is the name of a file, whatever it looks like."""
    assert main(["info", "--", "--overwrite"]) == 2
    assert capsys.readouterr().err == "sand: there is no file or folder --overwrite\n"


@pytest.mark.parametrize("name", NAMES)
def test_options_are_the_same_everywhere(name):
    """Each command reports all errors, and has --json, --quiet and --debug; no option has two meanings."""
    command = sand.commands[name]
    assert isinstance(command, parsing.Command)
    own = {word: param for param in command.params for word in param.opts}
    assert "--debug" in own
    assert ({"--json", "--quiet"} <= own.keys()) is (name not in WITHOUT_RESULTS)
    assert all(param.help for param in command.params if isinstance(param, click.Option))
    writes = {"new", "run", "build", "collide", "scatter", "analyse", "plot", "view", "export"}
    writes |= {"compress", "stretch", "shear", "elastic"}
    assert ("--overwrite" in own) is (name in writes)  # grow and resume continue what is there
    if "--workers" in own:
        assert own["--workers"] is not None and "Number of worker processes" in str(own["--workers"].help)
    assert len(COMMANDS) == len(NAMES)


def test_options_with_one_name_have_one_meaning():
    """--quiet, --json, --workers, --seeds, --frames … are made in one place each, or at least of one type."""
    kinds = {}
    for name in NAMES:
        for param in sand.commands[name].params:
            if isinstance(param, click.Option):
                kinds.setdefault(param.opts[0], set()).add((param.is_flag, param.multiple, param.nargs, param.metavar))
    allowed = {"--out", "--seeds"}  # a folder, or the file of one body; a list, or for a sweep their number
    assert not {name: kind for name, kind in kinds.items() if len(kind) > 1 and name not in allowed}
