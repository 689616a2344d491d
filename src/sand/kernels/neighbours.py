"""The list of pairs that may touch soon."""

import math

from ..core.box import nearest_image
from ..core.jit import loop, rare
from ..core.vec import dot, load, put, sub
from ..core.world import PAIRS, REBUILT
from ..physics.contact import Pairing, bond_between

FULL = -1
"""Answer of `make_list` when the arrays are too short."""


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
def list_is_stale(grains, near, span, reach):
    """True once a grain has moved a quarter of `reach` [m] since the list was made.

    Two grains then close in by at most half of it; the other half is the next step's, so that no pair can
    touch before it is listed.
    """
    limit = (0.25 * reach) ** 2
    strayed = 0.0
    for i in range(grains.mass.size):
        moved = nearest_image(sub(load(grains.position, i), load(near.anchor, i)), span)
        # written so that an anchor at infinity (no list yet) counts as strayed
        strayed += 0.0 if dot(moved, moved) <= limit else 1.0
    return strayed > 0.0


@loop
def in_contact(contacts, i, j):
    """True if grains i and j share a contact."""
    for s in range(contacts.start[i], contacts.start[i + 1]):
        c = contacts.side[s] >> 1
        if contacts.pair[0, c] == j or contacts.pair[1, c] == j:
            return True
    return False


@rare
def make_list(grains, contacts, near, count, span, reach, law):
    """List all pairs with a gap below `reach` [m]; all pairs are looked at.  FULL if there is no room."""
    found = 0
    for i in range(grains.mass.size if law.on else 0):
        here, r1 = load(grains.position, i), grains.radius[i]
        for j in range(i):
            apart = nearest_image(sub(here, load(grains.position, j)), span)
            limit = r1 + grains.radius[j] + reach
            if dot(apart, apart) < limit * limit:
                if found == near.pair.shape[1]:
                    return FULL
                near.pair[0, found] = i
                near.pair[1, found] = j
                near.touching[found] = 1 if in_contact(contacts, i, j) else 0
                bond = bond_of(grains, law.pairings, i, j)
                near.step[found] = 2.0 * math.pi / math.sqrt(bond.fastest) / law.per_period
                near.length[found] = bond.break_overlap
                found += 1
    for i in range(grains.mass.size):
        put(near.anchor, i, load(grains.position, i))
    count[PAIRS] = found
    count[REBUILT] += 1
    return found


@rare
def forget_touch(near, count, i, j):
    """Mark the pair (i, j) of the list as no longer in contact."""
    for p in range(count[PAIRS]):
        a, b = near.pair[0, p], near.pair[1, p]
        if (a == i and b == j) or (a == j and b == i):
            near.touching[p] = 0
            return
