"""Which bodies may touch within a step."""

from ...basics.state import LATE, PAIRS
from ...compiler.jit import formula, loop
from ...numerics.flow import relative_velocity
from ...numerics.vec import dot, load, nearest_image, norm, sub
from .body_friction import gas_displacement

TOUCH_SPEED = 1.2
"""Closing speeds are taken this much larger to predict a touch."""
CLEAR, NEAR, LOADED, TOUCHING = range(4)
"""Values of `BodyArrays.near`: nothing near; a touch within about two steps; loads of contacts that may have changed by
more than the reserve; a touch within the next step."""


@loop
def _approach(grains, bodies, i, h):
    """Distance [m] that grain i may move in h seconds besides its velocity: twice the present accelerations."""
    first = bodies.first[i]
    mass, inertia = bodies.mass[first], load(bodies.inertia, first)
    s = norm(load(bodies.offset, i))
    w = load(grains.spin, i)
    smallest = min(inertia[0], min(inertia[1], inertia[2]))
    linear = norm(load(bodies.force, first)) / mass + s * norm(load(bodies.torque, first)) / smallest
    return (linear + dot(w, w) * s) * h * h


@formula
def reach_of_pair(grains, bodies, pair, apart, gas, span, limits):
    """Distance [m] by which the gap of a pair of grains may close in a step; `apart` is x_i − x_j.

    By the closing speed, a fifth more of it, the curvature of the paths, accelerations, and what a gas adds; `limits`
    are the rate of friction [1/s] and the step [s].
    """
    (i, j), (friction_rate, h), distance = pair, limits, norm(apart)
    v = relative_velocity(grains, i, j, apart, span)
    closing = max(-dot(v, apart) / distance, 0.0)
    across = max(dot(v, v) - closing * closing, 0.0)
    reach = TOUCH_SPEED * closing * h + 0.5 * across / distance * h * h
    reach += _approach(grains, bodies, i, h) + _approach(grains, bodies, j, h)
    if gas.gas.on:
        reach += gas_displacement(grains, bodies, i, friction_rate, gas.gas, h)
        reach += gas_displacement(grains, bodies, j, friction_rate, gas.gas, h)
    return reach


@formula
def reach_of_plane(grains, bodies, i, closing, gas, friction_rate, h):
    """As `reach_of_pair`, of grain i and a plane, which approach each other at the speed `closing`."""
    reach = TOUCH_SPEED * max(closing, 0.0) * h + _approach(grains, bodies, i, h)
    return reach + (gas_displacement(grains, bodies, i, friction_rate, gas.gas, h) if gas.gas.on else 0.0)


@loop
def find_near_bodies(grains, bodies, pair_list, count, span, gas, friction_rate, h):
    """Mark bodies near others (`BodyArrays.near`) for a step of h [s]."""
    for p in range(count[PAIRS]):
        i, j = pair_list.pair[0, p], pair_list.pair[1, p]
        one, other = bodies.first[i], bodies.first[j]
        if one == other:
            continue
        apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
        gap = norm(apart) - grains.radius[i] - grains.radius[j]
        reach = reach_of_pair(grains, bodies, (i, j), apart, gas, span, (friction_rate, h))
        if gap > 2.0 * reach:
            continue
        both_awake = bodies.asleep[i] + bodies.asleep[j] == 0
        if not gap > reach and not both_awake:  # also if the reach is not a number
            bodies.near[one] = bodies.near[other] = TOUCHING
            count[LATE] += 1 if gap < 0.0 else 0
        else:
            bodies.near[one] = max(bodies.near[one], NEAR)
            bodies.near[other] = max(bodies.near[other], NEAR)
