"""The compiled driver: thousands of velocity Verlet steps per call from Python.

One step:  choose dt → kick dt/2, drift and turn dt → lists of pairs checked → contacts: pass, break or move, form
→ forces (contacts, far, per grain) → kick dt/2.  Far forces are summed once in a cycle of one or more steps; a
contact that forms or breaks ends the cycle.  The driver comes back between two cycles, for the end of the time
asked for or because no step can be taken, and in the middle of a step (STAGE) for longer arrays; it goes on from
there, so that growing arrays changes no number.
"""

import functools
from collections.abc import Callable

from ..compiler.jit import kernel, loop
from ..contact.events import new_touches
from ..forces.external.loops import external_loads
from ..forces.pair.loops import NO_LONG_RANGE_FORCE
from ..neighbours.skin import consume_skins, invalidate_speeds, reset_skins
from ..state.state import CONTACTS, CYCLE, LARGEST_SPEED, LARGEST_SPIN, LEFT, LONG_RANGE_SUMS, STAGE, STEP, STEPS, TIME
from .kernel_spec import KernelSpec, Stop
from .motion import kick
from .parallel_loops import large_loops
from .respa import (
    add_extrapolated_loads,
    add_long_range_loads,
    add_slow_loads,
    apply_impulse,
    bonded_loops,
    clear_long_range_loads,
    follow_path,
    keep_angular_momentum,
    update_slow_loads,
)
from .step_control import cycle_steps
from .step_parts import (
    apply_drag_and_noise,
    drift_with_work_for,
    no_gas,
    no_rates,
    possible_step,
    rates_loop,
    remove_broken_contacts,
    update_contacts,
    update_lists,
)
from .task_queue import join_workers, no_workers


@loop
def _nothing_between(grains, long_range, elapsed):
    """In a cycle of one step nothing lies between two sums."""


@loop
def _no_begin(grains, long_range, clock, dt):
    """Far loads act with all others."""


@loop
def _no_inner(grains, long_range, span, clock, dt):
    """As above."""


@loop
def _no_end(grains, long_range, span, clock, elapsed, dt):
    """As above."""


@loop
def _no_cut(grains, long_range, span, clock, elapsed):
    """As above."""


@loop
def _begin_impulse(grains, long_range, clock, dt):
    """The first of a cycle's two impulses; half a step of the far loads is given with all others."""
    update_slow_loads(grains, long_range)
    if clock[CYCLE] > dt:
        apply_impulse(grains, long_range, 0.5 * (clock[CYCLE] - dt))


@loop
def _inside_impulses(grains, long_range, span, clock, dt):
    """Between two steps of a cycle, the last of clock[STEP] and the next of dt seconds."""
    follow_path(grains, long_range, span, 0.5 * (clock[STEP] + dt))


@loop
def _end_impulse(grains, long_range, span, clock, elapsed, dt):
    """The second impulse: half the cycle was given at its begin, half a step just now."""
    if clock[CYCLE] > dt:
        apply_impulse(grains, long_range, elapsed - 0.5 * clock[CYCLE] - 0.5 * dt)
        follow_path(grains, long_range, span, 0.5 * dt)
        keep_angular_momentum(grains, long_range, span, elapsed - 0.5 * clock[CYCLE])


@loop
def _cut_impulse(grains, long_range, span, clock, elapsed):
    """The second impulse between two steps: the last half step had the held loads alone."""
    apply_impulse(grains, long_range, 0.5 * clock[STEP])
    _end_impulse(grains, long_range, span, clock, elapsed, clock[STEP])


@loop
def _no_far(grains, contacts, long_range, count, rules):
    """No grain feels another from afar."""


@loop
def _no_bonded(grains, contacts, count, span, numbers):
    """Pairs in contact are not apart from the others."""


@loop
def _no_change(grains, contacts, count, long_range, span, numbers):
    """As above."""


@loop
def _no_cycle(grains, contacts, long_range, clock, count, rules):
    """A cycle of one step needs no cutting."""


_IMPULSES = (_begin_impulse, _inside_impulses, _end_impulse, _cut_impulse)
_NO_IMPULSES = (_no_begin, _no_inner, _no_end, _no_cut)


