"""Charges and masses: sums of central forces over all pairs or over listed pairs."""

from typing import Any, NamedTuple

from ...box import nearest_image
from ...compiler.jit import loop
from ...numerics.vec import accrue, axpy, load, put, scale, sub
from .inverse_square_formulas import central_field, central_potential, central_rate
from .loops import LongRangeSums


class InverseSquareParameters(NamedTuple):
    """The numbers of the sums."""

    k: float  # 1/(4πε₀) [N m²/C²], or −G [N m²/kg²]
    cutoff: Any
    massive: bool  # masses attract, not charges


@loop
def strength(grains, rules, i):
    """The charge [C] of grain i, or its mass [kg]."""
    return grains.mass[i] if rules.massive else grains.charge[i]


@loop
def both(grains, rules, i, j):
    """The product of two of them."""
    return strength(grains, rules, i) * strength(grains, rules, j)


@loop
def all_loads(grains, long_range, span, rules):
    """Forces of all pairs, nearest images."""
    for i in range(grains.mass.size):
        here, push = load(grains.position, i), (0.0, 0.0, 0.0)
        for j in range(i):
            f = central_field(nearest_image(sub(here, load(grains.position, j)), span), rules.k, rules.cutoff)
            push = axpy(strength(grains, rules, j), f, push)
            accrue(long_range.force, j, scale(-both(grains, rules, i, j), f))
        accrue(long_range.force, i, scale(strength(grains, rules, i), push))


@loop
def pack_charges(grains, long_range, rules):
    """Positions and charges in the order of the list."""
    for s in range(grains.mass.size):
        i = long_range.order[s]
        put(long_range.packed_position, s, load(grains.position, i))
        long_range.source[0, s] = strength(grains, rules, i)


@loop
def listed_loads(grains, long_range, span, rules):
    """Forces of listed pairs."""
    pack_charges(grains, long_range, rules)
    for s in range(grains.mass.size):
        here, push = load(long_range.packed_position, s), (0.0, 0.0, 0.0)
        for m in range(long_range.start[s], long_range.start[s + 1]):
            t = long_range.neighbour[m]
            apart = nearest_image(sub(here, load(long_range.packed_position, t)), span)
            push = axpy(long_range.source[0, t], central_field(apart, rules.k, rules.cutoff), push)
        accrue(long_range.force, long_range.order[s], scale(long_range.source[0, s], push))


@loop
def rate_of_pair(grains, long_range, span, rules, i, j):
    """Rate of the force on i due to j [N/s]; `past_position` holds ṙ."""
    apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
    moving = sub(load(long_range.past_position, i), load(long_range.past_position, j))
    return scale(both(grains, rules, i, j), central_rate(apart, moving, rules.k, rules.cutoff))


@loop
def all_rates(grains, long_range, span, rules):
    """Rates of force of all pairs."""
    for i in range(grains.mass.size):
        for j in range(i):
            f = rate_of_pair(grains, long_range, span, rules, i, j)
            accrue(long_range.force_rate, i, f)
            accrue(long_range.force_rate, j, (-f[0], -f[1], -f[2]))


@loop
def listed_rates(grains, long_range, span, rules):
    """Rates of force of listed pairs."""
    for s in range(grains.mass.size):
        for m in range(long_range.start[s], long_range.start[s + 1]):
            i = long_range.order[s]
            accrue(
                long_range.force_rate,
                i,
                rate_of_pair(grains, long_range, span, rules, i, long_range.order[long_range.neighbour[m]]),
            )


@loop
def pair_energy(grains, span, rules, i, j):
    """k S q_i q_j/r [J]"""
    apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
    return both(grains, rules, i, j) * central_potential(apart, rules.k, rules.cutoff)


@loop
def all_energies(grains, long_range, span, rules, shares):
    """Half the energy of each pair to each of its grains."""
    for i in range(grains.mass.size):
        for j in range(i):
            half = 0.5 * pair_energy(grains, span, rules, i, j)
            shares[i] += half
            shares[j] += half


@loop
def listed_energies(grains, long_range, span, rules, shares):
    """The same over listed pairs."""
    for s in range(grains.mass.size):
        for m in range(long_range.start[s], long_range.start[s + 1]):
            shares[long_range.order[s]] += 0.5 * pair_energy(
                grains, span, rules, long_range.order[s], long_range.order[long_range.neighbour[m]]
            )


@loop
def loads_of_pair(grains, span, rules, i, j):
    """Force on i of one pair; no torques."""
    apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
    force = scale(both(grains, rules, i, j), central_field(apart, rules.k, rules.cutoff))
    return force, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)


ALL_PAIRS = LongRangeSums(all_loads, all_rates, all_energies, loads_of_pair)
LISTED_PAIRS = LongRangeSums(listed_loads, listed_rates, listed_energies, loads_of_pair)
