"""The compiled driver: thousands of velocity Verlet steps per call from Python.

One step:  choose dt → kick dt/2, drift, rotate dt → check the pair lists → update contacts: slip, break, form → forces
(contacts, long-range, external) → kick dt/2.  Long-range forces are summed once per cycle of one or more steps; a
contact that forms or breaks ends the cycle.  The driver returns between two cycles, at the requested end or because no
step is possible, and in the middle of a step (STAGE = 1) if an array is too small; the call after it resumes there, so
enlarging arrays does not change the result.
"""

import functools
from collections.abc import Callable

from ..compiler.jit import kernel, loop
from ..contact.events import count_new_contacts
from ..forces.external.loops import external_loads
from ..forces.pair.loops import NO_LONG_RANGE_FORCE
from ..neighbours.skin import consume_skins, invalidate_speeds, reset_skins
from ..state.state import CONTACTS, CYCLE, LEFT, LONG_RANGE_SUMS, SQUARED_SPEED, SQUARED_SPIN, STAGE, STEP, STEPS, TIME
from .kernel_spec import KernelSpec, Stop
from .motion import kick
from .parallel_loops import large_loops
from .respa import (
    add_constant_loads,
    add_extrapolated_loads,
    add_long_range_loads,
    apply_impulse,
    clear_long_range_loads,
    contact_pair_loops,
    correct_angular_momentum,
    integrate_displacement,
    update_constant_loads,
)
from .step_control import cycle_steps
from .step_parts import (
    apply_drag_and_noise,
    contact_events_loop,
    drift_with_work_for,
    lists_loop,
    no_gas,
    no_rates,
    possible_step,
    rates_loop,
    remove_broken_contacts,
)
from .task_queue import join_workers, no_workers


@loop
def _no_loads_within_cycle(grains, long_range, elapsed):
    """For cycles of one step."""


@loop
def _no_impulse_at_start(grains, long_range, clock, dt):
    """Without r-RESPA."""


@loop
def _no_impulse_within(grains, long_range, span, clock, dt):
    """Without r-RESPA."""


@loop
def _no_impulse_at_end(grains, long_range, span, clock, elapsed, dt):
    """Without r-RESPA."""


@loop
def _no_impulse_at_early_end(grains, long_range, span, clock, elapsed):
    """Without r-RESPA."""


@loop
def _impulse_at_start(grains, long_range, clock, dt):
    """First impulse of a cycle; the kick dt/2 of its first step already contains dt/2 of the long-range loads."""
    update_constant_loads(grains, long_range)
    if clock[CYCLE] > dt:
        apply_impulse(grains, long_range, 0.5 * (clock[CYCLE] - dt))


@loop
def _impulse_within(grains, long_range, span, clock, dt):
    """Between two steps of a cycle, of clock[STEP] and dt seconds: accumulate the path of the constant force."""
    integrate_displacement(grains, long_range, span, 0.5 * (clock[STEP] + dt))


@loop
def _impulse_at_end(grains, long_range, span, clock, elapsed, dt):
    """Second impulse: half of the cycle was applied at its start, dt/2 with the last kick."""
    if clock[CYCLE] > dt:
        apply_impulse(grains, long_range, elapsed - 0.5 * clock[CYCLE] - 0.5 * dt)
        integrate_displacement(grains, long_range, span, 0.5 * dt)
        correct_angular_momentum(grains, long_range, span, elapsed - 0.5 * clock[CYCLE])


@loop
def _impulse_at_early_end(grains, long_range, span, clock, elapsed):
    """Second impulse between two steps: the last half kick contained the constant loads only."""
    apply_impulse(grains, long_range, 0.5 * clock[STEP])
    _impulse_at_end(grains, long_range, span, clock, elapsed, clock[STEP])


@loop
def _no_long_range(grains, contacts, long_range, count, parameters):
    """Without long-range forces."""


@loop
def _no_contact_pairs(grains, contacts, count, span, parameters):
    """For long-range loads that are not split."""


@loop
def _no_reassignment(grains, contacts, count, long_range, span, parameters):
    """For long-range loads that are not split."""


@loop
def _no_open_cycle(grains, contacts, long_range, clock, count, parameters):
    """For cycles of one step."""


_IMPULSES = (_impulse_at_start, _impulse_within, _impulse_at_end, _impulse_at_early_end)
_NO_IMPULSES = (_no_impulse_at_start, _no_impulse_within, _no_impulse_at_end, _no_impulse_at_early_end)


