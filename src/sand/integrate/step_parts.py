"""What the steps of the driver are made of: lists, contacts, outside forces, gas."""

import functools
import math
from collections.abc import Callable

from ..box import nearest_image
from ..compiler.jit import loop, rare
from ..contact.events import book_stiffness, damp_contacts, drop_broken, make_contacts, settle_flagged
from ..contact.gather import sort_sides
from ..contact.update import contact_step
from ..forces.external.loops import outside_energy, outside_wrap
from ..forces.gas.loops import gas_kick
from ..neighbours.cell_list import FULL, make_far_list
from ..neighbours.pair_list import ROW_FULL, list_soon, make_near_list
from ..neighbours.skin import is_stale, look_up_harmless, look_up_speeds
from ..numerics.vec import dot, load, sub
from ..state.state import (
    CONTACTS,
    CYCLE,
    FAR_LEEWAY,
    FASTEST,
    GAS,
    GRAIN1,
    GRAIN2,
    KICKED,
    LEFT,
    NEAR_LEEWAY,
    OUTSIDE,
    QUICKEST,
    SOON_LEEWAY,
    STEP,
    STEPS,
    TIME,
)
from .kernel_spec import Stop
from .respa import clear_rates, remember, set_paces
from .step_control import CHECK_EVERY, choose_step, name_culprits

LONGEST_TURN = 0.5
"""Largest turn in one step [rad] for which `rotation.turn` is sound."""
SOON_PART = 0.05
"""Way, in the reach of the list of near pairs, after which those that may touch soon are picked out anew."""


@loop
def _moves_too_far(fastest, quickest, reach, dt):
    """Why no step of dt is taken at squares of speed and spin: farther than half the smallest radius, or a turn."""
    flown, turned = dt * dt * fastest > 0.25 * reach * reach, dt * dt * quickest > LONGEST_TURN**2
    return Stop.FLEW_TOO_FAR if flown else Stop.SPUN_TOO_FAR if turned else Stop.STEPS_DONE


@rare
def _stray(grains, reach, dt, stop):
    """The first grain that moves too far in the way that this stop tells."""
    for i in range(grains.mass.size):
        v, w = load(grains.velocity, i), load(grains.spin, i)
        if _moves_too_far(dot(v, v), dot(w, w), reach, dt) == stop:
            return i
    return -1


@loop
def _crushed(grains, contacts, count, span):
    """The first contact in which a centre lies inside the other grain, or −1."""
    for c in range(count[CONTACTS]):
        i, j = contacts.pair[0, c], contacts.pair[1, c]
        apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
        limit = max(grains.radius[i], grains.radius[j])
        if dot(apart, apart) < limit * limit:
            return c
    return -1


@loop
def possible_step(grains, contacts, near, far, clock, count, rules):
    """The step to take now [s], and STEPS_DONE or why there is none."""
    count[GRAIN1] = count[GRAIN2] = -1
    look_up_speeds(grains, near)
    dt = choose_step(grains, far, contacts.start, near, clock, count, rules.span, rules.control)
    if not dt > 0.0:
        return 0.0, Stop.NOT_FINITE
    if clock[LEFT] > 0.0:  # inside a cycle: whole steps that fill it
        dt = clock[LEFT] / math.ceil(clock[LEFT] / dt - 1e-6)
    if clock[TIME] + dt == clock[TIME]:
        name_culprits(grains, far, contacts.start, near, count, rules.span, rules.control)
        return 0.0, Stop.NO_STEP
    stop = _moves_too_far(near.watch[FASTEST], near.watch[QUICKEST], rules.control.reach, dt)
    if stop != Stop.STEPS_DONE:
        count[GRAIN1] = _stray(grains, rules.control.reach, dt, stop)
        return 0.0, stop
    if count[STEPS] % CHECK_EVERY == 0:
        c = _crushed(grains, contacts, count, rules.span)
        if c >= 0:
            count[GRAIN1], count[GRAIN2] = contacts.pair[0, c], contacts.pair[1, c]
            return 0.0, Stop.CRUSHED
    return dt, Stop.STEPS_DONE


