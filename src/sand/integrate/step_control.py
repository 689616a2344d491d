"""The choice of the step: contact periods while anything touches, magnetic and closing times otherwise."""

import math
from typing import NamedTuple

from ..box import nearest_image
from ..compiler.jit import formula, loop, rare
from ..contact.pair_types import pair_type_index
from ..forces.external.formulas import stiffness_of_field
from ..numerics.float_order import float_from_bits, rank
from ..numerics.vec import dot, load, sub
from ..state.state import (
    CALM,
    CHECKED,
    CONTACT_STEP,
    CONTACTS,
    CYCLE,
    GRAIN1,
    GRAIN2,
    LARGEST_SPEED,
    LEFT,
    LEVEL,
    LONG_RANGE_LEVEL,
    NEEDED,
    PAIRS,
    SAFE_SPEED,
    STEP,
    STEP_INCREASES,
    STEPS,
)

CHECK_EVERY = 16
"""Steps between two looks at the physics while contacts set the step."""
INCREASE_INTERVAL = 64
"""The step is halved at once but doubled only after this many steps, so that it does not flap."""
HOLD_STEPS = 256
"""While grains touch it is doubled only after this many steps, ten fastest periods, in none of which it was needed.

A step that follows the phase of the ringing pumps it: Verlet keeps p²/2m + ½kx² (1 − (ω dt)²/4), so that every
change of dt changes its energy, by up to one per cent, with a sign that depends on the phase.
"""
ALMOST = 1.0 - 1e-6
"""The step of the contacts is kept to few digits (`contact_step`): equal steps may differ by this."""
SPIN_ANGLE = 0.05
"""Largest turn of a grain in one step [rad]."""
FIELD_ANGLE = 0.03
"""Largest phase √(μB/I) dt of a moment swinging in its field; Verlet then errs by 4e-5 in its frequency."""
CLOSING_PART = 0.2
"""Largest part of the gap that two grains about to touch may close in one step."""
IMPACT_DISPLACEMENT = 25.0
"""Largest way two grains about to touch, or along n in contact, may move in one step, in δ_c / per_period."""
REACH_PART = 1.0 / 16.0
"""Largest part of the list's reach that a grain may fly in one step; keeps the check of the list safe."""


class StepCriteria(NamedTuple):
    """What the choice of the step needs to know."""

    fixed: float  # the user's own step [s]; 0: choose
    reach: float  # of the list of near pairs [m]
    energy_scale: float  # what the magnetics may put at stake, |U_min| [J]; 0: no such force
    accuracy: float  # part of it that a step may misplace
    outer_field: float  # size of the external flux density [T]
    longest: float  # for worlds in which nothing happens [s]
    impact: float  # largest way of an impact in one step, in δ_c


@formula
def field_step(moment, b, outer, inertia):
    """Longest step [s] for a moment in the field b of the others plus an external one of size `outer`."""
    square = stiffness_of_field(moment, b, inertia) + math.sqrt(dot(moment, moment)) * outer / inertia
    return FIELD_ANGLE / math.sqrt(square) if square > 0.0 else math.inf


@formula
def load_step(force, torque, mass, inertia, criteria):
    """Longest step [s] for which Verlet's energy error dt²/24 (F²/m + M²/I) stays below its share."""
    rate = dot(force, force) / mass + dot(torque, torque) / inertia
    stake = 24.0 * criteria.accuracy * criteria.energy_scale
    return math.sqrt(stake / rate) if rate > 0.0 and stake > 0.0 else math.inf


@loop
def grain_step(grains, long_range, start, criteria, i):
    """Longest step [s] that grain i by itself allows, and longest cycle of the far loads.

    Bound grains ring: their step is that of contacts, and only how they fly and spin is looked at.  Free grains
    limit the cycle as they limit the step, but for the part of the list's reach they fly.  Their loads are those of
    the long-range forces, whose energy is at stake: a uniform load, as gravity's, costs Verlet nothing.
    """
    v, w = load(grains.velocity, i), load(grains.spin, i)
    speed, turning = math.sqrt(dot(v, v)), math.sqrt(dot(w, w))
    spin = SPIN_ANGLE / turning if turning > 0.0 else math.inf
    inertia = grains.inertia[i]
    swing = field_step(load(grains.moment, i), load(grains.field, i), criteria.outer_field, inertia)
    own = math.inf
    if long_range.force.shape[1] > 0:  # else there is no such force
        own = load_step(load(long_range.force, i), load(long_range.torque, i), grains.mass[i], inertia, criteria)
    bound = start[i + 1] != start[i]
    own = math.inf if bound else own
    cycle = min(min(spin, swing), own)
    flight = REACH_PART * criteria.reach / speed if speed > 0.0 else math.inf
    return min(cycle, flight), math.inf if bound else cycle


@loop
def steps_of_free_grains(grains, long_range, start, count, criteria):
    """Longest step [s] that each grain by itself allows, and longest cycle of the far loads; 0, 0 if not finite.

    GRAIN1 becomes a grain that is not finite. `start` (N + 1,) tells who has contacts (state.arrays.ContactArrays).
    """
    step = cycle = rank(criteria.longest)
    lost = 0.0
    for i in range(grains.mass.size):
        v, w = load(grains.velocity, i), load(grains.spin, i)
        lost += 0.0 if (dot(v, v) < math.inf) & (dot(w, w) < math.inf) else 1.0
        own_step, own_cycle = grain_step(grains, long_range, start, criteria, i)
        step, cycle = min(step, rank(own_step)), min(cycle, rank(own_cycle))
    if lost > 0.0:
        count[GRAIN1] = first_not_finite(grains)
        return 0.0, 0.0
    return float_from_bits(step), float_from_bits(cycle)


