"""Components of a simulation, such as walls and driven grains; each has a line in `READERS`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..engine.component import Component
from .driven import DrivenGrains, read_driven
from .walls import Walls, read_walls

READERS = {"walls": (read_walls, Walls), "driven": (read_driven, DrivenGrains)}
"""By keyword of `sand.Simulation`: what reads the user's value, and the component; in the order in which they act."""


def read_components(**given: Any) -> dict[str, Component]:
    """The components of a simulation by keyword.  Raises BadInput."""
    return {name: component(read(given[name])) for name, (read, component) in READERS.items()}


def groups() -> list[Mapping[str, type]]:
    """Groups of arrays of each component, of which checkpoints have those of the components in use."""
    return [component.groups for _, component in READERS.values()]
