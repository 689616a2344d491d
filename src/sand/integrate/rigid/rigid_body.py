"""Motion of rigid bodies: the loops over the bodies of a state.

One step of a body is kick, drift, kick:

    P += ½h F, L += ½h RᵀT;   X += h P/M, rotor(h);   new F and T;   P += ½h F, L += ½h RᵀT

with the symplectic rotor of `numerics.rotor`.
"""

import math

from ...basics.state import BODIES
from ...compiler.jit import formula, loop
from ...numerics.flow import after_step, box_after, drifted_with_flow, less_flow, slowed
from ...numerics.kinds_of_box import unless_still
from ...numerics.quaternion import turned, turned_back
from ...numerics.rotor import free_rotation, free_sphere, product
from ...numerics.vec import accrue, add, axpy, cross, dot, load, load4, nearest_image, norm, put, put4, scale, sub
from ..motion import count_crossings


@loop
def sum_body_loads(grains, bodies, count, excludes_loads):
    """Sum force [N] and torque [N m] about the centre of mass of each body; awake ones included.

    The excluded loads on the grains of quick bodies, or of all if `excludes_loads`, are left out.
    """
    for b in range(count[BODIES]):
        first = bodies.member[bodies.start[b]]
        q = load4(bodies.orientation, first)
        force = torque = (0.0, 0.0, 0.0)
        for k in range(bodies.start[b], bodies.start[b + 1]):
            i = bodies.member[k]
            own, turning = load(grains.force, i), load(grains.torque, i)
            if excludes_loads or bodies.quick[first] == 1:
                own = sub(own, load(bodies.excluded_force, i))
                turning = sub(turning, load(bodies.excluded_torque, i))
            force = add(force, own)
            torque = add(torque, add(turning, cross(turned(q, load(bodies.offset, i)), own)))
        put(bodies.force, first, force)
        put(bodies.torque, first, torque)


@loop
def kick_bodies(bodies, count, dt):
    """P += F dt and L += Rᵀ T dt of all bodies asleep."""
    for b in range(count[BODIES]):
        first = bodies.member[bodies.start[b]]
        if bodies.asleep[first] == 1:
            accrue(bodies.momentum, first, scale(dt, load(bodies.force, first)))
            own = turned_back(load4(bodies.orientation, first), load(bodies.torque, first))
            accrue(bodies.angular_momentum, first, scale(dt, own))


@formula
def spin_of(bodies, first):
    """Angular velocity [rad/s] of a body, in the laboratory frame."""
    own, inertia = load(bodies.angular_momentum, first), load(bodies.inertia, first)
    in_body = (own[0] / inertia[0], own[1] / inertia[1], own[2] / inertia[2])
    return turned(load4(bodies.orientation, first), in_body)


@loop
def place_velocities(grains, bodies, b, span):
    """Velocities and spins of the grains of body b from those of the body.

    In a box that is deformed, u_i = U + ω×s − A s, with U relative to the flow at the centre of mass.
    """
    first = bodies.member[bodies.start[b]]
    q, spin = load4(bodies.orientation, first), spin_of(bodies, first)
    velocity = scale(1.0 / bodies.mass[first], load(bodies.momentum, first))
    for k in range(bodies.start[b], bodies.start[b + 1]):
        i = bodies.member[k]
        put(grains.spin, i, spin)
        s = turned(q, load(bodies.offset, i))
        put(grains.velocity, i, less_flow(add(velocity, cross(spin, s)), s, span))


@unless_still(
    lambda bodies, first, dt, span: nearest_image(
        axpy(dt / bodies.mass[first], load(bodies.momentum, first), load(bodies.centre, first)), span
    )
)
def moved_centre(bodies, first, dt, span):
    """Centre of mass [m] of a body after a drift of dt [s], in the box then.

    In a box that is deformed, the momentum becomes that relative to the flow at the end.
    """
    velocity = scale(1.0 / bodies.mass[first], load(bodies.momentum, first))
    put(bodies.momentum, first, slowed(load(bodies.momentum, first), span, dt))
    return nearest_image(drifted_with_flow(load(bodies.centre, first), velocity, span, dt), after_step(dt, span))


@loop
def move_body(bodies, b, span, dt, piece):
    """Move and turn body b by a step of dt [s]; its grains stay where they are.

    Pieces of the rotation are at most `piece`, in units of the time in which motions about the second axis part.
    """
    first = bodies.member[bodies.start[b]]
    centre = moved_centre(bodies, first, dt, span)
    q, angular, inertia = (
        load4(bodies.orientation, first),
        load(bodies.angular_momentum, first),
        load(bodies.inertia, first),
    )
    if bodies.start[b + 1] - bodies.start[b] > 1:
        q, angular = free_rotation(q, angular, inertia, dt, piece)
    else:
        q = free_sphere(q, angular, inertia[1], dt)
    put(bodies.centre, first, centre)
    put4(bodies.orientation, first, q)
    put(bodies.angular_momentum, first, angular)


