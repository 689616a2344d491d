"""The compiled driver of adaptive runs: Runge–Kutta steps while nothing touches, velocity Verlet otherwise.

One step:  list of pairs made anew if need be → trial step → again and shorter if its error is too large → again up to
the first touch if two grains come to touch in it → orientations normalised, positions wrapped, work booked.  A touch
ends the step and is handed over as the second half of a Verlet step of 0 s, which forms the contact.
"""

import functools
import math
from collections.abc import Callable

from ..box import nearest_image
from ..compiler.jit import kernel, loop
from ..forces.external.loops import external_energy, external_wrap
from ..neighbours.cell_list import FULL, build_verlet_list
from ..neighbours.skin import invalidate_skins, invalidate_speeds, largest_displacement, reset_skins
from ..numerics.vec import dot, load, put
from ..state.state import (
    CHECKED,
    CONTACTS,
    CYCLE,
    FLIGHT,
    GRAIN1,
    GRAIN2,
    LEFT,
    OUTSIDE,
    REJECTED,
    STAGE,
    STEP,
    STEP_INCREASES,
    STEPS,
    TIME,
)
from .driver import half_steps_for
from .event_location import NEVER, first_contact_time
from .kernel_spec import KernelSpec, Stop
from .runge_kutta import (
    GROW,
    error_ratio,
    stage_loads,
    step_size_factor,
    normalise_all,
    set_stage,
    trial_step_loops,
    work_of,
)
from .step_control import INCREASE_INTERVAL, steps_of_free_grains
from .step_parts import apply_drag_and_noise, no_gas
from .task_queue import join_workers, no_workers

ORDER = 5.0
"""The error of a step goes as this power of its length."""
STALE_PART = 0.25
"""Part of the list's margin that grains may have moved when a step begins."""
STRIDE_PART = 0.9
"""Of the longest way, for the way foretold."""
TRIES = 30
"""Most attempts to end a step at a touch; each squares the error of the last, so that five are many."""


@loop
def refresh_verlet_list(grains, long_range, count, parameters):
    """Make the far list anew where a quarter of its margin is used up; FULL asks for longer arrays."""
    search = parameters.search
    if search.listed and not largest_displacement(grains, long_range.anchor, parameters.span) <= STALE_PART * search.margin:
        return build_verlet_list(grains, long_range, count, parameters.span, search)
    return 0


@loop
def first_trial(grains, contacts, long_range, clock, count, parameters):
    """The step to try [s]: what the last one left, or Verlet's own after a start or a parting; 0 if not finite."""
    dt = clock[FLIGHT]
    if not dt > 0.0:
        dt, _ = steps_of_free_grains(grains, long_range, contacts.start, count, parameters.criteria)
    fastest = 0.0
    for i in range(grains.mass.size):
        v = load(grains.velocity, i)
        fastest = max(fastest, dot(v, v))
    stride = STRIDE_PART * parameters.error_limits.stride
    if fastest * dt * dt > stride * stride:
        dt = stride / math.sqrt(fastest)
    return dt


@loop
def wrap_all(grains, span):
    """Bring all grains back into a periodic box."""
    for i in range(grains.mass.size):
        put(grains.position, i, nearest_image(load(grains.position, i), span))


@functools.cache
def step_for(spec: KernelSpec) -> Callable:
    """The loop that finds the length of a Runge–Kutta step and takes it: (length [s], touched?, stop)."""
    sum_stage = stage_loads(spec.external, spec.long_range.loads)
    begin_step, try_step = trial_step_loops(spec.external, spec.long_range.loads)

    @loop
    def fitting_step(grains, contacts, long_range, stages, clock, count, parameters):
        dt = wish = first_trial(grains, contacts, long_range, clock, count, parameters)
        if not dt > 0.0:
            return 0.0, False, Stop.NOT_FINITE
        begin_step(grains, stages, parameters, clock[TIME])
        growth, tries = GROW, 0
        while True:
            if tries == 0 and clock[TIME] + dt == clock[TIME]:
                set_stage(grains, stages, 0, 0.0)
                sum_stage(grains, long_range, count, parameters, clock[TIME])
                return 0.0, False, Stop.NO_STEP
            error, stray = math.inf, -1
            if try_step(grains, long_range, stages, count, parameters, clock[TIME], dt):
                error, stray = error_ratio(stages, dt, parameters.error_limits)
            if not error <= 1.0:
                count[GRAIN1], count[GRAIN2] = stray, -1
                count[REJECTED] += 1
                dt *= step_size_factor(error, ORDER)
                growth, tries = 1.0, 0
                continue
            if tries == 0:
                wish = dt * min(growth, step_size_factor(error, ORDER))
            touch = first_contact_time(grains, long_range, stages, parameters, dt) if parameters.contact.on else NEVER
            if touch >= 1.0 or tries == TRIES:
                clock[FLIGHT] = min(wish, parameters.criteria.longest)
                return dt, touch <= 1.0, Stop.STEPS_DONE
            dt *= touch
            tries += 1

    return fitting_step


