"""The compiled driver: thousands of velocity Verlet steps per call from Python.

One step:  choose dt → kick dt/2, drift, rotate dt → check the pair lists → update contacts: slip, break, form → forces
(contacts, long-range, external) → kick dt/2.  Long-range forces are summed once per cycle of one or more steps; a
contact that forms or breaks ends the cycle.  The driver returns between two cycles: at the requested end, because no
step is possible, or after a contact formed or broke, if a cut-off follows the clusters.  It returns in the middle of a
step (STAGE = 1) if an array is too small; the call after it resumes there, so enlarging arrays does not change the
result.

The driver is compiled once, for all forces and contact laws: it calls their stages by address (`stages`,
`force_stages`).  Short loops over grains that do not depend on them are part of the driver.
"""

import math

from ..compiler.jit import caller, loop, rare
from ..compiler.program import call_stage, has_stage
from ..compiler.stage import stage
from ..contact.events import count_new_contacts
from ..contact.update import load_contact_sums, log_contact_sums
from ..neighbours.skin import consume_skins, invalidate_speeds, list_is_stale, reset_skins
from ..numerics.simd import float_bits, float_from_bits, magnitude_bits
from ..state.state import (
    BROKEN,
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
    SQUARED_SPEED,
    SQUARED_SPIN,
    STAGE,
    STEP,
    STEPS,
    TIME,
)
from .driven import HOLD, HOLD_IN_EVENTS, RELEASE, RELEASE_FROM_EVENTS, RESET
from .force_calls import (
    add_external_loads,
    add_pairs_in_contact,
    subtract_pairs_in_contact,
    sum_external,
    sum_pair_forces,
    update_pairs_in_contact,
)
from .force_stages import ENERGY, PAIR_STAGES, RATES, WRAPPING
from .motion import kick, wrap_all
from .parts import CYCLE_LENGTH, DT, SINCE, Stop
from .respa import (
    add_constant_loads,
    add_long_range_loads,
    apply_impulse,
    correct_angular_momentum,
    integrate_displacement,
    update_constant_loads,
)
from .stages import (
    BATH_WALL_WORK,
    BATH_WORK,
    CONTACT_PASS,
    CONTACT_STEP,
    DRIFT,
    DRIVE,
    EXPLAIN,
    EXTRAPOLATE,
    FIRST_FORCE,
    FLIGHT,
    FORM,
    GAS_KICK,
    GATHER,
    GATHER_AND_KICK,
    INNER_LIST,
    NEXT_STEP,
    PAIR_LIST,
    PREPARE_RATES,
    REMOVE_BROKEN,
    SETTLE,
    SETTLE_CLUSTERS,
    SORT,
    STIFFNESS_WORK,
    STORE_POSITIONS,
    VERLET_LIST,
    WALL_CONTACTS,
    WALL_LOADS,
    WALL_STEP,
)
from .step_control import cycle_steps, is_close, is_past
from .step_parts import possible_step
from .task_queue import CONTACTS_PER_BLOCK, GRAINS_PER_BLOCK, blocks_of, for_each_block, join_workers


@loop
def largest_speeds(queue, blocks):
    """Squares of the largest speed [m²/s²] and spin [1/s²] over blocks of grains."""
    fastest = fastest_spin = float_bits(0.0)
    for b in range(blocks):
        fastest = max(fastest, magnitude_bits(queue.speeds[b, 0]))
        fastest_spin = max(fastest_spin, magnitude_bits(queue.speeds[b, 1]))
    return float_from_bits(fastest), float_from_bits(fastest_spin)


@rare
def sum_rates(clock, scratch, forces, program, table, cycle):
    """The rates of the Taylor series at the start of a cycle of `cycle` [s]; none for 0."""
    if cycle > 0.0:
        scratch[CYCLE_LENGTH] = cycle
        call_stage(program, PREPARE_RATES, table, 0)
        for k in range(forces.pair):
            call_stage(program, FIRST_FORCE + PAIR_STAGES * k + RATES, table, 0)
    call_stage(program, STORE_POSITIONS, table, 0)


