"""Components of a simulation: the user gives walls and driven grains, others follow from the forces.

Each has a line in `COMPONENTS`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..basics.box import Box
from ..basics.grains import Grains
from ..engine.component import Component
from ..forces.base import Force
from .cluster_cutoff import ClusterCutoff
from .deformation import DeformedBox, read_deformation
from .driven import DrivenGrains, read_driven
from .gas import GasKicks
from .ramps import Ramps
from .settling import Settling
from .walls import Walls, read_walls

COMPONENTS: tuple[type[Component], ...] = (ClusterCutoff, Ramps, Walls, GasKicks, DrivenGrains, Settling, DeformedBox)
"""All components, in the order in which they act at the same place.

Between two cycles each grain moves in the gas, then driven grains return to their prescribed motion, and what settling
finds is the motion of clusters, and that of their grains relative to it.
"""
GIVEN = {"walls": read_walls, "driven": read_driven, "deformation": read_deformation}
"""What reads a component that the user gives, by keyword of `sand.Simulation`, which is the table of case files."""


def read_components(**given: Any) -> dict[str, Component]:
    """The components that the user gives, by keyword.  Raises BadInput."""
    return {each.name: each(GIVEN[each.name](given[each.name])) for each in COMPONENTS if each.name in GIVEN}


def components_of(given: Mapping[str, Component], forces: Sequence[Force], grains: Grains, box: Box) -> list[Component]:
    """All components of a simulation: the user's components, and the components that follow from the forces."""
    found = [given.get(each.name) or each.of(forces, grains, box) for each in COMPONENTS]
    return [each for each in found if each.items]


def groups() -> list[Mapping[str, type]]:
    """Groups of arrays of each component, of which checkpoints have those of the components in use."""
    return [each.groups for each in COMPONENTS]
