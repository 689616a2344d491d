"""Step-size control: the contact period while there are contacts; magnetic, collision and flight times otherwise."""

import math
from typing import NamedTuple

from ..basics.state import (
    CALM,
    CHECKED,
    COMPONENT_STEP,
    CONTACT_LIMIT,
    CONTACTS,
    CYCLE,
    GRAIN1,
    GRAIN2,
    LEFT,
    LEVEL,
    LONG_RANGE_LEVEL,
    NEEDED,
    PAIRS,
    SAFE_SPEED,
    SQUARED_SPEED,
    STEP,
    STEP_INCREASES,
    STEPS,
)
from ..compiler.jit import formula, loop, rare
from ..contact.pair_types import pair_type_index
from ..forces.external_formulas import stiffness_of_field
from ..numerics.flow import relative_velocity, squared_approach
from ..numerics.simd import float_bits, float_from_bits
from ..numerics.vec import dot, load, nearest_image, sub

CHECK_INTERVAL = 16
"""Steps between two evaluations of the criteria while contacts determine the step."""
INCREASE_INTERVAL = 64
"""Least number of steps before the step is doubled; halving is immediate.  The hysteresis prevents alternation."""
HOLD_STEPS = 256
"""The same while there are contacts: steps (ten fastest periods) in none of which the shorter step was needed.

A step that follows the phase of contact oscillations heats them: Verlet conserves p²/2m + ½kx² (1 − (ω dt)²/4), so each
change of dt changes the energy by up to one per cent, with a sign that depends on the phase.
"""
EQUAL_STEPS = 1.0 - 1e-6
"""The limit of contacts has single precision (`contact_limit`): steps equal to within this factor are the same."""
MAX_SPIN_ANGLE = 0.05
"""Largest rotation of a grain in one step [rad]."""
MAX_FIELD_PHASE = 0.03
"""Largest phase √(μB/I) dt of a moment oscillating in its field; the frequency error of Verlet is then 4e-5."""
CLOSING_FRACTION = 0.2
"""Largest fraction of its gap that an approaching pair may close in one step."""
IMPACT_DISPLACEMENT = 25.0
"""Largest relative displacement of an approaching pair, or along n in contact, per step, in δ_c / steps_per_period."""
FLIGHT_FRACTION = 1.0 / 16.0
"""Largest flight of a grain in one step in units of the gap of the pair list, so that the list stays valid."""
ROUNDING = 1e-14
"""Rounding error of a sum of steps, in units of the time."""


class StepCriteria(NamedTuple):
    """Parameters of the step-size criteria."""

    fixed: float  # step set by the user [s]; 0: automatic
    pair_gap: float  # largest gap of the pairs in the pair list: the smallest radius, or more with rigid clusters [m]
    energy_scale: float  # largest energy of a long-range pair, |U_min| for dipoles [J]; 0: no such force
    accuracy: float  # allowed energy error of a step, in units of energy_scale
    outer_field: float  # magnitude of the external flux density [T]
    longest: float  # largest step, if no other criterion applies [s]
    impact: float  # largest relative displacement of an impact in one step, in δ_c
    reach: float = 0.0  # largest distance of grains in the pair list [m]


@formula
def field_step(moment, b, outer, inertia):
    """Largest step [s] for a moment in the flux density b of the other grains plus an external one of size `outer`."""
    square = stiffness_of_field(moment, b, inertia) + math.sqrt(dot(moment, moment)) * outer / inertia
    return MAX_FIELD_PHASE / math.sqrt(square) if square > 0.0 else math.inf


@formula
def load_step(force, torque, mass, inertia, criteria):
    """Largest step [s] for which Verlet's energy error dt²/24 (F²/m + M²/I) is at most accuracy × energy_scale."""
    rate = dot(force, force) / mass + dot(torque, torque) / inertia
    allowed = 24.0 * criteria.accuracy * criteria.energy_scale
    return math.sqrt(allowed / rate) if rate > 0.0 and allowed > 0.0 else math.inf