@caller
def begin_cycle(grains, long_range, clock, scratch, respa, forces, program, table, dt, cycle):
    """Start a cycle of `cycle` [s] with a step of dt: rates, or the first impulse.

    The kick dt/2 of the first step already contains dt/2 of the long-range loads.
    """
    if respa.taylor:
        sum_rates(clock, scratch, forces, program, table, cycle if cycle > dt else 0.0)
    clock[CYCLE] = clock[LEFT] = cycle
    if respa.impulse:
        update_constant_loads(grains, long_range)
        if cycle > dt:
            apply_impulse(grains, long_range, 0.5 * (cycle - dt))


@rare
def impulse_at_end(grains, long_range, span, clock, elapsed, dt):
    """Second impulse: half of the cycle was applied at its start, dt/2 with the last kick."""
    if clock[CYCLE] > dt:
        apply_impulse(grains, long_range, elapsed - 0.5 * clock[CYCLE] - 0.5 * dt)
        integrate_displacement(grains, long_range, span, 0.5 * dt)
        clock[CORRECTED] += correct_angular_momentum(grains, long_range, span, elapsed - 0.5 * clock[CYCLE])


@caller
def drift_with_work(clock, lost, scratch, span, external_work, forces, grains, queue, program, table, dt):
    """Half a kick and a drift; logs the work of external forces that depend on time or position.

    Returns the largest displacement [m].
    """
    start, end = clock[TIME], clock[TIME] + dt
    gained = 0.0
    if external_work.time_dependent:
        gained += sum_external(scratch, forces, program, table, end, ENERGY)
        gained -= sum_external(scratch, forces, program, table, start, ENERGY)
    scratch[DT] = dt
    blocks = blocks_of(grains.mass.size, GRAINS_PER_BLOCK)
    driven = has_stage(program, DRIVE)
    if driven:
        call_stage(program, DRIVE, table, HOLD)
    if clock[STEP] != dt:
        if has_stage(program, BATH_WORK):
            call_stage(program, BATH_WORK, table, NEXT_STEP)
        if has_stage(program, BATH_WALL_WORK):
            call_stage(program, BATH_WALL_WORK, table, NEXT_STEP)
    for_each_block(program, DRIFT, table, queue.words, blocks)
    if driven:
        call_stage(program, DRIVE, table, RELEASE)
    if external_work.time_dependent:
        gained += sum_external(scratch, forces, program, table, end, ENERGY)
        gained -= sum_external(scratch, forces, program, table, start, ENERGY)
    gained *= 0.5
    if external_work.position_dependent:
        gained += sum_external(scratch, forces, program, table, end, WRAPPING)
        wrap_all(grains, span)
    lost[OUTSIDE] -= gained
    return dt * math.sqrt(largest_speeds(queue, blocks)[0])


@caller
def sum_all_pairs(grains, long_range, count, respa, forces, queue, program, table):
    """Sum the long-range loads and add them to the loads of the grains."""
    sum_pair_forces(long_range, count, forces, queue, program, table)
    if respa.impulse and count[CONTACTS] > 0:
        subtract_pairs_in_contact(forces, program, table)
    add_long_range_loads(grains, long_range)


@caller
def sum_loads(
    grains, long_range, clock, count, scratch, respa, forces, queue, program, table, due, elapsed
):  # fmt: skip
    """Sum forces and torques at the end of a step.

    Long-range loads are summed if `due`; within a cycle their constant part or extrapolation replaces them.
    """
    for_each_block(program, GATHER, table, queue.words, blocks_of(grains.mass.size, GRAINS_PER_BLOCK))
    if has_stage(program, WALL_LOADS):
        call_stage(program, WALL_LOADS, table, 0)
    add_external_loads(scratch, forces, program, table, clock[TIME] + clock[STEP])
    if forces.pair == 0:
        count[LONG_RANGE_SUMS] += 1
    elif due:
        sum_all_pairs(grains, long_range, count, respa, forces, queue, program, table)
    elif respa.impulse:
        add_constant_loads(grains, long_range, elapsed)
    else:
        scratch[SINCE] = elapsed
        call_stage(program, EXTRAPOLATE, table, 0)


