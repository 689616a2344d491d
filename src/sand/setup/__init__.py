"""Initial conditions: gases, lattices, aggregates, collision set-ups and frames of earlier runs."""

from ..basics.initial_pairs import StrainedContacts
from ..neighbours.spatial_sort import in_space_order
from .aggregates import KINDS, build, chain, grain, hexagonal, lattice
from .deposit import deposit, rbd
from .encounters import Encounter, encounter, turned, turned_at_random
from .fractal import fractal
from .from_frame import Start, from_frame
from .gas import gas, gas_with_contacts
from .grain_classes import GrainClass
from .growing import bcca, bpca, dla, dlca
from .moments import magnetic_energy, relaxed
from .population import Lognormal, PowerLaw

__all__ = [
    "KINDS",
    "Encounter",
    "GrainClass",
    "Lognormal",
    "PowerLaw",
    "Start",
    "StrainedContacts",
    "bcca",
    "bpca",
    "build",
    "chain",
    "deposit",
    "dla",
    "dlca",
    "encounter",
    "fractal",
    "from_frame",
    "gas",
    "gas_with_contacts",
    "grain",
    "hexagonal",
    "in_space_order",
    "lattice",
    "magnetic_energy",
    "rbd",
    "relaxed",
    "turned",
    "turned_at_random",
]
