"""The compiled driver of rigid clusters: steps of all bodies, until a cluster has to wake or contact steps are needed.

One step:  choose h → kick ½h, drift, rotor → long-range and external forces on all grains → kick ½h.  In a gas the
drift is two of ½h, with friction and noise between them (`body_friction`).  The driver returns before a step in which
bodies may touch (`Stop.HAS_TO_WAKE`), and before one in which some bodies take substeps (`Stop.SUBSTEPS`), see
`substeps`.  While a cluster is awake it returns twice in a step: after the drift, so that
grains of awake clusters take their contact steps (`AWAKE_STEPS`), and at the end (`AWAKE_LOADS`).
"""

import math

from ...basics.state import (
    BODIES,
    BROKEN,
    COMPARED,
    GAS,
    GRAINS_AWAKE,
    KICKED,
    LARGEST_LOAD,
    LONG_RANGE_SKIN,
    MADE,
    OUTSIDE,
    PAIR_LIST_SKIN,
    PAIRS,
    PHASE,
    SOME_AWAKE,
    STEP,
    STEPS,
    TIME,
)
from ...compiler.jit import caller, formula, loop
from ...compiler.program import call_stage, has_stage
from ...compiler.stage import stage
from ...neighbours.skin import invalidate_skins, invalidate_speeds, list_is_stale
from ...numerics.flow import extends_over_half, relative_velocity
from ...numerics.kinds_of_box import unless_still
from ...numerics.quaternion import turned
from ...numerics.rotor import LARGEST_PIECE
from ...numerics.vec import accrue, dot, load, load4, nearest_image, norm, put, sub
from ..force_calls import add_external_loads, sum_external, sum_pair_forces
from ..force_stages import ENERGY, WRAPPING
from ..hooks import Hook, call_hook
from ..motion import wrap_all
from ..parts import DRIVER_PARTS, DT, LIMIT, Stop
from ..respa import add_long_range_loads
from ..stages import StageNumber
from ..step_control import has_arrived, is_past
from ..task_queue import join_workers
from .body_friction import drift_bodies_in_gas
from .body_touches import CLEAR, LOADED, TOUCHING, find_near_bodies
from .rigid_body import (
    contact_loads_bound,
    drift_bodies,
    kick_bodies,
    move_velocities,
    spin_of,
    sum_body_loads,
)
from .substeps import AFTER_ALL, AFTER_SUBSTEPS, choose_shared_step, squared_rate

LARGEST_TURN, TURN_PER_FRACTION = 1.0, 10.0
"""Largest rotation of a body in one step [rad], so that loads that turn with it are averaged over six directions, and
the same in units of η, so that errors fall as η²."""
LARGEST_FLIGHT = 0.2
"""Largest flight of a grain in one step, in units of the gap of the pair list, so that no pair is missed."""


@formula
def squared_rates(grains, bodies, criteria, limits, b):
    """`squared_rate` of body b by the fields of other bodies and its force."""
    first = bodies.member[bodies.start[b]]
    q, energy = load4(bodies.orientation, first), 0.0
    for k in range(bodies.start[b], bodies.start[b + 1]):
        i = bodies.member[k]
        outer = sub(load(grains.field, i), turned(q, load(bodies.inner_field, i)))
        energy += norm(load(grains.moment, i)) * (norm(outer) + criteria.outer_field)
    return squared_rate(bodies, first, load(bodies.force, first), energy, limits.smallest_radius)


@loop
def within_rate(h, rate):
    """The step h [s], or the largest of h/2, h/4, … that is at most 1/`rate`."""
    if h * rate > 1.0:
        h *= 2.0 ** math.floor(-math.log2(h * rate))
        h = 0.5 * h if h * rate > 1.0 else h
    return h


