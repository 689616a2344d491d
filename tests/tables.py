"""Tables of parts, with which tests call single stages."""

from typing import Any

from sand.compiler.table import Table
from sand.integrate.parts import PARTS


def table_of(**parts: Any) -> Table:
    """A table of these parts, at the places that they have in runs: stages need no code of their own for it."""
    table = Table((*PARTS, *(name for name in parts if name not in PARTS)))
    for name, value in parts.items():
        table.set(name, value)
    return table