@loop
def update_lists(grains, contacts, near, far, count, rules):
    """Make anew the lists that are too old for what this step needs; FULL stops ask for longer arrays."""
    span, search, reach = rules.span, rules.search, rules.control.reach
    stale = rules.contact.on and is_stale(grains, near.anchor, span, 0.25 * reach, near.watch, NEAR_LEEWAY)
    old = search.listed and is_stale(grains, far.anchor, span, 0.5 * search.margin, near.watch, FAR_LEEWAY)
    if old and make_far_list(grains, far, count, span, search) == FULL:
        return Stop.LIST_FULL, stale
    if stale:
        made = make_near_list(grains, contacts, near, far, count, span, reach, rules.contact, search)
        if made == FULL:
            return Stop.PAIRS_FULL, stale
        if made == ROW_FULL:
            return Stop.LIST_FULL, stale
        look_up_harmless(near, count)
    # written so that what is no number is spent
    if rules.contact.on and (stale or not near.watch[SOON_LEEWAY] > 0.0):
        list_soon(grains, near, count, span, 2.0 * SOON_PART * reach)
    return Stop.STEPS_DONE, stale


@loop
def update_contacts(grains, contacts, near, clock, count, lost, rules, stale, fresh, flagged):
    """Contacts beyond a limit break or move, `fresh` new ones form.  True if any broke."""
    span, law, dt = rules.span, rules.contact, clock[STEP]
    if law.follow:
        book_stiffness(grains, contacts, count, lost, span, dt)
    parted = flagged and settle_flagged(grains, contacts, near, count, lost, span, law, dt)
    if law.damped:
        damp_contacts(grains, contacts, count, lost, span, dt)
    if fresh > 0:
        make_contacts(grains, contacts, near, count, lost, clock, span, law, dt)
    if fresh > 0:
        sort_sides(contacts, count, grains.mass.size)
    if fresh > 0 or stale:
        contact_step(contacts, near, count, grains.mass.size, clock, law.per_period)
    return parted


@loop
def bury_broken(grains, contacts, near, clock, count, rules):
    """Take broken contacts out of the arrays; until now they stood there without loads."""
    drop_broken(contacts, count)
    sort_sides(contacts, count, grains.mass.size)
    contact_step(contacts, near, count, grains.mass.size, clock, rules.contact.per_period)


@functools.cache
def drift_booked_for(outside: Callable, drift: Callable) -> Callable:
    """Half a kick and a drift, with what time and boundaries do to the energy of the per-grain forces."""
    energy, wrap = outside_energy(outside), outside_wrap(outside)

    @loop
    def drift_booked(grains, contacts, far, clock, count, lost, rules, dt):
        now, then = clock[TIME], clock[TIME] + dt
        gained = 0.0
        if rules.books.timed:
            gained += 0.5 * (energy(grains, then, rules.outside) - energy(grains, now, rules.outside))
        way = drift(grains, contacts, far, count, rules, dt)
        if rules.books.timed:
            gained += 0.5 * (energy(grains, then, rules.outside) - energy(grains, now, rules.outside))
        if rules.books.moored:
            gained += wrap(grains, rules.span, then, rules.outside)
        lost[OUTSIDE] -= gained
        return way

    return drift_booked


@loop
def no_rates(grains, contacts, far, clock, rules, cycle):
    pass


@functools.cache
def rates_loop(sum_rates: Callable) -> Callable:
    """The loop that prepares the Taylor series at the begin of a cycle of `cycle` seconds."""

    @loop
    def set_rates(grains, contacts, far, clock, rules, cycle):
        if cycle > 0.0:
            # a mean over much less time than what is to be foretold is no drift
            past = clock[CYCLE] if clock[CYCLE] >= 0.5 * cycle else 0.0
            set_paces(grains, far, contacts.start, rules.span, past, rules.beat.literal)
            clear_rates(far)
            sum_rates(grains, far, rules.span, rules.far)
        remember(grains, far)

    return set_rates


@loop
def no_gas(grains, clock, count, lost, rules):
    pass


@loop
def stir_gas(grains, clock, count, lost, rules):
    """Drag and kicks for the time since the last ones, at the step or cycle that ends nearest to a period of it."""
    elapsed = clock[TIME] - clock[KICKED]
    if elapsed + 0.5 * max(clock[STEP], clock[CYCLE]) >= rules.gas.period:
        lost[GAS] += gas_kick(grains, rules.gas.seed, count[STEPS], elapsed, rules.gas.gas)
        clock[KICKED] = clock[TIME]
