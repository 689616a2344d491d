"""Where near pairs keep the numbers of their kind: one place for all where all grains are equal."""

import math
from typing import Any, NamedTuple

import numpy as np

from ..compiler.jit import loop
from ..state.state import PAIRS
from .law import Pairing, bond_between


class PairType(NamedTuple):
    """What the constants of a pair's contact depend on, and what the list keeps of them."""

    grains: Any  # material, radius [m] and mass [kg] of each
    step: Any  # the step that a contact needs [s]
    length: Any  # δ at which it breaks [m]


NO_GRAIN_TYPE = (np.uint32(0), -1.0, -1.0)
NO_PAIR_TYPE = PairType((NO_GRAIN_TYPE, NO_GRAIN_TYPE), 0.0, 0.0)


@loop
def load_pairing(pairings, a, b):
    """What materials a and b make together, from the (10, M, M) table."""
    return Pairing(
        pairings[0, a, b],
        pairings[1, a, b],
        pairings[2, a, b],
        pairings[3, a, b],
        pairings[4, a, b],
        pairings[5, a, b],
        pairings[6, a, b],
        pairings[7, a, b],
        pairings[8, a, b],
        pairings[9, a, b],
    )


@loop
def bond_of(grains, pairings, i, j):
    """The constants of a contact between grains i and j."""
    pairing = load_pairing(pairings, grains.material[i], grains.material[j])
    return bond_between(pairing, grains.radius[i], grains.radius[j], grains.mass[i], grains.mass[j])


@loop
def grain_type_of(grains, i):
    """All that the bonds of grain i depend on."""
    return grains.material[i], grains.radius[i], grains.mass[i]


@loop
def pair_type_of(grains, law, i, j, last):
    """The kind of a pair: the `last` one if it is the same, as its powers cost more than all else."""
    a, b = grain_type_of(grains, i), grain_type_of(grains, j)
    if (a, b) == last.grains:
        return last
    bond = bond_of(grains, law.pairings, i, j)
    return PairType((a, b), 2.0 * math.pi / math.sqrt(bond.max_squared_frequency) / law.per_period, bond.break_overlap)


@loop
def pair_type_index(pair_list, p):
    """The place of the numbers of pair p."""
    return p if pair_list.step.size > 1 else 0


@loop
def pair_type_count(pair_list, count):
    """How many places are in use."""
    return min(count[PAIRS], pair_list.step.size)
