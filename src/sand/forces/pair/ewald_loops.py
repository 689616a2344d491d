"""Loops of the Ewald sum of dipoles in a periodic box.

The real part is summed by the pair loops of `dipole_loops`.  The reciprocal part of the energy is

    U = (2πk/V) Σ exp(−q²/4α²)/q² |S(q)|²,  S(q) = Σ_j (μ_j·q) exp(i q·x_j),  q = 2π (n_x/L_x, n_y/L_y, n_z/L_z) ≠ 0

Half of the vectors suffice, since S(−q) = −S*(q).  They are summed in columns of equal n_x and n_y ≥ 0 … with n_z and
−n_z together.  Within a column exp(i q·x) = w exp(±i q_z z), and with weights G = (8πk/V) exp(−q²/4α²)/q²

    B_j = −Re w_j (q_x V_0, q_y V_0, V_1),  F_j = Im w_j [(μ_x q_x + μ_y q_y) (q_x V_0, q_y V_0, V_1)
    + μ_z (q_x V_1, q_y V_1, V_2)],  V_m = Σ over n_z of G S* q_z^m exp(i q_z z_j)

Each column needs no other one, so that columns are shared among threads in blocks, each with sums of its own.
"""

import functools
import math
from typing import NamedTuple

import numpy as np

from ...box import nearest_image
from ...compiler.jit import formula, loop
from ...numerics.vec import accrue, add, cross, load, put, scale, sub
from .dipole_formulas import pair_load
from .dipole_loops import (
    COPIES,
    add_blocks,
    add_torques,
    all_pairs_block_of,
    copy_moments,
    energy_shares,
    listed_block_of,
    pack_moments,
    separation_if,
)
from .ewald_formulas import real_part
from .loops import LongRangeSums, all_blocks, listed_blocks

WORK_ROWS = 12
"""Rows of the buffer of a block: w, (μ_x q_x + μ_y q_y) w, μ_z w, V_0, V_1, V_2, real and imaginary parts."""


class Waves(NamedTuple):
    """The wave vectors of the reciprocal part, and buffers of its loops; V is the padded number of grains."""

    column: np.ndarray  # (4, C) int64: n_x, n_y, number of n_z ≥ 0, index of the first weight
    weight: np.ndarray  # (W,) G [T m²/(A m²)]; half of it for n_z = 0 and n_x = n_y = 0, which are counted twice
    block: np.ndarray  # (B+1,) int64: first column of each block
    phase: np.ndarray  # (3, M+1, 2, V): cos and sin of 2π m x/L of each axis
    moment: np.ndarray  # (3, V) [A m²], padded with zeros
    work: np.ndarray  # (B, 12, V)
    sums: np.ndarray  # (B, 6, V): forces [N] and flux densities [T] of each block


class EwaldParameters(NamedTuple):
    """Parameters of the loops."""

    k: float  # μ₀/4π [T m/A]
    cutoff_square: float  # r_c² [m²]
    stretch: float  # 2/r_c² [1/m²]
    coefficients: tuple  # of B_s [1/m³], that of the highest power first
    self_field: float  # about 4α³k/(3√π) [T/(A m²)]: removes the flux density of a grain's own smeared dipole
    mean_field: float  # −4πk/(3V) in vacuum, 0 for tin foil [T/(A m²)]: flux density per total moment
    waves: Waves


@loop
def prepare_phases(grains, span, waves):
    """Copy the moments, and compute cos and sin of 2π m x/L for all grains, axes and m up to the largest."""
    phase = waves.phase
    for i in range(grains.mass.size):
        x = load(grains.position, i)
        at = x[0] * span.inverse_x, x[1] * span.inverse_y, x[2] * span.inverse_z
        for axis in range(3):
            angle = 2.0 * math.pi * (at[axis] - np.rint(at[axis]))
            phase[axis, 0, 0, i], phase[axis, 0, 1, i] = 1.0, 0.0
            phase[axis, 1, 0, i], phase[axis, 1, 1, i] = math.cos(angle), math.sin(angle)
        put(waves.moment, i, load(grains.moment, i))
    for axis in range(3):
        for m in range(2, phase.shape[1]):
            for i in range(phase.shape[3]):
                c, s = phase[axis, 1, 0, i], phase[axis, 1, 1, i]
                before, sine = phase[axis, m - 1, 0, i], phase[axis, m - 1, 1, i]
                phase[axis, m, 0, i] = before * c - sine * s
                phase[axis, m, 1, i] = sine * c + before * s


