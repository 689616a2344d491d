"""`sand new NAME`: writes a case file with every key."""

from __future__ import annotations

import shlex
from pathlib import Path

import click

from ..basics.errors import BadInput
from ..config.commands import PACKINGS
from . import options, parsing, report

READERS = {"magnetic": "run", "encounters": "grow"}
"""Kinds of cases that are no commands, and the commands that read them."""
KINDS = ("run", "magnetic", "collide", "scatter", "grow", "encounters", *PACKINGS, "sweep")
"""Commands that read a case file, and kinds of their cases; as `experiments.templates.TEMPLATES`, which takes long to
import."""


@parsing.command("new", short_help="Write a case file with every key.")
@click.argument("name", metavar="NAME", type=options.FILE)
@click.option(
    "--for",
    "reader",
    type=click.Choice(KINDS),
    default="run",
    show_default=True,
    help="The command that reads the file, or a kind of its cases.",
)
@click.option("--overwrite", is_flag=True, help="Replace the file if it exists.")
@options.output
def command(name: str, reader: str, overwrite: bool, **output: bool) -> None:
    """Write NAME.toml, a case file with every key, its meaning, unit, default and allowed values.

    \b
    run         a gas of silica grains
    magnetic    a gas of magnetic grains of iron of two sizes, for sand run
    collide     two fluffy aggregates of silica
    scatter     cross-sections of two magnetic grains of iron
    grow        the gas, for several seeds
    encounters  magnetic grains of iron in dilute dust, for sand grow
    compress    a fluffy aggregate of ice, in a periodic box
    stretch     a compact aggregate of ice, between two walls
    shear       a compact aggregate of ice, between two walls
    elastic     a fluffy aggregate of ice, compressed in a periodic box
    sweep       the aggregates, for several speeds, impact parameters and seeds

    It can be run as it is; keys that are not in use are comments.
    """
    from ..experiments.templates import TEMPLATES
    from ..io.run_folder import replace_file

    path = Path(name if name.endswith(".toml") else f"{name}.toml")
    if path.exists() and not overwrite:
        raise BadInput(f"{path} exists; give another name, or --overwrite")
    if not path.parent.is_dir():
        raise BadInput(f"there is no folder {path.parent}; make it first")
    replace_file(path, TEMPLATES[reader](str(path)).encode())
    command = READERS.get(reader, reader)
    quoted = shlex.quote(str(path))
    rows = [("file", str(path)), ("check with", f"sand info {quoted}"), ("run with", f"sand {command} {quoted}")]
    report.answer({"file": str(path), "command": command}, f"new {path}", rows, **output)
