"""Magnetic loads of all grains on each other: all pairs, all pairs with a cut-off, or listed pairs.

All pairs go by action and reaction (Newton's third law); listed ones stand in both grains' rows, so that each
row is a sum of its own that vectorises.
"""

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ...box import nearest_image
from ...compiler.jit import LONG_VECTORS, formula, loop
from ...numerics.roots import seeded_inverse_root
from ...numerics.simd import round_up_to_simd_width
from ...numerics.vec import accrue, add, cross, dot, load, put, sub
from .dipole_formulas import pair_load, pair_load_at, pair_load_cut
from .dipole_rates import pair_rates
from .loops import LongRangeSums, BlockedSum, all_blocks

ROWS_AT_ONCE = 256
"""Rows of the list in a block that one thread takes."""


FEW = 3
"""Pairs that are faster done one by one than as a vector."""
NOWHERE = 1.0
"""A distance [m] of what is no pair, and has loads of 0 times something."""


class DipoleParameters(NamedTuple):
    """The numbers of the sums."""

    k: float  # μ₀/4π [T m/A]
    cutoff: Any


@loop
def clear_field(grains):
    """No flux density at any grain."""
    for i in range(grains.mass.size):
        put(grains.field, i, (0.0, 0.0, 0.0))


@loop
def add_torques(grains, long_range, span, rules):
    """μ×B of the flux density summed before."""
    for i in range(grains.mass.size):
        accrue(long_range.torque, i, cross(load(grains.moment, i), load(grains.field, i)))


@loop
def pack_moments(grains, long_range, span, rules):
    """Positions and moments in the order of the list, so that neighbours lie close in memory."""
    for s in range(grains.mass.size):
        i = long_range.order[s]
        put(long_range.packed_position, s, load(grains.position, i))
        put(long_range.source, s, load(grains.moment, i))


@loop
def listed_rows(grains, long_range, span, rules, first, last):
    """Listed pairs of the places first…last − 1 (uint64), with nearest images and a cut-off.

    Whole vectors, unless few pairs are left over: beyond its end a row goes on with what is no pair of it.
    """
    few = np.uint64(FEW)
    for k in range(last - first):
        s = first + k
        here, mine = load(long_range.packed_position, s), load(long_range.source, s)
        push = field = (0.0, 0.0, 0.0)
        begin = np.uint64(long_range.start[s])
        pairs = np.uint64(long_range.start[s + np.uint64(1)]) - begin
        for m in range(round_up_to_simd_width(pairs, few)):
            t = long_range.neighbour[begin + m]
            f, b, _, _ = cut_pair(
                here, load(long_range.packed_position, t), span, mine, load(long_range.source, t), rules, m < pairs
            )
            push, field = add(push, f), add(field, b)
        i = long_range.order[s]
        accrue(long_range.force, i, push)
        put(grains.field, i, field)


@loop
def listed_loads(grains, long_range, span, rules):
    """All listed pairs."""
    pack_moments(grains, long_range, span, rules)
    listed_rows(grains, long_range, span, rules, np.uint64(0), np.uint64(grains.mass.size))
    add_torques(grains, long_range, span, rules)


@loop
def listed_block(grains, long_range, span, rules, b):
    """Some rows of the list."""
    first = b * ROWS_AT_ONCE
    last = min(first + ROWS_AT_ONCE, grains.mass.size)
    listed_rows(grains, long_range, span, rules, np.uint64(first), np.uint64(last))


@loop
def listed_blocks(grains):
    """How many blocks of rows there are."""
    return (grains.mass.size + ROWS_AT_ONCE - 1) // ROWS_AT_ONCE


@loop
def rates_of_pair(grains, pace, span, rules, i, j):
    """Rates of force and flux density at i due to j, and of the flux density at j."""
    apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
    moving = sub(load(pace.past_position, i), load(pace.past_position, j))
    turning1, turning2 = load(pace.past_moment, i), load(pace.past_moment, j)
    return pair_rates(
        apart, load(grains.moment, i), load(grains.moment, j), moving, turning1, turning2, rules.k, rules.cutoff
    )


@loop
def finish_rates(grains, long_range):
    """Ṁ = μ̇×B + μ×Ḃ (Eq. 53 as it should read), where `torque_rate` holds Ḃ."""
    for i in range(grains.mass.size):
        field_rate = load(long_range.torque_rate, i)
        turning = cross(load(long_range.past_moment, i), load(grains.field, i))
        put(long_range.torque_rate, i, add(turning, cross(load(grains.moment, i), field_rate)))


@loop
def cut_rates(grains, long_range, span, rules):
    """Rates of force and torque over all pairs; `past_position` and `past_moment` hold ṙ and μ̇."""
    for i in range(grains.mass.size):
        for j in range(i):
            f, b1, b2 = rates_of_pair(grains, long_range, span, rules, i, j)
            accrue(long_range.force_rate, i, f)
            accrue(long_range.force_rate, j, (-f[0], -f[1], -f[2]))
            accrue(long_range.torque_rate, i, b1)
            accrue(long_range.torque_rate, j, b2)
    finish_rates(grains, long_range)


@loop
def listed_rates(grains, long_range, span, rules):
    """The same over listed pairs."""
    for s in range(grains.mass.size):
        i = long_range.order[s]
        for m in range(long_range.start[s], long_range.start[s + 1]):
            f, b, _ = rates_of_pair(grains, long_range, span, rules, i, long_range.order[long_range.neighbour[m]])
            accrue(long_range.force_rate, i, f)
            accrue(long_range.torque_rate, i, b)
    finish_rates(grains, long_range)