@caller
def loads_and_kick(grains, long_range, clock, count, scratch, respa, forces, queue, program, table, due, elapsed):
    """Sum the loads and apply the second half kick; returns the squares of the largest speed and spin."""
    driven = has_stage(program, DRIVE)
    if has_stage(program, GATHER_AND_KICK):
        count[LONG_RANGE_SUMS] += 1
        scratch[DT] = 0.5 * clock[STEP]
        blocks = blocks_of(grains.mass.size, GRAINS_PER_BLOCK)
        if driven:
            call_stage(program, DRIVE, table, HOLD)
        for_each_block(program, GATHER_AND_KICK, table, queue.words, blocks)
        if driven:
            scratch[DT] = clock[STEP]
            call_stage(program, DRIVE, table, RELEASE)
        return largest_speeds(queue, blocks)
    sum_loads(grains, long_range, clock, count, scratch, respa, forces, queue, program, table, due, elapsed)
    if not driven:
        return kick(grains, 0.5 * clock[STEP])
    call_stage(program, DRIVE, table, HOLD)
    fastest, fastest_spin = kick(grains, 0.5 * clock[STEP])
    scratch[DT] = clock[STEP]
    call_stage(program, DRIVE, table, RELEASE)
    return fastest, fastest_spin


@rare
def close_cycle(grains, contacts, long_range, clock, count, scratch, span, respa, forces, queue, program, table):
    """End an unfinished cycle at the present step, so that a stopped run leaves a consistent state."""
    if clock[LEFT] > 0.0:
        elapsed = clock[CYCLE] - clock[LEFT]
        sum_loads(grains, long_range, clock, count, scratch, respa, forces, queue, program, table, True, elapsed)
        if respa.impulse:  # the last half kick contained the constant loads only
            apply_impulse(grains, long_range, 0.5 * clock[STEP])
            impulse_at_end(grains, long_range, span, clock, elapsed, clock[STEP])
            update_pairs_in_contact(contacts, count, forces, program, table)
        clock[LEFT], clock[CYCLE] = 0.0, elapsed


@caller
def first_half(
    grains, contacts, pair_list, long_range, clock, count, lost, scratch, span, respa, external_work, criteria, forces,
    queue, program, table, until, shorten
):  # fmt: skip
    """Choose the step, kick dt/2 and drift; no step was taken unless the value of `Stop.NONE` is returned.

    A cycle that would pass `until` [s] is not begun, or, with `shorten`, ends at this time.
    """
    at_wall = call_stage(program, WALL_STEP, table, 0) if has_stage(program, WALL_STEP) else Stop.NONE.value
    grain = count[GRAIN1]
    dt, stop = possible_step(grains, contacts, pair_list, long_range, clock, count, span, criteria)
    if stop == Stop.NONE.value and at_wall != Stop.NONE.value:
        stop, count[GRAIN1] = at_wall, grain
    if stop != Stop.NONE.value:
        scratch[DT] = dt
        if stop != Stop.OVERCOMPRESSED.value:
            call_stage(program, EXPLAIN, table, stop)
        close_cycle(grains, contacts, long_range, clock, count, scratch, span, respa, forces, queue, program, table)
        return stop
    if clock[LEFT] == 0.0:
        cycle = dt * cycle_steps(clock, count, respa, dt)
        if is_past(clock[TIME] + cycle, until):
            if not shorten:
                return Stop.TIME_REACHED.value
            cycle = until - clock[TIME]
            dt = cycle / max(1, math.ceil(cycle / dt - 1e-6))
        begin_cycle(grains, long_range, clock, scratch, respa, forces, program, table, dt, cycle)
    elif respa.impulse:  # between two steps of clock[STEP] and dt seconds
        integrate_displacement(grains, long_range, span, 0.5 * (clock[STEP] + dt))
    displacement = drift_with_work(
        clock, lost, scratch, span, external_work, forces, grains, queue, program, table, dt
    )  # fmt: skip
    consume_skins(pair_list, displacement)
    clock[LEFT] = clock[LEFT] - dt if clock[LEFT] > 1.5 * dt else 0.0
    clock[STEP] = dt
    count[STAGE] = 1
    return Stop.NONE.value


