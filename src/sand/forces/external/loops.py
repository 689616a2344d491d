"""Loops of external forces: one composed formula over all grains."""

import functools

from ...box import nearest_image
from ...compiler.jit import is_builtin, kernel, loop
from ...numerics.vec import accrue, load, put
from .formulas import GrainState


@loop
def grain_at(grains, i):
    """The state of grain i for a formula."""
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
    """The loop that adds force and torque of a composed formula to the loads of every grain."""

    @loop
    def add_loads(grains, time, parameters):
        for i in range(grains.mass.size):
            force, torque, _ = formula_of_grain(time, grain_at(grains, i), parameters)
            accrue(grains.force, i, force)
            accrue(grains.torque, i, torque)

    return add_loads


def external_energy(formula_of_grain):
    """The loop that sums the energy [J] of a composed formula over all grains."""

    @loop
    def sum_energy(grains, time, parameters):
        total = 0.0
        for i in range(grains.mass.size):
            total += formula_of_grain(time, grain_at(grains, i), parameters)[2]
        return total

    return sum_energy


def external_wrap(formula_of_grain):
    """The loop that wraps positions into a periodic box; returns the change of external energy [J] by wrapping."""

    @loop
    def wrap(grains, span, time, parameters):
        gained = 0.0
        for i in range(grains.mass.size):
            position = load(grains.position, i)
            wrapped = nearest_image(position, span)
            if wrapped != position:
                before = formula_of_grain(time, grain_at(grains, i), parameters)[2]
                put(grains.position, i, wrapped)
                gained += formula_of_grain(time, grain_at(grains, i), parameters)[2] - before
        return gained

    return wrap


@functools.cache
def external_energies_for(formula_of_grain):
    """Compile the loop that sets `shares` (N,) to the energy [J] of each grain by one formula."""

    def fill_shares(grains, time, parameters, shares):
        for i in range(grains.mass.size):
            shares[i] = formula_of_grain(time, grain_at(grains, i), parameters)[2]

    return kernel(fill_shares, cached=is_builtin(formula_of_grain), purpose="the energies of external forces")
