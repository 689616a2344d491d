"""Loops of the dipole forces: over all pairs, over all pairs with a cut-off, or over the pairs of a Verlet list.

Sums over all pairs use Newton's third law.  In the Verlet list each pair is in the rows of both grains, so that each
row is an independent sum that vectorises.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ...compiler.jit import formula, loop
from ...compiler.recipes import factory
from ...numerics.flow import add_virial, with_pair
from ...numerics.simd import round_up_to_simd_width
from ...numerics.vec import accrue, add, cross, load, nearest_image, put, scale, sub
from .dipole_formulas import pair_load, pair_load_cut
from .dipole_rates import pair_rates
from .long_range_loops import ROWS_PER_BLOCK, LongRangeSums, all_blocks, first_row, listed_blocks, virial_of_pairs

MAX_REMAINDER = 3
"""Remaining pairs of a row up to which scalar arithmetic is faster than a partly filled SIMD vector."""
DUMMY_DISTANCE = 1.0
"""Distance [m] of the dummy pairs that fill a vector; their loads are multiplied by 0."""


COPIES = "packed_position", "packed_moment"
"""Copies of positions and moments that these loops use."""


class DipoleParameters(NamedTuple):
    """Parameters of the loops."""

    k: float  # μ₀/4π [T m/A]
    cutoff: Any  # dipole_formulas.Cutoff


@loop
def clear_field(grains):
    """Set the flux density of all grains to 0."""
    for i in range(grains.mass.size):
        put(grains.field, i, (0.0, 0.0, 0.0))


@loop
def add_torques(grains, long_range, span, parameters):
    """Add the torques μ×B of the summed flux densities B."""
    for i in range(grains.mass.size):
        accrue(long_range.torque, i, cross(load(grains.moment, i), load(grains.field, i)))


@loop
def pack_moments(grains, long_range, span, parameters):
    """Copy positions and moments in the order of the Verlet list, so that neighbours are close in memory."""
    for s in range(grains.mass.size):
        i = long_range.order[s]
        put(long_range.packed_position, s, load(grains.position, i))
        put(long_range.packed_moment, s, load(grains.moment, i))


@loop
def rates_of_pair(grains, long_range, span, parameters, i, j):
    """Rates of the force on i, of the flux density at i due to j, and of that at j due to i."""
    apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
    moving = sub(load(long_range.past_position, i), load(long_range.past_position, j))
    turning1, turning2 = load(long_range.past_moment, i), load(long_range.past_moment, j)
    return pair_rates(
        apart,
        load(grains.moment, i),
        load(grains.moment, j),
        moving,
        turning1,
        turning2,
        parameters.k,
        parameters.cutoff,
    )


@loop
def finish_rates(grains, long_range):
    """Replace Ḃ in `torque_rate` by Ṁ = μ̇×B + μ×Ḃ (Eq. 53, corrected)."""
    for i in range(grains.mass.size):
        field_rate = load(long_range.torque_rate, i)
        turning = cross(load(long_range.past_moment, i), load(grains.field, i))
        put(long_range.torque_rate, i, add(turning, cross(load(grains.moment, i), field_rate)))


@loop
def cut_rates(grains, long_range, span, parameters):
    """Rates of force and torque of all pairs; `past_position` and `past_moment` hold ṙ and μ̇."""
    for i in range(grains.mass.size):
        for j in range(i):
            f, b1, b2 = rates_of_pair(grains, long_range, span, parameters, i, j)
            accrue(long_range.force_rate, i, f)
            accrue(long_range.force_rate, j, (-f[0], -f[1], -f[2]))
            accrue(long_range.torque_rate, i, b1)
            accrue(long_range.torque_rate, j, b2)
    finish_rates(grains, long_range)


@loop
def listed_rates(grains, long_range, span, parameters):
    """As `cut_rates`, over the pairs of the Verlet list."""
    for s in range(grains.mass.size):
        i = long_range.order[s]
        for m in range(long_range.start[s], long_range.start[s + 1]):
            f, b, _ = rates_of_pair(grains, long_range, span, parameters, i, long_range.order[long_range.neighbour[m]])
            accrue(long_range.force_rate, i, f)
            accrue(long_range.torque_rate, i, b)
    finish_rates(grains, long_range)


@loop
def energy_shares(grains, long_range, span, parameters, shares):
    """Add −½ μ·B [J], half the energy of each pair, to both of its grains, from the last sum of B."""
    for i in range(grains.mass.size):
        mu, b = load(grains.moment, i), load(grains.field, i)
        shares[i] += -0.5 * (mu[0] * b[0] + mu[1] * b[1] + mu[2] * b[2])


@loop
def loads_of_pair(grains, span, parameters, i, j):
    """Force on i and torques on i and j of one pair."""
    apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
    moment1, moment2 = load(grains.moment, i), load(grains.moment, j)
    force, b1, b2, _ = pair_load_cut(apart, moment1, moment2, parameters.k, parameters.cutoff)
    return force, cross(moment1, b1), cross(moment2, b2)


@formula
def separation_if(real, apart):
    """Separation of a `real` pair; for a dummy pair a vector with finite 1/r²."""
    return apart[0] if real else DUMMY_DISTANCE, apart[1], apart[2]


@loop
def uncut_pair(position1, position2, span, moment1, moment2, parameters, real):
    """Loads of a pair in an open box without a cut-off; 0 for a dummy pair (not `real`)."""
    return pair_load(separation_if(real, sub(position1, position2)), moment1, moment2, parameters.k if real else 0.0)


@loop
def cut_pair(position1, position2, span, moment1, moment2, parameters, real):
    """As `uncut_pair`, with nearest images and a cut-off."""
    apart, k = separation_if(real, nearest_image(sub(position1, position2), span)), parameters.k if real else 0.0
    return pair_load_cut(apart, moment1, moment2, k, parameters.cutoff)


@factory
def listed_block_of(pair_loads: Callable) -> Callable:
    """The loop over a block of list rows; each row is the sum over the neighbours of one grain.

    Rows are extended to whole SIMD vectors with dummy pairs, unless few pairs remain.
    """
    remainder = np.uint64(MAX_REMAINDER)

    @loop
    def add_rows(grains, long_range, span, parameters, first, last):
        for k in range(last - first):
            s = first + k
            position, moment = load(long_range.packed_position, s), load(long_range.packed_moment, s)
            force = field = virial = (0.0, 0.0, 0.0)
            begin = np.uint64(long_range.start[s])
            pairs = np.uint64(long_range.start[s + np.uint64(1)]) - begin
            for m in range(round_up_to_simd_width(pairs, remainder)):
                t = long_range.neighbour[begin + m]
                f, b, _, _ = pair_loads(
                    position,
                    load(long_range.packed_position, t),
                    span,
                    moment,
                    load(long_range.packed_moment, t),
                    parameters,
                    m < pairs,
                )
                force, field = add(force, f), add(field, b)
                apart = nearest_image(sub(position, load(long_range.packed_position, t)), span)
                virial = with_pair(virial, apart, f, span)
            i = long_range.order[s]
            accrue(long_range.force, i, force)
            put(grains.field, i, field)
            add_virial(long_range.virial, i, scale(0.5, virial), span)

    @loop
    def block(grains, long_range, span, parameters, b):
        first = b * ROWS_PER_BLOCK
        last = min(first + ROWS_PER_BLOCK, grains.mass.size)
        add_rows(grains, long_range, span, parameters, np.uint64(first), np.uint64(last))

    return block


@factory
def rows_of(pair_loads: Callable) -> Callable:
    """The loop over the rows first…last − 1 (uint64) of the triangle of all pairs j < i, each pair once.

    Rows are extended beyond the diagonal to whole SIMD vectors with dummy pairs, unless few pairs remain.
    """
    remainder = np.uint64(MAX_REMAINDER)

    @loop
    def add_rows(long_range, force, field, span, parameters, first, last):
        for k in range(last - first):
            i = first + k
            position, moment = load(long_range.packed_position, i), load(long_range.packed_moment, i)
            force_i = field_i = virial = (0.0, 0.0, 0.0)
            for j in range(round_up_to_simd_width(i, remainder)):
                f, b1, b2, _ = pair_loads(
                    position,
                    load(long_range.packed_position, j),
                    span,
                    moment,
                    load(long_range.packed_moment, j),
                    parameters,
                    j < i,
                )
                force_i, field_i = add(force_i, f), add(field_i, b1)
                apart = nearest_image(sub(position, load(long_range.packed_position, j)), span)
                virial = with_pair(virial, apart, f, span)
                accrue(force, j, (-f[0], -f[1], -f[2]))
                accrue(field, j, b2)
            accrue(force, i, force_i)
            accrue(field, i, field_i)
            add_virial(long_range.virial, i, virial, span)

    return add_rows


@loop
def copy_moments(grains, long_range, span, parameters):
    """Copy positions and moments to arrays that are padded to whole SIMD vectors."""
    for i in range(grains.mass.size):
        put(long_range.packed_position, i, load(grains.position, i))
        put(long_range.packed_moment, i, load(grains.moment, i))


@loop
def add_blocks(grains, long_range, span, parameters):
    """Add up forces and flux densities of all blocks."""
    clear_field(grains)
    for b in range(all_blocks(grains)):
        force, field = long_range.block_sums[2 * b], long_range.block_sums[2 * b + 1]
        for i in range(first_row(grains, b + 1, all_blocks(grains))):
            accrue(long_range.force, i, load(force, i))
            accrue(grains.field, i, load(field, i))


@loop
def add_blocks_and_torques(grains, long_range, span, parameters):
    """Add up forces and flux densities of all blocks, and the torques."""
    add_blocks(grains, long_range, span, parameters)
    add_torques(grains, long_range, span, parameters)


@factory
def all_pairs_block_of(pair_loads: Callable) -> Callable:
    """The loop over a block of the triangle of all pairs, which adds to two arrays of its own."""
    add_rows = rows_of(pair_loads)

    @loop
    def block(grains, long_range, span, parameters, b):
        force, field = long_range.block_sums[2 * b], long_range.block_sums[2 * b + 1]
        for i in range(long_range.packed_position.shape[1]):
            put(force, i, (0.0, 0.0, 0.0))
            put(field, i, (0.0, 0.0, 0.0))
        first, last = first_row(grains, b, all_blocks(grains)), first_row(grains, b + 1, all_blocks(grains))
        add_rows(long_range, force, field, span, parameters, first, last)

    return block


def all_pairs(pair_loads: Callable) -> LongRangeSums:
    """The loops over all pairs, for one formula of the pair loads."""
    block = all_pairs_block_of(pair_loads)
    return LongRangeSums(
        copy_moments,
        block,
        add_blocks_and_torques,
        all_blocks,
        cut_rates,
        energy_shares,
        loads_of_pair,
        arrays=COPIES,
        virial=virial_of_pairs(loads_of_pair, False),
    )


ALL_PAIRS = all_pairs(uncut_pair)
ALL_PAIRS_CUT = all_pairs(cut_pair)
LISTED_PAIRS = LongRangeSums(
    pack_moments,
    listed_block_of(cut_pair),
    add_torques,
    listed_blocks,
    listed_rates,
    energy_shares,
    loads_of_pair,
    arrays=COPIES,
    virial=virial_of_pairs(loads_of_pair, True),
)
