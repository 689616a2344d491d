"""Loops over the forces of a simulation, each of which is called by address."""

from ..compiler.jit import caller
from ..compiler.program import call_stage, has_stage
from ..state.state import LONG_RANGE_SUMS
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
from .stages import FIRST_FORCE
from .task_queue import SHARED, for_each_block, share_blocks


@caller
def add_external_loads(scratch, forces, program, table, time):
    """Add forces and torques of all external forces at a time [s] to the loads of the grains."""
    scratch[LOAD_TIME] = time
    for k in range(forces.external):
        call_stage(program, FIRST_FORCE + PAIR_STAGES * forces.pair + EXTERNAL_STAGES * k + LOADS, table, 0)


@caller
def sum_external(scratch, forces, program, table, time, quantity):
    """Sum ENERGY, POWER or WRAPPING of all external forces at a time [s] over all grains."""
    scratch[LOAD_TIME] = time
    scratch[EXTERNAL] = 0.0
    for k in range(forces.external):
        call_stage(program, FIRST_FORCE + PAIR_STAGES * forces.pair + EXTERNAL_STAGES * k + WORK, table, quantity)
    return scratch[EXTERNAL]


@caller
def sum_pair_forces(long_range, count, forces, queue, program, table):
    """Sum the loads of all pair forces over all pairs."""
    clear_long_range_loads(long_range)
    for k in range(forces.pair):
        number = FIRST_FORCE + PAIR_STAGES * k + SUM
        for r in range(number + ROUND, number + ROUND + ROUNDS):
            if has_stage(program, r):
                for_each_block(program, r, table, queue.words, call_stage(program, r, table, BEGIN))
        if queue.words[SHARED] == 1:
            blocks = call_stage(program, number, table, BEGIN)
            share_blocks(program, number, table, queue.words, blocks)
            call_stage(program, number, table, END)
        else:
            call_stage(program, number, table, WHOLE)
    count[LONG_RANGE_SUMS] += 1


@caller
def add_pairs_in_contact(forces, program, table):
    """Add the pair forces of grains in contact to the contact loads."""
    for k in range(forces.pair):
        call_stage(program, FIRST_FORCE + PAIR_STAGES * k + IN_CONTACT, table, 0)


@caller
def subtract_pairs_in_contact(forces, program, table):
    """Subtract the pair forces of grains in contact from the sums over all pairs."""
    for k in range(forces.pair):
        call_stage(program, FIRST_FORCE + PAIR_STAGES * k + REASSIGN, table, SUBTRACT)


@caller
def update_pairs_in_contact(contacts, count, forces, program, table):
    """Update the sums over all pairs for new and broken contacts."""
    for k in range(forces.pair):
        call_stage(program, FIRST_FORCE + PAIR_STAGES * k + REASSIGN, table, UPDATE)
    mark_every_step(contacts, count)
