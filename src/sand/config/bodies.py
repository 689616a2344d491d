"""Bodies from files, checked for overlaps and gaps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..grains import Grains
from ..io.bodies import read_body
from ..material import Material
from ..setup.checks import check_body


def body_from_file(path: str | Path, material: Material | None = None, *others: Any, **named: Any) -> Grains:
    """Read a body that is in one piece; parameters as for `io.bodies.read_body`.

    Raises
    ------
    BadInput
        As `read_body`; also for grains that overlap by more than a simulation allows at its start, and for grains
        without a contact to the rest. The first ten are named.
    """
    body = read_body(path, material, *others, **named)
    check_body(body, str(path))
    return body
