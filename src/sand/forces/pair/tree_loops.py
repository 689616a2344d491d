"""Loops of the tree sum of dipoles in an open box: walk through the cells, near pairs, loads (Dehnen 2002).

Two cells A and B of the tree (`tree_cells`), with half diagonals r and distance R of their centres, interact as a whole
if

    r_A + r_B < θ R  and  R > r_A + g_A + r_B + g_B

where g is the largest radius of a grain in the cell, so that grains in contact are summed directly.  Otherwise the
larger cell is divided.  Pairs of leaves that remain are summed directly.

The leaves are shared among threads in blocks.  A block descends from the root to its leaves.  At each cell the cells
that were too close to its parent are tested again: the expansions of some are added to the local expansion of the
cell, the others are passed on.  The test is symmetric, so that both cells of a pair come to the same result and their
forces are opposite and equal to rounding.  The net torque that remains, because expansions end, is removed by forces
α × (x − x̄) on all grains.
"""

from typing import NamedTuple

import numpy as np

from ...basics.alignment import SIMD_WIDTH
from ...compiler.jit import loop
from ...numerics.simd import round_up_to_simd_width
from ...numerics.vec import accrue, add, cross, dot, load, put, sub
from .dipole_formulas import pair_load
from .dipole_loops import COPIES, MAX_REMAINDER, energy_shares, separation_if
from .ewald_loops import bare_pair
from .long_range_loops import LongRangeSums
from .multipoles import LANES, Tables, add_shifted_expansion, complete
from .tree_cells import Cells, build_cells, first_grain, levels_below, tree_blocks
from .tree_operators import add_batch, add_far, clear, harmonics_at, set_offset, sum_moments

SOURCES = 2048
"""Grains of near leaves that are summed together, a multiple of the SIMD width."""


class Scratch(NamedTuple):
    """Memory of each of the B blocks; E is the number of derivatives."""

    listed: np.ndarray  # (B, levels + 2, leaves) uint32: candidates of each level
    candidates: np.ndarray  # (B, levels + 2) int64: how many
    local: np.ndarray  # (B, levels + 1, E): local expansions of the cell of each level
    near: np.ndarray  # (B, leaves) uint32: leaves too close to a leaf
    batch: np.ndarray  # (B, LANES) uint32: cells whose expansions are evaluated next
    distance: np.ndarray  # (B, 3, LANES) [m]
    row: np.ndarray  # (B, LANES)
    derivative: np.ndarray  # (B, E, LANES)
    moment: np.ndarray  # (B, E, LANES)
    sum: np.ndarray  # (B, E, LANES)
    source: np.ndarray  # (B, 6, SOURCES): positions and moments of near grains
    load: np.ndarray  # (B, 6, grains of a leaf, padded): forces and flux densities
    net: np.ndarray  # (B, 12): torque, sum of positions, and of their products


class TreeParameters(NamedTuple):
    """Parameters of the loops."""

    k: float  # μ₀/4π [T m/A]
    opening: float  # θ
    tables: Tables
    cells: Cells
    scratch: Scratch


class Leaf(NamedTuple):
    """A leaf of the tree."""

    cell: int  # its number
    level: int
    first: int  # its grains first … last − 1, in the order of the leaves
    last: int


@loop
def far_enough(cells, opening, a, b):
    """Whether two cells interact as a whole."""
    apart = sub(load(cells.centre, a), load(cells.centre, b))
    square = dot(apart, apart)
    extent, reach = cells.size[0, a] + cells.size[0, b], cells.size[1, a] + cells.size[1, b]
    return extent * extent < opening * opening * square and reach * reach < square


