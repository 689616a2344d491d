"""Theory: closed forms for contacts, magnetic capture and growth, and the coagulation equation."""

from . import kinetics, smoluchowski
from .contact import ContactNumbers, contact
from .growth import (
    Exponents,
    aggregate_moment,
    alignment_exponent,
    alignment_time,
    chain_moment,
    dynamic_exponent,
    growth_exponents,
    mean_size,
    squared_exponent,
)
from .magnetic import (
    barrier,
    capture_cross_section,
    capture_radius,
    coupling,
    dipole_energy,
    effective_potential,
    geometric_cross_section,
    interaction_radius,
    lowest_energy,
    potential_parameter,
    reduced_mass,
    thermal_speed,
)
from .magnetic_limits import MagneticLimits, magnetic_limits
from .papers import PaperRow, paper_table

__all__ = [
    "ContactNumbers",
    "Exponents",
    "MagneticLimits",
    "PaperRow",
    "aggregate_moment",
    "alignment_exponent",
    "alignment_time",
    "barrier",
    "capture_cross_section",
    "capture_radius",
    "chain_moment",
    "contact",
    "coupling",
    "dipole_energy",
    "dynamic_exponent",
    "effective_potential",
    "geometric_cross_section",
    "growth_exponents",
    "interaction_radius",
    "kinetics",
    "lowest_energy",
    "magnetic_limits",
    "mean_size",
    "paper_table",
    "potential_parameter",
    "reduced_mass",
    "smoluchowski",
    "squared_exponent",
    "thermal_speed",
]
