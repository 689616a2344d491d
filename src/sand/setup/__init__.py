"""How simulations begin."""

from .aggregates import chain, grain, lattice, pca
from .encounters import Encounter, encounter, turned, turned_at_random
from .frame import Bonds, Start, from_frame
from .gas import gas

__all__ = [
    "Bonds",
    "Encounter",
    "Start",
    "chain",
    "encounter",
    "from_frame",
    "gas",
    "grain",
    "lattice",
    "pca",
    "turned",
    "turned_at_random",
]
