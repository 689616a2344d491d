"""Magnetic loads of all grains on each other: all pairs, all pairs with a cut-off, or listed pairs.

All pairs go by action and reaction (Newton's third law); listed ones stand in both grains' rows, so that each
row is a sum of its own that vectorises.
"""

from typing import Any, NamedTuple

from ..core.box import nearest_image
from ..core.jit import loop
from ..core.vec import accrue, add, cross, load, put, sub
from ..physics.dipole import pair_load, pair_load_cut
from ..physics.dipole_rates import pair_rates
from .far import FarSums


class DipoleRules(NamedTuple):
    """The numbers of the sums."""

    k: float  # μ₀/4π [T m/A]
    cutoff: Any


@loop
def clear_field(grains):
    """No flux density at any grain."""
    for i in range(grains.mass.size):
        put(grains.field, i, (0.0, 0.0, 0.0))


@loop
def add_torques(grains, far):
    """μ×B of the flux density summed before."""
    for i in range(grains.mass.size):
        accrue(far.torque, i, cross(load(grains.moment, i), load(grains.field, i)))


@loop
def bare_loads(grains, far, span, rules):
    """All pairs of an open box."""
    clear_field(grains)
    for i in range(grains.mass.size):
        here, mine = load(grains.position, i), load(grains.moment, i)
        push = field = (0.0, 0.0, 0.0)
        for j in range(i):
            apart = sub(here, load(grains.position, j))
            f, b1, b2, _ = pair_load(apart, mine, load(grains.moment, j), rules.k)
            push, field = add(push, f), add(field, b1)
            accrue(far.force, j, (-f[0], -f[1], -f[2]))
            accrue(grains.field, j, b2)
        accrue(far.force, i, push)
        accrue(grains.field, i, field)
    add_torques(grains, far)


@loop
def cut_loads(grains, far, span, rules):
    """The same with nearest images and a cut-off."""
    clear_field(grains)
    for i in range(grains.mass.size):
        here, mine = load(grains.position, i), load(grains.moment, i)
        push = field = (0.0, 0.0, 0.0)
        for j in range(i):
            apart = nearest_image(sub(here, load(grains.position, j)), span)
            f, b1, b2, _ = pair_load_cut(apart, mine, load(grains.moment, j), rules.k, rules.cutoff)
            push, field = add(push, f), add(field, b1)
            accrue(far.force, j, (-f[0], -f[1], -f[2]))
            accrue(grains.field, j, b2)
        accrue(far.force, i, push)
        accrue(grains.field, i, field)
    add_torques(grains, far)


@loop
def pack_moments(grains, far):
    """Positions and moments in the order of the list, so that neighbours lie close in memory."""
    for s in range(grains.mass.size):
        i = far.order[s]
        put(far.here, s, load(grains.position, i))
        put(far.source, s, load(grains.moment, i))


@loop
def listed_loads(grains, far, span, rules):
    """Listed pairs with nearest images and a cut-off."""
    pack_moments(grains, far)
    for s in range(grains.mass.size):
        here, mine = load(far.here, s), load(far.source, s)
        push = field = (0.0, 0.0, 0.0)
        for m in range(far.start[s], far.start[s + 1]):
            t = far.mate[m]
            apart = nearest_image(sub(here, load(far.here, t)), span)
            f, b, _, _ = pair_load_cut(apart, mine, load(far.source, t), rules.k, rules.cutoff)
            push, field = add(push, f), add(field, b)
        i = far.order[s]
        accrue(far.force, i, push)
        put(grains.field, i, field)
    add_torques(grains, far)


@loop
def rates_of_pair(grains, pace, span, rules, i, j):
    """Rates of force and flux density at i due to j, and of the flux density at j."""
    apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
    moving = sub(load(pace.past_position, i), load(pace.past_position, j))
    turning1, turning2 = load(pace.past_moment, i), load(pace.past_moment, j)
    return pair_rates(
        apart, load(grains.moment, i), load(grains.moment, j), moving, turning1, turning2, rules.k, rules.cutoff
    )


@loop
def finish_rates(grains, far):
    """Ṁ = μ̇×B + μ×Ḃ (Eq. 53 as it should read), where `torque_rate` holds Ḃ."""
    for i in range(grains.mass.size):
        field_rate = load(far.torque_rate, i)
        turning = cross(load(far.past_moment, i), load(grains.field, i))
        put(far.torque_rate, i, add(turning, cross(load(grains.moment, i), field_rate)))


@loop
def cut_rates(grains, far, span, rules):
    """Rates of force and torque over all pairs; `past_position` and `past_moment` hold ṙ and μ̇."""
    for i in range(grains.mass.size):
        for j in range(i):
            f, b1, b2 = rates_of_pair(grains, far, span, rules, i, j)
            accrue(far.force_rate, i, f)
            accrue(far.force_rate, j, (-f[0], -f[1], -f[2]))
            accrue(far.torque_rate, i, b1)
            accrue(far.torque_rate, j, b2)
    finish_rates(grains, far)


@loop
def listed_rates(grains, far, span, rules):
    """The same over listed pairs."""
    for s in range(grains.mass.size):
        i = far.order[s]
        for m in range(far.start[s], far.start[s + 1]):
            f, b, _ = rates_of_pair(grains, far, span, rules, i, far.order[far.mate[m]])
            accrue(far.force_rate, i, f)
            accrue(far.torque_rate, i, b)
    finish_rates(grains, far)


@loop
def energy_shares(grains, far, span, rules, shares):
    """Half the energy of each pair to each of its grains [J]: −½ μ·B, from the field summed last."""
    for i in range(grains.mass.size):
        mu, b = load(grains.moment, i), load(grains.field, i)
        shares[i] += -0.5 * (mu[0] * b[0] + mu[1] * b[1] + mu[2] * b[2])


@loop
def loads_of_pair(grains, span, rules, i, j):
    """Force on i and torques on i and j of one pair."""
    apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
    mine, other = load(grains.moment, i), load(grains.moment, j)
    force, b1, b2, _ = pair_load_cut(apart, mine, other, rules.k, rules.cutoff)
    return force, cross(mine, b1), cross(other, b2)


BARE = FarSums(bare_loads, cut_rates, energy_shares, loads_of_pair)
CUT = FarSums(cut_loads, cut_rates, energy_shares, loads_of_pair)
LISTED = FarSums(listed_loads, listed_rates, energy_shares, loads_of_pair)
