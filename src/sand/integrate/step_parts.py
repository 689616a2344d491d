"""Conditions of a step that the driver checks itself: whether one is possible."""

import math

from ..basics.state import CONTACTS, GRAIN1, GRAIN2, LEFT, SQUARED_SPEED, SQUARED_SPIN, STEPS, TIME
from ..compiler.jit import loop, rare
from ..neighbours.skin import update_speeds
from ..numerics.vec import dot, load, nearest_image, sub
from .parts import Stop
from .step_control import CHECK_INTERVAL, choose_step

MAX_TURN = 0.5
"""Largest rotation in one step [rad] for which `quaternion.turn` is accurate."""


@loop
def _moves_too_far(fastest, fastest_spin, max_gap, dt):
    """Value of TOO_FAST if a grain moves by over max_gap/2 per step, of SPINS_TOO_FAST if it turns by over MAX_TURN."""
    moved_too_far, turned_too_far = dt * dt * fastest > 0.25 * max_gap * max_gap, dt * dt * fastest_spin > MAX_TURN**2
    if moved_too_far:
        return Stop.TOO_FAST.value
    return Stop.SPINS_TOO_FAST.value if turned_too_far else Stop.NONE.value


@rare
def first_too_fast(grains, max_gap, dt, stop):
    """Index of the first grain for which `_moves_too_far` gives this stop, or −1."""
    for i in range(grains.mass.size):
        v, w = load(grains.velocity, i), load(grains.spin, i)
        if _moves_too_far(dot(v, v), dot(w, w), max_gap, dt) == stop:
            return i
    return -1


@loop
def _first_overcompressed(grains, contacts, count, span):
    """Index of the first contact in which the centre of one grain lies inside the other, or −1."""
    for c in range(count[CONTACTS]):
        i, j = contacts.pair[0, c], contacts.pair[1, c]
        apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
        limit = max(grains.radius[i], grains.radius[j])
        if dot(apart, apart) < limit * limit:
            return c
    return -1


@loop
def possible_step(grains, contacts, pair_list, long_range, clock, count, span, criteria):
    """The next step [s] and the value of `Stop.NONE`, or a step [s] and the reason why it is not possible.

    GRAIN1 and GRAIN2 are set only to grains that are too close; `stages.explain_stop` finds those of other reasons.
    """
    count[GRAIN1] = count[GRAIN2] = -1
    update_speeds(grains, pair_list)
    dt = choose_step(grains, long_range, contacts.start, pair_list, clock, count, span, criteria)
    if not dt > 0.0:
        return 0.0, Stop.NOT_FINITE.value
    if clock[LEFT] > 0.0:  # within a cycle: equal steps that fill it
        dt = clock[LEFT] / math.ceil(clock[LEFT] / dt - 1e-6)
    if clock[TIME] + dt == clock[TIME]:
        return 0.0, Stop.NO_STEP.value
    stop = _moves_too_far(pair_list.skin[SQUARED_SPEED], pair_list.skin[SQUARED_SPIN], criteria.pair_gap, dt)
    if stop != Stop.NONE.value:
        return dt, stop
    if count[STEPS] % CHECK_INTERVAL == 0:
        c = _first_overcompressed(grains, contacts, count, span)
        if c >= 0:
            count[GRAIN1], count[GRAIN2] = contacts.pair[0, c], contacts.pair[1, c]
            return 0.0, Stop.OVERCOMPRESSED.value
    return dt, Stop.NONE.value
