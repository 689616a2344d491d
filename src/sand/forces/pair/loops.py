"""Loops of the long-range forces, and their composition into one sum of loads, of rates and of pair loads."""

import functools
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ...compiler.jit import kernel, loop
from ...numerics.vec import add

PARALLEL_FROM = 1000
"""Fewest grains for which large loops are divided into blocks; below, sharing a block costs more than computing it."""
ALL_PAIRS_BLOCKS = 8
"""Number of blocks of a sum over all pairs from PARALLEL_FROM grains on."""
ROWS_PER_BLOCK = 256
"""Rows of the Verlet list in a block."""


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


class BlockedSum(NamedTuple):
    """A sum of loads in blocks that threads share; equals `LongRangeSums.loads` except for rounding."""

    begin: Callable  # (grains, long_range, span, parameters): before the blocks
    block: Callable  # (grains, long_range, span, parameters, index of the block)
    end: Callable  # as `begin`, after the blocks
    blocks: Callable  # (grains,): number of blocks, determined by the number of grains alone


class LongRangeSums(NamedTuple):
    """The loops of one long-range force; arguments (grains, long_range, span, parameters) unless stated."""

    loads: Callable  # adds to long_range.force and long_range.torque
    rates: Callable | None  # adds to long_range.force_rate and torque_rate; None: no Taylor series of this force
    energies: Callable  # (…, shares): adds half the energy of each pair to shares (N,) of both grains
    pair: Callable  # (grains, span, parameters, i, j): force on i, torques on i and on j, of one pair
    shared: BlockedSum | None = None  # `loads` in blocks; None: `loads` is not divided
    wide: Any = None  # LongRangeSums that are faster with the longest SIMD vectors; None: these
    packed: bool = False  # whether the loops use long_range.packed_grain
    kept: bool = True  # cache the compiled code on disk; False with formulas from outside SAND

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
    first_loads, rest_loads, first_rates, rest_rates = (
        first.loads,
        rest.loads,
        first.rates or _no_sum,
        rest.rates or _no_sum,
    )
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

    return LongRangeSums(
        loads,
        None if first.rates is None or rest.rates is None else rates,
        _no_block,
        pair,
        combined_blocks(first.blocked, rest.blocked),
        packed=first.packed or rest.packed,
        kept=first.kept and rest.kept,
    )


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
def long_range_energies_for(sums: LongRangeSums) -> Callable:
    """Compile the loop that adds half of each pair energy [J] of one force to `shares` (N,) of both grains."""
    energies = sums.energies

    def fill_shares(grains, long_range, span, parameters, shares):
        energies(grains, long_range, span, parameters, shares)

    return kernel(fill_shares, cached=sums.kept, purpose="the energies of pairs")


def with_own_buffers(numbers: Sequence[Any], listed: Sequence[bool]) -> list[Any]:
    """Parameters of the loops of several forces, with a buffer for blocked sums of each that is summed over all pairs.

    Loops without a member `buffer` in their parameters, those of dipoles, use the first one.
    """
    first = sum(not own and not hasattr(n, "buffer") for n, own in zip(numbers, listed, strict=True))
    found = []
    for n, own in zip(numbers, listed, strict=True):
        if not own and hasattr(n, "buffer"):
            n, first = n._replace(buffer=first), first + 1
        found.append(n)
    return found
