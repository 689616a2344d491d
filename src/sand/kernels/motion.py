"""Kick, drift, turn: velocity Verlet for translation and rotation (Eqs. 28, 29, 31–33 with 1/m and 1/I)."""

import math

from ..core.box import nearest_image
from ..core.jit import loop
from ..core.least import rank, rank_for_most, ranked
from ..core.vec import axpy, dot, load, load4, put, put4, scale
from ..physics.rotation import turn, turned


@loop
def kicked(grains, i, dt):
    """Velocity and spin of grain i after v += F dt/m, ω += M dt/I; kept there."""
    v = axpy(dt / grains.mass[i], load(grains.force, i), load(grains.velocity, i))
    w = axpy(dt / grains.inertia[i], load(grains.torque, i), load(grains.spin, i))
    put(grains.velocity, i, v)
    put(grains.spin, i, w)
    return v, w


@loop
def kick(grains, dt):
    """All velocities and spins; returns squares of the largest speed [m²/s²] and spin [1/s²]."""
    fastest = quickest = rank(0.0)
    for i in range(grains.mass.size):
        v, w = kicked(grains, i, dt)
        fastest, quickest = max(fastest, rank_for_most(dot(v, v))), max(quickest, rank_for_most(dot(w, w)))
    return ranked(fastest), ranked(quickest)


@loop
def kick_and_drift(grains, span, dt):
    """Kick for dt/2; then x += v dt, wrapped into a periodic box, ϱ turned by ω dt; the moments follow.

    Returns the longest way [m].
    """
    fastest = rank(0.0)
    for i in range(grains.mass.size):
        v, w = kicked(grains, i, 0.5 * dt)
        fastest = max(fastest, rank_for_most(dot(v, v)))
        put(grains.position, i, nearest_image(axpy(dt, v, load(grains.position, i)), span))
        q = turn(load4(grains.orientation, i), scale(dt, w))
        put4(grains.orientation, i, q)
        put(grains.moment, i, turned(q, load(grains.body_moment, i)))
    return dt * math.sqrt(ranked(fastest))
