"""Poses of contacts from the arrays of grains and contacts, and displacements at the start of a step."""

from ..compiler.jit import loop
from ..numerics.flow import relative_velocity
from ..numerics.quaternion import turned, turned_by
from ..numerics.vec import axpy, load, load4, nearest_image, scale, sub
from . import tangential
from .mechanics import Pose, direction_of, displacements_of, pose_of


@loop
def separation_of(grains, contacts, span, c):
    """x1 − x2 [m] of the grains of contact c in an open box."""
    return sub(load(grains.position, contacts.pair[0, c]), load(grains.position, contacts.pair[1, c]))


@loop
def nearest_separation(grains, contacts, span, c):
    """x1 − x2 [m] of the grains of contact c in any box."""
    return nearest_image(separation_of(grains, contacts, span, c), span)


@loop
def pose_at(grains, contacts, span, c, twist):
    """Relative pose of the grains of contact c now, with the given twist φ [rad]."""
    return pose_apart(grains, contacts, nearest_separation(grains, contacts, span, c), c, twist)


@loop
def pose_apart(grains, contacts, separation, c, twist):
    """As `pose_at`, for given x1 − x2 [m]."""
    i, j = contacts.pair[0, c], contacts.pair[1, c]
    n, distance, inverse = direction_of(separation)  # first: its square root and division have the longest latency
    n1 = turned(load4(grains.orientation, i), load(contacts.pointer1, c))
    n2 = turned(load4(grains.orientation, j), load(contacts.pointer2, c))
    return Pose(n, distance, inverse, n1, n2, twist)


@loop
def twist_increment(grains, contacts, c, pose, step):
    """Increase of the twist [rad] in the step (`update.PresentStep`) that led to this pose, from mid-step motion."""
    i, j = contacts.pair[0, c], contacts.pair[1, c]
    turn = sub(load(grains.spin, i), load(grains.spin, j))
    speed = relative_velocity(grains, i, j, scale(pose.distance, pose.n), step.span)
    return step.dt * tangential.twisting_rate(pose.n, turn, speed, pose.inverse_distance, step.dt)


@loop
def pose_at_step_end(grains, contacts, separation, c, step):
    """Relative pose at the end of a step (`update.PresentStep`), with the twist accumulated in the step."""
    pose = pose_apart(grains, contacts, separation, c, 0.0)
    twist = contacts.twist[c] + twist_increment(grains, contacts, c, pose, step)
    return Pose(pose.n, pose.distance, pose.inverse_distance, pose.n1, pose.n2, twist)


@loop
def displacements_at_step_start(grains, contacts, c, pose, twist, constants, step):
    """Displacements at the start of the step that led to this pose; `twist` is the twist at that time."""
    i, j = contacts.pair[0, c], contacts.pair[1, c]
    separation, dt = scale(pose.distance, pose.n), step.dt
    separation = axpy(-dt, relative_velocity(grains, i, j, separation, step.span), separation)
    n1 = turned_by(scale(-dt, load(grains.spin, i)), pose.n1)
    n2 = turned_by(scale(-dt, load(grains.spin, j)), pose.n2)
    start, r1, r2 = pose_of(separation, n1, n2, twist), grains.radius[i], grains.radius[j]
    return displacements_of(start, r1 + r2 - start.distance, r1, r2, constants)


@loop
def displacements_before(grains, contacts, c, pose, constants, step):
    """Displacements at the start of the step, for a contact whose stored twist is that at the end."""
    twist = pose.twist - twist_increment(grains, contacts, c, pose, step)
    return displacements_at_step_start(grains, contacts, c, pose, twist, constants, step)