@caller
def update_lists(grains, pair_list, long_range, span, settings, search, criteria, program, table):
    """Rebuild stale lists; returns the value of a `Stop`, and whether the pair list was stale."""
    stale = settings.on and list_is_stale(
        grains, pair_list.anchor, span, 0.25 * criteria.pair_gap, pair_list.skin, PAIR_LIST_SKIN
    )
    if search.listed and list_is_stale(
        grains, long_range.anchor, span, 0.5 * search.margin, pair_list.skin, LONG_RANGE_SKIN
    ):
        stop = call_stage(program, VERLET_LIST, table, 0)
        if stop != Stop.NONE.value:
            return stop, stale
    if stale:
        stop = call_stage(program, PAIR_LIST, table, 0)
        if stop != Stop.NONE.value:
            return stop, stale
    # written so that a skin that is not a number counts as used up
    if settings.on and (stale or not pair_list.skin[INNER_SKIN] > 0.0):
        call_stage(program, INNER_LIST, table, 0)
    return Stop.NONE.value, stale


@caller
def update_contacts(clock, count, lost, settings, queue, program, table):
    """Update all contacts, and slip or break those beyond a limit; returns whether any contact broke."""
    blocks = blocks_of(count[CONTACTS], CONTACTS_PER_BLOCK)
    for_each_block(program, CONTACT_PASS, table, queue.words, blocks)
    pending = False
    for b in range(blocks):
        passed = load_contact_sums(queue.passed, b)
        pending |= passed.pending > 0.0
        clock[LARGEST_OVERLAP] = max(clock[LARGEST_OVERLAP], passed.deepest)
        if settings.damped or passed.slipped > 0.0:
            log_contact_sums(count, lost, passed)
    if settings.follow:
        call_stage(program, STIFFNESS_WORK, table, 0)
    return pending and call_stage(program, SETTLE, table, 0) == 1


@caller
def second_half(
    grains, contacts, pair_list, long_range, clock, count, lost, scratch, span, settings, search, respa, criteria,
    forces, queue, program, table
):  # fmt: skip
    """Update lists and contacts, sum the loads, kick dt/2; called again after an array was enlarged."""
    stop, list_rebuilt = update_lists(
        grains, pair_list, long_range, span, settings, search, criteria, program, table
    )  # fmt: skip
    if stop != Stop.NONE.value:
        return stop
    formed = count_new_contacts(grains, pair_list, count, span)
    if count[CONTACTS] + formed > contacts.pair.shape[1]:
        return Stop.CONTACTS_FULL.value
    driven = has_stage(program, DRIVE)
    if driven:
        call_stage(program, DRIVE, table, HOLD_IN_EVENTS)
    if has_stage(program, WALL_CONTACTS):
        stop = call_stage(program, WALL_CONTACTS, table, 0)
        if stop != Stop.NONE.value:
            if driven:
                call_stage(program, DRIVE, table, RELEASE_FROM_EVENTS)
            return stop
    broken = update_contacts(clock, count, lost, settings, queue, program, table)
    if formed > 0:
        call_stage(program, FORM, table, 0)
        call_stage(program, SORT, table, 0)
    if driven:
        call_stage(program, DRIVE, table, RELEASE_FROM_EVENTS)
    if formed > 0 or list_rebuilt:
        call_stage(program, CONTACT_STEP, table, 0)
    dt, elapsed = clock[STEP], clock[CYCLE] - clock[LEFT]
    due = clock[LEFT] == 0.0 or broken or formed > 0
    if respa.impulse and count[CONTACTS] > 0:
        add_pairs_in_contact(forces, program, table)
    fastest, fastest_spin = loads_and_kick(
        grains, long_range, clock, count, scratch, respa, forces, queue, program, table, due, elapsed
    )
    pair_list.skin[SQUARED_SPEED], pair_list.skin[SQUARED_SPIN] = fastest, fastest_spin
    if due:
        if respa.impulse:
            impulse_at_end(grains, long_range, span, clock, elapsed, dt)
            if count[CONTACTS] > 0:
                update_pairs_in_contact(contacts, count, forces, program, table)
        clock[LEFT], clock[CYCLE] = 0.0, elapsed
    if broken:
        call_stage(program, REMOVE_BROKEN, table, 0)
        call_stage(program, SORT, table, 0)
        call_stage(program, CONTACT_STEP, table, 0)
    clock[TIME] += dt
    count[STEPS] += 1
    count[STAGE] = 0
    if due:
        gas, settling = has_stage(program, GAS_KICK), has_stage(program, SETTLE_CLUSTERS)
        if gas:
            call_stage(program, GAS_KICK, table, 0)
        if settling:
            call_stage(program, SETTLE_CLUSTERS, table, 0)
        if gas and driven:
            call_stage(program, DRIVE, table, RESET)
        if gas or settling or respa.impulse:  # speeds changed between steps
            invalidate_speeds(pair_list)
    return Stop.NONE.value


