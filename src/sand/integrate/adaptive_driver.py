"""Adaptive Runge–Kutta steps of grains without contacts.

One Runge–Kutta step:  rebuild the Verlet list if stale → trial step → repeat with a shorter step if the error is too
large → shorten the step to the first contact, if there is one → normalise orientations, wrap positions, log the work of
external forces.  A first contact ends the step; the second half of a Verlet step of 0 s then forms the contact.
"""

import functools
import math
from collections.abc import Callable

from ..box import nearest_image
from ..compiler.jit import loop
from ..forces.external.loops import external_energy, external_wrap
from ..neighbours.cell_list import FULL, build_verlet_list
from ..neighbours.skin import invalidate_skins, invalidate_speeds, largest_displacement
from ..numerics.vec import dot, load, put
from ..state.state import (
    CHECKED,
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
from .event_location import NEVER, first_contact_time
from .kernel_spec import KernelSpec, Stop
from .runge_kutta import (
    GROW,
    error_ratio,
    normalise_all,
    set_stage,
    stage_loads,
    step_size_factor,
    trial_step_loops,
    work_of,
)
from .step_control import INCREASE_INTERVAL, steps_of_free_grains
from .step_parts import apply_drag_and_noise, no_gas

ORDER = 5.0
"""The error of a step is proportional to this power of its length."""
STALE_FRACTION = 0.25
"""Largest displacement of a grain since the list was built, at the start of a step, in units of the list's margin."""
STRIDE_FRACTION = 0.9
"""Displacement aimed at by a trial step, in units of the largest allowed one."""
MAX_ATTEMPTS = 30
"""Largest number of attempts to end a step at a contact; each squares the error of the previous one."""


@loop
def refresh_verlet_list(grains, long_range, count, parameters):
    """Rebuild the Verlet list once a quarter of its margin is used up; FULL if the array is too small."""
    search = parameters.search
    if not search.listed:
        return 0
    moved = largest_displacement(grains, long_range.anchor, parameters.span)
    # written so that an anchor at infinity (no list yet) counts as stale
    if not moved <= STALE_FRACTION * search.margin:
        return build_verlet_list(grains, long_range, count, parameters.span, search)
    return 0


@loop
def first_trial(grains, contacts, long_range, clock, count, parameters):
    """First trial step [s]: proposed by the last step, or Verlet's after a start or a break; 0 if not finite."""
    dt = clock[FLIGHT]
    if not dt > 0.0:
        dt, _ = steps_of_free_grains(grains, long_range, contacts.start, count, parameters.criteria)
    fastest = 0.0
    for i in range(grains.mass.size):
        v = load(grains.velocity, i)
        fastest = max(fastest, dot(v, v))
    stride = STRIDE_FRACTION * parameters.flight_limits.stride
    if fastest * dt * dt > stride * stride:
        dt = stride / math.sqrt(fastest)
    return dt


@loop
def wrap_all(grains, span):
    """Wrap all positions into the periodic box."""
    for i in range(grains.mass.size):
        put(grains.position, i, nearest_image(load(grains.position, i), span))


@functools.cache
def adaptive_step_for(spec: KernelSpec) -> Callable:
    """The loop that takes one Runge–Kutta step; returns its length [s], whether it ends at a contact, and a Stop."""
    sum_stage = stage_loads(spec.external, spec.long_range.loads)
    begin_step, try_step = trial_step_loops(spec.external, spec.long_range.loads)

    @loop
    def adaptive_step(grains, contacts, long_range, stages, clock, count, parameters):
        dt = proposed = first_trial(grains, contacts, long_range, clock, count, parameters)
        if not dt > 0.0:
            return 0.0, False, Stop.NOT_FINITE
        begin_step(grains, stages, parameters, clock[TIME])
        growth, attempts = GROW, 0
        while True:
            if attempts == 0 and clock[TIME] + dt == clock[TIME]:
                set_stage(grains, stages, 0, 0.0)
                sum_stage(grains, long_range, count, parameters, clock[TIME])
                return 0.0, False, Stop.NO_STEP
            error, limiting_grain = math.inf, -1
            if try_step(grains, long_range, stages, count, parameters, clock[TIME], dt):
                error, limiting_grain = error_ratio(stages, dt, parameters.flight_limits)
            if not error <= 1.0:
                count[GRAIN1], count[GRAIN2] = limiting_grain, -1
                count[REJECTED] += 1
                dt *= step_size_factor(error, ORDER)
                growth, attempts = 1.0, 0
                continue
            if attempts == 0:
                proposed = dt * min(growth, step_size_factor(error, ORDER))
            if parameters.contact.on:
                contact_time = first_contact_time(grains, long_range, stages, parameters, dt)
            else:
                contact_time = NEVER
            if contact_time >= 1.0 or attempts == MAX_ATTEMPTS:
                clock[FLIGHT] = min(proposed, parameters.criteria.longest)
                return dt, contact_time <= 1.0, Stop.NONE
            dt *= contact_time
            attempts += 1

    return adaptive_step


@functools.cache
def free_flight_for(spec: KernelSpec) -> Callable:
    """The loop that takes one Runge–Kutta step and logs the work of external forces."""
    adaptive_step, sum_stage = adaptive_step_for(spec), stage_loads(spec.external, spec.long_range.loads)
    energy, wrap_with_work = external_energy(spec.external), external_wrap(spec.external)
    apply_gas = apply_drag_and_noise if spec.gas else no_gas

    @loop
    def free_flight(grains, contacts, pair_list, long_range, stages, clock, count, lost, parameters):
        if refresh_verlet_list(grains, long_range, count, parameters) == FULL:
            return Stop.LIST_FULL
        before = energy(grains, clock[TIME], parameters.external) if parameters.external_work.time_dependent else 0.0
        dt, in_contact, stop = adaptive_step(grains, contacts, long_range, stages, clock, count, parameters)
        if stop != Stop.NONE:
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
        if in_contact:
            # the second half of a step of 0 s follows, with new lists and a new choice of the step
            pair_list.anchor[0, 0] = math.inf
            clock[FLIGHT] = 0.0
            count[CHECKED] = count[STEP_INCREASES] = count[STEPS] - INCREASE_INTERVAL
            count[STAGE] = 1
            return Stop.NONE
        clock[STEP] = dt
        count[STEPS] += 1
        apply_gas(grains, clock, count, lost, parameters)
        return Stop.NONE

    return free_flight
