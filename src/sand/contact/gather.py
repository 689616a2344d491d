"""Loads of contacts summed up at their grains, in a fixed order.

Grains have few contacts, some more and some less, and the processor guesses how many.  Its branch predictor learns the
numbers of a thousand grains, but not of ten thousand.  There, within blocks of neighbours in memory, those with equally
many come in a row.
"""

import math

from ..compiler.jit import kernel, loop, rare
from ..numerics.vec import add, load, put, sub
from ..state.arrays import GATHER_CLASSES
from ..state.state import CONTACTS

BLOCK = 64
"""Grains in a block; their contacts stay in the first cache."""
LARGEST_CLASS = math.isqrt(GATHER_CLASSES) - 1
"""Grains that are the first, or the second, of so many contacts or more are not told apart."""
DENSE_FROM = 3
"""Contacts per grain from which most grains have equally many, as they are numbered."""


@loop
def _gather_at(grains, contacts, g):
    force = torque = (0.0, 0.0, 0.0)
    for s in range(contacts.start[g], contacts.start[g + 1]):
        c = contacts.side[s] >> 1
        if contacts.side[s] & 1:
            force = sub(force, load(contacts.push, c))
            torque = add(torque, load(contacts.torque2, c))
        else:
            force = add(force, load(contacts.push, c))
            torque = add(torque, load(contacts.torque1, c))
    put(grains.force, g, force)
    put(grains.torque, g, torque)


@loop
def gather_in_index_order(grains, contacts, first, last):
    """`gather` where grains take no turns: in small worlds."""
    for k in range(last - first):
        _gather_at(grains, contacts, first + k)


@loop
def gather(grains, contacts, first, last):
    """Set force and torque of the grains first…last − 1 (uint64) to the sum over their contacts, in a fixed order.

    Both ends are multiples of BLOCK, but for the last grain of all.
    """
    if contacts.gather_order.size > 0:
        for k in range(last - first):
            _gather_at(grains, contacts, contacts.gather_order[first + k])
    else:
        gather_in_index_order(grains, contacts, first, last)


@rare
def sort_contacts_by_grain(contacts, count, n):
    """Rebuild the list of contacts per grain: first those that it is grain 1 of, each in the order of the contacts."""
    total = count[CONTACTS]
    start, side = contacts.start, contacts.side
    for g in range(n + 1):
        start[g] = 0
    for c in range(total):
        start[contacts.pair[0, c] + 1] += 1
        start[contacts.pair[1, c] + 1] += 1
    for g in range(n):
        start[g + 1] += start[g]
    # fill from the back, so that `start` ends where it should
    for end in range(2):
        for k in range(total):
            c = total - 1 - k
            g = contacts.pair[1 - end, c]
            start[g + 1] -= 1
            side[start[g + 1]] = 2 * c + 1 - end
    for g in range(n):
        start[g] = start[g + 1]
    start[n] = 2 * total
    if contacts.gather_order.size > 0:
        _set_gather_order(contacts, n, total)


@loop
def _gather_class(contacts, g):
    """A number for how many contacts grain g has, as the first and as the second of the two."""
    firsts = 0
    for s in range(contacts.start[g], contacts.start[g + 1]):
        firsts += 1 - int(contacts.side[s] & 1)
    seconds = int(contacts.start[g + 1]) - int(contacts.start[g]) - firsts
    return min(firsts, LARGEST_CLASS) * (LARGEST_CLASS + 1) + min(seconds, LARGEST_CLASS)


@loop
def _set_gather_order(contacts, n, total):
    """Fill `turn`: the grains of each block by their kind; by their numbers where contacts are many."""
    turn = contacts.gather_order
    for first in range(0, n, BLOCK):
        last = min(first + BLOCK, n)
        for g in range(first, last):
            turn[g] = g
        if total < DENSE_FROM * n:
            # the places behind all grains count the pair_type_count, and then say where the next of each goes
            for k in range(GATHER_CLASSES):
                turn[n + k] = 0
            for g in range(first, last):
                turn[n + _gather_class(contacts, g)] += 1
            place = first
            for k in range(GATHER_CLASSES):
                place, turn[n + k] = place + int(turn[n + k]), place
            for g in range(first, last):
                kind = _gather_class(contacts, g)
                turn[turn[n + kind]] = g
                turn[n + kind] += 1


@kernel
def resort_contacts_by_grain(contacts, count, n):
    """The same, from Python."""
    sort_contacts_by_grain(contacts, count, n)