@functools.cache
def loads_loop(plan: KernelSpec) -> Callable:
    """The loop that sums forces and torques at the end of a step: the far ones if `due`, else what stands for them."""
    add_outside = external_loads(plan.external)
    gather_all, far_loads = large_loops(plan).gather, large_loops(plan).far_loads
    between = add_extrapolated_loads if plan.taylor else add_slow_loads if plan.impulse else _nothing_between
    take_out_bonded = bonded_loops(plan.long_range.pair)[1] if plan.split else _no_change

    @loop
    def sum_far(grains, contacts, long_range, count, rules):
        clear_long_range_loads(long_range)
        far_loads(grains, contacts, long_range, count, rules)
        take_out_bonded(grains, contacts, count, long_range, rules.span, rules.long_range)
        add_long_range_loads(grains, long_range)

    add_far = _no_far if plan.long_range is NO_LONG_RANGE_FORCE else sum_far

    @loop
    def sum_loads(grains, contacts, long_range, clock, count, rules, due, elapsed):
        gather_all(grains, contacts, long_range, count, rules)
        add_outside(grains, clock[TIME] + clock[STEP], rules.external)
        if due:
            add_far(grains, contacts, long_range, count, rules)
            count[LONG_RANGE_SUMS] += 1
        else:
            between(grains, long_range, elapsed)

    return sum_loads


@functools.cache
def loads_and_kick_loop(plan: KernelSpec) -> Callable:
    """The loop for the end of a step: `loads_loop`, and the kick for its second half; returns what `kick` does."""
    sum_loads = loads_loop(plan)
    gather_and_kick_all = large_loops(plan).gather_and_kick

    @loop
    def bare_loads_and_kick(grains, contacts, long_range, clock, count, rules, due, elapsed):
        count[LONG_RANGE_SUMS] += 1
        return gather_and_kick_all(grains, contacts, long_range, count, rules, 0.5 * clock[STEP])

    @loop
    def loads_and_kick(grains, contacts, long_range, clock, count, rules, due, elapsed):
        sum_loads(grains, contacts, long_range, clock, count, rules, due, elapsed)
        return kick(grains, 0.5 * clock[STEP])

    return bare_loads_and_kick if plan.contacts_only else loads_and_kick


