"""The compiled driver: thousands of velocity Verlet steps per call from Python.

One step:  choose dt → kick dt/2, drift, rotate dt → check the pair lists → update contacts: slip, break, form → forces
(contacts, long-range, external) → kick dt/2.  Long-range forces are summed once per cycle of one or more steps; a
contact that forms or breaks ends the cycle.  The driver returns between two cycles: at the requested end, because no
step is possible, or after a contact formed or broke, if a cut-off follows the clusters.  It returns in the middle of a
step (PHASE = 1) if an array is too small; the call after it resumes there, so enlarging arrays does not change the
result.

The driver is compiled once, for all forces and contact laws: it calls their stages by address (`stages`,
`force_stages`).  Short loops over grains that do not depend on them are part of the driver.
"""

import math

from ..basics.state import (
    BROKEN,
    CHANGED,
    COMPARED,
    CONTACTS,
    CORRECTED,
    CYCLE,
    GRAIN1,
    INNER_SKIN,
    LARGEST_OVERLAP,
    LEFT,
    LONG_RANGE_SKIN,
    LONG_RANGE_SUMS,
    MADE,
    OUTSIDE,
    PAIR_LIST_SKIN,
    PHASE,
    SLID,
    SLIPPED,
    SQUARED_SPEED,
    SQUARED_SPIN,
    STEP,
    STEPS,
    TIME,
)
from ..compiler.jit import caller, loop, rare
from ..compiler.program import call_stage, has_stage
from ..compiler.stage import stage
from ..contact.events import count_new_contacts
from ..contact.update import load_contact_sums, log_contact_sums
from ..neighbours.skin import consume_skins, invalidate_speeds, list_is_stale, reset_skins
from ..numerics.flow import rate_of_strain
from ..numerics.simd import float_bits, float_from_bits, magnitude_bits
from .force_calls import (
    add_external_loads,
    add_pairs_in_contact,
    subtract_pairs_in_contact,
    sum_external,
    sum_pair_forces,
    update_pairs_in_contact,
)
from .force_stages import ENERGY, WRAPPING
from .hooks import Hook, call_hook
from .motion import kick, wrap_all
from .parts import DRIVER_PARTS, DT, LIMIT, SINCE, Stop
from .respa import (
    add_constant_loads,
    add_long_range_loads,
    apply_impulse,
    correct_angular_momentum,
    integrate_displacement,
    update_constant_loads,
)
from .stages import StageNumber
from .step_control import cycle_steps, has_arrived, hold_step, is_past
from .step_parts import possible_step
from .task_queue import CONTACTS_PER_BLOCK, GRAINS_PER_BLOCK, blocks_of, for_each_block, join_workers
from .taylor import sum_rates


@loop
def largest_speeds(queue, blocks):
    """Squares of the largest speed [m²/s²] and spin [1/s²] over blocks of grains."""
    fastest = fastest_spin = float_bits(0.0)
    for b in range(blocks):
        fastest = max(fastest, magnitude_bits(queue.speeds[b, 0]))
        fastest_spin = max(fastest_spin, magnitude_bits(queue.speeds[b, 1]))
    return float_from_bits(fastest), float_from_bits(fastest_spin)


@caller
def begin_cycle(s, dt, cycle):
    """Start a cycle of `cycle` [s] with a step of dt: rates, or the first impulse.

    The kick dt/2 of the first step already contains dt/2 of the long-range loads.
    """
    if s.respa.taylor:
        sum_rates(s, cycle if cycle > dt else 0.0)
    s.clock[CYCLE] = s.clock[LEFT] = cycle
    if s.respa.impulse:
        update_constant_loads(s.grains, s.long_range)
        if cycle > dt:
            apply_impulse(s.grains, s.long_range, 0.5 * (cycle - dt))


@rare
def impulse_at_end(grains, long_range, span, clock, elapsed, dt):
    """Second impulse: half of the cycle was applied at its start, dt/2 with the last kick."""
    if clock[CYCLE] > dt:
        apply_impulse(grains, long_range, elapsed - 0.5 * clock[CYCLE] - 0.5 * dt)
        integrate_displacement(grains, long_range, span, 0.5 * dt)
        clock[CORRECTED] += correct_angular_momentum(grains, long_range, span, elapsed - 0.5 * clock[CYCLE])


