"""The stages of pair forces and of external forces: a few for each force, whatever other forces there are."""

from collections.abc import Callable
from typing import Any

from ..compiler.recipes import factory
from ..compiler.stage import PythonStage, Stage, stage
from ..compiler.table import Table
from ..forces.external_loops import external_energy, external_loads, external_power, wrapping_work
from ..forces.pair.long_range_loops import LongRangeSums, Round, all_blocks
from .parts import EXTERNAL, LOAD_TIME
from .respa import contact_pair_loops

SUM, IN_CONTACT, REASSIGN, RATES, ROUND = range(5)
ROUNDS = 6
"""Largest number of rounds of a pair force, with the numbers ROUND, ROUND + 1, …"""
PAIR_STAGES = ROUND + ROUNDS
"""Stages of a pair force: sum over all pairs, pairs in contact, their change between cycles, rates of Taylor series,
and the rounds of a mesh before the sum."""
LOADS, WORK = range(2)
EXTERNAL_STAGES = 2
"""Stages of an external force: its loads; energy, power or work of wrapping."""
WHOLE, BEGIN, END = -1, -2, -3
"""Blocks of `SUM`: the whole sum; the work before the blocks 0, 1, …; the work after them."""
SUBTRACT, UPDATE = range(2)
"""Blocks of `REASSIGN`: subtract pairs in contact from the sums; update the sums for new and broken contacts."""
ENERGY, POWER, WRAPPING = range(3)
"""Blocks of `WORK`: energy [J], power [W], change of the energy [J] by wrapping positions into the box."""


@factory
def pair_force_stages(sums: LongRangeSums, long_vectors: bool) -> dict[int, Stage | PythonStage]:
    """The stages of one pair force by number."""
    begin, sum_block, end, blocks = sums.begin, sums.block, sums.end, sums.blocks
    add, subtract, reassign = contact_pair_loops(sums.pair)

    @stage("the pair forces", long_vectors=long_vectors, seconds=2.0)
    def sum_pairs(grains, long_range, span, parameters, block):
        """Sum one block of pairs; returns the number of blocks."""
        number = blocks(grains)
        if block in (WHOLE, BEGIN):
            begin(grains, long_range, span, parameters)
        first = max(block, 0)
        last = number if block == WHOLE else block + 1
        for b in range(first, last):
            sum_block(grains, long_range, span, parameters, b)
        if block in (WHOLE, END):
            end(grains, long_range, span, parameters)
        return number

    @stage("the pair forces of grains in contact", long_vectors=long_vectors)
    def pairs_in_contact(grains, contacts, count, span, parameters):
        add(grains, contacts, count, span, parameters)
        return 0

    @stage("the pair forces of new and broken contacts")
    def reassign_pairs(grains, contacts, count, long_range, span, parameters, block):
        if block == SUBTRACT:
            subtract(grains, contacts, count, long_range, span, parameters)
        else:
            reassign(grains, contacts, count, long_range, span, parameters)
        return 0

    found: dict[int, Stage | PythonStage]
    found = {SUM: sum_pairs, IN_CONTACT: pairs_in_contact, REASSIGN: reassign_pairs}
    found |= {ROUND + k: _round_stage(each) for k, each in enumerate(sums.rounds)}
    if sums.rates is None:
        return found
    sum_rates = sums.rates

    @stage("the rates of pair forces")
    def rates(grains, long_range, span, parameters):
        sum_rates(grains, long_range, span, parameters)
        return 0

    return found | {RATES: rates}


@factory
def _round_stage(given: Round) -> Stage | PythonStage:
    """The stage of one round of blocks."""
    begin, round_block = given.begin, given.block
    if not given.compiled:

        def in_python(grains, parameters, block):
            if block != BEGIN:
                round_block(parameters, block, all_blocks(grains))
            return all_blocks(grains)

        return PythonStage(in_python)

    @stage("the loops of the mesh")
    def in_blocks(grains, span, parameters, block):
        """Process one block; returns the number of blocks."""
        if block == BEGIN:
            begin(grains, span, parameters)
        else:
            round_block(grains, span, parameters, block, all_blocks(grains))
        return all_blocks(grains)

    return in_blocks


def run_rounds(sums: LongRangeSums, long_vectors: bool, table: Table, parameters: Any) -> None:
    """Run the rounds of a force from Python."""
    stages = pair_force_stages(sums, long_vectors)
    for number in range(ROUND, ROUND + len(sums.rounds)):
        for block in (BEGIN, *range(stages[number].run(table, parameters, BEGIN))):
            stages[number].run(table, parameters, block)


@factory
def external_force_stages(formula_of_grain: Callable) -> dict[int, Stage]:
    """The stages of one external force by number."""
    add_loads, energy = external_loads(formula_of_grain), external_energy(formula_of_grain)
    power, wrapping = external_power(formula_of_grain), wrapping_work(formula_of_grain)

    @stage("the external forces")
    def loads(grains, scratch, parameters):
        add_loads(grains, scratch[LOAD_TIME], parameters)
        return 0

    @stage("the work of external forces")
    def work(grains, span, scratch, parameters, block):
        """Add energy, power or work to scratch[EXTERNAL]."""
        if block == ENERGY:
            scratch[EXTERNAL] += energy(grains, scratch[LOAD_TIME], parameters)
        elif block == POWER:
            scratch[EXTERNAL] += power(grains, scratch[LOAD_TIME], parameters)
        else:
            scratch[EXTERNAL] += wrapping(grains, span, scratch[LOAD_TIME], parameters)
        return 0

    return {LOADS: loads, WORK: work}
