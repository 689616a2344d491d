"""Wrong input: what is given to functions, commands and case files, and all lines that it gives.  Nothing is compiled.

`messages.txt` is the table: "use → message", or a use and, indented below it, its messages, each whole.  A use that
begins with "sand " is a command; "[section] key = value" is a change of a case, and "[section] key" a case without
this key; any other use is an expression.  `…*` stands for text of other packages and for the rest of long lists.

Write a new use on a line of its own: `python -m tests.unit.basics.test_messages` adds its messages, and renews those of
all others.  Read what has changed.
"""

import contextlib
import io
import json
import math
import os
import re
import sys
import tempfile
import tomllib
import warnings
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import tomli_w

import sand
import sand.plotting.render.still
from sand.cli.main import main
from sand.config.build import simulation_of
from sand.config.case import check_case
from sand.io.bodies import read_body, read_grains, write_body
from sand.io.run_folder import LEDGER, TRAJECTORY
from sand.io.trajectory import read_frames
from sand.setup.from_file import body_from_file
from sand.simulation.contact_table import ContactTable

from ...plugins import ForestRuth

TABLE = Path(__file__).with_name("messages.txt")
CASE = """
[run]
until = "5 ns"
seed = 4
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
COLLISION = """
[target]
kind = "bpca"
grains = 8
radius = "0.1 um"
[projectile]
kind = "grain"
radius = "0.1 um"
[impact]
speed = "2 m/s"
seeds = [1, 2]
[forces.contact]
"""
LOADING = """
[aggregate]
kind = "lattice"
shape = [3, 3, 3]
radius = "0.1 um"
material = "ice"
[TABLE]
rate = "1 mm/s"
to = 0.6
by = "walls"
[forces.contact]
"""
ELASTIC = """
[aggregate]
kind = "lattice"
shape = [4, 4, 4]
radius = "0.1 um"
material = "ice"
[elastic]
box = "800 nm"
[forces.contact]
"""
SCATTERING = """
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
ENCOUNTERS = """
[method]
kind = "encounters"
[run]
stop = "mean_cluster_size >= 4"
[grains]
number = 100
number_density = "3e8 /m^3"
radius = "10 nm"
temperature = "100 K"
[forces.contact]
damping = "critical"
"""
KINDS = {"target": ("collide", COLLISION), "impact": ("collide", COLLISION), "projectile": ("collide", COLLISION)}
KINDS["aggregate"] = ("compress", LOADING.replace("TABLE", "compression"))
KINDS |= {
    table: (command, LOADING.replace("TABLE", table))
    for command, table in {"compress": "compression", "stretch": "stretch", "shear": "shear"}.items()
}
KINDS["elastic"] = ("elastic", ELASTIC)
KINDS |= {"flight": ("scatter", SCATTERING), "measure": ("scatter", SCATTERING), "method": ("grow", ENCOUNTERS)}
"""Command and case of a use that begins with a change of this section; of other sections: `sand run` and CASE."""


def names():
    """Names of expressions; files are made in the present folder."""
    x, iron = [[0, 0, 0], [3e-8, 0, 0]], {"radius": "10 nm", "material": "iron"}
    grains = sand.Grains(x, 1e-8, "silica")
    write_body(Path("body.gsd"), grains)
    Path("run").mkdir()
    Path("body.gsd").rename(Path("run", TRAJECTORY))
    Path("run", LEDGER).write_text("step,total\n0,1.0\n")
    Path("small.toml").write_text(CASE)
    Path("empty").mkdir()
    Path("hit.toml").write_text(COLLISION)
    Path("picture.png").write_bytes(b"\x89PNG")
    table = ContactTable.__new__(ContactTable)
    table.update({"pair": np.zeros((0, 2), int), "overlap": np.zeros(0)})
    mass = sand.IRON.density * 4.0 / 3.0 * math.pi * 1e-24
    kinetics, smoluchowski = sand.theory.kinetics, sand.theory.smoluchowski
    constant, nine = kinetics.constant(1e-14), smoluchowski.all_sizes(9)

    def file(text):
        """A file of this text."""
        Path("a").write_text(text)
        return "a"

    def two(gap=1e-8, material="iron", **options):
        """Two grains of 10 nm."""
        return sand.Grains([[0, 0, 0], [2e-8 + gap, 0, 0]], 1e-8, material, **options)

    def grow(kernel=constant, sizes=nine, numbers=1e18, times=(2e-4,), **options):
        return smoluchowski.coagulate(kernel, sizes, numbers, list(times), **({"mass": mass} | options))

    given = {"sand": sand, "np": np, "nan": math.nan, "inf": math.inf, "ForestRuth": ForestRuth, "setattr": setattr}
    given |= {"x": x, "iron": iron, "grains": grains, "sim": sand.Simulation(grains, [sand.Contact()]), "table": table}
    given |= {"two": two, "one": sand.Grains([[0, 0, 0]], 1e-8, "iron")}
    given |= {
        "magnet": sand.Grains([[0, 0, 0]], 1e-8, "iron", moment=[0, 0, 1e-18]),
        "charged": sand.Grains([[0, 0, 0], [1e-7, 0, 0]], 1e-8, "silica", charge=1e-19, moment="1e-18 A m^2"),
        "row": sand.Grains([[0, 0, 0], [2.5e-8, 0, 0], [5e-8, 0, 0]], 1e-8, "silica"),
        "floor": sand.Wall([0, 0, 0], [0, 0, 1], "silica", name="floor"),
        "flight": iron | {"moment": "200 A m^2/kg", "temperature": "100 K", "speed": 0.2},
        "run": "run",
        "body": read_frames(Path("run", TRAJECTORY))[0],
        "frame": SimpleNamespace(radius=np.ones(2), pair=np.zeros((0, 2), int)),
    }
    given |= {"file": file, "read_grains": read_grains, "read_body": read_body, "body_from_file": body_from_file}
    return given | {
        "grow": grow,
        "kinetics": kinetics,
        "smoluchowski": smoluchowski,
        "constant": constant,
        "mass": mass,
    }


