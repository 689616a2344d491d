"""Long-range forces together: one sum of loads, of rates and of energies."""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

from ...compiler.jit import kernel, loop
from ...numerics.vec import add


@loop
def _no_sum(grains, long_range, span, numbers):
    """Neither loads nor rates, and nothing before or after blocks."""


@loop
def _nothing_in(grains, long_range, span, numbers, place):
    """Neither a block nor energies."""


@loop
def _no_blocks(grains):
    return 0


PARALLEL_FROM = 1000
"""Fewest grains for which large loops are cut into blocks; below, a block is less work than to share it."""
ALL_BLOCKS = 8
"""Blocks of a sum over all pairs, then."""


@loop
def all_blocks(grains):
    """Blocks of a sum over all pairs."""
    return ALL_BLOCKS if grains.mass.size >= PARALLEL_FROM else 1


class BlockedSum(NamedTuple):
    """The sum of loads in blocks that threads may share; `loads` of LongRangeSums is their sum but for rounding."""

    begin: Callable  # (grains, far, span, numbers): before the blocks
    block: Callable  # the same and the number of the block
    end: Callable  # as begin, after them
    blocks: Callable  # (grains,): how many there are, by the number of grains alone


class LongRangeSums(NamedTuple):
    """The loops of one long-range force; each gets (grains, far, span, its numbers)."""

    loads: Callable  # adds to far.force and far.torque
    rates: Callable  # adds to far.force_rate and far.torque_rate
    energies: Callable  # adds half the energy of each pair to each grain's entry of a fifth argument, (N,)
    pair: Callable  # (grains, span, numbers, i, j): force on i, torques on i and on j, of one pair
    shared: BlockedSum | None = None  # for threads; None: `loads` is done by one
    wide: Any = None  # the same sums by loops that are faster for many grains; None: by these

    @property
    def blocked(self) -> BlockedSum:
        """In blocks; or all of it after the blocks of others, which need what it would overwrite."""
        return self.shared or BlockedSum(_no_sum, _nothing_in, self.loads, _no_blocks)


@loop
def _no_pair(grains, span, numbers, i, j):
    return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)


NO_LONG_RANGE_FORCE = LongRangeSums(_no_sum, _no_sum, _nothing_in, _no_pair)


@functools.cache
def combined_sums(first: LongRangeSums, rest: LongRangeSums) -> LongRangeSums:
    """The sums of two; `numbers` is the pair of theirs.  Energies are asked for one by one (`long_range_energies_for`)."""
    first_loads, rest_loads, first_rates, rest_rates = first.loads, rest.loads, first.rates, rest.rates
    first_pair, rest_pair = first.pair, rest.pair

    @loop
    def loads(grains, long_range, span, numbers):
        first_loads(grains, long_range, span, numbers[0])
        rest_loads(grains, long_range, span, numbers[1])

    @loop
    def rates(grains, long_range, span, numbers):
        first_rates(grains, long_range, span, numbers[0])
        rest_rates(grains, long_range, span, numbers[1])

    @loop
    def pair(grains, span, numbers, i, j):
        force1, here1, there1 = first_pair(grains, span, numbers[0], i, j)
        force2, here2, there2 = rest_pair(grains, span, numbers[1], i, j)
        return add(force1, force2), add(here1, here2), add(there1, there2)

    return LongRangeSums(loads, rates, _nothing_in, pair, combined_blocks(first.blocked, rest.blocked))


@functools.cache
def combined_blocks(first: BlockedSum, rest: BlockedSum) -> BlockedSum:
    """The parts of two; block b of both is one block."""
    first_begin, first_block, first_end, first_blocks = first
    rest_begin, rest_block, rest_end, rest_blocks = rest

    @loop
    def begin(grains, long_range, span, numbers):
        first_begin(grains, long_range, span, numbers[0])
        rest_begin(grains, long_range, span, numbers[1])

    @loop
    def block(grains, long_range, span, numbers, b):
        if b < first_blocks(grains):
            first_block(grains, long_range, span, numbers[0], b)
        if b < rest_blocks(grains):
            rest_block(grains, long_range, span, numbers[1], b)

    @loop
    def end(grains, long_range, span, numbers):
        first_end(grains, long_range, span, numbers[0])
        rest_end(grains, long_range, span, numbers[1])

    @loop
    def blocks(grains):
        return max(first_blocks(grains), rest_blocks(grains))

    return BlockedSum(begin, block, end, blocks)


@functools.cache
def long_range_energies_for(energies: Callable) -> Callable:
    """The compiled sum of each grain's part of the energy [J] of one long-range force."""

    def fill_shares(grains, long_range, span, numbers, shares):
        energies(grains, long_range, span, numbers, shares)

    return kernel(fill_shares)
