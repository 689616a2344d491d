"""What the steps of the driver are made of: lists, contacts, outside forces, gas."""

import functools
import math
from collections.abc import Callable

from ..box import nearest_image
from ..compiler.jit import loop, rare
from ..contact.events import compact_contacts, damp_contacts, log_stiffness_work, make_contacts, update_flagged_contacts
from ..contact.gather import sort_contacts_by_grain
from ..contact.update import contact_step
from ..forces.external.loops import external_energy, external_wrap
from ..forces.gas.loops import gas_kick
from ..neighbours.cell_list import FULL, build_verlet_list
from ..neighbours.pair_list import ROW_FULL, build_inner_list, build_pair_list
from ..neighbours.skin import list_is_stale, update_safe_speed, update_speeds
from ..numerics.vec import dot, load, sub
from ..state.state import (
    CONTACTS,
    CYCLE,
    GAS,
    GRAIN1,
    GRAIN2,
    INNER_SKIN,
    KICKED,
    LARGEST_SPEED,
    LARGEST_SPIN,
    LEFT,
    LONG_RANGE_SKIN,
    OUTSIDE,
    PAIR_LIST_SKIN,
    STEP,
    STEPS,
    TIME,
)
from .kernel_spec import Stop
from .respa import clear_rates, set_mean_velocities, store_positions
from .step_control import CHECK_EVERY, choose_step, find_limiting_grains

LONGEST_TURN = 0.5
"""Largest turn in one step [rad] for which `rotation.turn` is sound."""
INNER_SKIN_FRACTION = 0.05
"""Way, in the reach of the list of near pairs, after which those that may touch soon are picked out anew."""


@loop
def _moves_too_far(fastest, fastest_spin, reach, dt):
    """Why no step of dt is taken at squares of speed and spin: farther than half the smallest radius, or a turn."""
    flown, turned = dt * dt * fastest > 0.25 * reach * reach, dt * dt * fastest_spin > LONGEST_TURN**2
    return Stop.TOO_FAST if flown else Stop.SPINS_TOO_FAST if turned else Stop.STEPS_DONE


@rare
def _first_too_fast(grains, reach, dt, stop):
    """The first grain that moves too far in the way that this stop tells."""
    for i in range(grains.mass.size):
        v, w = load(grains.velocity, i), load(grains.spin, i)
        if _moves_too_far(dot(v, v), dot(w, w), reach, dt) == stop:
            return i
    return -1


@loop
def _first_overcompressed(grains, contacts, count, span):
    """The first contact in which a centre lies inside the other grain, or −1."""
    for c in range(count[CONTACTS]):
        i, j = contacts.pair[0, c], contacts.pair[1, c]
        apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
        limit = max(grains.radius[i], grains.radius[j])
        if dot(apart, apart) < limit * limit:
            return c
    return -1


@loop
def possible_step(grains, contacts, pair_list, long_range, clock, count, rules):
    """The step to take now [s], and STEPS_DONE or why there is none."""
    count[GRAIN1] = count[GRAIN2] = -1
    update_speeds(grains, pair_list)
    dt = choose_step(grains, long_range, contacts.start, pair_list, clock, count, rules.span, rules.criteria)
    if not dt > 0.0:
        return 0.0, Stop.NOT_FINITE
    if clock[LEFT] > 0.0:  # inside a cycle: whole steps that fill it
        dt = clock[LEFT] / math.ceil(clock[LEFT] / dt - 1e-6)
    if clock[TIME] + dt == clock[TIME]:
        find_limiting_grains(grains, long_range, contacts.start, pair_list, count, rules.span, rules.criteria)
        return 0.0, Stop.NO_STEP
    stop = _moves_too_far(pair_list.skin[LARGEST_SPEED], pair_list.skin[LARGEST_SPIN], rules.criteria.reach, dt)
    if stop != Stop.STEPS_DONE:
        count[GRAIN1] = _first_too_fast(grains, rules.criteria.reach, dt, stop)
        return 0.0, stop
    if count[STEPS] % CHECK_EVERY == 0:
        c = _first_overcompressed(grains, contacts, count, rules.span)
        if c >= 0:
            count[GRAIN1], count[GRAIN2] = contacts.pair[0, c], contacts.pair[1, c]
            return 0.0, Stop.OVERCOMPRESSED
    return dt, Stop.STEPS_DONE