@loop
def begin_column(waves, work, n_x, n_y, q_x, q_y):
    """w = exp(i (q_x x + q_y y)), its products with the moments, and zeros for V_m."""
    moment, phase = waves.moment, waves.phase
    row, sign = abs(n_y), 1.0 if n_y >= 0 else -1.0
    for i in range(moment.shape[1]):
        c_x, s_x, c_y, s_y = phase[0, n_x, 0, i], phase[0, n_x, 1, i], phase[1, row, 0, i], sign * phase[1, row, 1, i]
        real, imaginary = c_x * c_y - s_x * s_y, s_x * c_y + c_x * s_y
        d = moment[0, i] * q_x + moment[1, i] * q_y
        work[0, i], work[1, i] = real, imaginary
        work[2, i], work[3, i] = d * real, d * imaginary
        work[4, i], work[5, i] = moment[2, i] * real, moment[2, i] * imaginary
        work[6, i] = work[7, i] = work[8, i] = work[9, i] = work[10, i] = work[11, i] = 0.0


@loop
def structure_factors(phase, work, m, q):
    """S(q) [A m] for n_z = m and for n_z = −m, real and imaginary parts."""
    a = b = c = d = e = f = g = h = 0.0
    for i in range(work.shape[1]):
        cosine, sine = phase[2, m, 0, i], phase[2, m, 1, i]
        a += work[2, i] * cosine
        b += work[2, i] * sine
        c += work[3, i] * cosine
        d += work[3, i] * sine
        e += work[4, i] * cosine
        f += work[4, i] * sine
        g += work[5, i] * cosine
        h += work[5, i] * sine
    return a - d + q * (e - h), b + c + q * (f + g), a + d - q * (e + h), c - b - q * (g - f)


@loop
def add_wave_pair(phase, work, m, q, weight, up, up_imaginary, down, down_imaginary):
    """Add the waves n_z = m and −m to V_0, V_1 and V_2."""
    even, even_i = weight * (up + down), -weight * (up_imaginary + down_imaginary)
    odd, odd_i = weight * (up - down), -weight * (up_imaginary - down_imaginary)
    q2 = q * q
    for i in range(work.shape[1]):
        cosine, sine = phase[2, m, 0, i], phase[2, m, 1, i]
        real, imaginary = even * cosine - odd_i * sine, even_i * cosine + odd * sine
        work[6, i] += real
        work[7, i] += imaginary
        work[8, i] += q * (odd * cosine - even_i * sine)
        work[9, i] += q * (odd_i * cosine + even * sine)
        work[10, i] += q2 * real
        work[11, i] += q2 * imaginary


@loop
def end_column(waves, work, sums, q_x, q_y):
    """Add forces and flux densities of a column to the sums of its block."""
    moment = waves.moment
    for i in range(moment.shape[1]):
        real, imaginary = work[0, i], work[1, i]
        field = real * work[6, i] - imaginary * work[7, i], real * work[8, i] - imaginary * work[9, i]
        turned = real * work[7, i] + imaginary * work[6, i], real * work[9, i] + imaginary * work[8, i]
        d = moment[0, i] * q_x + moment[1, i] * q_y
        across = d * turned[0] + moment[2, i] * turned[1]
        sums[0, i] += q_x * across
        sums[1, i] += q_y * across
        sums[2, i] += d * turned[1] + moment[2, i] * (real * work[11, i] + imaginary * work[10, i])
        sums[3, i] -= q_x * field[0]
        sums[4, i] -= q_y * field[0]
        sums[5, i] -= field[1]


