"""Relaxation of magnetic moments at fixed positions to a local minimum of the dipole energy."""

import math

from ...compiler.jit import kernel, loop
from ...forces.pair.dipole_formulas import pair_load
from ...numerics.vec import add, dot, load, norm, put, scale, sub


@loop
def flux_density_at(position, moment, i, k):
    """Flux density B [T] at moment i due to all other moments, open boundaries."""
    x, own, total = load(position, i), load(moment, i), (0.0, 0.0, 0.0)
    for first, last in ((0, i), (i + 1, position.shape[1])):
        for j in range(first, last):
            total = add(total, pair_load(sub(x, load(position, j)), own, load(moment, j), k)[1])
    return total


@kernel
def relax(position, moment, k, tolerance, most):
    """Align each moment in turn with the field of the others, until none rotates by more than `tolerance`.

    Gauss–Seidel iteration: each rotation lowers the term −μ·B of this moment and changes no other term of the energy.

    Parameters
    ----------
    position : ndarray
        (3, N) [m].
    moment : ndarray
        (3, N) [A m²], modified.
    k : float
        μ0/4π [T m/A].
    tolerance : float
        Angle [rad].
    most : int
        Largest number of sweeps.

    Returns
    -------
    sweeps : int
        Number of sweeps.
    worst : float
        Largest rotation in the last sweep [rad].
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
    """Magnetic interaction energy U = −½ Σ μ·B [J]."""
    total = 0.0
    for i in range(position.shape[1]):
        total -= 0.5 * dot(load(moment, i), flux_density_at(position, moment, i, k))
    return total