@functools.cache
def flight_for(spec: KernelSpec) -> Callable:
    """The loop that takes one Runge–Kutta step and books it."""
    fitting_step, sum_stage = step_for(spec), stage_loads(spec.external, spec.long_range.loads)
    energy, wrap_with_work = external_energy(spec.external), external_wrap(spec.external)
    stir = apply_drag_and_noise if spec.gas else no_gas

    @loop
    def fly(grains, contacts, pair_list, long_range, stages, clock, count, lost, parameters):
        if refresh_verlet_list(grains, long_range, count, parameters) == FULL:
            return Stop.LIST_FULL
        before = energy(grains, clock[TIME], parameters.external) if parameters.external_work.time_dependent else 0.0
        dt, touched, stop = fitting_step(grains, contacts, long_range, stages, clock, count, parameters)
        if stop != Stop.STEPS_DONE:
            return stop
        normalise_all(grains)
        invalidate_speeds(pair_list)
        invalidate_skins(pair_list)
        clock[TIME] += dt
        if parameters.external_work.time_dependent:
            lost[OUTSIDE] -= energy(grains, clock[TIME], parameters.external) - before + work_of(stages, dt)
        if parameters.external_work.position_dependent:
            lost[OUTSIDE] -= wrap_with_work(grains, parameters.span, clock[TIME], parameters.external)
            sum_stage(grains, long_range, count, parameters, clock[TIME])
        else:
            wrap_all(grains, parameters.span)
        clock[STEP] = clock[CYCLE] = clock[LEFT] = 0.0
        if touched:
            # what is left is the second half of a step of 0 s, with new lists and then a new choice of the step
            pair_list.anchor[0, 0] = math.inf
            clock[FLIGHT] = 0.0
            count[CHECKED] = count[STEP_INCREASES] = count[STEPS] - INCREASE_INTERVAL
            count[STAGE] = 1
            return Stop.STEPS_DONE
        clock[STEP] = dt
        count[STEPS] += 1
        stir(grains, clock, count, lost, parameters)
        return Stop.STEPS_DONE

    return fly


@functools.cache
def adaptive_driver_for(spec: KernelSpec) -> Callable:
    """The compiled `advance` of an adaptive run; as `advance.driver_for`, with the stages besides."""
    first_half, second_half = half_steps_for(spec)
    fly = flight_for(spec)
    leave = join_workers if spec.queue else no_workers

    @loop
    def steps_until(grains, contacts, pair_list, long_range, stages, clock, count, lost, parameters, until, last):
        """Steps until the first end of a step or cycle at or after `until` [s], or step `last`; returns a Stop."""
        reset_skins(pair_list, count)
        while True:
            stop = Stop.STEPS_DONE
            if count[STAGE] == 0:
                if clock[LEFT] == 0.0:
                    if clock[TIME] >= until:
                        return Stop.TIME_REACHED
                    if count[STEPS] >= last:
                        return Stop.STEPS_DONE
                if count[CONTACTS] == 0 and clock[LEFT] == 0.0:
                    stop = fly(grains, contacts, pair_list, long_range, stages, clock, count, lost, parameters)
                else:
                    stop = first_half(grains, contacts, pair_list, long_range, clock, count, lost, parameters)
            if stop == Stop.STEPS_DONE and count[STAGE] == 1:
                stop = second_half(grains, contacts, pair_list, long_range, clock, count, lost, parameters)
            if stop != Stop.STEPS_DONE:
                return stop

    def advance(grains, contacts, pair_list, long_range, stages, clock, count, lost, parameters, until, last):
        stop = steps_until(grains, contacts, pair_list, long_range, stages, clock, count, lost, parameters, until, last)
        leave(parameters)
        return stop

    return kernel(advance, keep=spec.keep, alone=spec.queue, wide=spec.wide)