@loop
def update_lists(grains, contacts, pair_list, long_range, count, rules):
    """Make anew the lists that are too old for what this step needs; FULL stops ask for longer arrays."""
    span, search, reach = rules.span, rules.search, rules.criteria.reach
    stale = rules.contact.on and list_is_stale(
        grains, pair_list.anchor, span, 0.25 * reach, pair_list.skin, PAIR_LIST_SKIN
    )
    old = search.listed and list_is_stale(
        grains, long_range.anchor, span, 0.5 * search.margin, pair_list.skin, LONG_RANGE_SKIN
    )
    if old and build_verlet_list(grains, long_range, count, span, search) == FULL:
        return Stop.LIST_FULL, stale
    if stale:
        made = build_pair_list(grains, contacts, pair_list, long_range, count, span, reach, rules.contact, search)
        if made == FULL:
            return Stop.PAIRS_FULL, stale
        if made == ROW_FULL:
            return Stop.LIST_FULL, stale
        update_safe_speed(pair_list, count)
    # written so that what is no number is spent
    if rules.contact.on and (stale or not pair_list.skin[INNER_SKIN] > 0.0):
        build_inner_list(grains, pair_list, count, span, 2.0 * INNER_SKIN_FRACTION * reach)
    return Stop.STEPS_DONE, stale


@loop
def update_contacts(grains, contacts, pair_list, clock, count, lost, rules, stale, fresh, flagged):
    """Contacts beyond a limit break or move, `fresh` new ones form.  True if any broke."""
    span, law, dt = rules.span, rules.contact, clock[STEP]
    if law.follow:
        log_stiffness_work(grains, contacts, count, lost, span, dt)
    parted = flagged and update_flagged_contacts(grains, contacts, pair_list, count, lost, span, law, dt)
    if law.damped:
        damp_contacts(grains, contacts, count, lost, span, dt)
    if fresh > 0:
        make_contacts(grains, contacts, pair_list, count, lost, clock, span, law, dt)
    if fresh > 0:
        sort_contacts_by_grain(contacts, count, grains.mass.size)
    if fresh > 0 or stale:
        contact_step(contacts, pair_list, count, grains.mass.size, clock, law.per_period)
    return parted


@loop
def remove_broken_contacts(grains, contacts, pair_list, clock, count, rules):
    """Take broken contacts out of the arrays; until now they stood there without loads."""
    compact_contacts(contacts, count)
    sort_contacts_by_grain(contacts, count, grains.mass.size)
    contact_step(contacts, pair_list, count, grains.mass.size, clock, rules.contact.per_period)


@functools.cache
def drift_with_work_for(external: Callable, drift: Callable) -> Callable:
    """Half a kick and a drift, with what time and boundaries do to the energy of the per-grain forces."""
    energy, wrap = external_energy(external), external_wrap(external)

    @loop
    def drift_with_work(grains, contacts, long_range, clock, count, lost, rules, dt):
        now, then = clock[TIME], clock[TIME] + dt
        gained = 0.0
        if rules.external_work.time_dependent:
            gained += 0.5 * (energy(grains, then, rules.external) - energy(grains, now, rules.external))
        way = drift(grains, contacts, long_range, count, rules, dt)
        if rules.external_work.time_dependent:
            gained += 0.5 * (energy(grains, then, rules.external) - energy(grains, now, rules.external))
        if rules.external_work.position_dependent:
            gained += wrap(grains, rules.span, then, rules.external)
        lost[OUTSIDE] -= gained
        return way

    return drift_with_work


@loop
def no_rates(grains, contacts, long_range, clock, rules, cycle):
    pass


@functools.cache
def rates_loop(sum_rates: Callable) -> Callable:
    """The loop that prepares the Taylor series at the begin of a cycle of `cycle` seconds."""

    @loop
    def set_rates(grains, contacts, long_range, clock, rules, cycle):
        if cycle > 0.0:
            # a mean over much less time than what is to be foretold is no drift
            past = clock[CYCLE] if clock[CYCLE] >= 0.5 * cycle else 0.0
            set_mean_velocities(grains, long_range, contacts.start, rules.span, past, rules.respa.literal)
            clear_rates(long_range)
            sum_rates(grains, long_range, rules.span, rules.long_range)
        store_positions(grains, long_range)

    return set_rates


@loop
def no_gas(grains, clock, count, lost, rules):
    pass


@loop
def apply_drag_and_noise(grains, clock, count, lost, rules):
    """Drag and kicks for the time since the last ones, at the step or cycle that ends nearest to a period of it."""
    elapsed = clock[TIME] - clock[KICKED]
    if elapsed + 0.5 * max(clock[STEP], clock[CYCLE]) >= rules.gas.period:
        lost[GAS] += gas_kick(grains, rules.gas.seed, count[STEPS], elapsed, rules.gas.gas)
        clock[KICKED] = clock[TIME]