@loop
def longest_step(grains, bodies, pair_list, count, span, criteria, limits, some_awake):
    """The next step [s] of all bodies, a power of two of the longest one; NaN if the state is not finite.

    Returns
    -------
    tuple of float
        The step that all bodies require, and the longest one that the flight of the fastest grain allows.
    """
    square = fastest = 0.0
    bodies.near[:] = CLEAR
    for b in range(count[BODIES]):
        first = bodies.member[bodies.start[b]]
        if bodies.asleep[first] == 1:
            spin = spin_of(bodies, first)
            rate = squared_rates(grains, bodies, criteria, limits, b)
            rate = max(rate, dot(spin, spin) * max(limits.step_fraction / LARGEST_TURN, 1.0 / TURN_PER_FRACTION) ** 2)
            bodies.rate[first] = rate
            square = max(square, rate)
        for k in range(bodies.start[b], bodies.start[b + 1]):
            v = load(grains.velocity, bodies.member[k])
            speed = dot(v, v)
            if not speed < math.inf:
                return math.nan, math.nan
            fastest = max(fastest, speed)
    for p in range(count[PAIRS]):
        i, j = pair_list.pair[0, p], pair_list.pair[1, p]
        if bodies.first[i] != bodies.first[j] and bodies.asleep[i] + bodies.asleep[j] > 0:
            apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
            v = relative_velocity(grains, i, j, apart, span)
            rate = dot(v, v) / dot(apart, apart)
            one, other = bodies.first[i], bodies.first[j]
            square = max(square, rate)
            bodies.rate[one], bodies.rate[other] = max(bodies.rate[one], rate), max(bodies.rate[other], rate)
    longest = within_rate(
        min(limits.longest_step, criteria.longest), math.sqrt(fastest) / (LARGEST_FLIGHT * criteria.pair_gap)
    )
    rate = math.sqrt(square) / limits.step_fraction
    return within_rate(longest, max(rate, 1.0 / limits.longest_awake) if some_awake else rate), longest


@unless_still(lambda bodies, b, span: False)
def has_outgrown_box(bodies, b, span):
    """Whether body b extends over half of a box that is deformed along an axis."""
    q = load4(bodies.orientation, bodies.member[bodies.start[b]])
    low, high = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for k in range(bodies.start[b], bodies.start[b + 1]):
        s = turned(q, load(bodies.offset, bodies.member[k]))
        low = min(low[0], s[0]), min(low[1], s[1]), min(low[2], s[2])
        high = max(high[0], s[0]), max(high[1], s[1]), max(high[2], s[2])
    return extends_over_half(low, high, span)


@loop
def find_loaded_bodies(grains, bodies, clock, count, span):
    """Mark bodies the loads of whose contacts may have changed by more than their reserve, or that no longer fit."""
    for b in range(count[BODIES]):
        first = bodies.member[bodies.start[b]]
        if bodies.asleep[first] == 1 and bodies.start[b + 1] - bodies.start[b] > 1:
            if has_outgrown_box(bodies, b, span):
                bodies.near[first] = TOUCHING
            bound = contact_loads_bound(grains, bodies, b)
            if bound > bodies.reserve[first]:
                bodies.near[first] = max(bodies.near[first], LOADED)
            else:
                bodies.load[first] = bodies.changed[first] + bound
                clock[LARGEST_LOAD] = max(clock[LARGEST_LOAD], bodies.load[first])


@loop
def any_has_to_wake(bodies, count):
    """Whether any body asleep is marked."""
    for b in range(count[BODIES]):
        first = bodies.member[bodies.start[b]]
        if bodies.near[first] >= LOADED and bodies.asleep[first] == 1:
            return True
    return False


