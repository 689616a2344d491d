"""Per-grain forces: one composed formula over all grains."""

import functools

from ...box import nearest_image
from ...compiler.jit import kernel, loop
from ...numerics.vec import accrue, load, put
from .formulas import GrainState


@loop
def grain_at(grains, i):
    """Grain i as a per-grain formula sees it."""
    return GrainState(
        load(grains.position, i),
        load(grains.velocity, i),
        load(grains.spin, i),
        load(grains.moment, i),
        grains.radius[i],
        grains.mass[i],
        grains.charge[i],
    )


def external_loads(formula_of_grain):
    """The loop that adds force and torque of one composed formula to every grain."""

    @loop
    def add_loads(grains, time, parameters):
        for i in range(grains.mass.size):
            force, torque, _ = formula_of_grain(time, grain_at(grains, i), parameters)
            accrue(grains.force, i, force)
            accrue(grains.torque, i, torque)

    return add_loads


def external_energy(formula_of_grain):
    """The loop that sums the energy [J] of one composed formula over all grains."""

    @loop
    def sum_energy(grains, time, parameters):
        total = 0.0
        for i in range(grains.mass.size):
            total += formula_of_grain(time, grain_at(grains, i), parameters)[2]
        return total

    return sum_energy


def external_wrap(formula_of_grain):
    """The loop that brings grains back into a periodic box; returns the energy [J] they gain by that."""

    @loop
    def wrap(grains, span, time, parameters):
        gained = 0.0
        for i in range(grains.mass.size):
            away = load(grains.position, i)
            home = nearest_image(away, span)
            if home != away:
                before = formula_of_grain(time, grain_at(grains, i), parameters)[2]
                put(grains.position, i, home)
                gained += formula_of_grain(time, grain_at(grains, i), parameters)[2] - before
        return gained

    return wrap


@functools.cache
def external_energies_for(formula_of_grain):
    """The compiled loop that fills `shares` (N,) with the energy [J] of one formula at each grain."""

    def fill_shares(grains, time, parameters, shares):
        for i in range(grains.mass.size):
            shares[i] = formula_of_grain(time, grain_at(grains, i), parameters)[2]

    return kernel(fill_shares, keep=is_builtin(formula_of_grain))


def is_builtin(formula_of_grain):
    """True for formulas of SAND itself; compiled code with a user's own formula is not kept on disk."""
    return str(formula_of_grain.__module__).startswith("sand.")
