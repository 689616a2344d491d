"""Contact parameters stored per candidate pair, or once where all grains are equal."""

import math
from typing import Any, NamedTuple

import numpy as np

from ..compiler.jit import loop
from ..state.state import PAIRS
from .law import Pairing, contact_constants


class PairType(NamedTuple):
    """Grain properties that determine the constants of a pair's contact, and the parameters stored in the pair list."""

    grains: Any  # material, radius [m] and mass [kg] of both grains
    step: Any  # time step that a contact needs [s]
    break_overlap: Any  # −δ at which the contact breaks [m]


NO_GRAIN_TYPE = (np.uint32(0), -1.0, -1.0)
NO_PAIR_TYPE = PairType((NO_GRAIN_TYPE, NO_GRAIN_TYPE), 0.0, 0.0)


@loop
def load_pairing(pairings, a, b):
    """Parameters of materials a and b, from the (10, M, M) table."""
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
def pair_constants(grains, pairings, i, j):
    """Constants of a contact between grains i and j."""
    pairing = load_pairing(pairings, grains.material[i], grains.material[j])
    return contact_constants(pairing, grains.radius[i], grains.radius[j], grains.mass[i], grains.mass[j])


@loop
def grain_type_of(grains, i):
    """Properties of grain i that contact constants depend on."""
    return grains.material[i], grains.radius[i], grains.mass[i]


@loop
def pair_type_of(grains, law, i, j, last):
    """Pair type of grains i and j; `last` is reused if equal, because powers are expensive."""
    a, b = grain_type_of(grains, i), grain_type_of(grains, j)
    if (a, b) == last.grains:
        return last
    constants = pair_constants(grains, law.pairings, i, j)
    return PairType(
        (a, b), 2.0 * math.pi / math.sqrt(constants.max_squared_frequency) / law.per_period, constants.break_overlap
    )


@loop
def pair_type_index(pair_list, p):
    """Index of the stored parameters of pair p."""
    return p if pair_list.step.size > 1 else 0


@loop
def pair_type_count(pair_list, count):
    """Number of stored parameter sets in use."""
    return min(count[PAIRS], pair_list.step.size)
