"""The list of pairs that may touch soon."""

import math

import numpy as np

from ..box import nearest_image
from ..compiler.jit import loop, rare
from ..contact.pair_types import NO_KIND, kind_at, kind_of
from ..numerics.vec import dot, load, put, sub
from ..state.state import PAIRS, REBUILT, SOON, SOON_LEEWAY
from .cell_list import FULL, Grid, grid_of, list_place
from .skin import SPARED


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
def are_near(grains, span, reach, i, j):
    """True if the gap of two grains is below `reach` [m]."""
    apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
    limit = grains.radius[i] + grains.radius[j] + reach
    return dot(apart, apart) < limit * limit


@loop
def candidates(near, far, grid, span, search, k):
    """Where in `mate` the places stand that may be near place k; the numbers themselves where there are no places."""
    if search.celled:
        end = list_place(far, near.anchor, grid, span, search.reach, k, 0)
        return np.int64(0), np.int64(end)
    if search.listed:
        return np.int64(far.start[k]), np.int64(far.start[k + 1])
    return np.int64(0), np.int64(k)


@rare
def make_near_list(grains, contacts, near, far, count, span, reach, law, search):
    """List the pairs with a gap below `reach` [m], out of all pairs, of those listed already (`far`), or from cells.

    FULL if there is no room: then count[PAIRS] says for how many there should be.  ROW_FULL if the neighbours of one
    grain need more.
    """
    found, kind, room = 0, NO_KIND, near.pair.shape[1]
    placed = search.celled or search.listed
    grid = NO_GRID
    if search.celled and law.on:  # until they are set at the end, the anchors are positions by place
        grid = grid_of(far, near.anchor, grains.position, span, search.reach)
    for k in range(grains.mass.size if law.on else 0):
        first, last = candidates(near, far, grid, span, search, k)
        if last == FULL:
            near.anchor[0, 0] = math.inf
            return ROW_FULL
        i = far.order[k] if placed else np.uint32(k)
        for m in range(first, last):
            j = far.order[far.mate[m]] if placed else np.uint32(m)
            if j < i and are_near(grains, span, reach, i, j):
                if found < room:
                    kind = kind_of(grains, law, i, j, kind)
                    near.pair[0, found], near.pair[1, found] = i, j
                    near.touching[found] = 1 if in_contact(contacts, i, j) else 0
                    own = kind_at(near, found)
                    near.step[own], near.length[own] = kind.step, kind.length
                found += 1
    count[PAIRS] = found
    if found > room:
        near.anchor[0, 0] = math.inf
        return FULL
    for i in range(grains.mass.size):
        put(near.anchor, i, load(grains.position, i))
    count[REBUILT] += 1
    return found


@rare
def list_soon(grains, near, count, span, gap):
    """Pick the pairs that are apart by less than `gap` [m] out of the near ones: only they can touch for a while.

    Until a grain has gone half the gap from where it is now, it cannot bring another pair to touch.  If there is no
    room for so many, all are looked at.
    """
    found, room = 0, near.soon.size - 1
    for p in range(count[PAIRS]):
        i, j = near.pair[0, p], near.pair[1, p]
        apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
        limit = grains.radius[i] + grains.radius[j] + gap
        near.soon[min(found, room)] = p
        found += 1 if (near.touching[p] == 0) & (dot(apart, apart) < limit * limit) else 0
    near.watch[SOON] = found if found <= room else count[PAIRS]
    near.watch[SOON_LEEWAY] = SPARED * 0.5 * gap
