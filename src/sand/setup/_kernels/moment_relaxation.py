"""Moments that turn into the field of the others while the grains stay where they are."""

import math

from ...compiler.jit import kernel, loop
from ...forces.pair.dipole_formulas import pair_load
from ...numerics.vec import add, dot, load, norm, put, scale, sub


@loop
def flux_density_at(position, moment, i, k):
    """B [T] at moment i from all others, open space."""
    here, own, total = load(position, i), load(moment, i), (0.0, 0.0, 0.0)
    for first, last in ((0, i), (i + 1, position.shape[1])):
        for j in range(first, last):
            total = add(total, pair_load(sub(here, load(position, j)), own, load(moment, j), k)[1])
    return total


@kernel
def relax(position, moment, k, tolerance, most):
    """Lay each moment along the field of the others, one after the other, until none turns by more than `tolerance`.

    Each turn lowers the energy, −μ·B of this moment, and no other part of it changes.

    Returns
    -------
    result
        Number of sweeps, and the largest turn of the last one [rad].
    """
    worst = math.inf
    for sweep in range(most):
        worst = 0.0
        for i in range(position.shape[1]):
            field, own = flux_density_at(position, moment, i, k), load(moment, i)
            strength, size = norm(field), norm(own)
            if strength > 0.0:
                new = scale(size / strength, field)
                step = sub(new, own)
                worst = max(worst, math.sqrt(dot(step, step)) / size)
                put(moment, i, new)
        if worst <= tolerance:
            return sweep + 1, worst
    return most, worst


@kernel
def alignment_energy(position, moment, k):
    """½ Σ −μ·B [J]"""
    total = 0.0
    for i in range(position.shape[1]):
        total -= 0.5 * dot(load(moment, i), flux_density_at(position, moment, i, k))
    return total
