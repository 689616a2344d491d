"""`sand new NAME`: writes a case file with every key."""

from __future__ import annotations

import shlex
from pathlib import Path

import click

from ..errors import BadInput
from . import options, parsing, report


@parsing.command("new", short_help="Write a case file with every key.")
@click.argument("name", metavar="NAME", type=options.PATH)
@options.output
def command(name: str, as_json: bool) -> None:
    """Write NAME.toml, a case file of `sand run` with every key, its meaning, unit, default and allowed values.

    The file describes a gas of silica grains; keys that are not in use are comments. An existing file is not replaced.
    """
    from ..config.template import template
    from ..io.run_folder import replace_file

    path = Path(name if name.endswith(".toml") else f"{name}.toml")
    if path.exists():
        raise BadInput(f"{path} exists; give another name, or remove it")
    if not path.parent.is_dir():
        raise BadInput(f"there is no folder {path.parent}; make it first")
    replace_file(path, template(str(path)).encode())
    rows = [("file", str(path)), ("check with", f"sand info {shlex.quote(str(path))}")]
    report.answer(
        {"file": str(path)}, f"new {path}", [*rows, ("run with", f"sand run {shlex.quote(str(path))}")], as_json=as_json
    )
