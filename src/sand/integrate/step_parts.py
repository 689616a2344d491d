"""Parts of a step of the driver: stop conditions, pair lists, contacts, work of external forces, gas."""

import functools
import math
from collections.abc import Callable

from ..box import nearest_image
from ..compiler.jit import loop, rare
from ..contact.damping import damping_loops
from ..contact.events import compact_contacts, forming_loops, settle_loop
from ..contact.gather import sort_contacts_by_grain
from ..contact.law import ContactLaw
from ..contact.update import contact_step
from ..forces.external.loops import external_energy, external_wrap
from ..forces.gas.loops import gas_kick
from ..neighbours.cell_list import FULL, build_verlet_list
from ..neighbours.pair_list import ROW_FULL, build_inner_list, pair_list_loop
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
    LEFT,
    LONG_RANGE_SKIN,
    OUTSIDE,
    PAIR_LIST_SKIN,
    SQUARED_SPEED,
    SQUARED_SPIN,
    STEP,
    STEPS,
    TIME,
)
from .kernel_spec import Stop
from .respa import clear_rates, set_mean_velocities, store_positions
from .step_control import CHECK_INTERVAL, choose_step, find_limiting_grains

MAX_TURN = 0.5
"""Largest rotation in one step [rad] for which `quaternion.turn` is accurate."""
INNER_SKIN_FRACTION = 0.05
"""Displacement, in units of the largest gap of the pair list, after which the inner list of candidates is rebuilt."""


@loop
def _moves_too_far(fastest, fastest_spin, max_gap, dt):
    """TOO_FAST if a grain moves by more than max_gap/2, SPINS_TOO_FAST if it turns by more than MAX_TURN, per step."""
    moved_too_far, turned_too_far = dt * dt * fastest > 0.25 * max_gap * max_gap, dt * dt * fastest_spin > MAX_TURN**2
    return Stop.TOO_FAST if moved_too_far else Stop.SPINS_TOO_FAST if turned_too_far else Stop.NONE


@rare
def _first_too_fast(grains, max_gap, dt, stop):
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
def possible_step(grains, contacts, pair_list, long_range, clock, count, parameters):
    """The next step [s] and `Stop.NONE`, or 0 and the reason why no step is possible."""
    count[GRAIN1] = count[GRAIN2] = -1
    update_speeds(grains, pair_list)
    dt = choose_step(grains, long_range, contacts.start, pair_list, clock, count, parameters.span, parameters.criteria)
    if not dt > 0.0:
        return 0.0, Stop.NOT_FINITE
    if clock[LEFT] > 0.0:  # within a cycle: equal steps that fill it
        dt = clock[LEFT] / math.ceil(clock[LEFT] / dt - 1e-6)
    if clock[TIME] + dt == clock[TIME]:
        find_limiting_grains(grains, long_range, contacts.start, pair_list, count, parameters.span, parameters.criteria)
        return 0.0, Stop.NO_STEP
    stop = _moves_too_far(pair_list.skin[SQUARED_SPEED], pair_list.skin[SQUARED_SPIN], parameters.criteria.pair_gap, dt)
    if stop != Stop.NONE:
        count[GRAIN1] = _first_too_fast(grains, parameters.criteria.pair_gap, dt, stop)
        return 0.0, stop
    if count[STEPS] % CHECK_INTERVAL == 0:
        c = _first_overcompressed(grains, contacts, count, parameters.span)
        if c >= 0:
            count[GRAIN1], count[GRAIN2] = contacts.pair[0, c], contacts.pair[1, c]
            return 0.0, Stop.OVERCOMPRESSED
    return dt, Stop.NONE


@functools.cache
def lists_loop(law: ContactLaw) -> Callable:
    """The loop that keeps the neighbour lists valid, for one contact law."""
    build_pair_list = pair_list_loop(law)

    @loop
    def update_lists(grains, contacts, pair_list, long_range, count, parameters):
        """Rebuild stale lists; returns `Stop.NONE` or the array that is full, and whether the pair list was stale."""
        span, search, max_gap = parameters.span, parameters.search, parameters.criteria.pair_gap
        stale = parameters.contact.on and list_is_stale(
            grains, pair_list.anchor, span, 0.25 * max_gap, pair_list.skin, PAIR_LIST_SKIN
        )
        verlet_stale = search.listed and list_is_stale(
            grains, long_range.anchor, span, 0.5 * search.margin, pair_list.skin, LONG_RANGE_SKIN
        )
        if verlet_stale and build_verlet_list(grains, long_range, count, span, search) == FULL:
            return Stop.LIST_FULL, stale
        if stale:
            settings = parameters.contact
            result = build_pair_list(grains, contacts, pair_list, long_range, count, span, max_gap, settings, search)
            if result == FULL:
                return Stop.PAIRS_FULL, stale
            if result == ROW_FULL:
                return Stop.LIST_FULL, stale
            update_safe_speed(pair_list, count)
        # written so that a skin that is not a number counts as used up
        if parameters.contact.on and (stale or not pair_list.skin[INNER_SKIN] > 0.0):
            build_inner_list(grains, pair_list, count, span, 2.0 * INNER_SKIN_FRACTION * max_gap)
        return Stop.NONE, stale

    return update_lists


