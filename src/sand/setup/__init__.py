"""How simulations begin."""

from .aggregates import chain, grain, lattice, pca
from .encounters import Encounter, encounter, turned, turned_at_random
from .gas import gas

__all__ = ["Encounter", "chain", "encounter", "gas", "grain", "lattice", "pca", "turned", "turned_at_random"]
