"""Which command a case file is for."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..errors import BadInput

OWN_TABLES = {
    "grow": {"grow"},
    "scatter": {"flight", "measure"},
    "collide": {"impact"},
    "run": {"run", "grains", "box", "neighbours"},
}
"""Tables that only the cases of one command have; a case of `sand grow` has those of `sand run`, too."""
BODIES = {"target", "projectile"}
"""Tables of `sand collide` and `sand scatter`."""


def command_for(content: dict[str, Any]) -> str | None:
    """The command that a case file is for, told by its tables; None if none of them tells."""
    for command, tables in OWN_TABLES.items():
        if tables & content.keys():
            return command
    return "collide" if BODIES & content.keys() else None


def refuse_other_command(content: dict[str, Any], path: str | Path, command: str) -> None:
    """Raises BadInput, in one line, for a case that is for another command than the one given."""
    meant = command_for(content)
    own = OWN_TABLES[command] | (OWN_TABLES["run"] if command == "grow" else set())
    if meant in (None, command) or (own & content.keys() and meant != "grow"):
        return
    raise BadInput(f"{path}: this is a case for `sand {meant}`; use: sand {meant} {path}")