@caller
def drift_with_work(s, dt):
    """Half a kick and a drift; logs the work of external forces that depend on time or position.

    Returns the largest displacement [m], of which two make up for the approach of two grains within reach of a list.
    """
    start, end = s.clock[TIME], s.clock[TIME] + dt
    gained = 0.0
    if s.external_work.time_dependent:
        gained += sum_external(s, end, ENERGY)
        gained -= sum_external(s, start, ENERGY)
    s.scratch[DT] = dt
    blocks = blocks_of(s.grains.mass.size, GRAINS_PER_BLOCK)
    call_hook(s, Hook.BEFORE_DRIFT)
    if s.clock[STEP] != dt:
        call_hook(s, Hook.BATH_WORK)
    for_each_block(s, StageNumber.DRIFT, blocks)
    call_hook(s, Hook.AFTER_DRIFT)
    if s.external_work.time_dependent:
        gained += sum_external(s, end, ENERGY)
        gained -= sum_external(s, start, ENERGY)
    gained *= 0.5
    if s.external_work.position_dependent:
        gained += sum_external(s, end, WRAPPING)
        wrap_all(s.grains, s.span)
    s.lost[OUTSIDE] -= gained
    # In a box that shrinks, a strain uses up half of it times the reach (`list_is_stale`).  Where the box grows, it is
    # up to twice as large in lengths when the list was built, as limits are below half the reach, and displacements,
    # below half the reach, grow with it.
    strained = 1.5 * s.search.reach * rate_of_strain(s.span)
    return dt * (math.sqrt(largest_speeds(s.queue, blocks)[0]) + strained)


@caller
def sum_all_pairs(s):
    """Sum the long-range loads and add them to the loads of the grains."""
    sum_pair_forces(s)
    if s.respa.impulse and s.count[CONTACTS] > 0:
        subtract_pairs_in_contact(s)
    add_long_range_loads(s.grains, s.long_range)


@caller
def sum_loads(s, due, elapsed):
    """Sum forces and torques at the end of a step.

    Long-range loads are summed if `due`; within a cycle their constant part or extrapolation replaces them.
    """
    for_each_block(s, StageNumber.GATHER, blocks_of(s.grains.mass.size, GRAINS_PER_BLOCK))
    call_hook(s, Hook.LOADS)
    add_external_loads(s, s.clock[TIME] + s.clock[STEP])
    if s.forces.pair == 0:
        s.count[LONG_RANGE_SUMS] += 1
    elif due:
        sum_all_pairs(s)
    elif s.respa.impulse:
        add_constant_loads(s.grains, s.long_range, elapsed)
    else:
        s.scratch[SINCE] = elapsed
        call_stage(s, StageNumber.EXTRAPOLATE)


@caller
def loads_and_kick(s, due, elapsed):
    """Sum the loads and apply the second half kick; returns the squares of the largest speed and spin."""
    in_one_loop = has_stage(s, StageNumber.GATHER_AND_KICK)
    if not in_one_loop:
        sum_loads(s, due, elapsed)
    call_hook(s, Hook.BEFORE_KICK)
    if in_one_loop:
        s.count[LONG_RANGE_SUMS] += 1
        s.scratch[DT] = 0.5 * s.clock[STEP]
        blocks = blocks_of(s.grains.mass.size, GRAINS_PER_BLOCK)
        for_each_block(s, StageNumber.GATHER_AND_KICK, blocks)
        fastest, fastest_spin = largest_speeds(s.queue, blocks)
    else:
        fastest, fastest_spin = kick(s.grains, 0.5 * s.clock[STEP])
    s.scratch[DT] = s.clock[STEP]
    call_hook(s, Hook.AFTER_KICK)
    return fastest, fastest_spin


@rare
def close_cycle(s):
    """End an unfinished cycle at the present step, so that a stopped run leaves a consistent state."""
    if s.clock[LEFT] > 0.0:
        elapsed = s.clock[CYCLE] - s.clock[LEFT]
        sum_loads(s, True, elapsed)
        if s.respa.impulse:  # the last half kick contained the constant loads only
            apply_impulse(s.grains, s.long_range, 0.5 * s.clock[STEP])
            impulse_at_end(s.grains, s.long_range, s.span, s.clock, elapsed, s.clock[STEP])
            update_pairs_in_contact(s)
        s.clock[LEFT], s.clock[CYCLE] = 0.0, elapsed


