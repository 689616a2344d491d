"""The list of pairs that may touch soon."""

import math

import numpy as np

from ..box import nearest_image
from ..compiler.jit import loop, rare
from ..contact.pair_types import NO_PAIR_TYPE, pair_type_index, pair_type_of
from ..numerics.vec import dot, load, put, sub
from ..state.state import INNER_COUNT, INNER_SKIN, PAIRS, REBUILT
from .cell_list import FULL, Grid, grid_of, list_place
from .skin import SKIN_SAFETY


@loop
def in_contact(contacts, i, j):
    """True if grains i and j share a contact."""
    for s in range(contacts.start[i], contacts.start[i + 1]):
        c = contacts.side[s] >> 1
        if contacts.pair[0, c] == j or contacts.pair[1, c] == j:
            return True
    return False


ROW_FULL = -2
"""Answer of the maker of the list of near pairs when there is no room for the neighbours of one grain."""
NO_GRID = Grid((0, 0, 0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0, 0.0, 0.0)


@loop
def within_reach(grains, span, reach, i, j):
    """True if the gap of two grains is below `reach` [m]."""
    apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
    limit = grains.radius[i] + grains.radius[j] + reach
    return dot(apart, apart) < limit * limit


@loop
def candidates(pair_list, long_range, grid, span, search, k):
    """Where in `mate` the places stand that may be near place k; the numbers themselves where there are no places."""
    if search.celled:
        end = list_place(long_range, pair_list.anchor, grid, span, search.reach, k, 0)
        return np.int64(0), np.int64(end)
    if search.listed:
        return np.int64(long_range.start[k]), np.int64(long_range.start[k + 1])
    return np.int64(0), np.int64(k)


@rare
def build_pair_list(grains, contacts, pair_list, long_range, count, span, reach, law, search):
    """List the pairs with a gap below `reach` [m], out of all pairs, of those listed already (`far`), or from cells.

    FULL if there is no room: then count[PAIRS] says for how many there should be.  ROW_FULL if the neighbours of one
    grain need more.
    """
    found, kind, room = 0, NO_PAIR_TYPE, pair_list.pair.shape[1]
    placed = search.celled or search.listed
    grid = NO_GRID
    if search.celled and law.on:  # until they are set at the end, the anchors are positions by place
        grid = grid_of(long_range, pair_list.anchor, grains.position, span, search.reach)
    for k in range(grains.mass.size if law.on else 0):
        first, last = candidates(pair_list, long_range, grid, span, search, k)
        if last == FULL:
            pair_list.anchor[0, 0] = math.inf
            return ROW_FULL
        i = long_range.order[k] if placed else np.uint32(k)
        for m in range(first, last):
            j = long_range.order[long_range.neighbour[m]] if placed else np.uint32(m)
            if j < i and within_reach(grains, span, reach, i, j):
                if found < room:
                    kind = pair_type_of(grains, law, i, j, kind)
                    pair_list.pair[0, found], pair_list.pair[1, found] = i, j
                    pair_list.touching[found] = 1 if in_contact(contacts, i, j) else 0
                    own = pair_type_index(pair_list, found)
                    pair_list.step[own], pair_list.length[own] = kind.step, kind.length
                found += 1
    count[PAIRS] = found
    if found > room:
        pair_list.anchor[0, 0] = math.inf
        return FULL
    for i in range(grains.mass.size):
        put(pair_list.anchor, i, load(grains.position, i))
    count[REBUILT] += 1
    return found


@rare
def build_inner_list(grains, pair_list, count, span, gap):
    """Pick the pairs that are apart by less than `gap` [m] out of the near ones: only they can touch for a while.

    Until a grain has gone half the gap from where it is now, it cannot bring another pair to touch.  If there is no
    room for so many, all are looked at.
    """
    found, room = 0, pair_list.inner.size - 1
    for p in range(count[PAIRS]):
        i, j = pair_list.pair[0, p], pair_list.pair[1, p]
        apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
        limit = grains.radius[i] + grains.radius[j] + gap
        pair_list.inner[min(found, room)] = p
        found += 1 if (pair_list.touching[p] == 0) & (dot(apart, apart) < limit * limit) else 0
    pair_list.skin[INNER_COUNT] = found if found <= room else count[PAIRS]
    pair_list.skin[INNER_SKIN] = SKIN_SAFETY * 0.5 * gap
