"""The cells of a tree of grains in an open box: division into halves, levels, blocks of leaves.

A binary tree divides the grains: a cell is cut at the median of the longest side of the box around its grains, so that
all leaves have the same level and, within one, as many grains.  Cells are numbered by level, 2c + 1 and 2c + 2 are the
halves of cell c.
"""

import math
from typing import NamedTuple

import numpy as np

from ...compiler.jit import loop
from ...numerics.vec import add, dot, load, put, scale, sub
from .long_range_loops import PARALLEL_FROM

LEAF = 40
"""Most grains in a leaf."""
SOME_BLOCKS, MOST_BLOCKS, LARGE_FROM = 8, 64, 20_000
"""Blocks from PARALLEL_FROM grains on, and from LARGE_FROM grains on."""
CONTACT_GAP = 1.01
"""Grains up to this distance, in units of the sum of their radii, are summed directly: those in contact are closer."""


class Cells(NamedTuple):
    """The tree: cells by number, and grains in its order."""

    order: np.ndarray  # (N,) uint32: grains in the order of the leaves
    centre: np.ndarray  # (3, C) [m]
    size: np.ndarray  # (2, C): half diagonal r, and r plus the largest radius of a grain [m]
    moment: np.ndarray  # (C, p²) multipole moments


@loop
def levels_below(grains):
    """Level of the leaves: 0 if the root is the only cell."""
    level, most = 0, LEAF
    while most < grains.mass.size:
        most *= 2
        level += 1
    return level


@loop
def tree_blocks(grains):
    """Number of blocks of leaves."""
    size = grains.mass.size
    most = 1 if size < PARALLEL_FROM else SOME_BLOCKS if size < LARGE_FROM else MOST_BLOCKS
    return min(most, 1 << levels_below(grains))


@loop
def first_grain(size, cell, level):
    """Index in the order of the tree of the first grain of a cell, of `size` grains; cells 2^level − 1 … of a level."""
    return (size * (cell + 1 - (1 << level))) >> level


@loop
def swap(order, position, i, j):
    """Exchange two grains of the order, and their positions."""
    order[i], order[j] = order[j], order[i]
    for axis in range(3):
        position[axis, i], position[axis, j] = position[axis, j], position[axis, i]


@loop
def divide(order, position, axis, first, last, middle):
    """Sort grains first … last − 1 so that those before `middle` have coordinates at most as large as those after it.

    Hoare's selection: the range that contains `middle` is divided at the median of three coordinates until it is short.
    """
    low, high = first, last - 1
    while high > low:
        a, b, c = position[axis, low], position[axis, (low + high) // 2], position[axis, high]
        pivot = max(min(a, b), min(max(a, b), c))
        i, j = low, high
        while i <= j:
            while position[axis, i] < pivot:
                i += 1
            while position[axis, j] > pivot:
                j -= 1
            if i <= j:
                swap(order, position, i, j)
                i += 1
                j -= 1
        if middle <= j:
            high = j
        elif middle >= i:
            low = i
        else:
            break


@loop
def build_cells(grains, cells, position):
    """Divide the grains into cells; `position` (3, V) gets their positions in the order of the leaves."""
    size, levels = grains.mass.size, levels_below(grains)
    for s in range(size):
        cells.order[s] = s
        put(position, s, load(grains.position, s))
    for level in range(levels + 1):
        for cell in range((1 << level) - 1, (1 << (level + 1)) - 1):
            first, last = first_grain(size, cell, level), first_grain(size, cell + 1, level)
            low = high = load(position, first)
            largest = 0.0
            for s in range(first, last):
                x = load(position, s)
                low = (min(low[0], x[0]), min(low[1], x[1]), min(low[2], x[2]))
                high = (max(high[0], x[0]), max(high[1], x[1]), max(high[2], x[2]))
                largest = max(largest, grains.radius[cells.order[s]])
            side = sub(high, low)
            half = 0.5 * math.sqrt(dot(side, side))
            put(cells.centre, cell, scale(0.5, add(low, high)))
            cells.size[0, cell], cells.size[1, cell] = half, half + CONTACT_GAP * largest
            if level < levels:
                axis = 0 if side[0] >= side[1] and side[0] >= side[2] else 1 if side[1] >= side[2] else 2
                divide(cells.order, position, axis, first, last, first_grain(size, 2 * cell + 2, level + 1))