@caller
def steps_until(
    grains, contacts, pair_list, long_range, clock, count, lost, scratch, span, settings, search, respa, external_work,
    criteria, forces, queue, program, table, until, last, shorten
):  # fmt: skip
    """Take steps until the last end of a step or cycle not after `until` [s], or step `last`.

    With `shorten` the last step or cycle is shortened so that it ends at `until`. Returns the value of a `Stop`.
    """
    reset_skins(pair_list, count)
    while True:
        stop = Stop.NONE.value
        if count[STAGE] == 0:
            if clock[LEFT] == 0.0:
                # before all other returns, so that no output lies between the step and the new cut-off
                if count[COMPARED] >= 0 and count[COMPARED] != count[MADE] + count[BROKEN]:
                    return Stop.CLUSTERS_CHANGED.value
                if clock[TIME] >= until or (shorten and is_close(clock[TIME], until)):
                    return Stop.TIME_REACHED.value
                if count[STEPS] >= last:
                    return Stop.NONE.value
            if count[CONTACTS] == 0 and clock[LEFT] == 0.0 and has_stage(program, FLIGHT):
                stop = call_stage(program, FLIGHT, table, 0)
                if stop == Stop.NOT_FINITE.value:
                    call_stage(program, EXPLAIN, table, stop)
            else:
                stop = first_half(
                    grains, contacts, pair_list, long_range, clock, count, lost, scratch, span, respa, external_work,
                    criteria, forces, queue, program, table, until, shorten
                )  # fmt: skip
        if stop == Stop.NONE.value and count[STAGE] == 1:
            stop = second_half(
                grains, contacts, pair_list, long_range, clock, count, lost, scratch, span, settings, search, respa,
                criteria, forces, queue, program, table
            )  # fmt: skip
        if stop != Stop.NONE.value:
            return stop


@stage("the time steps")
def advance(
    table, program, grains, contacts, pair_list, long_range, clock, count, lost, scratch, span, settings, search, respa,
    external_work, criteria, forces, queue, until, last, shorten
):  # fmt: skip
    """Take steps, then end the work of the other threads; returns the value of a `Stop`.

    A run starts in the middle of a step of length 0 (STAGE 1): its second half builds the lists, finds grains that
    overlap already and sums the loads; its counters and energies are discarded.
    """
    stop = steps_until(
        grains, contacts, pair_list, long_range, clock, count, lost, scratch, span, settings, search, respa,
        external_work, criteria, forces, queue, program, table, until, last, shorten
    )  # fmt: skip
    join_workers(queue.words)
    return stop
