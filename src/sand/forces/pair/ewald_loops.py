"""Loops of the Ewald sum of charges or dipoles in a periodic box.

The reciprocal part of the energy is

    U = (2πk/V) Σ exp(−q²/4α²)/q² |S(q)|²,  q = 2π (n_x/L_x, n_y/L_y, n_z/L_z) ≠ 0
    S(q) = Σ_j A_j exp(i q·x_j),  A_j = q_j (charges),  A_j = a_j + b_j q_z = μ_j·q (dipoles)

Half of the vectors suffice, since S(−q) = −S*(q) of dipoles, S*(q) of charges.  They are summed in columns of equal
n_x ≥ 0 and n_y, with n_z and −n_z together.  Within a column exp(i q·x) = w exp(±i q_z z), and with weights
G = (8πk/V) exp(−q²/4α²)/q², a = μ_x q_x + μ_y q_y and b = μ_z, or a = q_j and b = 0,

    F_j = Im w_j [a (q_x V_0, q_y V_0, V_1) + b (q_x V_1, q_y V_1, V_2)],  V_m = Σ over n_z of G S* q_z^m exp(i q_z z_j)
    B_j = −Re w_j (q_x V_0, q_y V_0, V_1),  φ_j = Re w_j V_0

Each column needs no other one, so that columns are shared among threads in blocks, each with sums of its own.  The real
part of dipoles is summed by the pair loops of `dipole_loops`, that of charges in `ewald_charges`.

In a box that is deformed, α, r_c and the integers n stay as they were chosen; q, V and with them G are those of the
present box.  So the virial of `ewald_virial` is the derivative of the energy that is summed.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ...compiler.jit import formula, loop
from ...compiler.recipes import factory
from ...numerics.flow import add_virial, add_virial_of_moment, compression, with_wave
from ...numerics.kinds_of_box import unless_still
from ...numerics.turns import cosine_and_sine
from ...numerics.vec import accrue, add, cross, dot, load, nearest_image, put, scale, sub
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
from .ewald_virial import direct_virial, mesh_virial
from .long_range_loops import LongRangeSums, all_blocks, listed_blocks, virial_of_pairs
from .mesh_loops import (
    MESH_DIPOLES,
    Mesh,
    add_mesh_field,
    add_mesh_forces,
    add_mesh_virial,
    mesh_rounds,
    remove_self_waves,
)


class Buffers(NamedTuple):
    """Buffers of the blocks of columns, (B, V) each: loops over separate arrays vectorise without tests for overlap.

    Names with _i are imaginary parts.
    """

    wave: np.ndarray  # w = exp(i (q_x x + q_y y))
    wave_i: np.ndarray
    across: np.ndarray  # a w [A m] or [C]
    across_i: np.ndarray
    along: np.ndarray  # b w [A m²]
    along_i: np.ndarray
    v0: np.ndarray  # V_0 [T m], V_1 [T], V_2 [T/m] of dipoles; V_0 [V], V_1 [V/m] of charges
    v0_i: np.ndarray
    v1: np.ndarray
    v1_i: np.ndarray
    v2: np.ndarray
    v2_i: np.ndarray
    force_x: np.ndarray  # sums of the block [N]
    force_y: np.ndarray
    force_z: np.ndarray
    field_x: np.ndarray  # [T]
    field_y: np.ndarray
    field_z: np.ndarray
    potential: np.ndarray  # [V]


UNUSED = ("along", "along_i", "v2", "v2_i", "field_x", "field_y", "field_z"), ("potential",)
"""Buffers without an element in sums of charges, and of dipoles."""


class Waves(NamedTuple):
    """The wave vectors of the reciprocal part, and copies for its loops; V is the padded number of grains."""

    column: np.ndarray  # (4, C) int64: n_x, n_y, number of n_z ≥ 0, index of the first weight
    weight: np.ndarray  # (W,) G [T m²/(A m²)] or [V/C]; half of it for n_x = n_y = 0, which are counted twice
    block: np.ndarray  # (B+1,) int64: first column of each block
    cosine: np.ndarray  # (3, M+1, V): cos(2π m x/L) of each axis
    sine: np.ndarray  # (3, M+1, V)
    source: np.ndarray  # (3, V) moments [A m²] or (1, V) charges [C], padded with zeros
    virial: np.ndarray  # (3, B): Σ U_q [1 − 2 q_a² (1/q² + 1/4α²)] [J] of each block, in a box that is deformed


class EwaldParameters(NamedTuple):
    """Parameters of the loops, with wave vectors."""

    k: float  # μ₀/4π [T m/A] or 1/(4πε₀) [N m²/C²]
    cutoff_square: float  # r_c² [m²]
    stretch: float  # 2/r_c² [1/m²]
    coefficients: tuple  # of B_s [1/m³] or A_s [1/m], that of the highest power first
    self_field: float  # about 4α³k/(3√π) [T/(A m²)] or 2αk/√π [V/C]: of a grain's own smeared dipole or charge, removed
    mean_field: float  # per total moment −4πk/(3V) in vacuum, 0 for tin foil [T/(A m²)]; per net charge −πk/(Vα²) [V/C]
    alpha: float  # α [1/m]
    volume: float  # of the box for which they were chosen [m³]
    waves: Waves
    buffers: Buffers


class MeshEwaldParameters(NamedTuple):
    """Parameters of the loops, with a mesh; the first ones are those of `EwaldParameters`."""

    k: float
    cutoff_square: float
    stretch: float
    coefficients: tuple
    self_field: float
    mean_field: float
    alpha: float
    volume: float
    mesh: Mesh


@unless_still(lambda parameters, span: None)
def weigh_waves(parameters, span):
    """Set the weights G of all wave vectors to those of the present box."""
    waves, turn, quarter = parameters.waves, 2.0 * math.pi, 0.25 / parameters.alpha**2
    size = 8.0 * math.pi * parameters.k * span.inverse_x * span.inverse_y * span.inverse_z
    for column in range(waves.column.shape[1]):
        n_x, n_y, first = waves.column[0, column], waves.column[1, column], waves.column[3, column]
        across = (turn * n_x * span.inverse_x) ** 2 + (turn * n_y * span.inverse_y) ** 2
        share = size if n_x != 0 or n_y != 0 else 0.5 * size
        for m in range(waves.column[2, column]):
            square = across + (turn * m * span.inverse_z) ** 2
            waves.weight[first + m] = share * math.exp(-quarter * square) / square if square > 0.0 else 0.0


@loop
def prepare_phases(grains, span, waves):
    """Compute cos and sin of 2π m x/L for all grains, axes and m up to the largest."""
    cosine, sine = waves.cosine, waves.sine
    for i in range(grains.mass.size):
        x = load(grains.position, i)
        at = x[0] * span.inverse_x, x[1] * span.inverse_y, x[2] * span.inverse_z
        for axis in range(3):
            cosine[axis, 1, i], sine[axis, 1, i] = cosine_and_sine(at[axis] - np.rint(at[axis]))
    for axis in range(3):
        for m in range(2, cosine.shape[1]):
            for i in range(cosine.shape[2]):
                c, s = cosine[axis, 1, i], sine[axis, 1, i]
                cosine[axis, m, i] = cosine[axis, m - 1, i] * c - sine[axis, m - 1, i] * s
                sine[axis, m, i] = sine[axis, m - 1, i] * c + cosine[axis, m - 1, i] * s


@factory
def column_loops(dipoles: bool) -> tuple[Callable, Callable]:
    """The loops before and after the waves of a column, of dipoles or of charges."""

    @loop
    def begin_column(waves, buffers, b, n_x, n_y, q_x, q_y):
        """w = exp(i (q_x x + q_y y)), a w and b w; V_m = 0; returns S(q) for n_z = 0."""
        factor = factor_i = 0.0
        source, row, sign = waves.source, abs(n_y), 1.0 if n_y >= 0 else -1.0
        for i in range(source.shape[1]):
            c_x, s_x = waves.cosine[0, n_x, i], waves.sine[0, n_x, i]
            c_y, s_y = waves.cosine[1, row, i], sign * waves.sine[1, row, i]
            wave, wave_i = c_x * c_y - s_x * s_y, s_x * c_y + c_x * s_y
            across = source[0, i] * q_x + source[1, i] * q_y if dipoles else source[0, i]
            buffers.wave[b, i], buffers.wave_i[b, i] = wave, wave_i
            buffers.across[b, i], buffers.across_i[b, i] = across * wave, across * wave_i
            factor += across * wave
            factor_i += across * wave_i
            if dipoles:
                buffers.along[b, i], buffers.along_i[b, i] = source[2, i] * wave, source[2, i] * wave_i
        return factor, factor_i

    @loop
    def end_column(waves, buffers, b, q_x, q_y):
        """Add forces, and flux densities or potentials, of a column to the sums of its block."""
        source = waves.source
        for i in range(source.shape[1]):
            w, w_i = buffers.wave[b, i], buffers.wave_i[b, i]
            v0, v0_i, v1, v1_i = buffers.v0[b, i], buffers.v0_i[b, i], buffers.v1[b, i], buffers.v1_i[b, i]
            real0, turned0, turned1 = w * v0 - w_i * v0_i, w * v0_i + w_i * v0, w * v1_i + w_i * v1
            across = source[0, i] * q_x + source[1, i] * q_y if dipoles else source[0, i]
            force, force_z = across * turned0, across * turned1
            if dipoles:
                force += source[2, i] * turned1
                force_z += source[2, i] * (w * buffers.v2_i[b, i] + w_i * buffers.v2[b, i])
                buffers.field_x[b, i] -= q_x * real0
                buffers.field_y[b, i] -= q_y * real0
                buffers.field_z[b, i] -= w * v1 - w_i * v1_i
            else:
                buffers.potential[b, i] += real0
            buffers.force_x[b, i] += q_x * force
            buffers.force_y[b, i] += q_y * force
            buffers.force_z[b, i] += force_z

    return begin_column, end_column


@factory
def wave_loops(dipoles: bool) -> tuple[Callable, Callable]:
    """The loops of the waves n_z = m and −m of a column, of dipoles or of charges."""

    @loop
    def structure_factors(waves, buffers, b, m, q):
        """S(q) for n_z = m and for n_z = −m, real and imaginary parts."""
        across_c = across_s = across_i_c = across_i_s = along_c = along_s = along_i_c = along_i_s = 0.0
        for i in range(buffers.wave.shape[1]):
            c, s = waves.cosine[2, m, i], waves.sine[2, m, i]
            across_c += buffers.across[b, i] * c
            across_s += buffers.across[b, i] * s
            across_i_c += buffers.across_i[b, i] * c
            across_i_s += buffers.across_i[b, i] * s
            if dipoles:
                along_c += buffers.along[b, i] * c
                along_s += buffers.along[b, i] * s
                along_i_c += buffers.along_i[b, i] * c
                along_i_s += buffers.along_i[b, i] * s
        up = across_c - across_i_s + q * (along_c - along_i_s)
        up_i = across_s + across_i_c + q * (along_s + along_i_c)
        down = across_c + across_i_s - q * (along_c + along_i_s)
        down_i = across_i_c - across_s - q * (along_i_c - along_s)
        return up, up_i, down, down_i

    @loop
    def add_wave_pair(waves, buffers, b, m, q, weight, factors):
        """Add the waves n_z = m and −m to V_0, V_1 and V_2; `factors` are those of `structure_factors`."""
        up, up_i, down, down_i = factors
        even, even_i = weight * (up + down), -weight * (up_i + down_i)
        odd, odd_i = weight * (up - down), -weight * (up_i - down_i)
        even1, even1_i, odd1, odd1_i, q2 = q * even, q * even_i, q * odd, q * odd_i, q * q
        for i in range(buffers.wave.shape[1]):
            c, s = waves.cosine[2, m, i], waves.sine[2, m, i]
            v0, v0_i = even * c - odd_i * s, even_i * c + odd * s
            buffers.v0[b, i] += v0
            buffers.v0_i[b, i] += v0_i
            buffers.v1[b, i] += odd1 * c - even1_i * s
            buffers.v1_i[b, i] += odd1_i * c + even1 * s
            if dipoles:
                buffers.v2[b, i] += q2 * v0
                buffers.v2_i[b, i] += q2 * v0_i

    return structure_factors, add_wave_pair


@factory
def wave_block_of(dipoles: bool) -> Callable:
    """The loop over one block of columns, which computes forces, and flux densities or potentials."""
    (begin_column, end_column), (structure_factors, add_wave_pair) = column_loops(dipoles), wave_loops(dipoles)

    @loop
    def start_potentials(buffers, b, value, value_i):
        """Set V_0 to that of n_z = 0, V_1 and V_2 to 0."""
        for i in range(buffers.wave.shape[1]):
            buffers.v0[b, i], buffers.v0_i[b, i] = value, value_i
            buffers.v1[b, i] = buffers.v1_i[b, i] = 0.0
            if dipoles:
                buffers.v2[b, i] = buffers.v2_i[b, i] = 0.0

    @loop
    def wave_block(span, waves, buffers, b, quarter):
        virial = (0.0, 0.0, 0.0)
        for i in range(buffers.wave.shape[1]):
            buffers.force_x[b, i] = buffers.force_y[b, i] = buffers.force_z[b, i] = 0.0
            if dipoles:
                buffers.field_x[b, i] = buffers.field_y[b, i] = buffers.field_z[b, i] = 0.0
            else:
                buffers.potential[b, i] = 0.0
        turn = 2.0 * math.pi
        for column in range(waves.block[b], waves.block[b + 1]):
            n_x, n_y = waves.column[0, column], waves.column[1, column]
            q_x, q_y = turn * n_x * span.inverse_x, turn * n_y * span.inverse_y
            factor, factor_i = begin_column(waves, buffers, b, n_x, n_y, q_x, q_y)
            first = waves.column[3, column]
            weight = waves.weight[first]
            start_potentials(buffers, b, weight * factor, -weight * factor_i)
            energy = 0.5 * weight * (factor * factor + factor_i * factor_i)
            virial = with_wave(virial, energy, (q_x, q_y, 0.0), quarter, span)
            for m in range(1, waves.column[2, column]):
                q = turn * m * span.inverse_z
                factors, weight = structure_factors(waves, buffers, b, m, q), waves.weight[first + m]
                add_wave_pair(waves, buffers, b, m, q, weight, factors)
                energy = 0.5 * weight * (dot(factors[:3], factors[:3]) + factors[3] * factors[3])
                virial = with_wave(virial, energy, (q_x, q_y, q), quarter, span)
            end_column(waves, buffers, b, q_x, q_y)
        waves.virial[0, b] = waves.virial[1, b] = waves.virial[2, b] = 0.0
        add_virial(waves.virial, b, virial, span)

    return wave_block


@factory
def with_waves(begin_pairs: Callable, pair_block: Callable, blocks_of_pairs: Callable, dipoles: bool) -> tuple:
    """`begin`, `block` and `blocks` of `LongRangeSums` that sum waves, in the first blocks, and pairs."""
    wave_block = wave_block_of(dipoles)

    @loop
    def begin(grains, long_range, span, parameters):
        begin_pairs(grains, long_range, span, parameters)
        waves = parameters.waves
        weigh_waves(parameters, span)
        prepare_phases(grains, span, waves)
        for i in range(grains.mass.size):
            if dipoles:
                put(waves.source, i, load(grains.moment, i))
            else:
                waves.source[0, i] = grains.charge[i]

    @loop
    def blocks(grains):
        return blocks_of_pairs(grains) + all_blocks(grains)

    @loop
    def block(grains, long_range, span, parameters, b):
        waves = all_blocks(grains)
        if b < waves:
            wave_block(span, parameters.waves, parameters.buffers, b, 0.25 / parameters.alpha**2)
        else:
            pair_block(grains, long_range, span, parameters, b - waves)

    return begin, block, blocks


@loop
def add_waves(grains, long_range, span, parameters):
    """Add the reciprocal part of all blocks."""
    sums = parameters.buffers
    for b in range(sums.wave.shape[0]):
        add_virial(long_range.virial, 0, load(parameters.waves.virial, b), span)
        for i in range(grains.mass.size):
            field = sums.field_x[b, i], sums.field_y[b, i], sums.field_z[b, i]
            accrue(long_range.force, i, (sums.force_x[b, i], sums.force_y[b, i], sums.force_z[b, i]))
            accrue(grains.field, i, field)
            add_virial_of_moment(long_range.virial, i, load(grains.moment, i), field, span)


@loop
def add_own_and_mean_field(grains, long_range, span, parameters):
    """Add the fields that remove those of a grain's own smeared dipole, and the mean field B_m.

    The energy −½ μ·B_m of the mean field is proportional to 1/V: W_aa = −½ μ·B_m.
    """
    self_field, mean_field = parameters.self_field, parameters.mean_field * compression(parameters.volume, span)
    total = (0.0, 0.0, 0.0)
    for i in range(grains.mass.size):
        total = add(total, load(grains.moment, i))
    mean = scale(mean_field, total)
    for i in range(grains.mass.size):
        accrue(grains.field, i, add(mean, scale(self_field, load(grains.moment, i))))
    energy = -0.5 * dot(mean, total)
    add_virial(long_range.virial, 0, (energy, energy, energy), span)


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


@factory
def ewald_sums(degree: int, listed: bool, order: int = 0) -> LongRangeSums:
    """The loops of dipoles, with a polynomial of this degree, over the pairs of the Verlet list or over all pairs.

    `order` is that of the splines of a mesh, 0 for a sum over wave vectors.
    """
    loads = real_part(degree)

    @formula
    def pair_loads(position1, position2, span, moment1, moment2, parameters, real):
        apart = separation_if(real, nearest_image(sub(position1, position2), span))
        inside = real and apart[0] * apart[0] + apart[1] * apart[1] + apart[2] * apart[2] < parameters.cutoff_square
        k = parameters.k if inside else 0.0
        return loads(apart, moment1, moment2, k, parameters.stretch, parameters.coefficients)

    @loop
    def real_pair(grains, span, parameters, i, j):
        position1, position2 = load(grains.position, i), load(grains.position, j)
        moment1, moment2 = load(grains.moment, i), load(grains.moment, j)
        force, b1, b2, _ = pair_loads(position1, position2, span, moment1, moment2, parameters, True)
        return force, cross(moment1, b1), cross(moment2, b2)

    virial = virial_of_pairs(real_pair, listed)
    pack = pack_moments if listed else copy_moments
    blocks_of_pairs = listed_blocks if listed else all_blocks
    pair_block = listed_block_of(pair_loads) if listed else all_pairs_block_of(pair_loads)

    if order:
        remove_waves = remove_self_waves(MESH_DIPOLES)

        @loop
        def end_with_mesh(grains, long_range, span, parameters):
            if not listed:
                add_blocks(grains, long_range, span, parameters)
            add_mesh_virial(long_range, parameters.mesh, span)
            for i in range(grains.mass.size):
                moment, field = load(grains.moment, i), load(parameters.mesh.field, i)
                add_virial_of_moment(long_range.virial, i, moment, field, span)
            remove_waves(grains, span, parameters.mesh)
            add_mesh_forces(grains, long_range, parameters.mesh)
            add_mesh_field(grains, parameters.mesh)
            add_own_and_mean_field(grains, long_range, span, parameters)
            add_torques(grains, long_range, span, parameters)

        return LongRangeSums(
            pack,
            pair_block,
            end_with_mesh,
            blocks_of_pairs,
            None,
            energy_shares,
            bare_pair,
            arrays=COPIES,
            rounds=mesh_rounds(order, MESH_DIPOLES),
            virial=virial,
            reciprocal_virial=mesh_virial(True),
        )

    begin, block, blocks = with_waves(pack, pair_block, blocks_of_pairs, True)

    @loop
    def end(grains, long_range, span, parameters):
        if not listed:
            add_blocks(grains, long_range, span, parameters)
        add_waves(grains, long_range, span, parameters)
        add_own_and_mean_field(grains, long_range, span, parameters)
        add_torques(grains, long_range, span, parameters)

    return LongRangeSums(
        begin,
        block,
        end,
        blocks,
        None,
        energy_shares,
        bare_pair,
        arrays=COPIES,
        virial=virial,
        reciprocal_virial=direct_virial(True),
    )