@functools.cache
def loads_loop(spec: KernelSpec) -> Callable:
    """The loop that sums forces and torques at the end of a step.

    Long-range loads are summed if `due`; within a cycle their constant part or extrapolation replaces them.
    """
    add_external = external_loads(spec.external)
    gather_all, long_range_loads = large_loops(spec).gather, large_loops(spec).long_range_loads
    add_within_cycle = (
        add_extrapolated_loads if spec.taylor else add_constant_loads if spec.impulse else _no_loads_within_cycle
    )
    subtract_contact_pairs = contact_pair_loops(spec.long_range.pair)[1] if spec.split else _no_reassignment

    @loop
    def sum_long_range(grains, contacts, long_range, count, parameters):
        clear_long_range_loads(long_range)
        long_range_loads(grains, contacts, long_range, count, parameters)
        subtract_contact_pairs(grains, contacts, count, long_range, parameters.span, parameters.long_range)
        add_long_range_loads(grains, long_range)

    add_long_range = _no_long_range if spec.long_range is NO_LONG_RANGE_FORCE else sum_long_range

    @loop
    def sum_loads(grains, contacts, long_range, clock, count, parameters, due, elapsed):
        gather_all(grains, contacts, long_range, count, parameters)
        add_external(grains, clock[TIME] + clock[STEP], parameters.external)
        if due:
            add_long_range(grains, contacts, long_range, count, parameters)
            count[LONG_RANGE_SUMS] += 1
        else:
            add_within_cycle(grains, long_range, elapsed)

    return sum_loads


@functools.cache
def loads_and_kick_loop(spec: KernelSpec) -> Callable:
    """The loop that sums the loads (`loads_loop`) and applies the second half kick; returns as `motion.kick` does."""
    sum_loads = loads_loop(spec)
    gather_and_kick_all = large_loops(spec).gather_and_kick

    @loop
    def contact_loads_and_kick(grains, contacts, long_range, clock, count, parameters, due, elapsed):
        count[LONG_RANGE_SUMS] += 1
        return gather_and_kick_all(grains, contacts, long_range, count, parameters, 0.5 * clock[STEP])

    @loop
    def loads_and_kick(grains, contacts, long_range, clock, count, parameters, due, elapsed):
        sum_loads(grains, contacts, long_range, clock, count, parameters, due, elapsed)
        return kick(grains, 0.5 * clock[STEP])

    return contact_loads_and_kick if spec.contacts_only else loads_and_kick


@functools.cache
def half_steps_for(spec: KernelSpec) -> tuple[Callable, Callable]:
    """The two halves of a velocity Verlet step.

    See `verlet_driver_for` for the step of length 0 at the start of a run.
    """
    drift_with_work = drift_with_work_for(spec.external, large_loops(spec).drift)
    sum_loads, loads_and_kick = loads_loop(spec), loads_and_kick_loop(spec)
    pass_contacts = large_loops(spec).pass_contacts
    update_lists, update_contacts = lists_loop(spec.law), contact_events_loop(spec.law)
    set_rates = rates_loop(spec.long_range.rates) if spec.taylor else no_rates
    add_contact_pairs, _, reassign_contact_pairs = (
        contact_pair_loops(spec.long_range.pair) if spec.split else (_no_contact_pairs, None, _no_reassignment)
    )
    impulse_at_start, impulse_within, impulse_at_end, impulse_at_early_end = _IMPULSES if spec.impulse else _NO_IMPULSES
    apply_gas = apply_drag_and_noise if spec.gas else no_gas
    speeds_change_between_steps = spec.impulse or spec.gas

    @loop
    def close_cycle(grains, contacts, long_range, clock, count, parameters):
        """End an unfinished cycle at the present step, so that a stopped run leaves a consistent state."""
        if clock[LEFT] > 0.0:
            elapsed = clock[CYCLE] - clock[LEFT]
            sum_loads(grains, contacts, long_range, clock, count, parameters, True, elapsed)
            impulse_at_early_end(grains, long_range, parameters.span, clock, elapsed)
            reassign_contact_pairs(grains, contacts, count, long_range, parameters.span, parameters.long_range)
            clock[LEFT], clock[CYCLE] = 0.0, elapsed

    close_open_cycle = _no_open_cycle if spec.contacts_only else close_cycle

    @loop
    def first_half(grains, contacts, pair_list, long_range, clock, count, lost, parameters):
        """Choose the step, kick dt/2 and drift; no step was taken unless `Stop.NONE` is returned."""
        dt, stop = possible_step(grains, contacts, pair_list, long_range, clock, count, parameters)
        if stop != Stop.NONE:
            close_open_cycle(grains, contacts, long_range, clock, count, parameters)
            return stop
        if clock[LEFT] == 0.0:
            cycle = dt * cycle_steps(clock, count, parameters.respa, dt)
            set_rates(grains, contacts, long_range, clock, parameters, cycle if cycle > dt else 0.0)
            clock[CYCLE] = clock[LEFT] = cycle
            impulse_at_start(grains, long_range, clock, dt)
        else:
            impulse_within(grains, long_range, parameters.span, clock, dt)
        consume_skins(pair_list, drift_with_work(grains, contacts, long_range, clock, count, lost, parameters, dt))
        clock[LEFT] = clock[LEFT] - dt if clock[LEFT] > 1.5 * dt else 0.0
        clock[STEP] = dt
        count[STAGE] = 1
        return Stop.NONE

    @loop
    def second_half(grains, contacts, pair_list, long_range, clock, count, lost, parameters):
        """Update lists and contacts, sum the loads, kick dt/2; called again after an array was enlarged."""
        stop, list_rebuilt = update_lists(grains, contacts, pair_list, long_range, count, parameters)
        if stop != Stop.NONE:
            return stop
        formed = count_new_contacts(grains, pair_list, count, parameters.span)
        if count[CONTACTS] + formed > contacts.pair.shape[1]:
            return Stop.CONTACTS_FULL
        flagged = pass_contacts(grains, contacts, long_range, clock, count, lost, parameters)
        broken = update_contacts(
            grains, contacts, pair_list, clock, count, lost, parameters, list_rebuilt, formed, flagged
        )
        dt, elapsed = clock[STEP], clock[CYCLE] - clock[LEFT]
        due = clock[LEFT] == 0.0 or broken or formed > 0
        add_contact_pairs(grains, contacts, count, parameters.span, parameters.long_range)
        fastest, fastest_spin = loads_and_kick(grains, contacts, long_range, clock, count, parameters, due, elapsed)
        pair_list.skin[SQUARED_SPEED], pair_list.skin[SQUARED_SPIN] = fastest, fastest_spin
        if due:
            impulse_at_end(grains, long_range, parameters.span, clock, elapsed, dt)
            reassign_contact_pairs(grains, contacts, count, long_range, parameters.span, parameters.long_range)
            clock[LEFT], clock[CYCLE] = 0.0, elapsed
        if broken:
            remove_broken_contacts(grains, contacts, pair_list, clock, count, parameters)
        clock[TIME] += dt
        count[STEPS] += 1
        count[STAGE] = 0
        if due:
            apply_gas(grains, clock, count, lost, parameters)
            if speeds_change_between_steps:
                invalidate_speeds(pair_list)
        return Stop.NONE

    return first_half, second_half


