"""Loops of the Ewald sum of charges in a periodic box.

The real part is summed by the loops of `generic_loops`, the reciprocal part by those of `ewald_loops` or of
`mesh_loops`.  The energies of the grains are ½ q_j φ_j, with the potential φ of all images, without that of the own
charge,

    φ_j = real part + waves − 2αk/√π q_j − πk/(Vα²) Q

Q is the net charge; its uniform background, of charge −Q, gives the last term and no force.
"""

from __future__ import annotations

from collections.abc import Callable

from ...compiler.jit import formula, loop
from ...compiler.recipes import factory
from ...numerics.flow import add_virial, compression
from ...numerics.vec import accrue, dot, load
from .ewald_formulas import real_part_of_charges
from .ewald_loops import with_waves
from .ewald_virial import direct_virial, mesh_virial
from .generic_loops import ZERO, sums_of
from .long_range_loops import LongRangeSums, all_blocks
from .mesh_loops import MESH_CHARGES, add_mesh_forces, add_mesh_virial, mesh_rounds, remove_self_waves


@loop
def add_wave_forces(grains, long_range, span, parameters):
    """Add the forces of all blocks of wave vectors."""
    sums = parameters.buffers
    for b in range(sums.wave.shape[0]):
        add_virial(long_range.virial, 0, load(parameters.waves.virial, b), span)
        for i in range(grains.mass.size):
            accrue(long_range.force, i, (sums.force_x[b, i], sums.force_y[b, i], sums.force_z[b, i]))


@loop
def with_wave_potential(potential, parameters, i):
    """A potential [V], with that of the waves at a grain."""
    sums = parameters.buffers
    for b in range(sums.wave.shape[0]):
        potential += sums.potential[b, i]
    return potential


@loop
def with_mesh_potential(potential, parameters, i):
    """A potential [V], with that of the mesh at a grain."""
    return potential - parameters.mesh.field[0, i]


@loop
def add_virial_of_background(grains, long_range, span, parameters):
    """Add the virial ½ Q φ of the background, whose energy is proportional to 1/V."""
    total = 0.0
    for i in range(grains.mass.size):
        total += grains.charge[i]
    energy = 0.5 * parameters.mean_field * compression(parameters.volume, span) * total * total
    add_virial(long_range.virial, 0, (energy, energy, energy), span)


@factory
def add_energies_of(with_reciprocal: Callable) -> Callable:
    """The loop that adds ½ q (reciprocal part of φ, less that of the own charge, with that of the background) [J]."""

    @loop
    def add_energies(grains, span, parameters, shares):
        total, mean_field = 0.0, parameters.mean_field * compression(parameters.volume, span)
        for i in range(grains.mass.size):
            total += grains.charge[i]
        for i in range(grains.mass.size):
            potential = mean_field * total - parameters.self_field * grains.charge[i]
            shares[i] += 0.5 * grains.charge[i] * with_reciprocal(potential, parameters, i)

    return add_energies


@factory
def ewald_charge_sums(degree: int, listed: bool, bare: Callable, order: int = 0) -> LongRangeSums:
    """The loops of charges, with a polynomial of this degree, over the pairs of the Verlet list or over all pairs.

    `order` is that of the splines of a mesh, 0 for a sum over wave vectors.  In an r-RESPA cycle the bare force of
    grains in contact, by the pair formula `bare`, acts in every step; the sum less these forces, which are those of all
    images, varies slowly.
    """
    loads = real_part_of_charges(degree)

    @formula
    def real_pair(apart, a, b, parameters):
        inside = dot(apart, apart) < parameters.cutoff_square
        product = parameters.k * a.charge * b.charge if inside else 0.0
        force, energy = loads(apart, product, parameters.stretch, parameters.coefficients)
        return force, ZERO, ZERO, energy

    @formula
    def bare_pair(apart, a, b, parameters):
        force, energy = bare(apart, a, b, parameters)
        return force, ZERO, ZERO, energy

    pairs = sums_of(real_pair, False, listed)._replace(pair=sums_of(bare_pair, False, listed).pair)
    end_pairs, pair_energies = pairs.end, pairs.energies

    if order:
        remove_waves, add_mesh_energies = remove_self_waves(MESH_CHARGES), add_energies_of(with_mesh_potential)

        @loop
        def end_with_mesh(grains, long_range, span, parameters):
            end_pairs(grains, long_range, span, parameters)
            add_mesh_virial(long_range, parameters.mesh, span)
            add_virial_of_background(grains, long_range, span, parameters)
            remove_waves(grains, span, parameters.mesh)
            add_mesh_forces(grains, long_range, parameters.mesh)

        @loop
        def mesh_energies(grains, long_range, span, parameters, shares):
            pair_energies(grains, long_range, span, parameters, shares)
            remove_waves(grains, span, parameters.mesh)
            add_mesh_energies(grains, span, parameters, shares)

        rounds = mesh_rounds(order, MESH_CHARGES)
        return pairs._replace(
            end=end_with_mesh,
            energies=mesh_energies,
            rounds=rounds,
            energies_need_rounds=True,
            reciprocal_virial=mesh_virial(False),
        )

    add_wave_energies = add_energies_of(with_wave_potential)
    begin, block, blocks = with_waves(pairs.begin, pairs.block, pairs.blocks, False)

    @loop
    def end(grains, long_range, span, parameters):
        end_pairs(grains, long_range, span, parameters)
        add_wave_forces(grains, long_range, span, parameters)
        add_virial_of_background(grains, long_range, span, parameters)

    @loop
    def energies(grains, long_range, span, parameters, shares):
        pair_energies(grains, long_range, span, parameters, shares)
        begin(grains, long_range, span, parameters)
        for b in range(all_blocks(grains)):  # those of the waves
            block(grains, long_range, span, parameters, b)
        add_wave_energies(grains, span, parameters, shares)

    return pairs._replace(
        begin=begin, block=block, end=end, blocks=blocks, energies=energies, reciprocal_virial=direct_virial(False)
    )
