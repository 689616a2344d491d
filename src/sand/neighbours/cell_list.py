"""Cells and the list of pairs within the reach of long-range forces; the one neighbour search of SAND."""

import math
from typing import Any, NamedTuple

import numpy as np

from ..box import nearest_image
from ..compiler.jit import kernel, loop, rare
from ..numerics.simd import SIMD_WIDTH
from ..numerics.vec import dot, load, put, sub
from ..state.arrays import CELLS_PER_GRAIN
from ..state.state import LISTED

FULL = -1
"""Answer of the makers of lists when the arrays are too short."""
FINEST = 16
"""Most cells along x in the width of one along y or z: more would shorten the stretches of a row by little."""
WITH_NEIGHBOURS = 3
"""Fewest cells on a periodic axis, so that the two beside each are two."""
SLACK = 1e-6
"""Part of the square of the reach by which a stretch is longer than it need be, so that rounding cuts no pair off."""
ROUNDING = 1e-6
"""The same in cells: coordinates are counted in them, up to some 10⁹."""


class Search(NamedTuple):
    """How neighbours are found."""

    listed: bool  # is there a list that outlasts a step? The near pairs are picked out of it
    reach: float  # pairs closer than this are listed [m]
    margin: float  # part of the reach that grains may move before the list is made anew, Δr [m]; 0 without a list
    celled: bool = False  # near pairs come from cells, without any other list; neither: out of all pairs


class Grid(NamedTuple):
    """Cells along each axis; along x they are thinner: a row of them is one stretch of places, however many it has."""

    counts: Any  # how many, (x, y, z)
    low: Any  # where the first begins [m]
    per_length: Any  # how many there are in a metre, 0 where all grains are in one plane
    fine: Any  # so many together along x are at least as wide as the reach
    width_y: Any  # [m]
    width_z: Any


@loop
def axis_of_grid(low, high, length, reach):
    """Number of cells on one axis, where they begin, and how many there are in a metre.

    With two on a periodic axis, or with one and its images, a grain would meet others from both sides: then all is
    one cell, without neighbours.
    """
    start, extent = (-0.5 * length, length) if length > 0.0 else (low, high - low)
    number = max(1, min(int(extent / reach), 1 << 20)) if extent > 0.0 else 1
    number = 1 if length > 0.0 and number < WITH_NEIGHBOURS else number
    return number, start, number / extent if extent > 0.0 else 0.0