@caller
def drift_with_work(s, h):
    """Move the bodies at rest without substeps; log the work of external forces of time or position, and of a gas.

    Grains of awake clusters stay where they are; the change of their energies with time is part of the work.
    """
    start, end, gained = s.clock[TIME], s.clock[TIME] + h, 0.0
    is_wrapped, piece = not s.external_work.position_dependent, min(LARGEST_PIECE, s.flight_limits.step_fraction)
    if s.external_work.time_dependent:
        gained += sum_external(s, end, ENERGY)
        gained -= sum_external(s, start, ENERGY)
    if s.gas.gas.on:
        s.lost[GAS] += drift_bodies_in_gas(s.grains, s.bodies, s.count, s.span, s.gas, h, is_wrapped, piece)
    else:
        drift_bodies(s.grains, s.bodies, s.count, s.span, h, is_wrapped, piece)
    if s.external_work.time_dependent:
        gained += sum_external(s, end, ENERGY)
        gained -= sum_external(s, start, ENERGY)
    gained *= 0.5
    if s.external_work.position_dependent:
        gained += sum_external(s, end, WRAPPING)
        wrap_all(s.grains, s.span)
    s.lost[OUTSIDE] -= gained


@caller
def update_lists(s):
    """Rebuild stale lists; returns the value of a `Stop`."""
    invalidate_skins(s.pair_list)
    if s.search.listed and list_is_stale(
        s.grains, s.long_range, s.span, 0.5 * s.search.margin, s.search.reach, s.pair_list.skin, LONG_RANGE_SKIN
    ):
        stop = call_stage(s, StageNumber.VERLET_LIST)
        if stop != Stop.NONE.value:
            return stop
    if list_is_stale(
        s.grains, s.pair_list, s.span, 0.25 * s.criteria.pair_gap, s.search.reach, s.pair_list.skin, PAIR_LIST_SKIN
    ):
        return call_stage(s, StageNumber.PAIR_LIST)
    return Stop.NONE.value


@caller
def sum_loads(s, excludes_loads):
    """Sum all loads on the grains but those of contacts, at the time of the end of the step; add those excluded."""
    for i in range(s.grains.mass.size):
        put(s.grains.force, i, (0.0, 0.0, 0.0))
        put(s.grains.torque, i, (0.0, 0.0, 0.0))
    add_external_loads(s, s.clock[TIME] + s.clock[STEP])
    if s.forces.pair > 0:
        sum_pair_forces(s)
        add_long_range_loads(s.grains, s.long_range)
    if excludes_loads:
        for i in range(s.grains.mass.size):
            accrue(s.grains.force, i, load(s.bodies.excluded_force, i))
            accrue(s.grains.torque, i, load(s.bodies.excluded_torque, i))


@loop
def awake_grains(bodies):
    """Number of grains of clusters that are awake."""
    number = 0
    for i in range(bodies.asleep.size):
        number += 1 if bodies.asleep[i] == 0 else 0
    return number


@caller
def first_half(s, some_awake):
    """Choose the step, kick and drift; returns the value of a `Stop`, `NONE` if the step was begun."""
    s.bodies.quick[:] = 0
    sum_body_loads(s.grains, s.bodies, s.count, s.flight_limits.excludes_loads)
    h, longest = longest_step(s.grains, s.bodies, s.pair_list, s.count, s.span, s.criteria, s.flight_limits, some_awake)
    if not h > 0.0:
        call_stage(s, StageNumber.EXPLAIN, Stop.NOT_FINITE.value)
        return Stop.NOT_FINITE.value
    if has_stage(s, Hook.LIMIT_STEP):
        s.scratch[LIMIT] = h
        stop = call_hook(s, Hook.LIMIT_STEP)
        if stop != Stop.NONE.value:
            call_stage(s, StageNumber.EXPLAIN, stop)
            return stop
        h = within_rate(h, 1.0 / s.scratch[LIMIT])
    if s.clock[TIME] + h == s.clock[TIME]:
        return Stop.NO_STEP.value
    takes_substeps = False
    if s.flight_limits.substeps:
        shared = choose_shared_step(s, h, longest)
        h, takes_substeps = shared, shared > h
    if is_past(s.clock[TIME] + h, s.until):
        if not s.shorten:
            s.bodies.quick[:] = 0
            return Stop.TIME_REACHED.value
        h = s.until - s.clock[TIME]
    s.clock[STEP] = s.scratch[DT] = h
    if not takes_substeps:
        find_near_bodies(s.grains, s.bodies, s.pair_list, s.count, s.span, s.gas, s.flight_limits.friction_rate, h)
        call_hook(s, Hook.NEAR_BODIES)
    find_loaded_bodies(s.grains, s.bodies, s.clock, s.count, s.span)
    if any_has_to_wake(s.bodies, s.count):
        s.bodies.quick[:] = 0
        return Stop.HAS_TO_WAKE.value
    if takes_substeps:
        return Stop.SUBSTEPS.value
    call_hook(s, Hook.BEFORE_BODIES)
    kick_bodies(s.bodies, s.count, 0.5 * h)
    drift_with_work(s, h)
    call_hook(s, Hook.AFTER_BODIES)
    if not some_awake:
        call_hook(s, Hook.NONE_AWAKE)
    s.count[PHASE] = 1
    return Stop.AWAKE_STEPS.value if some_awake else Stop.NONE.value


