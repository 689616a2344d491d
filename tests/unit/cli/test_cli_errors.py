"""All errors of a command line at once, and the options that every command has."""

import json

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


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (
            "run a.toml --foo 3 --seed x --until 1kg --threads",
            ["--foo", "'--threads' requires an argument", "'--seed'", "--until = '1kg'"],
        ),
        ("build bpco --out --overwrite", ["'--out' requires an argument", "'KIND'"]),
        (
            "build bpca --shape 3 --grains 4 --dimension q",
            ["Missing option '--out'", "--dimension 'q'", "leave --grains"],
        ),
        ("info a b --quiet=3", ["'--quiet' does not take a value", "unexpected extra argument (b)"]),
        ("info", ["Missing argument 'DIR|FILE'"]),
        ("info --foo", ["--foo", "Missing argument"]),
        ("info --foo=3 -x a", ["--foo", "-x"]),
        ("info --foo a b", ["--foo"]),  # a may be the value of --foo
        ("analyse --window 3 2 a a", ["--window 3 2", "the same folder"]),
        ("analyse --window 3", ["'--window' requires 2 arguments", "Missing argument"]),
        ("export a --to gif --frames x", ["'--to'", "--frames 'x'"]),
        ("scatter a --resume --overwrite --workers 0", ["'--workers'", "exclude each other"]),
        ("plot a --size wide --dpi 1 --format gif --what x", ["'--format'", "'--dpi'", "--size 'wide'", "--what 'x'"]),
        ("collide a --seeds 3- --workers many", ["'--workers'", "--seeds '3-'"]),
        ("run --frame 3", ["give --from, too"]),
        ("new", ["Missing argument 'NAME'"]),
        ("view a --port 70000 --every 0", ["'--port'", "'--every'"]),
        ("--foo", ["--foo"]),
        ("fly", ["No such command"]),
    ],
)
def test_every_error_of_a_command_line_is_a_line(words, parts, capsys):
    """One line for each error and no other, exit code 2; the same lines with --json."""
    assert main(words.split()) == 2
    out, err = capsys.readouterr()
    lines = err.splitlines()
    assert out == "" and len(lines) == len(parts), err
    assert all(line.startswith("sand: ") for line in lines)
    for part in parts:
        assert sum(part in line for line in lines) == 1, (part, lines)
    if words.startswith("--") or "--threads" in words:
        return  # --json would be an option of the group, or the value of --threads
    assert main([*words.split()[:1], "--json", *words.split()[1:]]) == 2
    assert [f"sand: {line}" for line in json.loads(capsys.readouterr().out)["error"]] == lines


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
    allowed = {"--out"}  # a folder, or the file of one body
    assert not {name: kind for name, kind in kinds.items() if len(kind) > 1 and name not in allowed}