@loop
def energy_shares(grains, long_range, span, rules, shares):
    """Half the energy of each pair to each of its grains [J]: −½ μ·B, from the field summed last."""
    for i in range(grains.mass.size):
        mu, b = load(grains.moment, i), load(grains.field, i)
        shares[i] += -0.5 * (mu[0] * b[0] + mu[1] * b[1] + mu[2] * b[2])


@loop
def loads_of_pair(grains, span, rules, i, j):
    """Force on i and torques on i and j of one pair."""
    apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
    mine, other = load(grains.moment, i), load(grains.moment, j)
    force, b1, b2, _ = pair_load_cut(apart, mine, other, rules.k, rules.cutoff)
    return force, cross(mine, b1), cross(other, b2)


@formula
def apart_if(real, apart):
    """What lies between the two of a pair; where there is no pair, something of which 1/r² is a number."""
    return apart[0] if real else NOWHERE, apart[1], apart[2]


@loop
def uncut_pair(here, there, span, mine, other, rules, real):
    """Loads of a pair in an open box without a cut-off; none if it is not `real`."""
    return pair_load(apart_if(real, sub(here, there)), mine, other, rules.k if real else 0.0)


@loop
def uncut_pair_seeded(here, there, span, mine, other, rules, real):
    """The same, with 1/r from a seed."""
    apart = apart_if(real, sub(here, there))
    return pair_load_at(apart, seeded_inverse_root(dot(apart, apart)), mine, other, rules.k if real else 0.0)


@loop
def cut_pair(here, there, span, mine, other, rules, real):
    """The same with nearest images and a cut-off."""
    apart, k = apart_if(real, nearest_image(sub(here, there), span)), rules.k if real else 0.0
    return pair_load_cut(apart, mine, other, k, rules.cutoff)


@loop
def corner(grains, b, blocks):
    """The first row of block b of the triangle of all pairs: blocks have equal areas."""
    if blocks == 1:
        return np.uint64(b * grains.mass.size)
    return np.uint64(grains.mass.size * math.sqrt(b / blocks))


@functools.cache
def rows_of(pair_loads: Callable) -> Callable:
    """The loop over some rows (uint64) of the triangle of all pairs, each pair once (Newton's third law).

    Rows are as long as whole vectors, unless few pairs are left over: what is beyond the diagonal is no pair.
    """
    few = np.uint64(FEW)

    @loop
    def add_rows(long_range, force, field, span, rules, first, last):
        for k in range(last - first):
            i = first + k
            here, mine = load(long_range.packed_position, i), load(long_range.source, i)
            push = own = (0.0, 0.0, 0.0)
            for j in range(round_up_to_simd_width(i, few)):
                f, b1, b2, _ = pair_loads(
                    here, load(long_range.packed_position, j), span, mine, load(long_range.source, j), rules, j < i
                )
                push, own = add(push, f), add(own, b1)
                accrue(force, j, (-f[0], -f[1], -f[2]))
                accrue(field, j, b2)
            accrue(force, i, push)
            accrue(field, i, own)

    return add_rows


@loop
def copy_moments(grains, long_range, span, rules):
    """Positions and moments where there is room for whole vectors."""
    for i in range(grains.mass.size):
        put(long_range.packed_position, i, load(grains.position, i))
        put(long_range.source, i, load(grains.moment, i))


@loop
def add_shares(grains, long_range, span, rules):
    """Forces, fields and torques from those of the blocks."""
    clear_field(grains)
    for b in range(all_blocks(grains)):
        force, field = long_range.block_sums[2 * b], long_range.block_sums[2 * b + 1]
        for i in range(corner(grains, b + 1, all_blocks(grains))):
            accrue(long_range.force, i, load(force, i))
            accrue(grains.field, i, load(field, i))
    add_torques(grains, long_range, span, rules)


def all_pairs(pair_loads: Callable) -> LongRangeSums:
    """The sums over all pairs."""
    add_rows = rows_of(pair_loads)

    @loop
    def block(grains, long_range, span, rules, b):
        force, field = long_range.block_sums[2 * b], long_range.block_sums[2 * b + 1]
        for i in range(long_range.packed_position.shape[1]):
            put(force, i, (0.0, 0.0, 0.0))
            put(field, i, (0.0, 0.0, 0.0))
        first, last = corner(grains, b, all_blocks(grains)), corner(grains, b + 1, all_blocks(grains))
        add_rows(long_range, force, field, span, rules, first, last)

    @loop
    def loads(grains, long_range, span, rules):
        copy_moments(grains, long_range, span, rules)
        if grains.mass.size <= FEW:  # no row reaches beyond the last grain
            clear_field(grains)
            last = np.uint64(grains.mass.size)
            add_rows(long_range, long_range.force, grains.field, span, rules, np.uint64(0), last)
            add_torques(grains, long_range, span, rules)
            return
        for b in range(all_blocks(grains)):
            block(grains, long_range, span, rules, b)
        add_shares(grains, long_range, span, rules)

    parts = BlockedSum(copy_moments, block, add_shares, all_blocks)
    return LongRangeSums(loads, cut_rates, energy_shares, loads_of_pair, parts)


ALL_PAIRS = all_pairs(uncut_pair)._replace(wide=all_pairs(uncut_pair_seeded) if LONG_VECTORS else None)
ALL_PAIRS_CUT = all_pairs(cut_pair)
LISTED_PAIRS = LongRangeSums(
    listed_loads,
    listed_rates,
    energy_shares,
    loads_of_pair,
    BlockedSum(pack_moments, listed_block, add_torques, listed_blocks),
)
