"""Substeps: bodies whose loads change fast take several steps within one step of all bodies.

The step of all bodies is set by the slowest ones.  With the loads F of all grains on each other and F_q of the quick
bodies on each other and of external forces on them, the quick loads, one step H is

    all bodies:    P += ½H (F − F_q)                                                 (the slow loads)
    quick bodies:  steps h < H:  P += ½h F_q, drift, rotor, new F_q, P += ½h F_q     (the steps of `rigid_driver`)
    other bodies:  drift H, rotor                                                    (F_q = 0)
    all bodies:    new F;  P += ½H (F − F_q)

This is the impulse method of multiple time stepping (Tuckerman, Berne & Martyna 1992) with a splitting by pairs of
bodies (Pelupessy, Jänes & Portegies Zwart 2012): each force acts on both bodies of a pair at the same time, so that
momentum and angular momentum are conserved to rounding.  Quick are bodies that require a step shorter than H, awake
clusters, all that are near these, and pairs that may touch within H.  In their substeps these bodies touch, wake and
come to rest as in any step.  Contacts at rest carry all loads: of the slow ones those at the start.

`BodyArrays.excluded_force` and torque are the loads on a grain that do not kick its body: F_q in the state of all
bodies, F − F_q in that of the quick ones.
"""

import math

from ...basics.state import BODIES, PAIRS, STEP
from ...compiler.jit import caller, formula, loop
from ...compiler.stage import stage
from ...numerics.vec import add, load, nearest_image, norm, sub
from .body_touches import reach_of_pair
from .rigid_body import kick_bodies, move_velocities, sum_body_loads

AFTER_SUBSTEPS, AFTER_ALL = 2, 3
"""Values of `PHASE` when the quick bodies have arrived at the end of the step, and when all others have, too."""
GRAIN_COST, CALL_COST = 0.35, 250.0
"""Estimated cost [µs] of a step for each grain, and of substeps besides that of each substep."""
SUBSTEP_COST, SUBSTEP_GRAIN_COST, SUBSTEP_PAIR_COST = 1.0, 0.2, 0.0075
"""Estimated cost [µs] of a substep, for each grain in it, and for each square of their number."""
WORTH = 0.7
"""Substeps are taken if they cost less than this share of steps of all bodies.  Costs need only be rough, but must not
depend on the machine: the steps would."""


@formula
def squared_rate(bodies, first, force, energy, smallest_radius):
    """Square of the largest rate [1/s²] at which loads change the motion of a body.

    Rotation in the field of other bodies: Σ|μ B|/I; translation: 4 F/(M d), d two of the smallest radii, for forces
    that fall with the distance like those of dipoles, r⁻⁴, or slower.
    """
    inertia = load(bodies.inertia, first)
    smallest = min(inertia[0], min(inertia[1], inertia[2]))
    return max(energy / smallest, 2.0 * norm(force) / (bodies.mass[first] * smallest_radius))


@loop
def mark_quick_bodies(grains, bodies, pair_list, count, span, gas, limits, h):
    """Mark the bodies that take substeps in a step of h [s], awake ones included; returns how many grains they have."""
    square = (limits.step_fraction / h) ** 2
    for b in range(count[BODIES]):
        first = bodies.member[bodies.start[b]]
        bodies.quick[first] = 1 if bodies.rate[first] > square or bodies.asleep[first] == 0 else 0
    bodies.near[:] = 0  # here: whether a body takes substeps for the sake of a quick neighbour
    for p in range(count[PAIRS]):
        i, j = pair_list.pair[0, p], pair_list.pair[1, p]
        one, other = bodies.first[i], bodies.first[j]
        if one == other:
            continue
        if bodies.quick[one] + bodies.quick[other] > 0:
            bodies.near[one] = bodies.near[other] = 1
        elif bodies.near[one] + bodies.near[other] < 2:
            apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
            gap = norm(apart) - grains.radius[i] - grains.radius[j]
            if gap <= 2.0 * reach_of_pair(grains, bodies, (i, j), apart, gas, span, (limits.friction_rate, h)):
                bodies.near[one] = bodies.near[other] = 1
    number = 0
    for b in range(count[BODIES]):
        first = bodies.member[bodies.start[b]]
        bodies.quick[first] = max(bodies.quick[first], bodies.near[first])
        if bodies.quick[first] == 1:
            number += bodies.start[b + 1] - bodies.start[b]
    bodies.near[:] = 0
    return number


@caller
def choose_shared_step(s, h, longest):
    """Step of all bodies [s], h times a power of two, at most `longest`, with the least estimated cost per time.

    Marks the bodies that take substeps in it; none if it is h, the step that all bodies require.
    """
    whole = GRAIN_COST * s.grains.mass.size
    least, best, tried = WORTH * whole / h, h, 2.0 * h
    while tried <= longest:
        if whole + CALL_COST < least * tried:  # else it cannot cost less
            number = mark_quick_bodies(s.grains, s.bodies, s.pair_list, s.count, s.span, s.gas, s.flight_limits, tried)
            each = SUBSTEP_COST + number * (SUBSTEP_GRAIN_COST + number * SUBSTEP_PAIR_COST)
            cost = (whole + CALL_COST + each * tried / h) / tried
            if cost < least:
                least, best = cost, tried
        tried *= 2.0
    if best > h:
        mark_quick_bodies(s.grains, s.bodies, s.pair_list, s.count, s.span, s.gas, s.flight_limits, best)
    else:
        s.bodies.quick[:] = 0
    return best


@stage("the kicks by loads that do not act in substeps")
def kick_by_slow_loads(grains, bodies, clock, count):
    """Kick all bodies at rest for half a step, the quick ones by the loads that do not act in substeps."""
    sum_body_loads(grains, bodies, count, False)
    kick_bodies(bodies, count, 0.5 * clock[STEP])
    return 0


@stage("the velocities of grains of bodies at rest")
def place_all_velocities(grains, bodies, count, span):
    """Velocities and spins of the grains of all bodies at rest, from momentum and angular momentum of these."""
    move_velocities(grains, bodies, count, span)
    return 0


@stage("the rates of loads that do not act in substeps")
def find_slow_rate(grains, bodies, count, flight_limits, parameters):
    """Set parameters[2][0] to the largest rate [1/s] at which slow loads change the motion of a body.

    Parameters: forces (3, n) [N] and flux densities (3, n) [T] on the grains that do not act in substeps.
    """
    forces, fields, square = parameters[0], parameters[1], 0.0
    for b in range(count[BODIES]):
        first = bodies.member[bodies.start[b]]
        force, energy = (0.0, 0.0, 0.0), 0.0
        for k in range(bodies.start[b], bodies.start[b + 1]):
            i = bodies.member[k]
            force = add(force, load(forces, i))
            energy += norm(load(grains.moment, i)) * norm(load(fields, i))
        square = max(square, squared_rate(bodies, first, force, energy, flight_limits.smallest_radius))
    parameters[2][0] = math.sqrt(square)
    return 0
