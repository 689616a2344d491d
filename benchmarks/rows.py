"""All rows of the table."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from . import pieces, scattering, start_up, steps, threads


def all_rows(quick: bool) -> Iterator[dict[str, Any]]:
    """Measure everything, one row after the other."""
    for part in (steps, threads, pieces, scattering, start_up):
        yield from part.all_rows(quick)
