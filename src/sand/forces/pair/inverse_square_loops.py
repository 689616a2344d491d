"""Loops of the inverse-square forces: over all pairs, or over the pairs of a Verlet list."""

from typing import Any, NamedTuple

from ...box import nearest_image
from ...compiler.jit import loop
from ...numerics.vec import accrue, axpy, load, put, scale, sub
from .inverse_square_formulas import central_field, central_potential, central_rate
from .loops import LongRangeSums


class InverseSquareParameters(NamedTuple):
    """Parameters of the loops."""

    k: float  # 1/(4πε₀) [N m²/C²], or −G [N m²/kg²]
    cutoff: Any  # dipole_formulas.Cutoff
    by_mass: bool  # the strength of a grain is its mass, not its charge


@loop
def strength(grains, parameters, i):
    """Charge [C] or mass [kg] of grain i."""
    return grains.mass[i] if parameters.by_mass else grains.charge[i]


@loop
def strength_product(grains, parameters, i, j):
    """Product of the strengths of grains i and j."""
    return strength(grains, parameters, i) * strength(grains, parameters, j)


@loop
def all_loads(grains, long_range, span, parameters):
    """Forces of all pairs, with nearest images."""
    for i in range(grains.mass.size):
        position, field = load(grains.position, i), (0.0, 0.0, 0.0)
        for j in range(i):
            f = central_field(
                nearest_image(sub(position, load(grains.position, j)), span), parameters.k, parameters.cutoff
            )
            field = axpy(strength(grains, parameters, j), f, field)
            accrue(long_range.force, j, scale(-strength_product(grains, parameters, i, j), f))
        accrue(long_range.force, i, scale(strength(grains, parameters, i), field))


@loop
def pack_strengths(grains, long_range, parameters):
    """Copy positions and strengths in the order of the Verlet list."""
    for s in range(grains.mass.size):
        i = long_range.order[s]
        put(long_range.packed_position, s, load(grains.position, i))
        long_range.source[0, s] = strength(grains, parameters, i)


@loop
def listed_loads(grains, long_range, span, parameters):
    """Forces of all pairs of the Verlet list."""
    pack_strengths(grains, long_range, parameters)
    for s in range(grains.mass.size):
        position, field = load(long_range.packed_position, s), (0.0, 0.0, 0.0)
        for m in range(long_range.start[s], long_range.start[s + 1]):
            t = long_range.neighbour[m]
            apart = nearest_image(sub(position, load(long_range.packed_position, t)), span)
            field = axpy(long_range.source[0, t], central_field(apart, parameters.k, parameters.cutoff), field)
        accrue(long_range.force, long_range.order[s], scale(long_range.source[0, s], field))


@loop
def rate_of_pair(grains, long_range, span, parameters, i, j):
    """Rate of the force on i due to j [N/s]; `past_position` holds ṙ."""
    apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
    moving = sub(load(long_range.past_position, i), load(long_range.past_position, j))
    return scale(
        strength_product(grains, parameters, i, j), central_rate(apart, moving, parameters.k, parameters.cutoff)
    )


@loop
def all_rates(grains, long_range, span, parameters):
    """Rates of the forces of all pairs."""
    for i in range(grains.mass.size):
        for j in range(i):
            f = rate_of_pair(grains, long_range, span, parameters, i, j)
            accrue(long_range.force_rate, i, f)
            accrue(long_range.force_rate, j, (-f[0], -f[1], -f[2]))


@loop
def listed_rates(grains, long_range, span, parameters):
    """Rates of the forces of all pairs of the Verlet list."""
    for s in range(grains.mass.size):
        for m in range(long_range.start[s], long_range.start[s + 1]):
            i = long_range.order[s]
            accrue(
                long_range.force_rate,
                i,
                rate_of_pair(grains, long_range, span, parameters, i, long_range.order[long_range.neighbour[m]]),
            )


@loop
def pair_energy(grains, span, parameters, i, j):
    """Energy k S q_i q_j/r [J] of one pair."""
    apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
    return strength_product(grains, parameters, i, j) * central_potential(apart, parameters.k, parameters.cutoff)


@loop
def all_energies(grains, long_range, span, parameters, shares):
    """Add half the energy of each pair to both of its grains."""
    for i in range(grains.mass.size):
        for j in range(i):
            half = 0.5 * pair_energy(grains, span, parameters, i, j)
            shares[i] += half
            shares[j] += half


@loop
def listed_energies(grains, long_range, span, parameters, shares):
    """As `all_energies`, over the pairs of the Verlet list."""
    for s in range(grains.mass.size):
        for m in range(long_range.start[s], long_range.start[s + 1]):
            shares[long_range.order[s]] += 0.5 * pair_energy(
                grains, span, parameters, long_range.order[s], long_range.order[long_range.neighbour[m]]
            )


@loop
def loads_of_pair(grains, span, parameters, i, j):
    """Force on i of one pair, and no torques."""
    apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
    force = scale(strength_product(grains, parameters, i, j), central_field(apart, parameters.k, parameters.cutoff))
    return force, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)


ALL_PAIRS = LongRangeSums(all_loads, all_rates, all_energies, loads_of_pair)
LISTED_PAIRS = LongRangeSums(listed_loads, listed_rates, listed_energies, loads_of_pair)
