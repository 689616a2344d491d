"""Components of a simulation: the user gives walls and driven grains, others follow from the forces.

Each has a line in `GIVEN` or `OF_FORCES`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..basics.box import Box
from ..basics.grains import Grains
from ..engine.component import Component
from ..forces.base import Force
from .cluster_cutoff import ClusterCutoff
from .driven import DrivenGrains, read_driven
from .ramps import Ramps
from .walls import Walls, read_walls

GIVEN = {"walls": (read_walls, Walls), "driven": (read_driven, DrivenGrains)}
"""By keyword of `sand.Simulation`, which is the table of case files: what reads the user's value, and the component; in
the order in which they act."""
OF_FORCES = (ClusterCutoff, Ramps)
"""Components that follow from the forces, in the order in which they act."""


def read_components(**given: Any) -> dict[str, Component]:
    """The components that the user gives, by keyword.  Raises BadInput."""
    return {name: component(read(given[name])) for name, (read, component) in GIVEN.items()}


def components_of(forces: Sequence[Force], grains: Grains, box: Box) -> list[Component]:
    """The components that follow from the forces on these grains."""
    return [component for each in OF_FORCES if (component := each.of(forces, grains, box)).items]


def groups() -> list[Mapping[str, type]]:
    """Groups of arrays of each component, of which checkpoints have those of the components in use."""
    return [component.groups for component in (*(each for _, each in GIVEN.values()), *OF_FORCES)]
