"""Kicks and drifts of velocity Verlet for translation and rotation (Eqs. 28, 29, 31–33, with 1/m and 1/I)."""

import functools
from collections.abc import Callable

import numpy as np

from ..basics.box import Span
from ..compiler.jit import formula, loop
from ..contact.gather import GRAINS_AT_ONCE, gather
from ..numerics.flow import after_step, drifted_with_flow, slowed
from ..numerics.kinds_of_box import unless_still, unless_straight
from ..numerics.quaternion import turn, turned
from ..numerics.simd import float_bits, float_from_bits, magnitude_bits
from ..numerics.vec import axpy, dot, load, load4, nearest_image, put, put4, scale

UNBOUNDED = Span(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""A box without periodic boundaries, for drifts whose positions are wrapped afterwards."""
BLOCK_OF_GRAINS = np.uint64(4 * GRAINS_AT_ONCE)
"""Grains gathered before they are kicked: whole blocks of `contact.gather`, whose forces stay in the L1 cache."""


@formula  # not a `loop`: where the driver calls it in a loop, LLVM loses the information that arrays do not overlap
def kicked(grains, i, dt):
    """Apply v += F dt/m, ω += M dt/I to grain i; returns the new velocity and spin."""
    v = axpy(dt / grains.mass[i], load(grains.force, i), load(grains.velocity, i))
    w = axpy(dt / grains.inertia[i], load(grains.torque, i), load(grains.spin, i))
    put(grains.velocity, i, v)
    put(grains.spin, i, w)
    return v, w


@loop
def kick_some(grains, first, last, dt):
    """Kick the grains first…last − 1 (uint64); returns the bits of the largest squares of speed and spin."""
    fastest = fastest_spin = float_bits(0.0)
    for k in range(last - first):
        v, w = kicked(grains, first + k, dt)
        fastest, fastest_spin = max(fastest, magnitude_bits(dot(v, v))), max(fastest_spin, magnitude_bits(dot(w, w)))
    return fastest, fastest_spin


@loop
def kick(grains, dt):
    """Kick all grains; returns the squares of the largest speed [m²/s²] and spin [1/s²]."""
    fastest, fastest_spin = kick_some(grains, np.uint64(0), np.uint64(grains.mass.size), dt)
    return float_from_bits(fastest), float_from_bits(fastest_spin)


@loop
def gather_and_kick(grains, contacts, first, last, dt):
    """Sum the contact loads of few grains at a time and kick these, without other forces; returns as `kick_some`."""
    fastest = fastest_spin = float_bits(0.0)
    while first < last:
        end = min(first + BLOCK_OF_GRAINS, last)
        gather(grains, contacts, first, end)
        v, w = kick_some(grains, first, end, dt)
        fastest, fastest_spin, first = max(fastest, v), max(fastest_spin, w), end
    return fastest, fastest_spin


@loop
def _rotate_moment(grains, i, q):
    put(grains.moment, i, turned(q, load(grains.body_moment, i)))


@loop
def _no_moment(grains, i, q):
    """For grains without moments."""


@unless_straight(lambda position, span: position[0])
def across_upper_faces(position, span):
    """Coordinate [m] along x of a position, brought within the lengths of the box along z."""
    return position[0] - span.tilt * np.rint(position[2] * span.inverse_z)


@formula
def count_crossings(grains, i, position, span):
    """Count how often grain i crosses the periodic box before `nearest_image` brings `position` [m] back into it."""
    grains.image[0, i] += np.int32(np.rint(across_upper_faces(position, span) * span.inverse_x))
    grains.image[1, i] += np.int32(np.rint(position[1] * span.inverse_y))
    grains.image[2, i] += np.int32(np.rint(position[2] * span.inverse_z))


def _drifted(grains, i, v, dt, span):
    return axpy(dt, v, load(grains.position, i)), span


@unless_still(_drifted)
def drifted(grains, i, v, dt, span):
    """Position [m] of grain i after a drift of dt [s], and the box then.

    In a box that is deformed, the velocity becomes that relative to the flow at the end.
    """
    put(grains.velocity, i, slowed(v, span, dt))
    return drifted_with_flow(load(grains.position, i), v, span, dt), after_step(dt, span)


@unless_still(lambda wrapped_later, span: UNBOUNDED if wrapped_later else span)
def box_of_drift(wrapped_later, span):
    """The box in which a drift wraps positions: none if they are wrapped later, see `wrap_all`."""
    return span


@functools.cache
def drift_for(magnetic: bool) -> Callable:
    """The loop of the first half of a step; if `magnetic`, moments rotate with their grains."""
    rotate_moment = _rotate_moment if magnetic else _no_moment

    @loop
    def drift_some(grains, first, last, span, dt):
        """Kick the grains first…last − 1 (uint64) by dt/2; x += v dt, wrapped into the box; ϱ rotated by ω dt.

        Returns the bits of the largest square of a speed.
        """
        fastest = float_bits(0.0)
        for k in range(last - first):
            i = first + k
            v, w = kicked(grains, i, 0.5 * dt)
            fastest = max(fastest, magnitude_bits(dot(v, v)))
            position, box = drifted(grains, i, v, dt, span)
            put(grains.position, i, nearest_image(position, box))
            count_crossings(grains, i, position, box)
            q = turn(load4(grains.orientation, i), scale(dt, w))
            put4(grains.orientation, i, q)
            rotate_moment(grains, i, q)
        return fastest

    return drift_some


@loop
def wrap_all(grains, span):
    """Wrap all positions into the periodic box."""
    for i in range(grains.mass.size):
        position = load(grains.position, i)
        put(grains.position, i, nearest_image(position, span))
        count_crossings(grains, i, position, span)