@loop
def place_grains(grains, bodies, b, span, is_wrapped):
    """Positions, orientations and moments of the grains of body b.

    Positions are wrapped into the box if `is_wrapped`, else continuous with those before.
    """
    first = bodies.member[bodies.start[b]]
    centre, q = load(bodies.centre, first), load4(bodies.orientation, first)
    for k in range(bodies.start[b], bodies.start[b + 1]):
        i = bodies.member[k]
        position = add(centre, turned(q, load(bodies.offset, i)))
        if is_wrapped:
            wrapped = nearest_image(position, span)
            # both are within the box: they are most of a box apart if the grain has crossed a boundary between them
            count_crossings(grains, i, sub(load(grains.position, i), wrapped), span)
            put(grains.position, i, wrapped)
        else:
            accrue(grains.position, i, nearest_image(sub(position, load(grains.position, i)), span))
        own = product(q, load4(bodies.turn, i))
        put4(grains.orientation, i, own)
        put(grains.moment, i, turned(own, load(grains.body_moment, i)))


@formula
def takes_one_step(bodies, first):
    """Whether a body takes the step of all bodies in one: it is at rest, and takes no substeps."""
    return bodies.asleep[first] == 1 and bodies.quick[first] == 0


@loop
def drift_bodies(grains, bodies, count, span, dt, is_wrapped, piece):
    """Move and turn all bodies with one step by dt [s], with their grains.

    `is_wrapped` as in `place_grains`, `piece` as in `move_body`.
    """
    for b in range(count[BODIES]):
        if takes_one_step(bodies, bodies.member[bodies.start[b]]):
            move_body(bodies, b, span, dt, piece)
            place_grains(grains, bodies, b, box_after(dt, span), is_wrapped)


@loop
def move_velocities(grains, bodies, count, span):
    """`place_velocities` of all bodies asleep."""
    for b in range(count[BODIES]):
        if bodies.asleep[bodies.member[bodies.start[b]]] == 1:
            place_velocities(grains, bodies, b, span)


@formula
def accelerations(bodies, first):
    """Acceleration of the centre of mass [m/s²], angular acceleration [rad/s²] and spin [rad/s] of a body."""
    q, spin, inertia = load4(bodies.orientation, first), spin_of(bodies, first), load(bodies.inertia, first)
    torque = turned_back(q, load(bodies.torque, first))
    torque = sub(torque, cross(turned_back(q, spin), load(bodies.angular_momentum, first)))
    rate = turned(q, (torque[0] / inertia[0], torque[1] / inertia[1], torque[2] / inertia[2]))
    return scale(1.0 / bodies.mass[first], load(bodies.force, first)), rate, spin


@formula
def load_with_inertia(grains, bodies, i, q, linear, rate, spin):
    """Force and torque on grain i less its inertia, F − m a and M − I α, and its vector from the centre of mass."""
    s = turned(q, load(bodies.offset, i))
    acceleration = add(linear, add(cross(rate, s), cross(spin, cross(spin, s))))
    force = axpy(-grains.mass[i], acceleration, load(grains.force, i))
    return force, axpy(-grains.inertia[i], rate, load(grains.torque, i)), s


@loop
def store_loads(grains, bodies, b):
    """Store the present loads on the grains of body b, less their inertia, as the ones that are known."""
    first = bodies.member[bodies.start[b]]
    q = load4(bodies.orientation, first)
    linear, rate, spin = accelerations(bodies, first)
    for k in range(bodies.start[b], bodies.start[b + 1]):
        i = bodies.member[k]
        force, torque, _ = load_with_inertia(grains, bodies, i, q, linear, rate, spin)
        put(bodies.known_force, i, turned_back(q, force))
        put(bodies.known_torque, i, turned_back(q, torque))


@loop
def contact_loads_bound(grains, bodies, b):
    """Bound of the change of the loads of the contacts of a body from the known ones, in units of their limits.

    A contact divides the body into two parts, and carries the sum of the loads f = F − m a and t = M − I α on the
    grains of one part.  With their changes in the frame of the body, Σ|Δf| bounds the change of its force, and
    Σ(|Δt| + 2 s |Δf|) that of its torque, where s is the largest distance of a grain from the centre of mass.
    """
    first = bodies.member[bodies.start[b]]
    q = load4(bodies.orientation, first)
    linear, rate, spin = accelerations(bodies, first)
    forces = torques = extent = 0.0
    for k in range(bodies.start[b], bodies.start[b + 1]):
        i = bodies.member[k]
        force, torque, s = load_with_inertia(grains, bodies, i, q, linear, rate, spin)
        forces += norm(sub(force, turned(q, load(bodies.known_force, i))))
        torques += norm(sub(torque, turned(q, load(bodies.known_torque, i))))
        extent = max(extent, dot(s, s))
    torques += 2.0 * math.sqrt(extent) * forces
    return max(forces / bodies.strength[0, first], torques / bodies.strength[1, first])
