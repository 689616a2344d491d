"""Loops over pairs for any pair formula: all pairs, pairs of the Verlet list, blocks for threads, energies, rates.

A pair formula is a pure function of two grains a and b, decorated with `sand.compiler.jit.formula`:

    formula(apart, a, b, parameters) → force on a [N], energy [J]
    formula(apart, a, b, parameters) → force on a [N], torque on a [N m], torque on b [N m], energy [J]

`apart` r = x_a − x_b [m] is the nearest image, a and b are `PairGrain`; the force on b is the opposite one.  The loops
apply the cut-off, U → S(r²) U, with the exact gradient: F → S F + s U r, M → S M, s = −2 dS/d(r²).
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ...compiler.jit import formula, loop
from ...compiler.recipes import factory
from ...numerics.flow import add_virial, with_pair
from ...numerics.vec import accrue, axpy, dot, load, nearest_image, put, scale, sub
from .dipole_formulas import cut_weight
from .dipole_rates import cut_curvature
from .long_range_loops import ROWS_PER_BLOCK, LongRangeSums, all_blocks, first_row, listed_blocks, virial_of_pairs

ZERO = (0.0, 0.0, 0.0)


class PairGrain(NamedTuple):
    """The quantities of one grain that a pair formula may use."""

    moment: tuple  # μ [A m²], laboratory frame
    charge: float  # [C]
    mass: float  # [kg]
    radius: float  # [m]


class PairParameters(NamedTuple):
    """Parameters of the loops."""

    own: Any  # parameters of the formula
    cutoff: Any  # dipole_formulas.Cutoff


@loop
def pair_grain(grains, i):
    """The quantities of grain i for a pair formula."""
    return PairGrain(load(grains.moment, i), grains.charge[i], grains.mass[i], grains.radius[i])


@loop
def pack_grain(packed, s, grains, i):
    """Copy position and quantities of grain i to column s, so that neighbours are close in memory."""
    put(packed, s, load(grains.position, i))
    packed[3, s], packed[4, s], packed[5, s] = load(grains.moment, i)
    packed[6, s], packed[7, s], packed[8, s] = grains.charge[i], grains.mass[i], grains.radius[i]


@loop
def packed_grain(packed, s):
    """The quantities of the grain in column s."""
    return PairGrain((packed[3, s], packed[4, s], packed[5, s]), packed[6, s], packed[7, s], packed[8, s])


@factory
def cut_pair(pair_formula: Callable, torques: bool) -> Callable:
    """The formula for the energy S U: force on a, torques on a and on b, and energy of a pair with its cut-off."""

    @formula
    def without_torques(apart, a, b, parameters):
        force, energy = pair_formula(apart, a, b, parameters.own)
        weight, slope = cut_weight(dot(apart, apart), parameters.cutoff)
        return axpy(slope * energy, apart, scale(weight, force)), ZERO, ZERO, weight * energy

    @formula
    def with_torques(apart, a, b, parameters):
        force, torque_a, torque_b, energy = pair_formula(apart, a, b, parameters.own)
        weight, slope = cut_weight(dot(apart, apart), parameters.cutoff)
        force = axpy(slope * energy, apart, scale(weight, force))
        return force, scale(weight, torque_a), scale(weight, torque_b), weight * energy

    return with_torques if torques else without_torques


@functools.cache
def cut_rate(pair_formula: Callable, rate: Callable) -> Callable:
    """The rate Ḟ [N/s] of the force on a with its cut-off, for a force without torques and ṙ = v_a − v_b (`moving`).

    With F_u and U without cut-off:

        Ḟ = S Ḟ_u + Ṡ F_u + (U̇ s + U ṡ) r + U s ṙ,  U̇ = −F_u·ṙ,  Ṡ = −s r·ṙ
    """

    @formula
    def rate_of_pair(apart, moving, a, b, parameters):
        force, energy = pair_formula(apart, a, b, parameters.own)
        force_rate = rate(apart, moving, a, b, parameters.own)
        square, radial = dot(apart, apart), dot(apart, moving)
        weight, slope = cut_weight(square, parameters.cutoff)
        slope_rate = 2.0 * cut_curvature(square, parameters.cutoff) * radial
        shell = axpy(energy * slope_rate - dot(force, moving) * slope, apart, scale(energy * slope, moving))
        return axpy(weight, force_rate, axpy(-slope * radial, force, shell))

    return rate_of_pair


@factory
def pair_sums(pair_formula: Callable, rate: Callable | None, torques: bool, listed: bool) -> LongRangeSums:
    """The loops of one pair force.

    Parameters
    ----------
    pair_formula : callable
        See the module.
    rate : callable or None
        `rate(apart, moving, a, b, parameters)` → Ḟ [N/s], without cut-off, for `far="taylor"`; None if the force does
        not have it.  Forces with torques cannot have one.
    torques : bool
        Whether the formula returns torques.
    listed : bool
        Over the pairs of the Verlet list instead of all pairs.

    Returns
    -------
    LongRangeSums
        Their parameters are a `PairParameters`.
    """
    rates = None if rate is None or torques else _rate_loops(cut_rate(pair_formula, rate), listed)
    return sums_of(cut_pair(pair_formula, torques), torques, listed)._replace(rates=rates)


@factory
def sums_of(of_pair: Callable, torques: bool, listed: bool) -> LongRangeSums:
    """The loops, without rates, of one function of a pair, over all pairs or over the Verlet list.

    Parameters
    ----------
    of_pair : callable
        `of_pair(apart, a, b, parameters)` → force on a [N], torques on a and on b [N m], energy [J], cut-off included;
        `parameters` are those of the loops.
    torques : bool
        Whether torques differ from 0.
    listed : bool
        Over the pairs of the Verlet list instead of all pairs.
    """

    @loop
    def separation(grains, span, i, j):
        return nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)

    @loop
    def pair(grains, span, parameters, i, j):
        apart = separation(grains, span, i, j)
        force, torque_i, torque_j, _ = of_pair(apart, pair_grain(grains, i), pair_grain(grains, j), parameters)
        return force, torque_i, torque_j

    @loop
    def pair_energy(grains, span, parameters, i, j):
        return of_pair(separation(grains, span, i, j), pair_grain(grains, i), pair_grain(grains, j), parameters)[3]

    make = _listed_loops if listed else _all_pairs_loops
    (begin, block, end, blocks), energies = make(of_pair, pair_energy, torques)
    arrays = ("packed_grain",) if listed else ()
    virial = virial_of_pairs(pair, listed)
    return LongRangeSums(begin, block, end, blocks, None, energies, pair, arrays=arrays, virial=virial)


def _all_pairs_loops(of_pair: Callable, pair_energy: Callable, torques: bool) -> tuple[tuple[Callable, ...], Callable]:
    """Loops over all pairs j < i, each pair once: loads in blocks of rows i, and energies.

    Each block adds to two arrays of its own, for forces and torques, which are added up at the end in a fixed order.
    """

    @loop
    def add_rows(grains, long_range, force, torque, span, parameters, first, last):
        for i in range(first, last):
            position, a = load(grains.position, i), pair_grain(grains, i)
            force_i = torque_i = virial = (0.0, 0.0, 0.0)
            for j in range(i):
                apart = nearest_image(sub(position, load(grains.position, j)), span)
                f, torque_a, torque_b, _ = of_pair(apart, a, pair_grain(grains, j), parameters)
                force_i = axpy(1.0, f, force_i)
                accrue(force, j, scale(-1.0, f))
                virial = with_pair(virial, apart, f, span)
                if torques:
                    torque_i = axpy(1.0, torque_a, torque_i)
                    accrue(torque, j, torque_b)
            accrue(force, i, force_i)
            add_virial(long_range.virial, i, virial, span)
            if torques:
                accrue(torque, i, torque_i)

    @loop
    def begin(grains, long_range, span, parameters):
        """Nothing is copied before the blocks."""

    @loop
    def block(grains, long_range, span, parameters, b):
        blocks = all_blocks(grains)
        k = 2 * b
        force, torque = long_range.block_sums[k], long_range.block_sums[k + 1]
        first, last = np.int64(first_row(grains, b, blocks)), np.int64(first_row(grains, b + 1, blocks))
        for i in range(last):
            put(force, i, (0.0, 0.0, 0.0))
            if torques:
                put(torque, i, (0.0, 0.0, 0.0))
        add_rows(grains, long_range, force, torque, span, parameters, first, last)

    @loop
    def end(grains, long_range, span, parameters):
        blocks = all_blocks(grains)
        for b in range(blocks):
            k = 2 * b
            force, torque = long_range.block_sums[k], long_range.block_sums[k + 1]
            for i in range(np.int64(first_row(grains, b + 1, blocks))):
                accrue(long_range.force, i, load(force, i))
                if torques:
                    accrue(long_range.torque, i, load(torque, i))

    @loop
    def energies(grains, long_range, span, parameters, shares):
        for i in range(grains.mass.size):
            for j in range(i):
                half = 0.5 * pair_energy(grains, span, parameters, i, j)
                shares[i] += half
                shares[j] += half

    return (begin, block, end, all_blocks), energies


def _listed_loops(of_pair: Callable, pair_energy: Callable, torques: bool) -> tuple[tuple[Callable, ...], Callable]:
    """Loops over the rows of the Verlet list, in which each pair occurs twice: loads in blocks, and energies."""

    @loop
    def add_rows(grains, long_range, span, parameters, first, last):
        packed = long_range.packed_grain
        for s in range(first, last):
            i = long_range.order[s]
            position, a = load(packed, s), packed_grain(packed, s)
            force = torque = virial = (0.0, 0.0, 0.0)
            for m in range(long_range.start[s], long_range.start[s + 1]):
                t = long_range.neighbour[m]
                apart = nearest_image(sub(position, load(packed, t)), span)
                f, torque_a, _, _ = of_pair(apart, a, packed_grain(packed, t), parameters)
                force = axpy(1.0, f, force)
                virial = with_pair(virial, apart, f, span)
                if torques:
                    torque = axpy(1.0, torque_a, torque)
            accrue(long_range.force, i, force)
            add_virial(long_range.virial, i, scale(0.5, virial), span)
            if torques:
                accrue(long_range.torque, i, torque)

    @loop
    def begin(grains, long_range, span, parameters):
        for s in range(grains.mass.size):
            pack_grain(long_range.packed_grain, s, grains, long_range.order[s])

    @loop
    def end(grains, long_range, span, parameters):
        """Nothing is left to do after the blocks: each row belongs to one grain."""

    @loop
    def block(grains, long_range, span, parameters, b):
        first = b * ROWS_PER_BLOCK
        add_rows(grains, long_range, span, parameters, first, min(first + ROWS_PER_BLOCK, grains.mass.size))

    @loop
    def energies(grains, long_range, span, parameters, shares):
        for s in range(grains.mass.size):
            i = long_range.order[s]
            for m in range(long_range.start[s], long_range.start[s + 1]):
                shares[i] += 0.5 * pair_energy(grains, span, parameters, i, long_range.order[long_range.neighbour[m]])

    return (begin, block, end, listed_blocks), energies


def _rate_loops(rate_of_pair: Callable, listed: bool) -> Callable:
    """The loop that adds the rates of the forces; `past_position` holds ṙ."""

    @loop
    def rate(grains, long_range, span, parameters, i, j):
        apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
        moving = sub(load(long_range.past_position, i), load(long_range.past_position, j))
        return rate_of_pair(apart, moving, pair_grain(grains, i), pair_grain(grains, j), parameters)

    @loop
    def all_rates(grains, long_range, span, parameters):
        for i in range(grains.mass.size):
            for j in range(i):
                f = rate(grains, long_range, span, parameters, i, j)
                accrue(long_range.force_rate, i, f)
                accrue(long_range.force_rate, j, scale(-1.0, f))

    @loop
    def listed_rates(grains, long_range, span, parameters):
        for s in range(grains.mass.size):
            i = long_range.order[s]
            for m in range(long_range.start[s], long_range.start[s + 1]):
                j = long_range.order[long_range.neighbour[m]]
                accrue(long_range.force_rate, i, rate(grains, long_range, span, parameters, i, j))

    return listed_rates if listed else all_rates
