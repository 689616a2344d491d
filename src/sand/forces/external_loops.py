"""Loops of external forces: one formula over all grains."""

from ..compiler.jit import loop
from ..compiler.recipes import factory
from ..compiler.stage import stage
from ..numerics.vec import accrue, dot, load, nearest_image
from .external_formulas import GrainState


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
    """The loop that adds force and torque of a formula to the loads of every grain."""

    @loop
    def add_loads(grains, time, parameters):
        for i in range(grains.mass.size):
            force, torque, _ = formula_of_grain(time, grain_at(grains, i), parameters)
            accrue(grains.force, i, force)
            accrue(grains.torque, i, torque)

    return add_loads


def external_energy(formula_of_grain):
    """The loop that sums the energy [J] of a formula over all grains."""

    @loop
    def sum_energy(grains, time, parameters):
        total = 0.0
        for i in range(grains.mass.size):
            total += formula_of_grain(time, grain_at(grains, i), parameters)[2]
        return total

    return sum_energy


def external_power(formula_of_grain):
    """The loop that sums the power F·v + M·ω [W] of a formula over all grains."""

    @loop
    def sum_power(grains, time, parameters):
        total = 0.0
        for i in range(grains.mass.size):
            force, torque, _ = formula_of_grain(time, grain_at(grains, i), parameters)
            total += dot(force, load(grains.velocity, i)) + dot(torque, load(grains.spin, i))
        return total

    return sum_power


def wrapping_work(formula_of_grain):
    """The loop that sums the change of the energy [J] by wrapping positions into a periodic box; moves no grain."""

    @loop
    def sum_work(grains, span, time, parameters):
        gained = 0.0
        for i in range(grains.mass.size):
            grain = grain_at(grains, i)
            wrapped = nearest_image(grain.position, span)
            if wrapped != grain.position:
                moved = GrainState(
                    wrapped, grain.velocity, grain.spin, grain.moment, grain.radius, grain.mass, grain.charge
                )
                gained += formula_of_grain(time, moved, parameters)[2] - formula_of_grain(time, grain, parameters)[2]
        return gained

    return sum_work


@factory
def external_energies_for(formula_of_grain):
    """The stage that computes the energy [J] of each grain by one formula.

    Its parameters are those of the formula, the time [s], and the array of energies (N,).
    """

    @stage("the energies of external forces")
    def fill_shares(grains, parameters):
        for i in range(grains.mass.size):
            parameters[2][i] = formula_of_grain(parameters[1], grain_at(grains, i), parameters[0])[2]
        return 0

    return fill_shares