def changed(text):
    """The command and the content of a case with the changes of a use."""
    parts = [re.fullmatch(r"\[([\w.]*)\] (.*)", part).groups() for part in text.split("; ")]
    command, case = KINDS.get(parts[0][0], ("run", CASE))
    content = tomllib.loads(case)
    for section, entry in parts:
        table = content
        for name in filter(None, section.split(".")):
            table = table.setdefault(name, {})
        if " = " in entry:
            table.update(tomllib.loads(entry))
        else:
            table.pop(entry, None)
    return command, content


def lines_of_case(text):
    """Messages from reading a case, or from building its simulation; of other commands than `run`, and of `info`."""
    command, content = changed(text)
    if command == "run":
        with pytest.raises(sand.BadInput) as caught:
            simulation_of(check_case(content, "case.toml"), None)
        return caught.value.problems
    Path("case.toml").write_bytes(tomli_w.dumps(content).encode())
    found = lines_of_command(f"sand {command} case.toml")
    assert lines_of_command("sand info case.toml") == found
    Path("case.toml").unlink()
    return found


def lines_of_command(line):
    """Messages of a command, on standard error; the same with --json; nothing is written to the folder."""
    before, words = sorted(Path().rglob("*")), [word.strip("'") for word in re.findall(r"'[^']*'|\S+", line)[1:]]
    code, out, err = called(words)
    lines = err.splitlines()
    assert code == 2 and (out == "" or "--json" in words) and all(line.startswith("sand: ") for line in lines), (
        code,
        out,
        err,
    )
    if words[:1] and not words[0].startswith("-") and words[-1] != "--threads":  # --json would be its value
        code, out, _ = called([words[0], "--json", *words[1:]])
        assert code == 2 and [f"sand: {each}" for each in json.loads(out)["error"]] == lines
    assert sorted(Path().rglob("*")) == before
    return [line.removeprefix("sand: ") for line in lines]


def called(words):
    """Exit code, output and messages of a command."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        return main(words), out.getvalue(), err.getvalue()


def lines_of(use, given):
    """The messages of a use; HERE is the present folder."""
    return [line.replace(str(Path.cwd()), "HERE") for line in _lines_of(use, given)]


def _lines_of(use, given):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if use.startswith("sand "):
            return lines_of_command(use)
        if use.startswith("["):
            return lines_of_case(use)
        with pytest.raises(sand.BadInput) as caught:
            eval(use, dict(given))
    return caught.value.problems


def read_table():
    """Uses with their messages, and comments with none, in the order of the file."""
    rows = []
    for line in TABLE.read_text("utf-8").splitlines():
        use, _, message = line.partition(" → ")
        if line.startswith("    "):
            rows[-1][1].append(line[4:])
        else:
            rows.append((use, [message] if message else []))
    return rows


def is_use(text):
    return text != "" and not text.startswith("#")


@pytest.fixture(scope="module")
def given(tmp_path_factory):
    """Names of expressions."""
    folder, before = tmp_path_factory.mktemp("messages"), Path.cwd()
    os.chdir(folder)
    yield names()
    os.chdir(before)


ROWS = [(use, lines) for use, lines in read_table() if is_use(use)]


@pytest.mark.parametrize(("use", "lines"), ROWS, ids=[use[:70] for use, _ in ROWS])
def test_wrong_input_gives_its_lines(given, use, lines):
    """What, where, unit, what is allowed, what to do: one line for each mistake, each whole."""
    found = lines_of(use, given)
    assert len(found) == len(lines) > 0 and not any("\n" in line for line in found), found
    for line, expected in zip(found, lines, strict=True):
        assert line == expected or ("…*" in expected and matches(line, expected)), found


def matches(line, expected):
    """Whether a line is as expected, where text of other packages stands as `…*`."""
    return re.fullmatch(".*".join(map(re.escape, expected.split("…*"))), line) is not None


def renewed():
    """The table with the messages of today."""
    given, text = names(), []
    for use, lines in read_table():
        found = lines_of(use, given) if is_use(use) else []
        kept = len(found) == len(lines) and all(map(matches, found, lines))
        found = lines if kept else found
        short = len(found) == 1 and len(use) + len(found[0]) < 118
        text += [f"{use} → {found[0]}"] if short else [use, *(f"    {line}" for line in found)]
    return "\n".join(text) + "\n"


if __name__ == "__main__":
    with contextlib.chdir(tempfile.mkdtemp()):
        content = renewed()
    TABLE.write_text(content, "utf-8")
    sys.stdout.write(f"{content.count(chr(10))} lines in {TABLE}\n")