@functools.cache
def halves_for(plan: KernelSpec) -> tuple[Callable, Callable]:
    """The two halves of a velocity Verlet step for one plan.

    The second half of a step of 0 s finds the pairs and the contacts that are there and works out the loads.
    """
    drift_with_work = drift_with_work_for(plan.external, large_loops(plan).drift)
    sum_loads, loads_and_kick = loads_loop(plan), loads_and_kick_loop(plan)
    pass_contacts = large_loops(plan).pass_contacts
    set_rates = rates_loop(plan.long_range.rates) if plan.taylor else no_rates
    add_bonded, _, swap_slow_parts = (
        bonded_loops(plan.long_range.pair) if plan.split else (_no_bonded, None, _no_change)
    )
    begin, inside, end, cut = _IMPULSES if plan.impulse else _NO_IMPULSES
    stir = apply_drag_and_noise if plan.gas else no_gas
    kicked_besides = plan.impulse or plan.gas

    @loop
    def cut_cycle(grains, contacts, long_range, clock, count, rules):
        """End a cycle where it stands, so that what a run leaves behind when it stops is whole."""
        if clock[LEFT] > 0.0:
            elapsed = clock[CYCLE] - clock[LEFT]
            sum_loads(grains, contacts, long_range, clock, count, rules, True, elapsed)
            cut(grains, long_range, rules.span, clock, elapsed)
            swap_slow_parts(grains, contacts, count, long_range, rules.span, rules.long_range)
            clock[LEFT], clock[CYCLE] = 0.0, elapsed

    cut_short = _no_cycle if plan.contacts_only else cut_cycle

    @loop
    def first_half(grains, contacts, pair_list, long_range, clock, count, lost, rules):
        """Choose the step, kick half of it, drift; anything but STEPS_DONE: no step was taken."""
        dt, stop = possible_step(grains, contacts, pair_list, long_range, clock, count, rules)
        if stop != Stop.STEPS_DONE:
            cut_short(grains, contacts, long_range, clock, count, rules)
            return stop
        if clock[LEFT] == 0.0:
            cycle = dt * cycle_steps(clock, count, rules.respa, dt)
            set_rates(grains, contacts, long_range, clock, rules, cycle if cycle > dt else 0.0)
            clock[CYCLE] = clock[LEFT] = cycle
            begin(grains, long_range, clock, dt)
        else:
            inside(grains, long_range, rules.span, clock, dt)
        consume_skins(pair_list, drift_with_work(grains, contacts, long_range, clock, count, lost, rules, dt))
        clock[LEFT] = clock[LEFT] - dt if clock[LEFT] > 1.5 * dt else 0.0
        clock[STEP] = dt
        count[STAGE] = 1
        return Stop.STEPS_DONE

    @loop
    def second_half(grains, contacts, pair_list, long_range, clock, count, lost, rules):
        """Contacts, loads, the other half kick; may be entered again after arrays have grown."""
        stop, stale = update_lists(grains, contacts, pair_list, long_range, count, rules)
        if stop != Stop.STEPS_DONE:
            return stop
        fresh = new_touches(grains, pair_list, count, rules.span)
        if count[CONTACTS] + fresh > contacts.pair.shape[1]:
            return Stop.CONTACTS_FULL
        flagged = pass_contacts(grains, contacts, long_range, clock, count, lost, rules)
        parted = update_contacts(grains, contacts, pair_list, clock, count, lost, rules, stale, fresh, flagged)
        dt, elapsed = clock[STEP], clock[CYCLE] - clock[LEFT]
        due = clock[LEFT] == 0.0 or parted or fresh > 0
        add_bonded(grains, contacts, count, rules.span, rules.long_range)
        fastest, fastest_spin = loads_and_kick(grains, contacts, long_range, clock, count, rules, due, elapsed)
        pair_list.skin[LARGEST_SPEED], pair_list.skin[LARGEST_SPIN] = fastest, fastest_spin
        if due:
            end(grains, long_range, rules.span, clock, elapsed, dt)
            swap_slow_parts(grains, contacts, count, long_range, rules.span, rules.long_range)
            clock[LEFT], clock[CYCLE] = 0.0, elapsed
        if parted:
            remove_broken_contacts(grains, contacts, pair_list, clock, count, rules)
        clock[TIME] += dt
        count[STEPS] += 1
        count[STAGE] = 0
        if due:
            stir(grains, clock, count, lost, rules)
            if kicked_besides:
                invalidate_speeds(pair_list)
        return Stop.STEPS_DONE

    return first_half, second_half


@functools.cache
def driver_for(plan: KernelSpec) -> Callable:
    """The compiled `advance` for one plan.

    A world starts at STAGE 1 with a step of 0 s (what that counts and books is not part of a run).
    """
    first_half, second_half = halves_for(plan)
    leave = join_workers if plan.queue else no_workers

    @loop
    def steps_until(grains, contacts, pair_list, long_range, clock, count, lost, rules, until, last):
        """Steps until the first end of a cycle at or after `until` [s], or step `last`; returns a Stop."""
        reset_skins(pair_list, count)
        while True:
            if count[STAGE] == 0:
                if clock[LEFT] == 0.0:
                    if clock[TIME] >= until:
                        return Stop.TIME_REACHED
                    if count[STEPS] >= last:
                        return Stop.STEPS_DONE
                stop = first_half(grains, contacts, pair_list, long_range, clock, count, lost, rules)
                if stop != Stop.STEPS_DONE:
                    return stop
            stop = second_half(grains, contacts, pair_list, long_range, clock, count, lost, rules)
            if stop != Stop.STEPS_DONE:
                return stop

    def advance(grains, contacts, pair_list, long_range, clock, count, lost, rules, until, last):
        stop = steps_until(grains, contacts, pair_list, long_range, clock, count, lost, rules, until, last)
        leave(rules)
        return stop

    return kernel(advance, keep=plan.keep, alone=plan.queue, wide=plan.wide)
