"""Motion of rigid bodies: the symplectic rotor, and the loops over the bodies of a state.

The kinetic energy of a rotor with angular momentum L in its own frame is that of a sphere and two terms more,

    |L|²/2I₂ + ½ (1/I₁ − 1/I₂) L₁² + ½ (1/I₃ − 1/I₂) L₃².

Each alone generates an exact rotation.  That of the sphere commutes with the others, so that it is applied once, Φ₀(t);
the others are applied in n pieces (a symmetric top and one more axis, as Touma & Wisdom 1994, with quaternions as
Miller et al. 2002; both cited from memory):

    Φ₀(t) [Φ₁(t/2n) Φ₃(t/n) Φ₁(t/2n)]ⁿ,   Φ_k(t): q → q exp(a e_k/2), L → Rot(e_k, −a) L, a = t (1/I_k − 1/I₂) L_k

It is symplectic, of second order, keeps |L| and, in the laboratory frame, L to rounding, and is exact for a sphere and
for symmetric bodies such as straight chains.  One step of a body is kick, drift, kick:

    P += ½h F, L += ½h RᵀT;   X += h P/M, rotor(h);   new F and T;   P += ½h F, L += ½h RᵀT
"""

import math

from ...basics.state import BODIES
from ...compiler.jit import formula, loop
from ...numerics.flow import after_step, box_after, drifted_with_flow, less_flow, slowed
from ...numerics.kinds_of_box import unless_still
from ...numerics.quaternion import normalised, turned, turned_back
from ...numerics.vec import accrue, add, axpy, cross, dot, load, load4, nearest_image, norm, put, put4, scale, sub
from ..motion import count_crossings

LARGEST_PIECE = 0.1
"""Free rotation is computed in pieces t with t |L| √(…) at most this, see `parting_rate`, and at most η, so that its
error falls as η²."""


@formula
def product(a, b):
    """Quaternion of rotation b followed by rotation a."""
    return (
        a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
        a[3] * b[1] + a[1] * b[3] + a[2] * b[0] - a[0] * b[2],
        a[3] * b[2] + a[2] * b[3] + a[0] * b[1] - a[1] * b[0],
        a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2],
    )


@formula
def _about_first(q, angular, angle):
    """Rotation of the body about its first axis by an angle [rad]: new orientation and angular momentum."""
    s, c = math.sin(0.5 * angle), math.cos(0.5 * angle)
    sine, cosine = 2.0 * s * c, c * c - s * s
    x, y, z, w = q
    turned_q = (c * x + s * w, c * y + s * z, c * z - s * y, c * w - s * x)
    return turned_q, (angular[0], cosine * angular[1] + sine * angular[2], cosine * angular[2] - sine * angular[1])


@formula
def _about_third(q, angular, angle):
    """As `_about_first`, about the third axis."""
    s, c = math.sin(0.5 * angle), math.cos(0.5 * angle)
    sine, cosine = 2.0 * s * c, c * c - s * s
    x, y, z, w = q
    turned_q = (c * x + s * y, c * y - s * x, c * z + s * w, c * w - s * z)
    return turned_q, (cosine * angular[0] + sine * angular[1], cosine * angular[1] - sine * angular[0], angular[2])


@formula
def asymmetric_rotation(q, angular, inertia, t):
    """A step of a free rotor but for the rotation of a sphere with I₂, which commutes with it: Φ₁(t/2) Φ₃(t) Φ₁(t/2).

    Parameters
    ----------
    q : tuple
        Orientation: rotation from the principal axes to the laboratory frame.
    angular : tuple
        Angular momentum in the body [J s].
    inertia : tuple
        Principal moments of inertia [kg m²].
    t : float
        Step [s].

    Returns
    -------
    tuple
        New orientation and angular momentum.
    """
    first, third = t * (1.0 / inertia[0] - 1.0 / inertia[1]), t * (1.0 / inertia[2] - 1.0 / inertia[1])
    q, angular = _about_first(q, angular, 0.5 * first * angular[0])
    q, angular = _about_third(q, angular, third * angular[2])
    q, angular = _about_first(q, angular, 0.5 * first * angular[0])
    return normalised(q), angular


@formula
def parting_rate(inertia):
    """√((1/I₁ − 1/I₂)(1/I₂ − 1/I₃)) [1/(kg m²)]: times |L|, the rate at which motions about the second axis part.

    It is 0 for symmetric bodies, for which a step of any length is exact.  A piece t of `asymmetric_rotation` errs by
    about t³|L|³ (1/I₁ − 1/I₂)(1/I₂ − 1/I₃) times the larger of the two differences.
    """
    return math.sqrt((1.0 / inertia[0] - 1.0 / inertia[1]) * (1.0 / inertia[1] - 1.0 / inertia[2]))


@formula
def free_sphere(q, angular, inertia, t):
    """The rotation of a body with three equal moments of inertia, about its constant angular momentum; exact."""
    size = norm(angular)
    if size == 0.0:
        return q
    half = 0.5 * t * size / inertia
    axis = scale(math.sin(half) / size, angular)
    return normalised(product(q, (axis[0], axis[1], axis[2], math.cos(half))))


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
        # a number that free rotation keeps: pieces of changing length would change the energy
        pieces = int(dt * norm(angular) * parting_rate(inertia) / piece) + 1
        for _ in range(pieces):
            q, angular = asymmetric_rotation(q, angular, inertia, dt / pieces)
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