@functools.cache
def contact_events_loop(law: ContactLaw) -> Callable:
    """The loop of contact events, for one contact law."""
    damping, settle, form_contacts = damping_loops(law), settle_loop(law), forming_loops(law).form
    damp_contacts, log_stiffness_work = damping.damp, damping.log_stiffness_work

    @loop
    def update_contacts(grains, contacts, pair_list, clock, count, lost, parameters, stale, formed, flagged):
        """Slip or break the contacts beyond a limit and form `formed` new ones; returns whether any contact broke."""
        span, settings, dt = parameters.span, parameters.contact, clock[STEP]
        if settings.follow:
            log_stiffness_work(grains, contacts, count, lost, span, dt)
        broken = flagged and settle(grains, contacts, pair_list, count, lost, span, settings, dt)
        if settings.damped:
            damp_contacts(grains, contacts, count, lost, span, dt)
        if formed > 0:
            form_contacts(grains, contacts, pair_list, count, lost, clock, span, settings, dt)
            sort_contacts_by_grain(contacts, count, grains.mass.size)
        if formed > 0 or stale:
            contact_step(contacts, pair_list, count, grains.mass.size, clock, settings.per_period)
        return broken

    return update_contacts


@loop
def remove_broken_contacts(grains, contacts, pair_list, clock, count, parameters):
    """Remove broken contacts from the arrays, where they were kept without loads until the end of the step."""
    compact_contacts(contacts, count)
    sort_contacts_by_grain(contacts, count, grains.mass.size)
    contact_step(contacts, pair_list, count, grains.mass.size, clock, parameters.contact.per_period)


@functools.cache
def drift_with_work_for(external: Callable, drift: Callable) -> Callable:
    """The loop for half a kick and a drift, which logs the work of external forces that depend on time or position."""
    energy, wrap = external_energy(external), external_wrap(external)

    @loop
    def drift_with_work(grains, contacts, long_range, clock, count, lost, parameters, dt):
        start, end = clock[TIME], clock[TIME] + dt
        gained = 0.0
        if parameters.external_work.time_dependent:
            gained += 0.5 * (energy(grains, end, parameters.external) - energy(grains, start, parameters.external))
        displacement = drift(grains, contacts, long_range, count, parameters, dt)
        if parameters.external_work.time_dependent:
            gained += 0.5 * (energy(grains, end, parameters.external) - energy(grains, start, parameters.external))
        if parameters.external_work.position_dependent:
            gained += wrap(grains, parameters.span, end, parameters.external)
        lost[OUTSIDE] -= gained
        return displacement

    return drift_with_work


@loop
def no_rates(grains, contacts, long_range, clock, parameters, cycle):
    """Without Taylor extrapolation."""


@functools.cache
def rates_loop(sum_rates: Callable) -> Callable:
    """The loop that computes the rates of the Taylor series at the start of a cycle of `cycle` [s]."""

    @loop
    def set_rates(grains, contacts, long_range, clock, parameters, cycle):
        if cycle > 0.0:
            # a mean over much less than the extrapolated time is dominated by oscillations
            past = clock[CYCLE] if clock[CYCLE] >= 0.5 * cycle else 0.0
            instantaneous = parameters.respa.instantaneous_rates
            set_mean_velocities(grains, long_range, contacts.start, parameters.span, past, instantaneous)
            clear_rates(long_range)
            sum_rates(grains, long_range, parameters.span, parameters.long_range)
        store_positions(grains, long_range)

    return set_rates


@loop
def no_gas(grains, clock, count, lost, parameters):
    """Without a gas."""


@loop
def apply_drag_and_noise(grains, clock, count, lost, parameters):
    """Drag and Brownian kicks for the time since the last; at ends of steps or cycles, about once per gas period."""
    elapsed = clock[TIME] - clock[KICKED]
    if elapsed + 0.5 * max(clock[STEP], clock[CYCLE]) >= parameters.gas.period:
        lost[GAS] += gas_kick(grains, parameters.gas.seed, count[STEPS], elapsed, parameters.gas.gas)
        clock[KICKED] = clock[TIME]
