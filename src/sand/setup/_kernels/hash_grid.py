"""Hierarchical hash grid for neighbour search in growing aggregates.

Cells of widths w, 2w, 4w … of several levels share one hash table, which needs no bounding box and no memory for empty
cells. Cells of the lowest level hold linked lists of their grains; cells of higher levels only record that they are
occupied, from which a lower bound of the distance to the nearest grain follows.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from ...compiler.jit import formula, loop
from ...contact.jkr import rest_overlap, rest_radius
from ...numerics.vec import dot, load, sub

EMPTY = -1
LEVELS = 8
"""Number of levels; each doubles the cell width, up to 128 w."""
SLOTS_PER_GRAIN, MIN_SLOTS = 4, 512
"""Smallest size of the table: a connected grain occupies at most three cells, summed over the levels, apart from up to
eight cells per level at its corners; the table must never be full."""
TRIES = 100_000
"""Largest number of attempts to place a grain, or merge two clusters, with a single contact."""
APART = 1e-9
"""Smallest gap of surfaces that do not touch, relative to the sum of their radii."""
_HALF = 1 << 19
_SIDE = 1 << 20
_MULTIPLIER = -7046029254386353131  # Fibonacci hashing: 2⁶⁴ over the golden ratio, odd, as a signed integer


class GrainSet(NamedTuple):
    """Properties of the grains of a growing aggregate."""

    radius: np.ndarray  # (N,) [m]
    mass: np.ndarray  # (N,) [kg]
    material: np.ndarray  # (N,) index into the tables
    surface_energy: np.ndarray  # (M, M) γ_eff [J/m²]
    modulus: np.ndarray  # (M, M) E* [Pa]
    largest: float  # largest radius [m]


class HashGrid(NamedTuple):
    """Hash table of cells with open addressing; the first `mask` + 1 slots, a power of two, are in use."""

    key: np.ndarray  # (slots,) key of the cell, or EMPTY
    head: np.ndarray  # (slots,) first grain of the cell's linked list
    next_in_cell: np.ndarray  # (N,) next grain of the list, or EMPTY
    mask: Any
    width: float  # cell width w of the lowest level [m]


@formula
def pair_rest_distance(grain_set, i, j):
    """Equilibrium distance of the centres of grains i and j in contact [m]: r1 + r2 − δ0, δ0 = 0 without adhesion."""
    r1, r2 = grain_set.radius[i], grain_set.radius[j]
    a, b = grain_set.material[i], grain_set.material[j]
    reduced = r1 * r2 / (r1 + r2)
    return (
        r1 + r2 - rest_overlap(rest_radius(grain_set.surface_energy[a, b], reduced, grain_set.modulus[a, b]), reduced)
    )


@formula
def cell_on_axis(x, width):
    """Cell index of a coordinate."""
    return math.floor(x / width)


@formula
def cell_key(level, x, y, z):
    """Integer key of a cell; each index must lie within ±2¹⁹."""
    return ((level * _SIDE + x + _HALF) * _SIDE + y + _HALF) * _SIDE + z + _HALF


@loop
def slot_of(grid, key):
    """Slot of a cell in the table, or the empty slot in which to insert it (linear probing).

    Eight consecutive cells, whose keys differ in the last bits, are adjacent in memory.
    """
    slot = ((((key >> 3) * _MULTIPLIER) >> 32 << 3) + (key & 7)) & grid.mask
    while grid.key[slot] != EMPTY and grid.key[slot] != key:
        slot = (slot + 1) & grid.mask
    return slot


@loop
def table_size(grains, most):
    """Number of slots for this number of grains, a power of two, at most `most`."""
    size = MIN_SLOTS
    while size < SLOTS_PER_GRAIN * grains + MIN_SLOTS and size < most:
        size *= 2
    return size


@loop
def clear(grid):
    """Empty the table."""
    for slot in range(grid.mask + 1):
        grid.key[slot] = EMPTY


@loop
def first_in_cell(grid, key):
    """First grain in the list of a cell, or EMPTY."""
    slot = slot_of(grid, key)
    return grid.head[slot] if grid.key[slot] == key else EMPTY


@loop
def insert_in_cell(grid, key, i):
    """Insert grain i in the list of a cell."""
    slot = slot_of(grid, key)
    grid.next_in_cell[i] = grid.head[slot] if grid.key[slot] == key else EMPTY
    grid.key[slot] = key
    grid.head[slot] = i


@loop
def insert_grain(grid, i, x):
    """Insert grain i at x in the lowest level, and mark its cells of all higher levels as occupied."""
    width = grid.width
    key = cell_key(0, cell_on_axis(x[0], width), cell_on_axis(x[1], width), cell_on_axis(x[2], width))
    insert_in_cell(grid, key, i)
    for level in range(1, LEVELS):
        width *= 2.0
        key = cell_key(level, cell_on_axis(x[0], width), cell_on_axis(x[1], width), cell_on_axis(x[2], width))
        slot = slot_of(grid, key)
        if grid.key[slot] == key:
            return
        grid.key[slot] = key


@loop
def occupied_around(grid, level, width, x):
    """Whether the cell of x on this level or one of its 26 neighbours is occupied."""
    cx, cy, cz = cell_on_axis(x[0], width), cell_on_axis(x[1], width), cell_on_axis(x[2], width)
    for step in range(27):
        cell = (step + 13) % 27  # the central cell first
        key = cell_key(level, cx + cell % 3 - 1, cy + cell // 3 % 3 - 1, cz + cell // 9 - 1)
        if grid.key[slot_of(grid, key)] == key:
            return True
    return False


@loop
def empty_distance(grid, x):
    """Lower bound of the distance from x to the nearest grain centre [m]; 0 if it may be less than w."""
    width = grid.width * (1 << (LEVELS - 1))
    for k in range(LEVELS):
        if not occupied_around(grid, LEVELS - 1 - k, width, x):
            return width
        width *= 0.5
    return 0.0


@loop
def head_of_neighbour_cell(grid, x, step):
    """First grain in the list of cell number `step` of the 27 lowest-level cells around x, or EMPTY."""
    cx, cy, cz = (cell_on_axis(x[0], grid.width), cell_on_axis(x[1], grid.width), cell_on_axis(x[2], grid.width))
    return first_in_cell(grid, cell_key(0, cx + step % 3 - 1, cy + step // 3 % 3 - 1, cz + step // 9 - 1))


@loop
def gap_to_nearest(grid, position, grain_set, b, x):
    """Gap between grain b at x and the nearest other grain.

    Returns
    -------
    gap : float
        Gap between the surfaces [m], or a lower bound of it.
    nearest : int
        The nearest grain; EMPTY if `gap` is a lower bound.
    """
    reach = grain_set.radius[b] + grain_set.largest
    free = empty_distance(grid, x)
    if free > 0.0:
        return free - reach, EMPTY
    best, nearest = grid.width - reach, EMPTY
    for step in range(27):
        j = head_of_neighbour_cell(grid, x, step)
        while j != EMPTY:
            separation = sub(x, load(position, j))
            touch = grain_set.radius[b] + grain_set.radius[j]
            square = dot(separation, separation)
            if square < (best + touch) ** 2:
                best, nearest = math.sqrt(square) - touch, j
            j = grid.next_in_cell[j]
    return best, nearest


@loop
def touches_other(grid, position, grain_set, b, x, neighbour):
    """Whether grain b at x touches any grain other than `neighbour`."""
    for step in range(27):
        j = head_of_neighbour_cell(grid, x, step)
        while j != EMPTY:
            separation = sub(x, load(position, j))
            touch = (grain_set.radius[b] + grain_set.radius[j]) * (1.0 + APART)
            if j != neighbour and dot(separation, separation) <= touch * touch:
                return True
            j = grid.next_in_cell[j]
    return False