@loop
def wave_block(span, waves, b):
    """Forces and flux densities of one block of columns."""
    work, sums, phase = waves.work[b], waves.sums[b], waves.phase
    turn = 2.0 * math.pi
    for row in range(sums.shape[0]):
        for i in range(sums.shape[1]):
            sums[row, i] = 0.0
    for column in range(waves.block[b], waves.block[b + 1]):
        n_x, n_y = waves.column[0, column], waves.column[1, column]
        q_x, q_y = turn * n_x * span.inverse_x, turn * n_y * span.inverse_y
        begin_column(waves, work, n_x, n_y, q_x, q_y)
        first = waves.column[3, column]
        for m in range(waves.column[2, column]):
            weight = waves.weight[first + m]
            if weight > 0.0:
                q = turn * m * span.inverse_z
                up, up_i, down, down_i = structure_factors(phase, work, m, q)
                add_wave_pair(phase, work, m, q, weight, up, up_i, down, down_i)
        end_column(waves, work, sums, q_x, q_y)


@loop
def add_waves(grains, long_range, parameters):
    """Add the reciprocal part of all blocks, the fields of a grain's own smeared dipole, and the mean field."""
    sums = parameters.waves.sums
    for b in range(sums.shape[0]):
        for i in range(grains.mass.size):
            accrue(long_range.force, i, (sums[b, 0, i], sums[b, 1, i], sums[b, 2, i]))
            accrue(grains.field, i, (sums[b, 3, i], sums[b, 4, i], sums[b, 5, i]))
    total = (0.0, 0.0, 0.0)
    for i in range(grains.mass.size):
        total = add(total, load(grains.moment, i))
    mean = scale(parameters.mean_field, total)
    for i in range(grains.mass.size):
        accrue(grains.field, i, add(mean, scale(parameters.self_field, load(grains.moment, i))))


@loop
def bare_pair(grains, span, parameters, i, j):
    """Force on i and torques on i and j of one pair of nearest images, not screened.

    These loads of grains in contact act in every step of an r-RESPA cycle; the sum less these loads, which are those
    of all images, varies slowly.
    """
    apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
    moment1, moment2 = load(grains.moment, i), load(grains.moment, j)
    force, b1, b2, _ = pair_load(apart, moment1, moment2, parameters.k)
    return force, cross(moment1, b1), cross(moment2, b2)


@functools.cache
def ewald_sums(degree: int, listed: bool) -> LongRangeSums:
    """The loops, with a polynomial of this degree, over the pairs of the Verlet list or over all pairs."""
    loads = real_part(degree)

    @formula
    def pair_loads(position1, position2, span, moment1, moment2, parameters, real):
        apart = separation_if(real, nearest_image(sub(position1, position2), span))
        inside = real and apart[0] * apart[0] + apart[1] * apart[1] + apart[2] * apart[2] < parameters.cutoff_square
        k = parameters.k if inside else 0.0
        return loads(apart, moment1, moment2, k, parameters.stretch, parameters.coefficients)

    pack = pack_moments if listed else copy_moments
    blocks_of_pairs = listed_blocks if listed else all_blocks
    pair_block = listed_block_of(pair_loads) if listed else all_pairs_block_of(pair_loads)

    @loop
    def begin(grains, long_range, span, parameters):
        pack(grains, long_range, span, parameters)
        prepare_phases(grains, span, parameters.waves)

    @loop
    def blocks(grains):
        return blocks_of_pairs(grains) + all_blocks(grains)

    @loop
    def block(grains, long_range, span, parameters, b):
        waves = all_blocks(grains)
        if b < waves:
            wave_block(span, parameters.waves, b)
        else:
            pair_block(grains, long_range, span, parameters, b - waves)

    @loop
    def end(grains, long_range, span, parameters):
        if not listed:
            add_blocks(grains, long_range, span, parameters)
        add_waves(grains, long_range, parameters)
        add_torques(grains, long_range, span, parameters)

    return LongRangeSums(begin, block, end, blocks, None, energy_shares, bare_pair, arrays=COPIES)
