"""Bodies from files, looked at before they are used."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..core.grains import Grains
from ..core.material import PRESETS, Material
from ..files.bodies import read_body
from ..setup.soundness import refuse_unsound


def body_from_file(
    path: str | Path,
    material: Material | None = None,
    radius: Any = None,
    length: str | None = None,
    materials: Mapping[str, Material] = PRESETS,
    otherwise: Material | None = None,
) -> Grains:
    """`files.bodies.read_body`, and a body in one piece.

    Raises:
        BadInput: as `read_body`; also for grains that overlap by more than a simulation allows at its start, and for
            gaps: grains without a contact to the rest.  The first ten are named.
    """
    body = read_body(path, material, radius, length, materials, otherwise)
    refuse_unsound(body, str(path))
    return body
