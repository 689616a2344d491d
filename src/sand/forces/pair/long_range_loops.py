"""Loops of a long-range force: sums in blocks, rates, energies, single pairs."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ...compiler.jit import loop
from ...compiler.recipes import factory
from ...compiler.stage import Stage, stage
from ...numerics.vec import load, nearest_image, sub

PARALLEL_FROM = 1000
"""Fewest grains for which large loops are divided into blocks; below, sharing a block costs more than computing it."""
ALL_PAIRS_BLOCKS = 8
"""Number of blocks of a sum over all pairs from PARALLEL_FROM grains on."""
ROWS_PER_BLOCK = 256
"""Rows of the Verlet list in a block."""


def blocks_for(count: int) -> int:
    """Number of blocks of a sum over all pairs, or waves, for a number of grains, as `all_blocks`."""
    return ALL_PAIRS_BLOCKS if count >= PARALLEL_FROM else 1


@loop
def all_blocks(grains):
    """Number of blocks of a sum over all pairs."""
    return ALL_PAIRS_BLOCKS if grains.mass.size >= PARALLEL_FROM else 1


@loop
def first_row(grains, b, blocks):
    """First row of block b of the triangle of all pairs j < i; the blocks have equal numbers of pairs."""
    if blocks == 1:
        return np.uint64(b * grains.mass.size)
    return np.uint64(grains.mass.size * math.sqrt(b / blocks))


@loop
def listed_blocks(grains):
    """Number of blocks of list rows."""
    return (grains.mass.size + ROWS_PER_BLOCK - 1) // ROWS_PER_BLOCK


@loop
def nothing_before(grains, span, parameters):
    """No work before the blocks of a round."""


class Round(NamedTuple):
    """Blocks that need the results of all earlier rounds; blocks of one round do not depend on each other."""

    block: Callable  # compiled: (grains, span, parameters, b, blocks); in Python: (parameters, b, blocks)
    begin: Callable = nothing_before  # (grains, span, parameters): before the blocks; not in Python
    compiled: bool = True  # False: an ordinary Python function, which needs the GIL


class LongRangeSums(NamedTuple):
    """The loops of one long-range force; arguments (grains, long_range, span, parameters) unless stated.

    The sum of the loads consists of blocks, which threads may share: `begin`, each `block`, then `end`.
    """

    begin: Callable  # before the blocks
    block: Callable  # (…, index of the block): adds to long_range.force and long_range.torque, or to block_sums
    end: Callable  # after the blocks
    blocks: Callable  # (grains,): number of blocks, determined by the number of grains alone
    rates: Callable | None  # adds to long_range.force_rate and torque_rate; None: no Taylor series of this force
    energies: Callable  # (…, shares): adds half the energy of each pair to shares (N,) of both grains
    pair: Callable  # (grains, span, parameters, i, j): force on i, torques on i and on j, of one pair
    arrays: tuple = ()  # names of the copies in long_range that the loops use, see state.arrays.PACKED_ARRAYS
    rounds: tuple[Round, ...] = ()  # before `begin`; each has as many blocks as a sum over all pairs, `all_blocks`
    energies_need_rounds: bool = False  # `energies` uses what the rounds compute
    own_memory: bool = False  # blocks keep their sums in the parameters, never in long_range.block_sums
    virial: Callable | None = None  # (…, out): adds the virial [J] of all pairs to out (9,); None: there is none
    # in Python: (grains, span, parameters) → virial (3, 3) [J] of the reciprocal part of an Ewald sum, after the rounds
    reciprocal_virial: Callable | None = None


@factory
def virial_of_pairs(pair: Callable, listed: bool) -> Callable:
    """The loop that adds Σ r_a F_b [J] of all pairs to an array (9,), rows a; r is the nearest image of x_i − x_j.

    `pair` is as in `LongRangeSums`.  In the Verlet list each pair occurs twice.
    """

    @loop
    def add_pair(grains, span, parameters, i, j, share, out):
        apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
        force, _, _ = pair(grains, span, parameters, i, j)
        for a in range(3):
            for b in range(3):
                out[3 * a + b] += share * apart[a] * force[b]

    @loop
    def of_all(grains, long_range, span, parameters, out):
        for i in range(grains.mass.size):
            for j in range(i):
                add_pair(grains, span, parameters, i, j, 1.0, out)

    @loop
    def of_listed(grains, long_range, span, parameters, out):
        for s in range(grains.mass.size):
            i = long_range.order[s]
            for m in range(long_range.start[s], long_range.start[s + 1]):
                add_pair(grains, span, parameters, i, long_range.order[long_range.neighbour[m]], 0.5, out)

    return of_listed if listed else of_all


@factory
def long_range_virial_for(sums: LongRangeSums) -> Stage:
    """The stage that adds the virial [J] of the pairs of one force to an array.

    Its parameters are those of the loops, and the array (9,).
    """
    assert sums.virial is not None
    virial = sums.virial

    @stage("the stress of pairs")
    def add_virial(grains, long_range, span, parameters):
        virial(grains, long_range, span, parameters[0], parameters[1])
        return 0

    return add_virial


@factory
def long_range_energies_for(sums: LongRangeSums) -> Stage:
    """The stage that adds half of each pair energy [J] of one force to both grains.

    Its parameters are those of the loops, and the array of energies (N,).
    """
    energies = sums.energies

    @stage("the energies of pairs")
    def fill_shares(grains, long_range, span, parameters):
        energies(grains, long_range, span, parameters[0], parameters[1])
        return 0

    return fill_shares
