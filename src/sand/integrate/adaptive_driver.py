"""Adaptive Runge–Kutta steps of grains without contacts.

One Runge–Kutta step:  rebuild the Verlet list if stale → trial step → repeat with a shorter step if the error is too
large → shorten the step to the first contact, if there is one → normalise orientations, wrap positions, log the work of
external forces.  A first contact ends the step; the second half of a Verlet step of 0 s then forms the contact.
"""

import math

from ..basics.state import (
    FLIGHT,
    GRAIN1,
    GRAIN2,
    REJECTED,
    TIME,
)
from ..compiler.jit import caller, loop
from ..compiler.program import call_stage, has_stage
from ..compiler.stage import stage
from ..neighbours.skin import largest_displacement
from ..numerics.vec import dot, load
from .event_location import NEVER, first_contact_time
from .flight import finish_flight_step
from .force_calls import sum_external
from .force_stages import ENERGY
from .parts import DRIVER_PARTS, Stop
from .runge_kutta import (
    GROW,
    begin_step,
    error_ratio,
    normalise_all,
    set_stage,
    step_size_factor,
    sum_loads,
    try_step,
    work_of,
)
from .stages import StageNumber
from .step_control import steps_of_free_grains

ORDER = 5.0
"""The error of a step is proportional to this power of its length."""
STALE_FRACTION = 0.25
"""Largest displacement of a grain since the list was built, at the start of a step, in units of the list's margin."""
STRIDE_FRACTION = 0.9
"""Displacement aimed at by a trial step, in units of the largest allowed one."""
MAX_ATTEMPTS = 30
"""Largest number of attempts to end a step at a contact; each squares the error of the previous one."""


@caller
def refresh_verlet_list(s):
    """Rebuild the Verlet list once a quarter of its margin is used up; returns a `Stop`."""
    if not s.search.listed:
        return Stop.NONE.value
    moved = largest_displacement(s.grains, s.long_range.anchor, s.span)
    # written so that an anchor at infinity (no list yet) counts as stale
    if not moved <= STALE_FRACTION * s.search.margin:
        return call_stage(s, StageNumber.VERLET_LIST)
    return Stop.NONE.value


@loop
def first_trial(grains, contacts, long_range, clock, criteria, stride):
    """First trial step [s]: proposed by the last step, or Verlet's after a start or a break; 0 if not finite."""
    dt = clock[FLIGHT]
    if not dt > 0.0:
        dt, _ = steps_of_free_grains(grains, long_range, contacts.start, criteria)
    fastest = 0.0
    for i in range(grains.mass.size):
        v = load(grains.velocity, i)
        fastest = max(fastest, dot(v, v))
    stride = STRIDE_FRACTION * stride
    if fastest * dt * dt > stride * stride:
        dt = stride / math.sqrt(fastest)
    return dt


@caller
def adaptive_step(s):
    """Take one Runge–Kutta step; returns its length [s], whether it ends at a contact, and a Stop.

    A step whose first trial would pass `until` [s] is not taken, or, with `shorten`, tried up to this time.
    """
    begin, stride = s.clock[TIME], s.flight_limits.stride
    dt = proposed = first_trial(s.grains, s.contacts, s.long_range, s.clock, s.criteria, stride)
    if not dt > 0.0:
        return 0.0, False, Stop.NOT_FINITE
    if begin + dt > s.until:
        if not s.shorten:
            return 0.0, False, Stop.TIME_REACHED
        dt = proposed = s.until - begin
    begin_step(s, begin)
    growth, attempts = GROW, 0
    while True:
        if attempts == 0 and begin + dt == begin:
            set_stage(s.grains, s.runge_kutta, 0, 0.0)
            sum_loads(s, begin)
            return 0.0, False, Stop.NO_STEP
        error, limiting_grain = math.inf, -1
        if try_step(s, begin, dt, stride):  # fmt: skip
            error, limiting_grain = error_ratio(s.runge_kutta, dt, s.flight_limits)
        if not error <= 1.0:
            s.count[GRAIN1], s.count[GRAIN2] = limiting_grain, -1
            s.count[REJECTED] += 1
            dt *= step_size_factor(error, ORDER)
            growth, attempts = 1.0, 0
            continue
        if attempts == 0:
            proposed = dt * min(growth, step_size_factor(error, ORDER))
        contact_time = (
            first_contact_time(s.grains, s.long_range, s.runge_kutta, s.span, s.search, dt) if s.settings.on else NEVER
        )
        if contact_time >= 1.0 or attempts == MAX_ATTEMPTS:
            s.clock[FLIGHT] = min(proposed, s.criteria.longest)
            return dt, contact_time <= 1.0, Stop.NONE
        dt *= contact_time
        attempts += 1


@stage(
    "the adaptive time steps",
    parts=(*DRIVER_PARTS, "contacts", "runge_kutta", "settings", "flight_limits"),
)
def free_flight(s):
    """Take one Runge–Kutta step and log the work of external forces; returns a `Stop`."""
    stop = refresh_verlet_list(s)
    if stop != Stop.NONE.value:
        return stop
    before = 0.0
    if s.external_work.time_dependent:
        before = sum_external(s, s.clock[TIME], ENERGY)
    dt, in_contact, reason = adaptive_step(s)
    if reason != Stop.NONE:
        return reason.value
    normalise_all(s.grains)
    work = work_of(s.runge_kutta, dt) if s.external_work.time_dependent else 0.0
    finish_flight_step(s, dt, in_contact, before, work)
    if s.external_work.position_dependent:
        sum_loads(s, s.clock[TIME])
    if in_contact:
        return Stop.NONE.value
    if has_stage(s, StageNumber.GAS_KICK):
        call_stage(s, StageNumber.GAS_KICK)
    return Stop.NONE.value
