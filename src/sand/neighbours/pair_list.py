"""The list of pairs that may touch soon."""

import math
from typing import Any, NamedTuple

import numpy as np

from ..box import nearest_image
from ..compiler.jit import loop, rare
from ..contact.law import Pairing, bond_between
from ..contact.pair_types import kind_at
from ..numerics.vec import dot, load, put, sub
from ..state.state import PAIRS, REBUILT, SOON, SOON_LEEWAY
from .cell_list import FULL, Grid, grid_of, list_place
from .skin import SPARED


@loop
def pairing_of(pairings, a, b):
    """What materials a and b make together, from the (10, M, M) table."""
    return Pairing(
        pairings[0, a, b],
        pairings[1, a, b],
        pairings[2, a, b],
        pairings[3, a, b],
        pairings[4, a, b],
        pairings[5, a, b],
        pairings[6, a, b],
        pairings[7, a, b],
        pairings[8, a, b],
        pairings[9, a, b],
    )


@loop
def bond_of(grains, pairings, i, j):
    """The constants of a contact between grains i and j."""
    pairing = pairing_of(pairings, grains.material[i], grains.material[j])
    return bond_between(pairing, grains.radius[i], grains.radius[j], grains.mass[i], grains.mass[j])


@loop
def in_contact(contacts, i, j):
    """True if grains i and j share a contact."""
    for s in range(contacts.start[i], contacts.start[i + 1]):
        c = contacts.side[s] >> 1
        if contacts.pair[0, c] == j or contacts.pair[1, c] == j:
            return True
    return False


class Kind(NamedTuple):
    """What the constants of a pair's contact depend on, and what the list keeps of them."""

    grains: Any  # material, radius [m] and mass [kg] of each
    step: Any  # the step that a contact needs [s]
    length: Any  # δ at which it breaks [m]


ROW_FULL = -2
"""Answer of the maker of the list of near pairs when there is no room for the neighbours of one grain."""
NO_GRID = Grid((0, 0, 0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0, 0.0, 0.0)
NO_GRAIN = (np.uint32(0), -1.0, -1.0)
NO_KIND = Kind((NO_GRAIN, NO_GRAIN), 0.0, 0.0)


@loop
def make_of(grains, i):
    """All that the bonds of grain i depend on."""
    return grains.material[i], grains.radius[i], grains.mass[i]


@loop
def kind_of(grains, law, i, j, last):
    """The kind of a pair: the `last` one if it is the same, as its powers cost more than all else."""
    a, b = make_of(grains, i), make_of(grains, j)
    if (a, b) == last.grains:
        return last
    bond = bond_of(grains, law.pairings, i, j)
    return Kind((a, b), 2.0 * math.pi / math.sqrt(bond.fastest) / law.per_period, bond.break_overlap)


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


@loop
def all_may_touch(near, count):
    """Are all near pairs to be looked at, instead of the first watch[SOON] of `soon`?"""
    return near.watch[SOON] == count[PAIRS]


@rare
def forget_touch(near, count, i, j):
    """Mark the pair (i, j) of the list as no longer in contact; it may touch again soon."""
    near.watch[SOON_LEEWAY] = 0.0
    for p in range(count[PAIRS]):
        a, b = near.pair[0, p], near.pair[1, p]
        if (a == i and b == j) or (a == j and b == i):
            near.touching[p] = 0
            return