@functools.cache
def verlet_driver_for(spec: KernelSpec) -> Callable:
    """Compile the driver `advance` of velocity Verlet for one specification.

    A run starts in the middle of a step of length 0 (STAGE 1): its second half builds the lists, finds grains that
    overlap already and sums the loads; its counters and energies are discarded.
    """
    first_half, second_half = half_steps_for(spec)
    join = join_workers if spec.queue else no_workers

    @loop
    def steps_until(grains, contacts, pair_list, long_range, clock, count, lost, parameters, until, last):
        """Take steps until the first end of a cycle at or after `until` [s], or step `last`; returns a Stop."""
        reset_skins(pair_list, count)
        while True:
            if count[STAGE] == 0:
                if clock[LEFT] == 0.0:
                    if clock[TIME] >= until:
                        return Stop.TIME_REACHED
                    if count[STEPS] >= last:
                        return Stop.NONE
                stop = first_half(grains, contacts, pair_list, long_range, clock, count, lost, parameters)
                if stop != Stop.NONE:
                    return stop
            stop = second_half(grains, contacts, pair_list, long_range, clock, count, lost, parameters)
            if stop != Stop.NONE:
                return stop

    def advance(grains, contacts, pair_list, long_range, clock, count, lost, parameters, until, last):
        stop = steps_until(grains, contacts, pair_list, long_range, clock, count, lost, parameters, until, last)
        join(parameters)
        return stop

    return kernel(advance, cached=spec.keep, nogil=spec.queue, long_vectors=spec.wide, purpose="the time steps")


@functools.cache
def flight_driver_for(spec: KernelSpec) -> Callable:
    """Compile the driver `advance` that takes steps of `spec.flight_loop` while there are no contacts.

    Like `verlet_driver_for`, with the arrays of stages.
    """
    assert spec.flight_loop is not None
    first_half, second_half = half_steps_for(spec)
    free_flight = spec.flight_loop(spec)
    join = join_workers if spec.queue else no_workers

    @loop
    def steps_until(grains, contacts, pair_list, long_range, stages, clock, count, lost, parameters, until, last):
        """Take steps until the first end of a step or cycle at or after `until` [s], or step `last`; returns a Stop."""
        reset_skins(pair_list, count)
        while True:
            stop = Stop.NONE
            if count[STAGE] == 0:
                if clock[LEFT] == 0.0:
                    if clock[TIME] >= until:
                        return Stop.TIME_REACHED
                    if count[STEPS] >= last:
                        return Stop.NONE
                if count[CONTACTS] == 0 and clock[LEFT] == 0.0:
                    stop = free_flight(grains, contacts, pair_list, long_range, stages, clock, count, lost, parameters)
                else:
                    stop = first_half(grains, contacts, pair_list, long_range, clock, count, lost, parameters)
            if stop == Stop.NONE and count[STAGE] == 1:
                stop = second_half(grains, contacts, pair_list, long_range, clock, count, lost, parameters)
            if stop != Stop.NONE:
                return stop

    def advance(grains, contacts, pair_list, long_range, stages, clock, count, lost, parameters, until, last):
        stop = steps_until(grains, contacts, pair_list, long_range, stages, clock, count, lost, parameters, until, last)
        join(parameters)
        return stop

    return kernel(advance, cached=spec.keep, nogil=spec.queue, long_vectors=spec.wide, purpose="the time steps")


def driver_for(spec: KernelSpec) -> Callable:
    """The compiled driver `advance` for one specification."""
    return verlet_driver_for(spec) if spec.flight_loop is None else flight_driver_for(spec)
