"""Substeps: bodies whose loads change fast take several steps within one step of all bodies.

The step of all bodies is set by the slowest ones.  With the loads F of all grains on each other and F_q of the quick
bodies on each other and of external forces on them, one step H is

    all bodies:    P += ½H (F − F_q)
    quick bodies:  steps h < H:  P += ½h F_q, drift, rotor, new F_q, P += ½h F_q     (the steps of `rigid_driver`)
    other bodies:  drift H, rotor                                                    (F_q = 0)
    all bodies:    new F;  P += ½H (F − F_q)

This is the impulse method of multiple time stepping (Tuckerman, Berne & Martyna 1992) with a splitting by pairs of
bodies (Pelupessy, Jänes & Portegies Zwart 2012): each force acts on both bodies of a pair at the same time, so that
momentum and angular momentum are conserved to rounding.  Quick are bodies that require a step shorter than H, all that
are near these, and pairs that may touch within H.
"""

from ..box import nearest_image
from ..compiler.jit import loop
from ..compiler.stage import stage
from ..numerics.quaternion import turned_back
from ..numerics.vec import add, load, load4, norm, put, sub
from ..state.state import BODIES, PAIRS, STEP
from .body_touches import reach_of_pair
from .rigid_body import kick_bodies, move_velocities, sum_body_loads

AFTER_SUBSTEPS = 2
"""Value of `STAGE` when the quick bodies have arrived at the end of the step, and the others are at its start."""
GRAIN_COST, CALL_COST = 0.35, 250.0
"""Estimated cost [µs] of a step for each grain, and of substeps besides that of each substep."""
SUBSTEP_COST, SUBSTEP_GRAIN_COST, SUBSTEP_PAIR_COST = 1.0, 0.2, 0.0075
"""Estimated cost [µs] of a substep, for each grain in it, and for each square of their number."""
WORTH = 0.7
"""Substeps are taken if they cost less than this share of steps of all bodies.  Costs need only be rough, but must not
depend on the machine: the steps would."""


@loop
def mark_quick_bodies(grains, bodies, pair_list, count, span, gas, limits, h):
    """Mark the bodies that take substeps within a step of h [s]; returns the number of their grains."""
    square = (limits.step_fraction / h) ** 2
    for b in range(count[BODIES]):
        first = bodies.member[bodies.start[b]]
        bodies.quick[first] = 1 if bodies.rate[first] > square else 0
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
            if gap <= 2.0 * reach_of_pair(grains, bodies, i, j, apart, gas, limits.friction_rate, h):
                bodies.near[one] = bodies.near[other] = 1
    number = 0
    for b in range(count[BODIES]):
        first = bodies.member[bodies.start[b]]
        bodies.quick[first] = max(bodies.quick[first], bodies.near[first])
        if bodies.quick[first] == 1:
            number += bodies.start[b + 1] - bodies.start[b]
    bodies.near[:] = 0
    return number


@loop
def choose_shared_step(grains, bodies, pair_list, count, span, gas, limits, h, longest):
    """Step of all bodies [s], h times a power of two, at most `longest`, with the least estimated cost per time.

    Marks the bodies that take substeps in it; none if it is h, the step that all bodies require.
    """
    whole = GRAIN_COST * grains.mass.size
    least, best, tried = WORTH * whole / h, h, 2.0 * h
    while tried <= longest:
        number = mark_quick_bodies(grains, bodies, pair_list, count, span, gas, limits, tried)
        each = SUBSTEP_COST + number * (SUBSTEP_GRAIN_COST + number * SUBSTEP_PAIR_COST)
        cost = (whole + CALL_COST + each * tried / h) / tried
        if cost < least:
            least, best = cost, tried
        tried *= 2.0
    if best > h:
        mark_quick_bodies(grains, bodies, pair_list, count, span, gas, limits, best)
    else:
        bodies.quick[:] = 0
    return best


@stage("the kicks by loads that do not act in substeps")
def kick_by_slow_loads(grains, bodies, clock, count):
    """Kick all bodies for half a step by the loads that do not act in substeps."""
    sum_body_loads(grains, bodies, count)
    kick_bodies(bodies, count, 0.5 * clock[STEP])
    return 0


@stage("the velocities of bodies")
def place_all_velocities(grains, bodies, count):
    """Velocities and spins of the grains of all bodies."""
    move_velocities(grains, bodies, count)
    return 0


@stage("the loads that do not act in substeps")
def split_loads(grains, bodies, count, flight_limits, parameters):
    """Prepare quick bodies for their substeps, in which they have only the loads on each other and external ones.

    Parameters: all other loads, force (3, n) [N], torque [N m] and flux density [T], and the largest rate² [1/s²] at
    which these change the motion of a body, which is set.  As known loads of contacts at rest, they are taken to turn
    with the body during the step.
    """
    forces, torques, fields, square = parameters[0], parameters[1], parameters[2], 0.0
    for b in range(count[BODIES]):
        first = bodies.member[bodies.start[b]]
        q, inertia = load4(bodies.orientation, first), load(bodies.inertia, first)
        force, energy = (0.0, 0.0, 0.0), 0.0
        for k in range(bodies.start[b], bodies.start[b + 1]):
            i = bodies.member[k]
            own = load(forces, i)
            force = add(force, own)
            energy += norm(load(grains.moment, i)) * norm(load(fields, i))
            put(bodies.known_force, i, sub(load(bodies.known_force, i), turned_back(q, own)))
            put(bodies.known_torque, i, sub(load(bodies.known_torque, i), turned_back(q, load(torques, i))))
        smallest = min(inertia[0], min(inertia[1], inertia[2]))
        rate = 2.0 * norm(force) / (bodies.mass[first] * flight_limits.smallest_radius)
        square = max(square, max(rate, energy / smallest))
    parameters[3][0] = square
    return 0
