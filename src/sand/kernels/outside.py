"""Per-grain forces: one composed formula over all grains."""

import functools

from ..core.jit import kernel, loop
from ..core.vec import accrue, load
from ..physics.surroundings import One


@loop
def grain_at(grains, i):
    """Grain i as a per-grain formula sees it."""
    return One(
        load(grains.position, i),
        load(grains.velocity, i),
        load(grains.spin, i),
        load(grains.moment, i),
        grains.radius[i],
        grains.mass[i],
        grains.charge[i],
    )


def outside_loads(formula_of_grain):
    """The loop that adds force and torque of one composed formula to every grain."""

    @loop
    def add_loads(grains, time, parameters):
        for i in range(grains.mass.size):
            force, torque, _ = formula_of_grain(time, grain_at(grains, i), parameters)
            accrue(grains.force, i, force)
            accrue(grains.torque, i, torque)

    return add_loads


@functools.cache
def energy_sum_for(formula_of_grain):
    """The compiled sum of the energy [J] of one formula over all grains."""

    def sum_energy(grains, time, parameters):
        total = 0.0
        for i in range(grains.mass.size):
            total += formula_of_grain(time, grain_at(grains, i), parameters)[2]
        return total

    return kernel(sum_energy, keep=is_ours(formula_of_grain))


def is_ours(formula_of_grain):
    """True for formulas of SAND itself; compiled code with a user's own formula is not kept on disk."""
    return formula_of_grain.__module__.startswith("sand.")
