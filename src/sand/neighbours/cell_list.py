"""Cell list, and the Verlet list of all pairs within the reach of long-range forces.

Grains are sorted into cells.  A grain has an index in this order, its sorted index s: grain `order[s]` has sorted index
s, and the grains of cell c have the sorted indices `cell_start[c]` … `cell_start[c + 1]` − 1.  Cells are subdivided
along x, so that the candidates of a grain in one row of cells form one contiguous range of sorted indices.

Cells are about as wide as the reach, however far apart the grains are (up to MOST_CELLS per axis).  Where there would
be too many, the arrays are a periodic hash grid: cell c of an axis is stored in place c modulo the number of places,
and pairs of grains from different cells in one place are rejected by their distance.

The Verlet list is stored in compressed sparse row form: `neighbour[start[s] : start[s + 1]]` are the sorted indices of
the neighbours of s.  It is a full list (each pair occurs in the rows of both grains) and a function of the anchors
alone.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from ..basics.alignment import SIMD_WIDTH
from ..basics.arrays import CELLS_PER_GRAIN
from ..basics.state import LISTED
from ..compiler.jit import loop, rare
from ..compiler.stage import stage
from ..numerics.flow import store_box
from ..numerics.kinds_of_box import unless_straight
from ..numerics.simd import round_up_to_simd_width
from ..numerics.vec import dot, load, nearest_image, put, sub

FULL = -1
"""Returned when the arrays of a list are too short."""
MAX_SUBDIVISION = 16
"""Most cells along x per cell width along y or z; more would hardly shorten the ranges."""
MOST_CELLS = 1 << 26
"""Most cells per axis."""
MIN_PERIODIC_CELLS = 3
"""Fewest cells on a divided periodic axis, so that the two neighbours of a cell differ; with fewer it is one cell."""
WIDER = 2.0
"""Width in units of the reach of cells that share places: grains are few or in clumps, and fewer cells to visit gain
more than fewer candidates."""
REACH_TOLERANCE = 1e-6
"""Relative increase of the squared reach when ranges are chosen, so that rounding excludes no pair."""
CELL_TOLERANCE = 1e-6
"""Tolerance of coordinates in units of cells, for the same purpose; valid up to about 10⁹ cells per axis."""


class Search(NamedTuple):
    """Method by which neighbours are found."""

    listed: bool  # a Verlet list exists; candidate pairs are selected from it
    reach: float  # pairs closer than this are listed [m]
    margin: float  # skin Δr of the Verlet list [m], contained in the reach; 0 without a list
    celled: bool = False  # candidate pairs are found with cells, without a Verlet list; neither: all pairs


class Grid(NamedTuple):
    """Cells along each axis, with narrower cells along x."""

    counts: Any  # number of cells per axis (x, y, z)
    stored: Any  # places of cells per axis: cell c has place c modulo this number; at least 3 where cells share places
    low: Any  # lower bounds [m]
    per_length: Any  # cells per metre, 0 on an axis along which all grains have the same coordinate
    subdivision: Any  # this many cells along x together are at least as wide as the reach
    width_y: Any  # cell widths [m]
    width_z: Any
    periods: Any  # box lengths [m] as multiples of the spacings, 0 on open axes
    spacings: Any  # coordinates on periodic axes are rounded to multiples of these [m]; 0 on open axes
    folded: Any  # whether a periodic axis is not divided, so that images have to be found pair by pair


@loop
def cells_on_axis(low, high, length, reach):
    """Number of cells on one axis, lower bound [m] and cells per metre.

    A periodic axis with fewer than three cells is not divided: a pair would be found from both sides.
    """
    start, extent = (-0.5 * length, length) if length > 0.0 else (low, high - low)
    number = max(1, min(int(extent / reach), MOST_CELLS)) if extent > 0.0 else 1
    number = 1 if length > 0.0 and number < MIN_PERIODIC_CELLS else number
    return number, start, number / extent if extent > 0.0 else 0.0


@loop
def spacing_on_axis(length):
    """Spacing [m], 2⁻⁵¹ of the power of two above a box length, so that coordinates, L and their sums are exact."""
    return math.ldexp(1.0, math.frexp(length)[1] - 51) if length > 0.0 else 0.0


@loop
def on_spacings(x, spacings):
    """Position [m] with its coordinates rounded to multiples of the spacings; those without one are unchanged."""
    return (
        np.rint(x[0] / spacings[0]) * spacings[0] if spacings[0] > 0.0 else x[0],
        np.rint(x[1] / spacings[1]) * spacings[1] if spacings[1] > 0.0 else x[1],
        np.rint(x[2] / spacings[2]) * spacings[2] if spacings[2] > 0.0 else x[2],
    )


@unless_straight(lambda nx, px, nz, span: (nx, px))
def cells_along_x(nx, px, nz, span):
    """Number of cells along x and cells per metre; one cell where images along z, displaced by the tilt, share one."""
    return (nx, px) if nz > 1 else (1, span.inverse_x)


@loop
def fewer_places(number):
    """The next smaller number of places on an axis on which cells share them."""
    return max(3, int(0.8 * number))


@loop
def multiple_of_places(number, stored, per_length, length):
    """Number of cells, on a periodic axis a multiple of the places, which may become fewer; places; cells per metre."""
    if length == 0.0 or number == stored:
        return number, stored, per_length
    stored = max(number // ((number + stored - 1) // stored), 3)
    return number // stored * stored, stored, (number // stored * stored) / length


@loop
def choose_grid(anchor, span, reach):
    """Grid of cells at least as wide as `reach`, or as WIDER times it, with at most CELLS_PER_GRAIN · N + 27 places.

    Larger cells instead of shared places would hold whole clumps, such as fragments that fly apart.  An open axis
    extends between the outermost grains.  Along x, cells are subdivided into up to MAX_SUBDIVISION, until there is a
    place per grain.
    """
    low, high = load(anchor, 0), load(anchor, 0)
    for i in range(anchor.shape[1]):
        x = load(anchor, i)
        low = (min(low[0], x[0]), min(low[1], x[1]), min(low[2], x[2]))
        high = (max(high[0], x[0]), max(high[1], x[1]), max(high[2], x[2]))
    most, width = CELLS_PER_GRAIN * anchor.shape[1] + 27, reach
    while True:
        nx, lx, px = cells_on_axis(low[0], high[0], span.x, width)
        ny, ly, py = cells_on_axis(low[1], high[1], span.y, width)
        nz, lz, pz = cells_on_axis(low[2], high[2], span.z, width)
        nx, px = cells_along_x(nx, px, nz, span)
        if float(nx) * ny * nz <= most or width > reach:
            break
        width *= WIDER
    mx, my, mz = nx, ny, nz
    while float(mx) * my * mz > most and max(mx, my, mz) > 3:
        if mx >= my and mx >= mz:
            mx = fewer_places(mx)
        elif my >= mz:
            my = fewer_places(my)
        else:
            mz = fewer_places(mz)
    nx, mx, px = multiple_of_places(nx, mx, px, span.x)
    ny, my, py = multiple_of_places(ny, my, py, span.y)
    nz, mz, pz = multiple_of_places(nz, mz, pz, span.z)
    subdivision = max(1, min(anchor.shape[1] // (mx * my * mz), MAX_SUBDIVISION))
    width_y, width_z = 1.0 / py if py > 0.0 else 0.0, 1.0 / pz if pz > 0.0 else 0.0
    spacings = spacing_on_axis(span.x), spacing_on_axis(span.y), spacing_on_axis(span.z)
    folded = (span.x > 0.0) & (nx == 1) | (span.y > 0.0) & (ny == 1) | (span.z > 0.0) & (nz == 1)
    return Grid(
        (nx * subdivision, ny, nz), (mx * subdivision, my, mz), (lx, ly, lz), (px * subdivision, py, pz), subdivision,
        width_y, width_z, on_spacings((span.x, span.y, span.z), spacings), spacings, folded,
    )  # fmt: skip


@loop
def cell_coordinates(grid, x):
    """Position [m] in units of cells, from the lower bounds."""
    return (
        (x[0] - grid.low[0]) * grid.per_length[0],
        (x[1] - grid.low[1]) * grid.per_length[1],
        (x[2] - grid.low[2]) * grid.per_length[2],
    )


@loop
def cell_index(x, number):
    """Index of the cell of a coordinate; values outside the grid, and NaN, belong to the first or last cell."""
    return max(0, min(math.floor(x), number - 1))


@loop
def place_of(cell, stored):
    """Place of a cell on an axis."""
    return cell if cell < stored else cell % stored


@loop
def sort_into_cells(long_range, sorted_position, anchor, span, grid):
    """Sort the grains by cell, and by index within a cell: fill `cell_of`, `cell_start`, `order` and `sorted_position`.

    `sorted_position` (anchors in sorted order) may be `long_range.packed_position`, which must then not be accessed by
    that name here or in `append_range` (the arguments of a kernel must not overlap).
    """
    nx, ny, nz = grid.counts
    mx, my, mz = grid.stored
    total = mx * my * mz
    for c in range(total + 1):
        long_range.cell_start[c] = 0
    for i in range(anchor.shape[1]):
        x = cell_coordinates(grid, on_spacings(nearest_image(load(anchor, i), span), grid.spacings))
        row = place_of(cell_index(x[2], nz), mz) * my + place_of(cell_index(x[1], ny), my)
        cell = row * mx + place_of(cell_index(x[0], nx), mx)
        long_range.cell_of[i] = cell
        long_range.cell_start[cell + 1] += 1
    for c in range(total):
        long_range.cell_start[c + 1] += long_range.cell_start[c]
    # counting sort: cell_start[c] is the index of the next grain of cell c, and is restored afterwards
    for i in range(anchor.shape[1]):
        cell = long_range.cell_of[i]
        s = long_range.cell_start[cell]
        long_range.order[s] = i
        put(sorted_position, s, on_spacings(nearest_image(load(anchor, i), span), grid.spacings))
        long_range.cell_start[cell] += 1
    for k in range(total):
        c = total - k
        long_range.cell_start[c] = long_range.cell_start[c - 1]
    long_range.cell_start[0] = 0


@loop
def neighbour_on_axis(c, step, number, stored, period):
    """Place of the cell at distance `step` and its shift [m], 0 or ±`period`; −1 where no cell is at that distance.

    There is none beyond the end of an open axis, whose period is 0, nor on an undivided one.
    """
    other = c + step
    if 0 <= other < number:
        return place_of(other, stored), 0.0
    if period == 0.0 or number == 1:
        return -1, 0.0
    return (0, period) if other >= number else (stored - 1, -period)


@loop
def gap_on_axis(x, c, step, width):
    """Lower bound of the distance [m] between a coordinate, in units of cells, and the cell at distance `step`."""
    gap = c + 1.0 - x if step > 0 else x - c
    return max(0.0, gap - CELL_TOLERANCE) * width if step != 0 else 0.0


def _moved(position, x, shifts, grid, span):
    return (position[0], position[1] - shifts[0], position[2] - shifts[1]), x


@unless_straight(_moved)
def beside_neighbours(position, x, shifts, grid, span):
    """Position [m], and coordinate x in units of cells, of a grain beside neighbours beyond faces; `shifts` along y, z.

    In a tilted box, images beyond a face along z are displaced along x by the tilt, which is on the spacings as
    coordinates are.  Where x is divided, the position is wrapped.
    """
    steps = np.rint(shifts[1] * span.inverse_z)
    along = position[0] - steps * np.rint(span.tilt / grid.spacings[0]) * grid.spacings[0]
    if grid.counts[0] > grid.subdivision:
        along -= grid.periods[0] * np.rint(along * span.inverse_x)
    return (along, position[1] - shifts[0], position[2] - shifts[1]), (along - grid.low[0]) * grid.per_length[0]


class Centre(NamedTuple):
    """A grain whose neighbours are sought."""

    s: Any  # its sorted index, uint64
    position: Any  # [m], shifted by whole box lengths to where its neighbours are
    limit: Any  # squared reach [m²]


@loop
def append_range(long_range, sorted_position, span, folded, centre, cells, used):
    """Append the sorted indices of the neighbours of a `Centre` in a range of cells; returns the new length, or FULL.

    A loop that vectorises first computes as integers whether pairs are within reach.  Then each index is written, and
    the length is increased by that integer: without branches.  Separations of i and j have equal magnitudes to the last
    bit, because sums of coordinates and box lengths are exact: both rows contain the pair, or neither.
    """
    s, own_position, limit = centre
    first, last = np.uint64(long_range.cell_start[cells[0]]), np.uint64(long_range.cell_start[cells[1]])
    length = last - first
    if used + np.int64(length) + SIMD_WIDTH > long_range.neighbour.size:  # one entry more than neighbours is written
        return FULL
    padded = min(round_up_to_simd_width(length, np.uint64(1)), np.uint64(long_range.order.size) - first)
    if folded:
        for k in range(padded):
            separation = nearest_image(sub(own_position, load(sorted_position, first + k)), span)
            long_range.near[k] = np.int64(dot(separation, separation) < limit)
    else:
        for k in range(padded):
            separation = sub(own_position, load(sorted_position, first + k))
            long_range.near[k] = np.int64(dot(separation, separation) < limit)
    if first <= s < last:
        long_range.near[s - first] = 0
    next_entry = np.uint64(used)
    for k in range(length):
        long_range.neighbour[next_entry] = first + k
        next_entry += np.uint64(long_range.near[k])
    return np.int64(next_entry)


class CellRow(NamedTuple):
    """A row of cells along x, in which a grain has neighbours."""

    x: float  # coordinate of the grain, in units of cells
    first: int  # place of its first cell
    squared_half_width: float  # largest squared distance of neighbours along x [m²]


@loop
def append_cell_row(long_range, sorted_position, span, grid, centre, row, used):
    """Append the neighbours of a `Centre` in a row of cells (`CellRow`); returns the new length, or FULL.

    Candidates lie within ±√squared_half_width [m] along x; across a periodic boundary, or where the places of cells
    begin anew, they form a second range.  On a periodic axis shorter than three times the reach all grains are
    candidates.
    """
    nx, mx, period = grid.counts[0], grid.stored[0], grid.periods[0]
    if period > 0.0 and nx == grid.subdivision:
        return append_range(long_range, sorted_position, span, grid.folded, centre, (row.first, row.first + nx), used)
    half_width, cell = math.sqrt(row.squared_half_width) * grid.per_length[0] + CELL_TOLERANCE, cell_index(row.x, nx)
    # at most the cells within the reach: in a box of three, one more would be visited from both sides;
    # at least one cell, even if a coordinate is NaN
    low = min(max(math.floor(row.x - half_width), cell - grid.subdivision), cell)
    high = max(min(math.floor(row.x + half_width), cell + grid.subdivision), cell)
    if period == 0.0:
        low, high = max(low, 0), min(high, nx - 1)
    x, y, z = centre.position
    start = cell - place_of(cell, mx)  # cells `start` to `start` + mx − 1 have the places 0 to mx − 1
    first, last = max(low, start), min(high, start + mx - 1)
    for _ in range(2):
        shift = period if first < 0 else -period if first >= nx else 0.0
        shifted = Centre(centre.s, (x + shift, y, z), centre.limit)
        cells = row.first + first - start, row.first + last + 1 - start
        used = append_range(long_range, sorted_position, span, grid.folded, shifted, cells, used)
        if used == FULL or (low >= start and high < start + mx):
            break
        first, last, start = (low, start - 1, start - mx) if low < start else (start + mx, high, start + mx)
    return used


@rare
def build_grid(long_range, sorted_position, anchor, span, reach):
    """Choose a grid for these anchors and sort the grains into its cells."""
    grid = choose_grid(anchor, span, reach)
    sort_into_cells(long_range, sorted_position, anchor, span, grid)
    return grid


@rare
def append_neighbours(long_range, sorted_position, grid, span, reach, s, used):
    """Append the sorted indices of all neighbours of s within the reach to `neighbour`, after the first `used` entries.

    `near` serves as a buffer.

    Parameters
    ----------
    long_range : LongRangeArrays
        Arrays of the list.
    sorted_position : ndarray
        (3, N) anchors in sorted order [m], from `build_grid`.
    grid : Grid
        The cells.
    span : Span
        The box.
    reach : float
        Largest distance of neighbours [m].
    s : int
        Sorted index of the grain.
    used : int
        Present length of the list.

    Returns
    -------
    int
        New length of the list, or FULL.
    """
    _, ny, nz = grid.counts
    mx, my, mz = grid.stored
    squared_reach = (1.0 + REACH_TOLERANCE) * reach * reach
    position = load(sorted_position, s)
    x = cell_coordinates(grid, position)
    cy, cz = cell_index(x[1], ny), cell_index(x[2], nz)
    for dz in range(-1, 2):
        tz, shift_z = neighbour_on_axis(cz, dz, nz, mz, grid.periods[2])
        gap_z = gap_on_axis(x[2], cz, dz, grid.width_z)
        for dy in range(-1, 2):
            ty, shift_y = neighbour_on_axis(cy, dy, ny, my, grid.periods[1])
            gap_y = gap_on_axis(x[1], cy, dy, grid.width_y)
            squared_half_width = squared_reach - gap_y * gap_y - gap_z * gap_z
            if ty >= 0 and tz >= 0 and squared_half_width > 0.0:
                shifted, along = beside_neighbours(position, x[0], (shift_y, shift_z), grid, span)
                row = CellRow(along, (tz * my + ty) * mx, squared_half_width)
                centre = Centre(np.uint64(s), shifted, reach * reach)
                used = append_cell_row(long_range, sorted_position, span, grid, centre, row, used)
                if used == FULL:
                    return FULL
    return used


@rare
def list_from_anchors(long_range, span, reach):
    """Build the Verlet list from the anchors alone; returns its length, or FULL.

    A row depends on the previous rows only through its start.  Blocks of rows could therefore be built in parallel,
    each with a distance buffer of its own, and be concatenated.
    """
    grid = build_grid(long_range, long_range.packed_position, long_range.anchor, span, reach)
    used = 0
    long_range.start[0] = 0
    for s in range(long_range.anchor.shape[1]):
        used = append_neighbours(long_range, long_range.packed_position, grid, span, reach, s, used)
        if used == FULL:
            return FULL
        long_range.start[s + 1] = used
    return used


@rare
def build_verlet_list(grains, long_range, count, span, search):
    """Build the Verlet list from the present positions; returns 0, or FULL."""
    for i in range(grains.mass.size):
        put(long_range.anchor, i, load(grains.position, i))
    store_box(long_range.built, span)
    if list_from_anchors(long_range, span, search.reach) == FULL:
        long_range.anchor[0, 0] = math.inf
        return FULL
    count[LISTED] += 1
    return 0


@stage("the Verlet list")
def rebuild_verlet_list(long_range, span, reach):
    """Restore the Verlet list of an earlier run from its anchors; returns its length, or FULL."""
    return list_from_anchors(long_range, span, reach)
