"""Cells and the list of pairs within the reach of long-range forces; the one neighbour search of SAND."""

import math
from typing import Any, NamedTuple

from ..core.box import nearest_image
from ..core.jit import kernel, loop, rare
from ..core.vec import dot, load, put, sub
from ..core.world import CELLS_PER_GRAIN, LISTED

FULL = -1
"""Answer of the makers of lists when the arrays are too short."""


class Search(NamedTuple):
    """How neighbours are found."""

    listed: bool  # False: all pairs, no list
    reach: float  # pairs closer than this are listed [m]
    margin: float  # part of the reach that grains may move before the list is made anew, Δr [m]


class Grid(NamedTuple):
    """Cells along each axis: their number, where the first begins [m], and how many there are in a metre."""

    counts: Any  # (x, y, z)
    low: Any
    per_length: Any


@loop
def list_is_stale(grains, anchor, span, limit):
    """True once a grain is farther than `limit` [m] from where it was when the list was made.

    What counts is the displacement, not the way: a grain that rings in its cluster moves as the cluster does, to
    within its amplitude, and does not make the list stale.
    """
    strayed = 0.0
    for i in range(grains.mass.size):
        moved = nearest_image(sub(load(grains.position, i), load(anchor, i)), span)
        # written so that an anchor at infinity (no list yet) counts as strayed
        strayed += 0.0 if dot(moved, moved) <= limit * limit else 1.0
    return strayed > 0.0


@loop
def axis_of_grid(low, high, length, reach):
    """Number of cells on one axis, where they begin, and how many there are in a metre."""
    start, extent = (-0.5 * length, length) if length > 0.0 else (low, high - low)
    number = max(1, min(int(extent / reach), 1 << 20)) if extent > 0.0 else 1
    return number, start, number / extent if extent > 0.0 else 0.0


@loop
def grid_for(anchor, span, reach):
    """Cells at least `reach` wide, at most CELLS_PER_GRAIN per grain and never fewer than 27 in all.

    Open axes are cut where the outermost grains are.  On periodic axes the box must be three cells wide.
    """
    low, high = load(anchor, 0), load(anchor, 0)
    for i in range(anchor.shape[1]):
        x = load(anchor, i)
        low = (min(low[0], x[0]), min(low[1], x[1]), min(low[2], x[2]))
        high = (max(high[0], x[0]), max(high[1], x[1]), max(high[2], x[2]))
    x, y, z = reach, reach, reach
    while True:
        nx, lx, px = axis_of_grid(low[0], high[0], span.x, x)
        ny, ly, py = axis_of_grid(low[1], high[1], span.y, y)
        nz, lz, pz = axis_of_grid(low[2], high[2], span.z, z)
        if nx * ny * nz <= CELLS_PER_GRAIN * anchor.shape[1] + 27 or max(nx, ny, nz) <= 3:
            return Grid((nx, ny, nz), (lx, ly, lz), (px, py, pz))
        # the axis with most cells takes larger ones
        if nx >= ny and nx >= nz:
            x *= 1.25
        elif ny >= nz:
            y *= 1.25
        else:
            z *= 1.25


@loop
def place_on_axis(x, low, per_length, number):
    """The cell of a coordinate; what lies outside (or is not a number) counts to the cell at the end."""
    return max(0, min(math.floor((x - low) * per_length), number - 1))


@loop
def sort_into_cells(far, grid):
    """Fill `home`, `cell` and `order`: grains by cell, in each cell by number."""
    nx, ny, nz = grid.counts
    total = nx * ny * nz
    for c in range(total + 1):
        far.cell[c] = 0
    for i in range(far.anchor.shape[1]):
        x = load(far.anchor, i)
        cx = place_on_axis(x[0], grid.low[0], grid.per_length[0], nx)
        cy = place_on_axis(x[1], grid.low[1], grid.per_length[1], ny)
        cz = place_on_axis(x[2], grid.low[2], grid.per_length[2], nz)
        home = (cz * ny + cy) * nx + cx
        far.home[i] = home
        far.cell[home + 1] += 1
    for c in range(total):
        far.cell[c + 1] += far.cell[c]
    # each `cell[c]` serves as the place of its next grain, and is put back afterwards
    for i in range(far.anchor.shape[1]):
        home = far.home[i]
        far.order[far.cell[home]] = i
        far.cell[home] += 1
    for k in range(total):
        c = total - k
        far.cell[c] = far.cell[c - 1]
    far.cell[0] = 0


@loop
def neighbour_on_axis(c, step, number, periodic):
    """The cell `step` further, or −1 where an open axis ends."""
    there = c + step
    if 0 <= there < number:
        return there
    if not periodic:
        return -1
    return there - number if there >= number else there + number


@loop
def list_cell(far, span, limit, s, first, last, found):
    """Append the grains at places first…last − 1 that are close to the one at place s; FULL if there is no room."""
    here = load(far.anchor, far.order[s])
    for t in range(first, last):
        apart = nearest_image(sub(here, load(far.anchor, far.order[t])), span)
        if t != s and dot(apart, apart) < limit:
            if found == far.mate.size:
                return FULL
            far.mate[found] = t
            found += 1
    return found


@rare
def rows_from_anchors(far, span, reach):
    """Order, rows and mates from the anchors alone; the number of entries, or FULL."""
    grid = grid_for(far.anchor, span, reach)
    sort_into_cells(far, grid)
    nx, ny, nz = grid.counts
    found = 0
    far.start[0] = 0
    for s in range(far.anchor.shape[1]):
        home = int(far.home[far.order[s]])
        cx, cy, cz = home % nx, home // nx % ny, home // (nx * ny)
        for step in range(27):
            tx = neighbour_on_axis(cx, step % 3 - 1, nx, span.x > 0.0)
            ty = neighbour_on_axis(cy, step // 3 % 3 - 1, ny, span.y > 0.0)
            tz = neighbour_on_axis(cz, step // 9 - 1, nz, span.z > 0.0)
            if tx >= 0 and ty >= 0 and tz >= 0:
                there = (tz * ny + ty) * nx + tx
                found = list_cell(far, span, reach * reach, s, far.cell[there], far.cell[there + 1], found)
                if found == FULL:
                    return FULL
        far.start[s + 1] = found
    return found


@rare
def make_far_list(grains, far, count, span, search):
    """List all pairs closer than the reach, from where the grains are now; FULL if there is no room."""
    for i in range(grains.mass.size):
        put(far.anchor, i, load(grains.position, i))
    if rows_from_anchors(far, span, search.reach) == FULL:
        far.anchor[0, 0] = math.inf
        return FULL
    count[LISTED] += 1
    return 0


@kernel
def remake_far_list(far, span, reach):
    """The list of an earlier run from its anchors, as it was; FULL if there is no room."""
    return rows_from_anchors(far, span, reach)


def three_cells_fit(lengths, reach):
    """True if every periodic side of a box holds three cells of this width [m]."""
    return all(length is None or int(length / reach) >= 3 for length in lengths)