@loop
def grain_step(grains, long_range, start, criteria, i):
    """Largest step [s] allowed by the motion of grain i, and largest cycle of the long-range loads.

    Grains in contact oscillate at contact frequencies, which the limit of contacts resolves: only their flight, spin
    and moment count here.  Free grains limit the cycle by the same criteria as the step, except the flight distance.
    The load criterion uses the long-range loads, whose energy sets the scale: a uniform load such as gravity causes no
    energy error.
    """
    v, w = load(grains.velocity, i), load(grains.spin, i)
    speed, rotation = math.sqrt(dot(v, v)), math.sqrt(dot(w, w))
    by_spin = MAX_SPIN_ANGLE / rotation if rotation > 0.0 else math.inf
    inertia = grains.inertia[i]
    by_field = field_step(load(grains.moment, i), load(grains.field, i), criteria.outer_field, inertia)
    by_loads = math.inf
    if long_range.force.shape[1] > 0:  # empty without long-range forces
        by_loads = load_step(load(long_range.force, i), load(long_range.torque, i), grains.mass[i], inertia, criteria)
    bound = start[i + 1] != start[i]
    by_loads = math.inf if bound else by_loads
    cycle = min(min(by_spin, by_field), by_loads)
    by_flight = FLIGHT_FRACTION * criteria.pair_gap / speed if speed > 0.0 else math.inf
    return min(cycle, by_flight), math.inf if bound else cycle


@loop
def steps_of_free_grains(grains, long_range, start, criteria):
    """Largest step [s] and cycle [s] allowed by the motion of all single grains (`grain_step`); 0, 0 if not finite.

    `start` (N + 1,) are the row offsets of the contacts of each grain (state.arrays.ContactArrays).
    """
    step = cycle = float_bits(criteria.longest)
    not_finite = 0.0
    for i in range(grains.mass.size):
        v, w = load(grains.velocity, i), load(grains.spin, i)
        not_finite += 0.0 if (dot(v, v) < math.inf) & (dot(w, w) < math.inf) else 1.0
        own_step, own_cycle = grain_step(grains, long_range, start, criteria, i)
        step, cycle = min(step, float_bits(own_step)), min(cycle, float_bits(own_cycle))
    if not_finite > 0.0:
        return 0.0, 0.0
    return float_from_bits(step), float_from_bits(cycle)


@rare
def first_not_finite(grains):
    """Index of the first grain whose velocity or spin is not finite, or −1."""
    for i in range(grains.mass.size):
        v, w = load(grains.velocity, i), load(grains.spin, i)
        if not (dot(v, v) < math.inf and dot(w, w) < math.inf):
            return i
    return -1


@loop
def pair_step(grains, pair_list, span, criteria, p):
    """Largest step [s] allowed by pair p of the list, approaching or in contact."""
    i, j = pair_list.pair[0, p], pair_list.pair[1, p]
    apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
    relative = relative_velocity(grains, i, j, apart, span)
    distance = math.sqrt(dot(apart, apart))
    closing = -dot(relative, apart) / distance
    touching = pair_list.in_contact[p] == 1
    # in contact only the normal velocity strains the contact; rotation of the pair does not
    speed = abs(closing) if touching else math.sqrt(dot(relative, relative))
    pair_type = pair_type_index(pair_list, p)
    required, overlap = pair_list.step[pair_type], pair_list.break_overlap[pair_type]
    fast = (overlap > 0.0) & (speed * required > criteria.impact * overlap)
    required = criteria.impact * overlap / speed if fast else required
    gap = distance - grains.radius[i] - grains.radius[j]
    free = max(required, CLOSING_FRACTION * gap / closing) if closing > 0.0 else math.inf
    # slow pairs in contact are resolved by the limit of contacts
    bound = required if fast else math.inf
    return bound if touching else free


@loop
def _all_speeds_safe(pair_list, criteria, span):
    """Whether no two grains are fast enough (twice the largest speed) to need a step below that of the contacts."""
    impact = criteria.impact * pair_list.skin[SAFE_SPEED]
    return squared_approach(pair_list.skin[SQUARED_SPEED], criteria.reach, span) < impact * impact


@loop
def closing_step(grains, pair_list, count, span, criteria, wanted):
    """Largest step [s], at most `wanted`, allowed by all approaching or touching pairs."""
    shortest = float_bits(wanted)
    for p in range(count[PAIRS]):
        shortest = min(shortest, float_bits(pair_step(grains, pair_list, span, criteria, p)))
    return float_from_bits(shortest)


@rare
def find_limiting_grains(grains, long_range, start, pair_list, count, span, criteria):
    """Set GRAIN1 and GRAIN2 to the pair, or GRAIN1 to the grain, that requires the smallest step."""
    shortest = math.inf
    for i in range(grains.mass.size):
        step, _ = grain_step(grains, long_range, start, criteria, i)
        if step < shortest:
            shortest = step
            count[GRAIN1], count[GRAIN2] = i, -1
    for p in range(count[PAIRS]):
        step = pair_step(grains, pair_list, span, criteria, p)
        if step < shortest:
            shortest = step
            count[GRAIN1], count[GRAIN2] = pair_list.pair[0, p], pair_list.pair[1, p]


