"""Tables of parts, with which tests call single stages."""

from typing import Any

from sand.compiler.table import Table


def table_of(**parts: Any) -> Table:
    """A table of these parts alone."""
    table = Table(tuple(parts))
    for name, value in parts.items():
        table.set(name, value)
    return table
