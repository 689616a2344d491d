"""Every grain feels every other: all pairs once, action and reaction (Newton's third law)."""

from ..core.box import nearest_image
from ..core.jit import loop
from ..core.vec import accrue, add, cross, load, put, sub
from ..physics.dipole import pair_load, pair_load_cut

OFF, BARE, CUT = range(3)
"""Ways to sum: not at all; all pairs of an open box; nearest images with a smooth cut-off."""


@loop
def bare_sum(grains, k):
    """Add forces [N] and set fields [T] of all pairs, open box."""
    for i in range(grains.mass.size):
        put(grains.field, i, (0.0, 0.0, 0.0))
    for i in range(grains.mass.size):
        here, mine = load(grains.position, i), load(grains.moment, i)
        push = field = (0.0, 0.0, 0.0)
        for j in range(i):
            apart = sub(here, load(grains.position, j))
            f, b1, b2, _ = pair_load(apart, mine, load(grains.moment, j), k)
            push, field = add(push, f), add(field, b1)
            accrue(grains.force, j, (-f[0], -f[1], -f[2]))
            accrue(grains.field, j, b2)
        accrue(grains.force, i, push)
        accrue(grains.field, i, field)


@loop
def cut_sum(grains, span, k, cutoff):
    """The same with nearest images and a smooth cut-off."""
    for i in range(grains.mass.size):
        put(grains.field, i, (0.0, 0.0, 0.0))
    for i in range(grains.mass.size):
        here, mine = load(grains.position, i), load(grains.moment, i)
        push = field = (0.0, 0.0, 0.0)
        for j in range(i):
            apart = nearest_image(sub(here, load(grains.position, j)), span)
            f, b1, b2, _ = pair_load_cut(apart, mine, load(grains.moment, j), k, cutoff)
            push, field = add(push, f), add(field, b1)
            accrue(grains.force, j, (-f[0], -f[1], -f[2]))
            accrue(grains.field, j, b2)
        accrue(grains.force, i, push)
        accrue(grains.field, i, field)


@loop
def dipole_loads(grains, span, dipoles):
    """Add magnetic forces and torques μ×B of the chosen kind to what the grains carry already."""
    if dipoles.way == BARE:
        bare_sum(grains, dipoles.k)
    elif dipoles.way == CUT:
        cut_sum(grains, span, dipoles.k, dipoles.cutoff)
    if dipoles.way != OFF:
        for i in range(grains.mass.size):
            accrue(grains.torque, i, cross(load(grains.moment, i), load(grains.field, i)))


@loop
def dipole_energy(grains, span, dipoles):
    """Magnetic energy of all pairs [J], each pair once."""
    total = 0.0
    if dipoles.way == OFF:
        return total
    for i in range(grains.mass.size):
        here, mine = load(grains.position, i), load(grains.moment, i)
        for j in range(i):
            apart, other = sub(here, load(grains.position, j)), load(grains.moment, j)
            if dipoles.way == CUT:
                total += pair_load_cut(nearest_image(apart, span), mine, other, dipoles.k, dipoles.cutoff)[3]
            else:
                total += pair_load(apart, mine, other, dipoles.k)[3]
    return total
