"""Energies that contacts dissipate: the energy table of the simulation and the losses of each contact."""

from ..basics.state import (
    DAMPING_NORMAL,
    DAMPING_ROLLING,
    DAMPING_SLIDING,
    DAMPING_TWISTING,
    RECORDED,
    ROLLING,
    SLIDING,
    STIFFNESS,
    TWISTING,
)
from ..compiler.jit import loop

FORMING_ROW, SLIDING_ROW, ROLLING_ROW, TWISTING_ROW, DAMPING_ROW, STIFFNESS_ROW = range(len(RECORDED))
"""Rows of `ContactArrays.lost`; the last two only exist in simulations with damping or changing stiffnesses."""


@loop
def add_slip_losses(losses, c, energies):
    """Add energies [J] dissipated by sliding, rolling and twisting to the losses of contact c."""
    losses[SLIDING_ROW, c] += energies[0]
    losses[ROLLING_ROW, c] += energies[1]
    losses[TWISTING_ROW, c] += energies[2]


@loop
def record_slip(contacts, lost, c, energies):
    """Add energies [J] that contact c dissipated by sliding, rolling and twisting to its losses and to the table."""
    add_slip_losses(contacts.lost, c, energies)
    add_slip_energies(lost, energies)


@loop
def record_stiffness_loss(contacts, lost, c, energy):
    """Add the energy [J] that changing stiffnesses removed from the springs of contact c, likewise."""
    contacts.lost[STIFFNESS_ROW, c] += energy
    lost[STIFFNESS] += energy


@loop
def add_slip_energies(lost, energies):
    """Add energies [J] dissipated by sliding, rolling and twisting to the energy table."""
    lost[SLIDING] += energies[0]
    lost[ROLLING] += energies[1]
    lost[TWISTING] += energies[2]


@loop
def add_damping_energies(lost, energies):
    """Add energies [J] dissipated by the dashpots of the four modes to the energy table."""
    lost[DAMPING_NORMAL] += energies[0]
    lost[DAMPING_SLIDING] += energies[1]
    lost[DAMPING_ROLLING] += energies[2]
    lost[DAMPING_TWISTING] += energies[3]
