"""Loops of the multipole expansions of a tree: moments of all cells, and expansions at cells and at grains."""

from ...compiler.jit import loop
from ...numerics.vec import load, sub
from .multipoles import (
    LANES,
    add_derivatives,
    add_expansions,
    add_moments,
    add_shifted_moments,
    fold,
    set_derivatives,
    set_harmonics,
)
from .tree_cells import first_grain


@loop
def clear(values):
    """Set all entries to 0."""
    for c in range(values.shape[0]):
        for s in range(values.shape[1]):
            values[c, s] = 0.0


@loop
def set_offset(offset, vector):
    """Set a vector in lane 0."""
    offset[0, 0], offset[1, 0], offset[2, 0] = vector


@loop
def harmonics_at(tables, harmonic, row, offset):
    """h_n of the vectors in `offset` (3, LANES)."""
    set_harmonics(tables, harmonic, row, tables.inside.size, offset[0], offset[1], offset[2])


@loop
def load_grains(centre, position, moment, start, last, sign, offset, spins):
    """Vectors from the centre of a cell to LANES grains from `start` on, times `sign`, and their moments; 0 beyond."""
    for s in range(LANES):
        real = start + s < last
        i = start + s if real else start
        x, mu = sub(load(position, i), centre), load(moment, i)
        for axis in range(3):
            offset[axis, s] = sign * x[axis]
            spins[axis, s] = mu[axis] if real else 0.0


@loop
def sum_moments(tables, cells, scratch, position, moment, size, levels):
    """Multipole moments of all cells, from the leaves to the root."""
    harmonic, row, total, offset = scratch.derivative[0], scratch.row[0], scratch.sum[0], scratch.distance[0]
    values, spins = scratch.local[0, 0], scratch.moment[0]
    for up in range(levels + 1):
        level = levels - up
        for cell in range((1 << level) - 1, (1 << (level + 1)) - 1):
            for c in range(values.size):
                values[c] = 0.0
            if level == levels:
                clear(total)
                first, last = first_grain(size, cell, level), first_grain(size, cell + 1, level)
                for start in range(first, last, LANES):
                    load_grains(load(cells.centre, cell), position, moment, start, last, -1.0, offset, spins)
                    harmonics_at(tables, harmonic, row, offset)
                    add_moments(tables, harmonic, spins, total)
                for c in range(values.size):
                    for s in range(LANES):
                        values[c] += total[c, s]
            else:
                for half in range(2 * cell + 1, 2 * cell + 3):
                    set_offset(offset, sub(load(cells.centre, cell), load(cells.centre, half)))
                    harmonics_at(tables, harmonic, row, offset)
                    add_shifted_moments(tables, harmonic, cells.moment[half], values)
            fold(tables, values)
            for c in range(cells.moment.shape[1]):
                cells.moment[cell, c] = values[c]


@loop
def add_batch(tables, cells, scratch, b, cell, number):
    """Add the expansions of the first `number` cells of the batch to the sums."""
    for s in range(LANES):
        source = scratch.batch[b, s]
        apart = sub(load(cells.centre, cell), load(cells.centre, source))
        part = 1.0 if s < number else 0.0
        scratch.distance[b, 0, s] = apart[0] if s < number else 1.0
        scratch.distance[b, 1, s], scratch.distance[b, 2, s] = part * apart[1], part * apart[2]
        for c in range(cells.moment.shape[1]):
            scratch.moment[b, c, s] = part * cells.moment[source, c]
    distance = scratch.distance[b]
    set_derivatives(tables, scratch.derivative[b], scratch.row[b], distance[0], distance[1], distance[2])
    add_expansions(tables, scratch.derivative[b], scratch.moment[b], scratch.sum[b])


@loop
def add_far(parameters, position, moment, b, leaf):
    """Loads of the grains of a leaf by its local expansion: B = −∇φ, F = (μ·∇) B; sets `load`."""
    tables, scratch, k = parameters.tables, parameters.scratch, parameters.k
    centre = load(parameters.cells.centre, leaf.cell)
    offset, spins, derivative = scratch.distance[b], scratch.moment[b], scratch.sum[b]
    for start in range(leaf.first, leaf.last, LANES):
        load_grains(centre, position, moment, start, leaf.last, 1.0, offset, spins)
        harmonics_at(tables, scratch.derivative[b], scratch.row[b], offset)
        for c in range(9):
            for s in range(LANES):
                derivative[c, s] = 0.0
        add_derivatives(tables, scratch.derivative[b], scratch.local[b, leaf.level], derivative)
        for s in range(LANES):
            i = start - leaf.first + s
            xx, xy, yy = derivative[4, s], derivative[5, s], derivative[6, s]
            xz, yz = derivative[7, s], derivative[8, s]
            x, y, z = spins[0, s], spins[1, s], spins[2, s]
            scratch.load[b, 0, i] = -k * (x * xx + y * xy + z * xz)
            scratch.load[b, 1, i] = -k * (x * xy + y * yy + z * yz)
            scratch.load[b, 2, i] = -k * (x * xz + y * yz - z * (xx + yy))
            for axis in range(3):
                scratch.load[b, 3 + axis, i] = -k * derivative[1 + axis, s]