@loop
def grid_for(anchor, span, reach):
    """Cells at least `reach` wide, at most CELLS_PER_GRAIN per grain and never fewer than 27 in all.

    Open axes are cut where the outermost grains are; a periodic one that is less than three cells wide is not cut.
    Along x each is cut once more, into FINEST or until there is a cell for each grain.
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
            fine = max(1, min(anchor.shape[1] // (nx * ny * nz), FINEST))
            wide_y, wide_z = 1.0 / py if py > 0.0 else 0.0, 1.0 / pz if pz > 0.0 else 0.0
            return Grid((nx * fine, ny, nz), (lx, ly, lz), (px * fine, py, pz), fine, wide_y, wide_z)
        # the axis with most cells takes larger ones
        if nx >= ny and nx >= nz:
            x *= 1.25
        elif ny >= nz:
            y *= 1.25
        else:
            z *= 1.25


@loop
def in_cells(grid, x):
    """A place [m] counted in cells along each axis."""
    return (
        (x[0] - grid.low[0]) * grid.per_length[0],
        (x[1] - grid.low[1]) * grid.per_length[1],
        (x[2] - grid.low[2]) * grid.per_length[2],
    )


@loop
def cell_at(x, number):
    """The cell of a coordinate; what lies outside (or is not a number) counts to the cell at the end."""
    return max(0, min(math.floor(x), number - 1))


@loop
def sort_into_cells(long_range, here, anchor, span, grid):
    """Fill `home`, `cell`, `order` and `here` (anchors by place): grains by cell, in each cell by number.

    Here and in `list_stretch`, `here` may be far.packed_position, which is not to be touched by its other name.
    """
    nx, ny, nz = grid.counts
    total = nx * ny * nz
    for c in range(total + 1):
        long_range.cell[c] = 0
    for i in range(anchor.shape[1]):
        x = in_cells(grid, nearest_image(load(anchor, i), span))
        home = (cell_at(x[2], nz) * ny + cell_at(x[1], ny)) * nx + cell_at(x[0], nx)
        long_range.cell_of[i] = home
        long_range.cell[home + 1] += 1
    for c in range(total):
        long_range.cell[c + 1] += long_range.cell[c]
    # each `cell[c]` serves as the place of its next grain, and is put back afterwards
    for i in range(anchor.shape[1]):
        home = long_range.cell_of[i]
        s = long_range.cell[home]
        long_range.order[s] = i
        put(here, s, nearest_image(load(anchor, i), span))
        long_range.cell[home] += 1
    for k in range(total):
        c = total - k
        long_range.cell[c] = long_range.cell[c - 1]
    long_range.cell[0] = 0


@loop
def neighbour_on_axis(c, step, number, periodic):
    """The cell `step` further, or −1 where an open axis ends or is not cut."""
    there = c + step
    if 0 <= there < number:
        return there
    if not periodic or number == 1:
        return -1
    return there - number if there >= number else there + number


@loop
def gap_on_axis(x, c, step, width):
    """How far [m] a coordinate, counted in cells, is from the cell `step` further; never too much by rounding."""
    gap = c + 1.0 - x if step > 0 else x - c
    return max(0.0, gap - ROUNDING) * width if step != 0 else 0.0


@loop
def list_stretch(long_range, here, span, limit, s, first, last, found):
    """Append those of the places first…last − 1 that are close to place s; FULL if there is no room for all.

    Distances first, in a loop that vectorises; then each place is written down, and kept if it is close: no branch
    has to be guessed.  The distance is odd in its two grains to the last bit, so that both have the pair or neither.
    """
    own, length = load(here, s), last - first
    if found + np.int64(length) + SIMD_WIDTH > long_range.neighbour.size:  # whole vectors are read
        return FULL
    for k in range(length):
        apart = nearest_image(sub(own, load(here, first + k)), span)
        long_range.source[0, k] = dot(apart, apart)
    if first <= s < last:
        long_range.source[0, s - first] = math.inf
    end = np.uint64(found)
    for k in range(length):
        long_range.neighbour[end] = first + k
        end += np.uint64(long_range.source[0, k] < limit)
    return np.int64(end)


@loop
def list_row(long_range, here, grid, span, limit, s, x, row, left, found):
    """Append the neighbours of place s in the row of cells from `row` on; FULL if there is no room.

    Those within ±√left [m] along x are looked at.  Beyond a periodic wall they are a stretch of their own.  All are
    where the axis is less than three times as wide as the reach.
    """
    nx = grid.counts[0]
    if span.x > 0.0 and nx == grid.fine:
        begin, end = np.uint64(long_range.cell[row]), np.uint64(long_range.cell[row + nx])
        return list_stretch(long_range, here, span, limit, np.uint64(s), begin, end, found)
    wide, home = math.sqrt(left) * grid.per_length[0] + ROUNDING, cell_at(x, nx)
    # never more cells than hold the reach: in a box of three, one more would be met from both sides;
    # never fewer than one, should a coordinate be no number
    low = min(max(math.floor(x - wide), home - grid.fine), home)
    high = max(min(math.floor(x + wide), home + grid.fine), home)
    first, last = max(low, 0), min(high, nx - 1) + 1
    for _ in range(2):
        begin, end = np.uint64(long_range.cell[row + first]), np.uint64(long_range.cell[row + last])
        found = list_stretch(long_range, here, span, limit, np.uint64(s), begin, end, found)
        if found == FULL or not (span.x > 0.0 and (low < 0 or high >= nx)):
            break
        first, last = (low + nx, nx) if low < 0 else (0, high - nx + 1)
    return found


@rare
def grid_of(long_range, here, anchor, span, reach):
    """Cells for these anchors, and the grains sorted into them."""
    grid = grid_for(anchor, span, reach)
    sort_into_cells(long_range, here, anchor, span, grid)
    return grid


@rare
def list_place(long_range, here, grid, span, reach, s, found):
    """Append the places closer than the reach to place s, from mate[found] on; where they end, or FULL.

    The first row of `source` serves meanwhile, for distances.

    Parameters
    ----------
    here
        (3, N) the anchors by place [m], from `grid_of`.
    """
    nx, ny, nz = grid.counts
    widest = (1.0 + SLACK) * reach * reach
    x = in_cells(grid, load(here, s))
    cy, cz = cell_at(x[1], ny), cell_at(x[2], nz)
    for step in range(9):
        dy, dz = step % 3 - 1, step // 3 - 1
        ty = neighbour_on_axis(cy, dy, ny, span.y > 0.0)
        tz = neighbour_on_axis(cz, dz, nz, span.z > 0.0)
        gap_y, gap_z = gap_on_axis(x[1], cy, dy, grid.width_y), gap_on_axis(x[2], cz, dz, grid.width_z)
        left = widest - gap_y * gap_y - gap_z * gap_z
        if ty >= 0 and tz >= 0 and left > 0.0:
            row = (tz * ny + ty) * nx
            found = list_row(long_range, here, grid, span, reach * reach, s, x[0], row, left, found)
            if found == FULL:
                return FULL
    return found


@rare
def rows_from_anchors(long_range, span, reach):
    """Order, rows and mates from the anchors alone; the number of entries, or FULL.

    A row of `mate` needs nothing of the rows before it but the place where it begins: blocks of places can be listed
    apart, each with room for distances of its own, and be put together in their order.
    """
    grid = grid_of(long_range, long_range.packed_position, long_range.anchor, span, reach)
    found = 0
    long_range.start[0] = 0
    for s in range(long_range.anchor.shape[1]):
        found = list_place(long_range, long_range.packed_position, grid, span, reach, s, found)
        if found == FULL:
            return FULL
        long_range.start[s + 1] = found
    return found


@rare
def build_verlet_list(grains, long_range, count, span, search):
    """List all pairs closer than the reach, from where the grains are now; FULL if there is no room."""
    for i in range(grains.mass.size):
        put(long_range.anchor, i, load(grains.position, i))
    if rows_from_anchors(long_range, span, search.reach) == FULL:
        long_range.anchor[0, 0] = math.inf
        return FULL
    count[LISTED] += 1
    return 0


@kernel
def rebuild_verlet_list(long_range, span, reach):
    """The list of an earlier run from its anchors, as it was; FULL if there is no room."""
    return rows_from_anchors(long_range, span, reach)
