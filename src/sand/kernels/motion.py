"""Kick, drift, turn: velocity Verlet for translation and rotation (Eqs. 28, 29, 31–33 with 1/m and 1/I)."""

from ..core.box import nearest_image
from ..core.jit import loop
from ..core.vec import axpy, load, load4, put, put4, scale
from ..physics.rotation import turn, turned


@loop
def kick(grains, dt):
    """v += F dt/m, ω += M dt/I."""
    for i in range(grains.mass.size):
        put(grains.velocity, i, axpy(dt / grains.mass[i], load(grains.force, i), load(grains.velocity, i)))
        put(grains.spin, i, axpy(dt / grains.inertia[i], load(grains.torque, i), load(grains.spin, i)))


@loop
def drift(grains, span, dt):
    """x += v dt, wrapped into a periodic box; ϱ turned by ω dt; the moments follow."""
    for i in range(grains.mass.size):
        moved = axpy(dt, load(grains.velocity, i), load(grains.position, i))
        put(grains.position, i, nearest_image(moved, span))
        q = turn(load4(grains.orientation, i), scale(dt, load(grains.spin, i)))
        put4(grains.orientation, i, q)
        put(grains.moment, i, turned(q, load(grains.body_moment, i)))
