"""Contact forces, second pass: a loop over grains that sums the loads of their contacts in a fixed order.

The inner loop has one iteration per contact of a grain.  The branch predictor of a processor learns the contact counts
of a thousand grains, but not of ten thousand.  From `GATHER_ORDER_FROM` grains on, each block of grains is therefore
sorted by contact count.
"""

import math

import numpy as np

from ..basics.arrays import GATHER_CLASSES
from ..basics.state import CONTACTS
from ..compiler.jit import loop, rare
from ..compiler.stage import stage
from ..numerics.vec import add, load, put, sub

GRAINS_AT_ONCE = 64
"""Grains per block; the contacts of a block stay in the first-level cache."""
LARGEST_CLASS = math.isqrt(GATHER_CLASSES) - 1
"""Contact counts of this number and more, separately as grain 1 and as grain 2, share a class."""
DENSE_FROM = 3
"""Number of contacts over number of grains, half the mean coordination number, from which most grains have equally
many contacts, so that sorting saves no time; the two sides of contacts are then summed in loops of their own."""


@loop
def _gather_at(grains, contacts, g):
    """Set force and torque of grain g to the sums over its contacts."""
    force = torque = (0.0, 0.0, 0.0)
    # an unsigned index cannot count from the end, which need not be checked
    for s in range(contacts.start[g], contacts.start[g + np.uint64(1)]):
        c = contacts.side[s] >> 1
        if contacts.side[s] & 1:
            force = sub(force, load(contacts.force, c))
            torque = add(torque, load(contacts.torque2, c))
        else:
            force = add(force, load(contacts.force, c))
            torque = add(torque, load(contacts.torque1, c))
    put(grains.force, g, force)
    put(grains.torque, g, torque)


@loop
def _gather_sides_apart(grains, contacts, g):
    """As `_gather_at`, with the same sums, in one loop over contacts as grain 1 and one over those as grain 2."""
    force = torque = (0.0, 0.0, 0.0)
    s, end = np.uint64(contacts.start[g]), np.uint64(contacts.start[g + np.uint64(1)])
    while s < end and contacts.side[s] & 1 == 0:
        force = add(force, load(contacts.force, contacts.side[s] >> 1))
        torque = add(torque, load(contacts.torque1, contacts.side[s] >> 1))
        s += np.uint64(1)
    while s < end:
        force = sub(force, load(contacts.force, contacts.side[s] >> 1))
        torque = add(torque, load(contacts.torque2, contacts.side[s] >> 1))
        s += np.uint64(1)
    put(grains.force, g, force)
    put(grains.torque, g, torque)


@loop
def gather_in_index_order(grains, contacts, first, last):
    """`gather` without a gather order, for small systems."""
    for k in range(last - first):
        _gather_at(grains, contacts, first + k)


@loop
def gather_few(grains, contacts, first, last):
    """`gather` where most grains have no contacts: all loads are set to 0 in a loop that vectorises, few are summed."""
    for k in range(last - first):
        put(grains.force, first + k, (0.0, 0.0, 0.0))
        put(grains.torque, first + k, (0.0, 0.0, 0.0))
    begin = contacts.start[first]
    for k in range(last - first):
        end = contacts.start[first + k + np.uint64(1)]
        if end > begin:
            _gather_at(grains, contacts, first + k)
        begin = end


@loop
def _sides_of(contacts, first, last):
    """Number of contacts of each of the grains first … last − 1 (uint64), added up."""
    return int(contacts.start[last]) - int(contacts.start[first])


@loop
def gather(grains, contacts, first, last):
    """Set force and torque of the grains first … last − 1 (uint64) to the sums over their contacts, in a fixed order.

    `first` and `last` are multiples of GRAINS_AT_ONCE, except where `last` is the number of grains.
    """
    sides, number = _sides_of(contacts, first, last), int(last - first)
    if 2 * sides < number:  # at least half of the grains have no contacts
        gather_few(grains, contacts, first, last)
    elif sides >= 2 * DENSE_FROM * number:
        for k in range(last - first):
            _gather_sides_apart(grains, contacts, first + k)
    elif contacts.gather_order.size > 0:
        for k in range(last - first):
            _gather_at(grains, contacts, contacts.gather_order[first + k])
    else:
        gather_in_index_order(grains, contacts, first, last)


@rare
def sort_contacts_by_grain(contacts, count, n):
    """Rebuild the list of contacts per grain in compressed sparse row form (`start`, `side`).

    The contacts of which a grain is grain 1 come first, each group in the order of the contacts.
    """
    total = count[CONTACTS]
    start, side = contacts.start, contacts.side
    for g in range(n + 1):
        start[g] = 0
    for c in range(total):
        start[contacts.pair[0, c] + 1] += 1
        start[contacts.pair[1, c] + 1] += 1
    for g in range(n):
        start[g + 1] += start[g]
    # fill from the back, which moves each `start` to the first entry of its grain
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
    """Class of grain g: its contact counts as grain 1 and as grain 2, combined into one integer."""
    firsts = 0
    for s in range(contacts.start[g], contacts.start[g + 1]):
        firsts += 1 - int(contacts.side[s] & 1)
    seconds = int(contacts.start[g + 1]) - int(contacts.start[g]) - firsts
    return min(firsts, LARGEST_CLASS) * (LARGEST_CLASS + 1) + min(seconds, LARGEST_CLASS)


@loop
def _set_gather_order(contacts, n, total):
    """Fill `gather_order`: the grains of each block sorted by class, or by index where contacts are many."""
    order = contacts.gather_order
    for first in range(0, n, GRAINS_AT_ONCE):
        last = min(first + GRAINS_AT_ONCE, n)
        for g in range(first, last):
            order[g] = g
        if total < DENSE_FROM * n:
            # counting sort: the last GATHER_CLASSES entries count grains per class, then hold the next index of each
            for k in range(GATHER_CLASSES):
                order[n + k] = 0
            for g in range(first, last):
                order[n + _gather_class(contacts, g)] += 1
            index = first
            for k in range(GATHER_CLASSES):
                index, order[n + k] = index + int(order[n + k]), index
            for g in range(first, last):
                gather_class = _gather_class(contacts, g)
                order[order[n + gather_class]] = g
                order[n + gather_class] += 1


@stage("the order of contacts")
def resort_contacts_by_grain(grains, contacts, count):
    """`sort_contacts_by_grain` as a stage."""
    sort_contacts_by_grain(contacts, count, grains.mass.size)
    return 0