@caller
def limit_step(s):
    """Set the longest step that components allow; returns the value of a `Stop` that refuses any.

    Components start from the fixed step, if one is given, which they can refuse, but not shorten.
    """
    if not has_stage(s, Hook.LIMIT_STEP):
        return Stop.NONE.value
    s.scratch[LIMIT] = s.criteria.fixed if s.criteria.fixed > 0.0 else s.criteria.longest
    stop = call_hook(s, Hook.LIMIT_STEP)
    hold_step(s.clock, s.count, s.scratch[LIMIT])
    return stop


@caller
def first_half(s):
    """Choose the step, kick dt/2 and drift; no step was taken unless the value of `Stop.NONE` is returned.

    A cycle that would pass `until` [s] is not begun, or, with `shorten`, ends at this time.
    """
    further = limit_step(s)
    grain = s.count[GRAIN1]
    dt, stop = possible_step(s.grains, s.contacts, s.pair_list, s.long_range, s.clock, s.count, s.span, s.criteria)
    if stop == Stop.NONE.value and further != Stop.NONE.value:
        stop, s.count[GRAIN1] = further, grain
    if stop != Stop.NONE.value:
        s.scratch[DT] = dt
        if stop != Stop.OVERCOMPRESSED.value:
            call_stage(s, StageNumber.EXPLAIN, stop)
        close_cycle(s)
        return stop
    if s.clock[LEFT] == 0.0:
        cycle = dt * cycle_steps(s.clock, s.count, s.respa, dt)
        if is_past(s.clock[TIME] + cycle, s.until):
            if not s.shorten:
                return Stop.TIME_REACHED.value
            cycle = s.until - s.clock[TIME]
            dt = cycle / max(1, math.ceil(cycle / dt - 1e-6))
        begin_cycle(s, dt, cycle)
    elif s.respa.impulse:  # between two steps of clock[STEP] and dt seconds
        integrate_displacement(s.grains, s.long_range, s.span, 0.5 * (s.clock[STEP] + dt))
    displacement = drift_with_work(s, dt)
    consume_skins(s.pair_list, displacement)
    s.clock[LEFT] = s.clock[LEFT] - dt if s.clock[LEFT] > 1.5 * dt else 0.0
    s.clock[STEP] = dt
    s.count[PHASE] = 1
    return Stop.NONE.value


@caller
def update_lists(s):
    """Rebuild stale lists; returns the value of a `Stop`, and whether the pair list was stale."""
    stale = s.settings.on and list_is_stale(
        s.grains, s.pair_list, s.span, 0.25 * s.criteria.pair_gap, s.search.reach, s.pair_list.skin, PAIR_LIST_SKIN
    )
    if s.search.listed and list_is_stale(
        s.grains, s.long_range, s.span, 0.5 * s.search.margin, s.search.reach, s.pair_list.skin, LONG_RANGE_SKIN
    ):
        stop = call_stage(s, StageNumber.VERLET_LIST)
        if stop != Stop.NONE.value:
            return stop, stale
    if stale:
        stop = call_stage(s, StageNumber.PAIR_LIST)
        if stop != Stop.NONE.value:
            return stop, stale
    # written so that a skin that is not a number counts as used up
    if s.settings.on and (stale or not s.pair_list.skin[INNER_SKIN] > 0.0):
        call_stage(s, StageNumber.INNER_LIST)
    return Stop.NONE.value, stale


@caller
def update_contacts(s):
    """Update all contacts, then slip or break the flagged ones; returns whether any contact broke."""
    blocks = blocks_of(s.count[CONTACTS], CONTACTS_PER_BLOCK)
    for_each_block(s, StageNumber.CONTACT_PASS, blocks)
    pending = False
    for b in range(blocks):
        passed = load_contact_sums(s.queue.passed, b)
        pending |= passed.pending > 0.0
        s.clock[LARGEST_OVERLAP] = max(s.clock[LARGEST_OVERLAP], passed.deepest)
        if s.settings.damped or passed.slipped > 0.0:
            log_contact_sums(s.count, s.lost, passed)
    if s.settings.follow:
        call_stage(s, StageNumber.STIFFNESS_WORK)
    return pending and call_stage(s, StageNumber.SLIP_AND_BREAK) == 1


