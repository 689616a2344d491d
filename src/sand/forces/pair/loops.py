"""Loops of the long-range forces, and their composition into one sum of loads, of rates and of pair loads."""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

from ...compiler.jit import kernel, loop
from ...numerics.vec import add

PARALLEL_FROM = 1000
"""Fewest grains for which large loops are divided into blocks; below, sharing a block costs more than computing it."""
ALL_PAIRS_BLOCKS = 8
"""Number of blocks of a sum over all pairs from PARALLEL_FROM grains on."""


@loop
def all_blocks(grains):
    """Number of blocks of a sum over all pairs."""
    return ALL_PAIRS_BLOCKS if grains.mass.size >= PARALLEL_FROM else 1


class BlockedSum(NamedTuple):
    """A sum of loads in blocks that threads share; equals `LongRangeSums.loads` except for rounding."""

    begin: Callable  # (grains, long_range, span, parameters): before the blocks
    block: Callable  # (grains, long_range, span, parameters, index of the block)
    end: Callable  # as `begin`, after the blocks
    blocks: Callable  # (grains,): number of blocks, determined by the number of grains alone


class LongRangeSums(NamedTuple):
    """The loops of one long-range force; arguments (grains, long_range, span, parameters) unless stated."""

    loads: Callable  # adds to long_range.force and long_range.torque
    rates: Callable  # adds to long_range.force_rate and long_range.torque_rate
    energies: Callable  # (…, shares): adds half the energy of each pair to shares (N,) of both grains
    pair: Callable  # (grains, span, parameters, i, j): force on i, torques on i and on j, of one pair
    shared: BlockedSum | None = None  # `loads` in blocks; None: `loads` is not divided
    wide: Any = None  # LongRangeSums that are faster with the longest SIMD vectors; None: these

    @property
    def blocked(self) -> BlockedSum:
        """`loads` in blocks; an undivided sum follows the blocks of other forces, whose arrays it would overwrite."""
        return self.shared or BlockedSum(_no_sum, _no_block, self.loads, _no_blocks)


@loop
def _no_sum(grains, long_range, span, parameters):
    """No loads, no rates, nothing before or after blocks."""


@loop
def _no_block(grains, long_range, span, parameters, index_or_shares):
    """No block, no energies."""


@loop
def _no_blocks(grains):
    return 0


@loop
def _no_pair(grains, span, parameters, i, j):
    return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)


NO_LONG_RANGE_FORCE = LongRangeSums(_no_sum, _no_sum, _no_block, _no_pair)


@functools.cache
def combined_sums(first: LongRangeSums, rest: LongRangeSums) -> LongRangeSums:
    """The sums of two forces, with the pair of their parameters; energies are computed per force."""
    first_loads, rest_loads, first_rates, rest_rates = first.loads, rest.loads, first.rates, rest.rates
    first_pair, rest_pair = first.pair, rest.pair

    @loop
    def loads(grains, long_range, span, parameters):
        first_loads(grains, long_range, span, parameters[0])
        rest_loads(grains, long_range, span, parameters[1])

    @loop
    def rates(grains, long_range, span, parameters):
        first_rates(grains, long_range, span, parameters[0])
        rest_rates(grains, long_range, span, parameters[1])

    @loop
    def pair(grains, span, parameters, i, j):
        force1, torque_i1, torque_j1 = first_pair(grains, span, parameters[0], i, j)
        force2, torque_i2, torque_j2 = rest_pair(grains, span, parameters[1], i, j)
        return add(force1, force2), add(torque_i1, torque_i2), add(torque_j1, torque_j2)

    return LongRangeSums(loads, rates, _no_block, pair, combined_blocks(first.blocked, rest.blocked))


@functools.cache
def combined_blocks(first: BlockedSum, rest: BlockedSum) -> BlockedSum:
    """The blocks of two forces; block b of both is one block."""
    first_begin, first_block, first_end, first_blocks = first
    rest_begin, rest_block, rest_end, rest_blocks = rest

    @loop
    def begin(grains, long_range, span, parameters):
        first_begin(grains, long_range, span, parameters[0])
        rest_begin(grains, long_range, span, parameters[1])

    @loop
    def block(grains, long_range, span, parameters, b):
        if b < first_blocks(grains):
            first_block(grains, long_range, span, parameters[0], b)
        if b < rest_blocks(grains):
            rest_block(grains, long_range, span, parameters[1], b)

    @loop
    def end(grains, long_range, span, parameters):
        first_end(grains, long_range, span, parameters[0])
        rest_end(grains, long_range, span, parameters[1])

    @loop
    def blocks(grains):
        return max(first_blocks(grains), rest_blocks(grains))

    return BlockedSum(begin, block, end, blocks)


@functools.cache
def long_range_energies_for(energies: Callable) -> Callable:
    """Compile the loop that adds half of each pair energy [J] of one force to `shares` (N,) of both grains."""

    def fill_shares(grains, long_range, span, parameters, shares):
        energies(grains, long_range, span, parameters, shares)

    return kernel(fill_shares)
