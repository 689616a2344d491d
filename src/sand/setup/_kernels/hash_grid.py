"""Grains that come one after another, found by where they are: cells of widths w, 2w, 4w … in one hash table.

Aggregates grow in all directions and may be fluffy; a hash table needs neither a box nor room for what is empty.
Cells of the lowest level list their grains, those above only say that there are some: where nothing is near, one look
tells how far the next grain is at least.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from ...compiler.jit import formula, loop
from ...contact.jkr import rest_overlap, rest_radius
from ...numerics.vec import dot, load, sub

EMPTY = -1
LEVELS = 8
"""Widths, each twice the one below; the widest cells are 128 w wide."""
PLACES_PER_GRAIN, PLACES = 4, 512
"""Least size of the table.  Connected grains occupy at most three cells each on all levels together, and the corners of
eight on each; a table must never be full."""
APART = 1e-9
"""Least gap of surfaces that do not touch, in the sum of their radii."""
_HALF = 1 << 19
_SIDE = 1 << 20
_SPREAD = -7046029254386353131  # 2⁶⁴ over the golden ratio, odd, as a signed number


class GrainSet(NamedTuple):
    """What the grains of a growing aggregate are."""

    radius: np.ndarray  # (N,) [m]
    mass: np.ndarray  # (N,) [kg]
    material: np.ndarray  # (N,) index into the tables
    surface_energy: np.ndarray  # (M, M) γ_eff [J/m²]
    modulus: np.ndarray  # (M, M) E* [Pa]
    largest: float  # largest radius [m]


class HashGrid(NamedTuple):
    """The cells; `mask` + 1 places of the table are in use, a power of two."""

    key: np.ndarray  # (places,) which cell has this place, or EMPTY
    head: np.ndarray  # (places,) the grain that came last into the cell
    before: np.ndarray  # (N,) the grain that came before it, or EMPTY
    mask: Any
    width: float  # w [m]


@formula
def rest_between(grain_set, i, j):
    """Distance of the centres of grains i and j in contact at rest [m]: r1 + r2 − δ0; r1 + r2 without adhesion."""
    r1, r2 = grain_set.radius[i], grain_set.radius[j]
    a, b = grain_set.material[i], grain_set.material[j]
    reduced = r1 * r2 / (r1 + r2)
    return (
        r1 + r2 - rest_overlap(rest_radius(grain_set.surface_energy[a, b], reduced, grain_set.modulus[a, b]), reduced)
    )


@formula
def cell_on_axis(x, width):
    """The cell of a coordinate."""
    return math.floor(x / width)


@formula
def cell_key(level, x, y, z):
    """One whole number for a cell, each coordinate within ±2¹⁹."""
    return ((level * _SIDE + x + _HALF) * _SIDE + y + _HALF) * _SIDE + z + _HALF


@loop
def place_of(crowd, key):
    """The place of a cell in the table: where it is, or the empty place where it belongs.

    Eight cells in a row, which differ in the last bits, lie together in memory.
    """
    at = ((((key >> 3) * _SPREAD) >> 32 << 3) + (key & 7)) & crowd.mask
    while crowd.key[at] != EMPTY and crowd.key[at] != key:
        at = (at + 1) & crowd.mask
    return at


@loop
def places_for(grains, most):
    """Size of the table for so many grains, a power of two, at most `most`."""
    size = PLACES
    while size < PLACES_PER_GRAIN * grains + PLACES and size < most:
        size *= 2
    return size


@loop
def clear(crowd):
    """Nobody is there."""
    for at in range(crowd.mask + 1):
        crowd.key[at] = EMPTY


@loop
def add_to_cell(crowd, key, i):
    """Grain i is in this cell."""
    at = place_of(crowd, key)
    crowd.before[i] = crowd.head[at] if crowd.key[at] == key else EMPTY
    crowd.key[at] = key
    crowd.head[at] = i


@loop
def join_hash_grid(crowd, i, x):
    """Grain i is at x, on all levels."""
    width = crowd.width
    key = cell_key(0, cell_on_axis(x[0], width), cell_on_axis(x[1], width), cell_on_axis(x[2], width))
    add_to_cell(crowd, key, i)
    for level in range(1, LEVELS):
        width *= 2.0
        key = cell_key(level, cell_on_axis(x[0], width), cell_on_axis(x[1], width), cell_on_axis(x[2], width))
        at = place_of(crowd, key)
        if crowd.key[at] == key:
            return
        crowd.key[at] = key


@loop
def anyone_around(crowd, level, width, x):
    """Whether a grain is in the cell of x on this level, or in one of the 26 around it."""
    cx, cy, cz = cell_on_axis(x[0], width), cell_on_axis(x[1], width), cell_on_axis(x[2], width)
    for step in range(27):
        turn = (step + 13) % 27  # the middle first
        key = cell_key(level, cx + turn % 3 - 1, cy + turn // 3 % 3 - 1, cz + turn // 9 - 1)
        if crowd.key[place_of(crowd, key)] == key:
            return True
    return False


@loop
def free_width(crowd, x):
    """A length [m] within which of x no grain has its centre; 0 if some may be within w."""
    width = crowd.width * (1 << (LEVELS - 1))
    for down in range(LEVELS):
        if not anyone_around(crowd, LEVELS - 1 - down, width, x):
            return width
        width *= 0.5
    return 0.0


@loop
def head_around(crowd, x, step):
    """The last grain in the `step`-th of the 27 lowest cells around x, or EMPTY."""
    cx, cy, cz = (cell_on_axis(x[0], crowd.width), cell_on_axis(x[1], crowd.width), cell_on_axis(x[2], crowd.width))
    key = cell_key(0, cx + step % 3 - 1, cy + step // 3 % 3 - 1, cz + step // 9 - 1)
    at = place_of(crowd, key)
    return crowd.head[at] if crowd.key[at] == key else EMPTY


@loop
def gap_at(crowd, position, grain_set, b, x):
    """Gap [m] between the surface of grain b at x and the nearest one, or less; and that grain, EMPTY if far."""
    reach = grain_set.radius[b] + grain_set.largest
    free = free_width(crowd, x)
    if free > 0.0:
        return free - reach, EMPTY
    best, nearest = crowd.width - reach, EMPTY
    for step in range(27):
        j = head_around(crowd, x, step)
        while j != EMPTY:
            apart = sub(x, load(position, j))
            touch = grain_set.radius[b] + grain_set.radius[j]
            square = dot(apart, apart)
            if square < (best + touch) ** 2:
                best, nearest = math.sqrt(square) - touch, j
            j = crowd.before[j]
    return best, nearest


@loop
def touches_other(crowd, position, grain_set, b, x, mate):
    """Whether grain b at x touches any grain but `mate`."""
    for step in range(27):
        j = head_around(crowd, x, step)
        while j != EMPTY:
            apart = sub(x, load(position, j))
            touch = (grain_set.radius[b] + grain_set.radius[j]) * (1.0 + APART)
            if j != mate and dot(apart, apart) <= touch * touch:
                return True
            j = crowd.before[j]
    return False