@caller
def second_half(s):
    """Update lists and contacts, sum the loads, kick dt/2; called again after an array was enlarged."""
    stop, list_rebuilt = update_lists(s)
    if stop != Stop.NONE.value:
        return stop
    formed = count_new_contacts(s.grains, s.pair_list, s.count, s.span)
    if s.count[CONTACTS] + formed > s.contacts.pair.shape[1]:
        return Stop.CONTACTS_FULL.value
    call_hook(s, Hook.BEFORE_CONTACTS)
    stop = call_hook(s, Hook.CONTACTS)
    slipped = s.count[SLIPPED]
    broken = stop == Stop.NONE.value and update_contacts(s)
    if stop == Stop.NONE.value and formed > 0:
        call_stage(s, StageNumber.FORM)
        call_stage(s, StageNumber.SORT)
    call_hook(s, Hook.AFTER_CONTACTS)
    if stop != Stop.NONE.value:
        return stop
    if formed > 0 or list_rebuilt:
        call_stage(s, StageNumber.CONTACT_LIMIT)
    dt, elapsed = s.clock[STEP], s.clock[CYCLE] - s.clock[LEFT]
    due = s.clock[LEFT] == 0.0 or broken or formed > 0
    if s.respa.impulse and s.count[CONTACTS] > 0:
        add_pairs_in_contact(s)
    fastest, fastest_spin = loads_and_kick(s, due, elapsed)
    s.pair_list.skin[SQUARED_SPEED], s.pair_list.skin[SQUARED_SPIN] = fastest, fastest_spin
    if due:
        if s.respa.impulse:
            impulse_at_end(s.grains, s.long_range, s.span, s.clock, elapsed, dt)
            if s.count[CONTACTS] > 0:
                update_pairs_in_contact(s)
        s.clock[LEFT], s.clock[CYCLE] = 0.0, elapsed
    if broken:
        call_stage(s, StageNumber.REMOVE_BROKEN)
        call_stage(s, StageNumber.SORT)
        call_stage(s, StageNumber.CONTACT_LIMIT)
    s.clock[TIME] += dt
    if broken or formed > 0:
        s.clock[CHANGED] = s.clock[TIME]
    if s.count[SLIPPED] != slipped:
        s.clock[SLID] = s.clock[TIME]
    s.count[STEPS] += 1
    s.count[PHASE] = 0
    call_hook(s, Hook.END_STEP)
    if due:
        call_hook(s, Hook.BETWEEN_CYCLES)
        call_hook(s, Hook.AFTER_CHANGES)
        if has_stage(s, Hook.BETWEEN_CYCLES) or s.respa.impulse:  # speeds changed between steps
            invalidate_speeds(s.pair_list)
    return Stop.NONE.value


@caller
def steps_until(s):
    """Take steps until the last end of a step or cycle not after `until` [s], or step `last`.

    With `shorten` the last step or cycle is shortened so that it ends at `until`. Returns the value of a `Stop`.
    """
    reset_skins(s.pair_list, s.count)
    while True:
        stop = Stop.NONE.value
        if s.count[PHASE] == 0:
            if s.clock[LEFT] == 0.0:
                # before all other returns, so that no output lies between the step and the new cut-off
                if s.count[COMPARED] >= 0 and s.count[COMPARED] != s.count[MADE] + s.count[BROKEN]:
                    return Stop.CLUSTERS_CHANGED.value
                if has_arrived(s.clock[TIME], s.until, s.shorten):
                    return Stop.TIME_REACHED.value
                if s.count[STEPS] >= s.last:
                    return Stop.NONE.value
            if s.count[CONTACTS] == 0 and s.clock[LEFT] == 0.0 and has_stage(s, StageNumber.FLIGHT):
                stop = call_stage(s, StageNumber.FLIGHT)
                if stop == Stop.NOT_FINITE.value:
                    call_stage(s, StageNumber.EXPLAIN, stop)
            else:
                stop = first_half(s)
        if stop == Stop.NONE.value and s.count[PHASE] == 1:
            stop = second_half(s)
        if stop != Stop.NONE.value:
            return stop


@stage(
    "the time steps",
    seconds=8.0,
    parts=(*DRIVER_PARTS, "contacts", "settings", "respa"),
)
def advance(s):
    """Take steps, then end the work of the other threads; returns the value of a `Stop`.

    A run starts in the middle of a step of length 0 (PHASE 1): its second half builds the lists, finds grains that
    overlap already and sums the loads; its counters and energies are discarded.
    """
    stop = steps_until(s)
    join_workers(s)
    return stop
