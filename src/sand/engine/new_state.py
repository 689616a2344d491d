"""Allocation of a state with the arrays that the stages of a simulation need."""

from __future__ import annotations

from ..basics.arrays import (
    ALWAYS_RECORDED,
    CELL_ARRAYS,
    FORCE_ARRAYS,
    LIST_ARRAYS,
    PACKED_ARRAYS,
    RATE_ARRAYS,
    RESPA_ARRAYS,
    cluster_arrays,
    empty_contact_arrays,
    empty_long_range_arrays,
    empty_pair_list,
)
from ..basics.box import Box, Span
from ..basics.grains import Grains
from ..basics.state import RECORDED, State
from ..contact.constants_table import constant_names
from ..forces.pair.long_range_loops import all_blocks
from ..integrate.parts import StepParameters
from ..integrate.stage_list import ProgramContent

NEIGHBOURS_PER_GRAIN = 4
"""Initial capacity of the Verlet list per grain; it grows on overflow."""
CELL_NEIGHBOURS = 1000
"""Capacity for the neighbours of one grain where pairs come straight from the cells and no list is stored."""


def new_state(
    grains: Grains,
    box: Box,
    parameters: StepParameters,
    content: ProgramContent,
    capacity: int,
    *,
    over_all_pairs: bool,
) -> State:
    """State with the arrays that the stages need.

    `capacity` is that of contacts and pairs, `over_all_pairs` whether any long-range force is summed over all pairs.
    """
    count, search, settings = len(grains), parameters.search, parameters.settings
    uniform_contacts = settings.uniform_contacts
    channels = len(RECORDED) if settings.damped or settings.follow else ALWAYS_RECORDED
    pair_forces = [sums for sums, _ in content.pair_forces]
    needed = set(LIST_ARRAYS if search.listed else CELL_ARRAYS if search.celled else ())
    needed |= set(RESPA_ARRAYS if parameters.respa.impulse else ())
    needed |= set(RATE_ARRAYS if parameters.respa.taylor else ())
    needed |= {name for sums in pair_forces for name in sums.arrays}
    needed |= set(FORCE_ARRAYS if pair_forces or content.flight else ())
    needed |= {"virial"} if pair_forces and not isinstance(parameters.span, Span) else set()
    return State(
        grains,
        box,
        empty_contact_arrays(
            count,
            capacity,
            len(constant_names(content.law)),
            uniform_contacts=uniform_contacts,
            channels=channels,
            damped=settings.damped,
        ),
        empty_pair_list(count, capacity, uniform_contacts=uniform_contacts),
        empty_long_range_arrays(
            count,
            NEIGHBOURS_PER_GRAIN * count if search.listed else CELL_NEIGHBOURS if search.celled else 0,
            all_blocks(grains) if pair_forces and over_all_pairs else 0,
            unused={*FORCE_ARRAYS, *LIST_ARRAYS, *PACKED_ARRAYS, *RESPA_ARRAYS, *RATE_ARRAYS, "virial"} - needed,
        ),
        clusters=cluster_arrays(0),
        uniform_contacts=uniform_contacts,
    )
