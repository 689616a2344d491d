"""The command that a case file is meant for."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..basics.errors import BadInput

OWN_TABLES = {
    "sweep": {"sweep"},
    "sequence": {"sequence"},  # of sequential collisions, which only a sweep reads
    "grow": {"grow", "method"},
    "scatter": {"flight", "measure"},
    "compress": {"compression"},
    "stretch": {"stretch"},
    "shear": {"shear"},
    "elastic": {"elastic"},
    "collide": {"impact"},
    "run": {"run", "grains", "box", "neighbours"},
}
"""Tables found only in case files of one command; a case of `sand grow` also has those of `sand run`, and one of `sand
sweep` those of any other command."""
LOADINGS = ("compress", "stretch", "shear")
"""Commands that load a packing."""
PACKINGS = (*LOADINGS, "elastic")
"""Commands that load a packing, or measure one at rest."""
BODIES = {"target", "projectile"}
"""Tables of the bodies of `sand collide` and `sand scatter`."""
OF_FILES = ("grains", "aggregate", *BODIES)
"""Tables that may name a file of grains, relative to the case file."""


def command_for(content: dict[str, Any]) -> str | None:
    """The command that a case file is meant for, according to its tables; None if it has none of these tables."""
    for command, tables in OWN_TABLES.items():
        if tables & content.keys():
            return command
    return "collide" if BODIES & content.keys() else None


def refuse_other_command(content: dict[str, Any], path: str | Path, command: str) -> None:
    """Raise BadInput if a case file is meant for another command than the one given."""
    intended = command_for(content)
    own = OWN_TABLES[command] | (OWN_TABLES["run"] if command == "grow" else set())
    if intended in (None, command) or (own & content.keys() and intended not in ("grow", "sweep")):
        return
    reader = "sweep" if intended == "sequence" else intended
    raise BadInput(f"{path}: this is a case for `sand {reader}`; use: sand {reader} {path}")
