"""Loops over the forces of a simulation, each of which is called by address."""

from ..basics.state import LONG_RANGE_SUMS
from ..compiler.jit import caller
from ..compiler.program import call_stage, has_stage
from .force_stages import (
    BEGIN,
    END,
    EXTERNAL_STAGES,
    IN_CONTACT,
    LOADS,
    PAIR_STAGES,
    REASSIGN,
    ROUND,
    ROUNDS,
    SUBTRACT,
    SUM,
    UPDATE,
    WHOLE,
    WORK,
)
from .parts import EXTERNAL, LOAD_TIME
from .respa import clear_long_range_loads, mark_every_step
from .stages import StageNumber
from .task_queue import SHARED, for_each_block, share_blocks


@caller
def add_external_loads(s, time):
    """Add forces and torques of all external forces at a time [s] to the loads of the grains."""
    s.scratch[LOAD_TIME] = time
    for k in range(s.forces.external):
        call_stage(s, StageNumber.FIRST_FORCE + PAIR_STAGES * s.forces.pair + EXTERNAL_STAGES * k + LOADS)


@caller
def sum_external(s, time, quantity):
    """Sum ENERGY, POWER or WRAPPING of all external forces at a time [s] over all grains."""
    s.scratch[LOAD_TIME] = time
    s.scratch[EXTERNAL] = 0.0
    for k in range(s.forces.external):
        call_stage(s, StageNumber.FIRST_FORCE + PAIR_STAGES * s.forces.pair + EXTERNAL_STAGES * k + WORK, quantity)
    return s.scratch[EXTERNAL]


@caller
def sum_pair_forces(s):
    """Sum the loads of all pair forces over all pairs."""
    clear_long_range_loads(s.long_range)
    for k in range(s.forces.pair):
        number = StageNumber.FIRST_FORCE + PAIR_STAGES * k + SUM
        for r in range(number + ROUND, number + ROUND + ROUNDS):
            if has_stage(s, r):
                for_each_block(s, r, call_stage(s, r, BEGIN))
        if s.queue.words[SHARED] == 1:
            blocks = call_stage(s, number, BEGIN)
            share_blocks(s, number, blocks)
            call_stage(s, number, END)
        else:
            call_stage(s, number, WHOLE)
    s.count[LONG_RANGE_SUMS] += 1


@caller
def add_pairs_in_contact(s):
    """Add the pair forces of grains in contact to the contact loads."""
    for k in range(s.forces.pair):
        call_stage(s, StageNumber.FIRST_FORCE + PAIR_STAGES * k + IN_CONTACT)


@caller
def subtract_pairs_in_contact(s):
    """Subtract the pair forces of grains in contact from the sums over all pairs."""
    for k in range(s.forces.pair):
        call_stage(s, StageNumber.FIRST_FORCE + PAIR_STAGES * k + REASSIGN, SUBTRACT)


@caller
def update_pairs_in_contact(s):
    """Update the sums over all pairs for new and broken contacts."""
    for k in range(s.forces.pair):
        call_stage(s, StageNumber.FIRST_FORCE + PAIR_STAGES * k + REASSIGN, UPDATE)
    mark_every_step(s.contacts, s.count)