@loop
def visit(parameters, b, cell, level, levels):
    """Local expansion of a cell, from that of its parent and from candidates; returns the number of cells passed on."""
    tables, cells, scratch = parameters.tables, parameters.cells, parameters.scratch
    leaf, first_leaf = level == levels, (1 << levels) - 1
    clear(scratch.sum[b])
    waiting = passed = 0
    for k in range(scratch.candidates[b, level]):
        stack = scratch.listed[b, level, k]
        # depth first through the divisions of a candidate: `at` runs through its cells in the order of the leaves
        at = np.int64(stack)
        while True:
            divided = False
            if far_enough(cells, parameters.opening, cell, at):
                scratch.batch[b, waiting] = at
                waiting += 1
                if waiting == LANES:
                    add_batch(tables, cells, scratch, b, cell, LANES)
                    waiting = 0
            elif at < first_leaf and (
                leaf
                or cells.size[0, at] > cells.size[0, cell]
                or (cells.size[0, at] == cells.size[0, cell] and at < cell)
            ):
                divided = True
            else:
                if leaf:
                    scratch.near[b, passed] = at
                else:
                    scratch.listed[b, level + 1, passed] = at
                passed += 1
            if divided:
                at = 2 * at + 1
            else:
                while at != stack and at % 2 == 0:  # a second half: its parent is finished
                    at = (at - 1) // 2
                if at == stack:
                    break
                at += 1
    if waiting > 0:
        for s in range(waiting, LANES):
            scratch.batch[b, s] = scratch.batch[b, 0]
        add_batch(tables, cells, scratch, b, cell, waiting)
    if not leaf:
        scratch.candidates[b, level + 1] = passed
    local = scratch.local[b, level]
    for c in range(local.size):
        local[c] = 0.0
    for c in range(tables.inside.size):
        for s in range(LANES):
            local[c] += scratch.sum[b, c, s]
    if level > 0:
        set_offset(scratch.distance[b], sub(load(cells.centre, cell), load(cells.centre, (cell - 1) // 2)))
        harmonics_at(tables, scratch.derivative[b], scratch.row[b], scratch.distance[b])
        add_shifted_expansion(tables, scratch.derivative[b], scratch.local[b, level - 1], local)
    complete(tables, local)
    return passed


@loop
def add_pairs(source, load_of, position, moment, leaf, count, own, k):
    """Loads of the grains of a leaf by the first `count` sources, of which `own` is its first grain."""
    n, remainder = np.uint64(count), np.uint64(MAX_REMAINDER)
    for q in range(leaf.last - leaf.first):
        x, mu = load(position, leaf.first + q), load(moment, leaf.first + q)
        self = np.uint64(own + q)
        force = field = (0.0, 0.0, 0.0)
        for t in range(round_up_to_simd_width(n, remainder)):
            real = (t < n) & (t != self)
            apart = separation_if(real, sub(x, (source[0, t], source[1, t], source[2, t])))
            f, b1, _, _ = pair_load(apart, mu, (source[3, t], source[4, t], source[5, t]), k if real else 0.0)
            force, field = add(force, f), add(field, b1)
        for axis in range(3):
            load_of[axis, q] += force[axis]
            load_of[3 + axis, q] += field[axis]


@loop
def add_near(scratch, position, moment, b, leaf, number, size, k):
    """Add the loads of the grains of a leaf by the `number` near leaves, SOURCES grains at a time."""
    source, count, own = scratch.source[b], 0, SOURCES
    for m in range(number):
        other = np.int64(scratch.near[b, m])
        start, end = first_grain(size, other, leaf.level), first_grain(size, other + 1, leaf.level)
        if count + end - start > SOURCES - SIMD_WIDTH:
            add_pairs(source, scratch.load[b], position, moment, leaf, count, own, k)
            count, own = 0, SOURCES
        own = count if other == leaf.cell else own
        for s in range(start, end):
            x, mu = load(position, s), load(moment, s)
            for axis in range(3):
                source[axis, count] = x[axis]
                source[3 + axis, count] = mu[axis]
            count += 1
    add_pairs(source, scratch.load[b], position, moment, leaf, count, own, k)


@loop
def store_loads(grains, long_range, parameters, b, first, last):
    """Add the loads of a leaf to those of its grains, and to the sums of the block."""
    cells, scratch, net = parameters.cells, parameters.scratch, parameters.scratch.net
    root = load(cells.centre, 0)
    for s in range(first, last):
        i, q = cells.order[s], s - first
        force = scratch.load[b, 0, q], scratch.load[b, 1, q], scratch.load[b, 2, q]
        field = scratch.load[b, 3, q], scratch.load[b, 4, q], scratch.load[b, 5, q]
        accrue(long_range.force, i, force)
        put(grains.field, i, field)
        x = sub(load(grains.position, i), root)
        torque = add(cross(x, force), cross(load(grains.moment, i), field))
        for axis in range(3):
            net[b, axis] += torque[axis]
            net[b, 3 + axis] += x[axis]
            net[b, 6 + axis] += x[axis] * x[axis]
        net[b, 9] += x[0] * x[1]
        net[b, 10] += x[0] * x[2]
        net[b, 11] += x[1] * x[2]


@loop
def begin(grains, long_range, span, parameters):
    """Build the tree and the multipole moments of its cells."""
    cells, size = parameters.cells, grains.mass.size
    build_cells(grains, cells, long_range.packed_position)
    for s in range(size):
        put(long_range.packed_moment, s, load(grains.moment, cells.order[s]))
    sum_moments(
        parameters.tables,
        cells,
        parameters.scratch,
        long_range.packed_position,
        long_range.packed_moment,
        size,
        levels_below(grains),
    )


@loop
def block(grains, long_range, span, parameters, b):
    """Loads of the grains of one block of leaves."""
    scratch, size, levels = parameters.scratch, grains.mass.size, levels_below(grains)
    position, moment = long_range.packed_position, long_range.packed_moment
    leaves, blocks = 1 << levels, tree_blocks(grains)
    for c in range(scratch.net.shape[1]):
        scratch.net[b, c] = 0.0
    scratch.listed[b, 0, 0] = 0
    scratch.candidates[b, 0] = 1
    for leaf in range(leaves * b // blocks, leaves * (b + 1) // blocks):
        near = 0
        for level in range(levels + 1):
            new = leaf == leaves * b // blocks or (leaf >> (levels - level)) != ((leaf - 1) >> (levels - level))
            if new:  # the cell of this level is not that of the previous leaf
                near = visit(parameters, b, (1 << level) - 1 + (leaf >> (levels - level)), level, levels)
        cell = leaves - 1 + leaf
        of_leaf = Leaf(cell, levels, first_grain(size, cell, levels), first_grain(size, cell + 1, levels))
        add_far(parameters, position, moment, b, of_leaf)
        add_near(scratch, position, moment, b, of_leaf, near, size, parameters.k)
        store_loads(grains, long_range, parameters, b, of_leaf.first, of_leaf.last)


@loop
def correction(net, count):
    """α [N/m] for which the forces α × (x − x̄) balance the net torque; 0 if the grains are on a line.

    With x̄ = Σx/N, S = Σ (x − x̄)(x − x̄)ᵀ: (tr S − S) α = −torque.
    """
    x, y, z = net[3], net[4], net[5]
    xx, yy, zz = net[6] - x * x / count, net[7] - y * y / count, net[8] - z * z / count
    xy, xz, yz = net[9] - x * y / count, net[10] - x * z / count, net[11] - y * z / count
    row1, row2, row3 = (yy + zz, -xy, -xz), (-xy, xx + zz, -yz), (-xz, -yz, xx + yy)
    first, second, third = cross(row2, row3), cross(row3, row1), cross(row1, row2)
    volume, trace = dot(row1, first), xx + yy + zz
    if not volume > 1e-9 * trace * trace * trace:
        return 0.0, 0.0, 0.0
    torque = (-net[0] / volume, -net[1] / volume, -net[2] / volume)
    return dot(first, torque), dot(second, torque), dot(third, torque)


@loop
def end(grains, long_range, span, parameters):
    """Remove the net torque, and add the torques of the grains."""
    net, count = parameters.scratch.net, grains.mass.size
    for b in range(1, tree_blocks(grains)):
        for c in range(net.shape[1]):
            net[0, c] += net[b, c]
    turn = correction(net[0], count)
    middle = add(load(parameters.cells.centre, 0), (net[0, 3] / count, net[0, 4] / count, net[0, 5] / count))
    for i in range(count):
        accrue(long_range.force, i, cross(turn, sub(load(grains.position, i), middle)))
        accrue(long_range.torque, i, cross(load(grains.moment, i), load(grains.field, i)))


TREE = LongRangeSums(begin, block, end, tree_blocks, None, energy_shares, bare_pair, arrays=COPIES, own_memory=True)