@rare
def first_not_finite(grains):
    """The first grain whose velocity or spin is not finite."""
    for i in range(grains.mass.size):
        v, w = load(grains.velocity, i), load(grains.spin, i)
        if not (dot(v, v) < math.inf and dot(w, w) < math.inf):
            return i
    return -1


@loop
def pair_step(grains, pair_list, span, criteria, p):
    """The longest step [s] that pair p allows, about to touch or in contact."""
    i, j = pair_list.pair[0, p], pair_list.pair[1, p]
    moving = sub(load(grains.velocity, i), load(grains.velocity, j))
    apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
    distance = math.sqrt(dot(apart, apart))
    closing = -dot(moving, apart) / distance
    touching = pair_list.touching[p] == 1
    # in contact only what loads the neck counts: a pair may spin as fast as it likes
    speed = abs(closing) if touching else math.sqrt(dot(moving, moving))
    kind = pair_type_index(pair_list, p)
    need, length = pair_list.step[kind], pair_list.length[kind]
    fast = (length > 0.0) & (speed * need > criteria.impact * length)
    need = criteria.impact * length / speed if fast else need
    gap = distance - grains.radius[i] - grains.radius[j]
    free = max(need, CLOSING_PART * gap / closing) if closing > 0.0 else math.inf
    # slow pairs in contact are served by the step of the contacts
    bound = need if fast else math.inf
    return bound if touching else free


@loop
def _safe_speed(pair_list, criteria):
    """True if no two grains can meet so fast that they need a shorter step than contacts do."""
    impact = criteria.impact * pair_list.skin[SAFE_SPEED]
    return 4.0 * pair_list.skin[LARGEST_SPEED] < impact * impact


@loop
def closing_step(grains, pair_list, count, span, criteria, wanted):
    """The longest step [s], at most `wanted`, that pairs about to touch or in contact allow."""
    least = rank(wanted)
    for p in range(count[PAIRS]):
        least = min(least, rank(pair_step(grains, pair_list, span, criteria, p)))
    return float_from_bits(least)


@rare
def find_limiting_grains(grains, long_range, start, pair_list, count, span, criteria):
    """Let GRAIN1 and GRAIN2 be the pair, or GRAIN1 the grain, that wants the shortest step."""
    shortest = math.inf
    for i in range(grains.mass.size):
        own, _ = grain_step(grains, long_range, start, criteria, i)
        if own < shortest:
            shortest = own
            count[GRAIN1], count[GRAIN2] = i, -1
    for p in range(count[PAIRS]):
        own = pair_step(grains, pair_list, span, criteria, p)
        if own < shortest:
            shortest = own
            count[GRAIN1], count[GRAIN2] = pair_list.pair[0, p], pair_list.pair[1, p]


@loop
def quantise_step(level, wanted, may_grow):
    """The power of two of a second at or below `wanted`, or the old level where that is below and may not grow."""
    level = level if level > 0.0 else 1.0
    while level > wanted:
        level *= 0.5
    while may_grow and 2.0 * level <= wanted:
        level *= 2.0
    return level


@loop
def choose_step(grains, long_range, start, pair_list, clock, count, span, criteria):
    """The next step [s], or 0 if there is none: that of the contacts, or less if something else needs less.

    Steps that are not the contacts' are powers of two of a second and change seldom, because every change
    costs velocity Verlet a little energy.  Inside a cycle the far loads are not at hand, and only pairs are looked
    at.
    """
    between = clock[LEFT] == 0.0
    alone = count[CONTACTS] == 0
    # a step of the user's own is looked at only for numbers that are not finite
    each = (alone and criteria.fixed == 0.0) or (between and clock[CYCLE] > clock[STEP])
    if each or count[STEPS] - count[CHECKED] >= CHECK_EVERY:
        may_grow = count[STEPS] - count[STEP_INCREASES] >= INCREASE_INTERVAL
        if between:
            clock[CALM], cycle = steps_of_free_grains(grains, long_range, start, count, criteria)
            if not clock[CALM] > 0.0:
                return 0.0
            clock[LONG_RANGE_LEVEL] = quantise_step(clock[LONG_RANGE_LEVEL], cycle, may_grow)
        quiet = not alone and _safe_speed(pair_list, criteria)
        wanted = clock[CALM] if quiet else closing_step(grains, pair_list, count, span, criteria, clock[CALM])
        if not wanted > 0.0:
            return 0.0
        count[CHECKED] = count[STEPS]
        if may_grow:
            count[STEP_INCREASES] = count[STEPS]
        if not alone:
            if wanted >= ALMOST * clock[CONTACT_STEP]:  # just that will do, not the power of two below
                wanted = max(wanted, 2.0 * clock[CONTACT_STEP])
            elif wanted < 2.0 * clock[LEVEL]:
                count[NEEDED] = count[STEPS]
            may_grow = count[STEPS] - count[NEEDED] >= HOLD_STEPS
        clock[LEVEL] = quantise_step(clock[LEVEL], wanted, may_grow)
    if criteria.fixed > 0.0:
        return criteria.fixed
    return min(clock[LEVEL], clock[CONTACT_STEP])


@loop
def cycle_steps(clock, count, beat, dt):
    """How many steps of dt [s] may lie between two sums of the far loads: 1 where nothing touches.

    Impulses must come more often than contacts ring, whatever the step: k_max counts the contacts' own steps.
    """
    if count[CONTACTS] == 0:
        return 1
    longest = min(clock[LONG_RANGE_LEVEL], beat.most * clock[CONTACT_STEP])
    return max(1, min(beat.most, int(longest / dt + 1e-6)))