@loop
def quantise_step(level, wanted, may_grow):
    """The largest power of two of a second not above `wanted`; not above the old level unless it `may_grow`."""
    level = level if level > 0.0 else 1.0
    while level > wanted:
        level *= 0.5
    while may_grow and 2.0 * level <= wanted:
        level *= 2.0
    return level


@loop
def choose_step(grains, long_range, start, pair_list, clock, count, span, criteria):
    """The next step [s]: the limit of contacts, or less if another criterion requires it; 0 if the state is not finite.

    Steps below the limit of contacts are powers of two of a second and change seldom, because each change costs
    velocity Verlet a little energy.  Within a cycle the long-range loads are not available, and only pairs are checked.
    """
    between_cycles = clock[LEFT] == 0.0
    no_contacts = count[CONTACTS] == 0
    chosen = count[CHECKED] == count[STEPS]  # by a call of the driver that ended before this step
    # with a fixed step the criteria only detect numbers that are not finite
    every_step = (no_contacts and criteria.fixed == 0.0) or (between_cycles and clock[CYCLE] > clock[STEP])
    if (every_step and not chosen) or count[STEPS] - count[CHECKED] >= CHECK_INTERVAL:
        may_grow = count[STEPS] - count[STEP_INCREASES] >= INCREASE_INTERVAL
        if between_cycles:
            clock[CALM], cycle = steps_of_free_grains(grains, long_range, start, criteria)
            if not clock[CALM] > 0.0:
                return 0.0
            clock[LONG_RANGE_LEVEL] = quantise_step(clock[LONG_RANGE_LEVEL], cycle, may_grow)
        slow = not no_contacts and _all_speeds_safe(pair_list, criteria, span)
        wanted = clock[CALM] if slow else closing_step(grains, pair_list, count, span, criteria, clock[CALM])
        if not wanted > 0.0:
            return 0.0
        count[CHECKED] = count[STEPS]
        if may_grow:
            count[STEP_INCREASES] = count[STEPS]
        if not no_contacts:
            if wanted >= EQUAL_STEPS * clock[CONTACT_LIMIT]:  # that limit itself, not the power of two below it
                wanted = max(wanted, 2.0 * clock[CONTACT_LIMIT])
            elif wanted < 2.0 * clock[LEVEL]:
                count[NEEDED] = count[STEPS]
            may_grow = count[STEPS] - count[NEEDED] >= HOLD_STEPS
        clock[LEVEL] = quantise_step(clock[LEVEL], wanted, may_grow)
    if criteria.fixed > 0.0:
        return criteria.fixed
    chosen_step = min(clock[LEVEL], clock[CONTACT_LIMIT])
    return min(chosen_step, clock[COMPONENT_STEP]) if clock[COMPONENT_STEP] > 0.0 else chosen_step


@loop
def hold_step(clock, count, step):
    """Set the step [s] that components allow: it falls at once and rises at every HOLD_STEPS-th step only.

    So it does not follow the phase of oscillations.
    """
    if clock[COMPONENT_STEP] == 0.0 or step < clock[COMPONENT_STEP] or count[STEPS] % HOLD_STEPS == 0:
        clock[COMPONENT_STEP] = step


@formula
def is_past(time, until):
    """Whether a time [s] is later than another by more than the rounding error of a sum of steps."""
    return time - until > ROUNDING * math.fabs(until)


@formula
def is_close(time, until):
    """Whether two times [s] differ by at most the rounding error of a sum of steps."""
    return math.fabs(until - time) <= ROUNDING * math.fabs(until)


@loop
def has_arrived(time, until, shorten):
    """Whether steps have arrived at `until` [s], to rounding if the last step is shortened to end there."""
    return time >= until or (shorten and is_close(time, until))


@loop
def cycle_steps(clock, count, respa, dt):
    """Number of steps of dt [s] in the next cycle of the long-range loads; 1 without contacts.

    Impulses must be more frequent than contact oscillations for any dt: k_max counts steps as long as contacts allow.
    """
    if count[CONTACTS] == 0 or respa.max_steps == 1:
        return 1
    longest = min(clock[LONG_RANGE_LEVEL], respa.max_steps * clock[CONTACT_LIMIT])
    return max(1, min(respa.max_steps, int(longest / dt + 1e-6)))