@caller
def second_half(s, awake, had_substeps):
    """Update the lists, sum the loads, and kick; returns the value of a `Stop`."""
    stop = update_lists(s)
    if stop != Stop.NONE.value:
        return stop
    sum_loads(s, s.flight_limits.excludes_loads)
    sum_body_loads(s.grains, s.bodies, s.count, s.flight_limits.excludes_loads)
    kick_bodies(s.bodies, s.count, 0.5 * s.clock[STEP])
    s.scratch[DT] = s.clock[STEP]
    call_hook(s, Hook.KICKED_BODIES)
    move_velocities(s.grains, s.bodies, s.count, s.span)
    s.bodies.quick[:] = 0
    s.clock[TIME] += s.clock[STEP]
    if s.gas.gas.on:
        s.clock[KICKED] = s.clock[TIME]
    if not had_substeps:
        s.clock[SOME_AWAKE] += s.clock[STEP] if awake > 0 else 0.0
        s.clock[GRAINS_AWAKE] += awake * s.clock[STEP] / s.grains.mass.size
    s.count[STEPS] += 1 if s.clock[STEP] > 0.0 else 0
    s.count[PHASE] = 0
    return Stop.AWAKE_LOADS.value if awake > 0 else Stop.NONE.value


@caller
def body_steps_until(s):
    """Take steps until the last end of a step not after `until` [s], or step `last`; returns the value of a `Stop`."""
    awake = awake_grains(s.bodies)
    invalidate_speeds(s.pair_list)
    while True:
        stop = Stop.NONE.value
        if s.count[PHASE] == 0:
            if s.count[COMPARED] >= 0 and s.count[COMPARED] != s.count[MADE] + s.count[BROKEN]:
                return Stop.CLUSTERS_CHANGED.value
            if has_arrived(s.clock[TIME], s.until, s.shorten):
                return Stop.TIME_REACHED.value
            if s.count[STEPS] >= s.last:
                return Stop.NONE.value
            stop = first_half(s, awake > 0)
        elif s.count[PHASE] == AFTER_SUBSTEPS:
            drift_with_work(s, s.clock[STEP])
            s.count[PHASE] = AFTER_ALL
        if stop == Stop.NONE.value:
            stop = second_half(s, awake, s.count[PHASE] == AFTER_ALL)
        if stop != Stop.NONE.value:
            return stop


@stage(
    "the steps of rigid bodies",
    seconds=8.0,
    parts=(*DRIVER_PARTS, "bodies", "gas", "flight_limits"),
)
def advance_bodies(s):
    """Take steps of all bodies, then end the work of the other threads; returns the value of a `Stop`."""
    stop = body_steps_until(s)
    join_workers(s)
    return stop


@stage("the search for touches of bodies")
def mark_near_bodies(grains, bodies, pair_list, clock, count, span, gas, flight_limits):
    """Mark bodies near others, for a step as long as the last one."""
    sum_body_loads(grains, bodies, count, flight_limits.excludes_loads)
    bodies.near[:] = CLEAR
    find_near_bodies(grains, bodies, pair_list, count, span, gas, flight_limits.friction_rate, clock[STEP])
    return 0
