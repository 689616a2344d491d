"""Contact parameters stored per candidate pair, or once where all grains are equal."""

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..basics.state import PAIRS
from ..compiler.jit import loop
from .constants_table import column_loops
from .law import ContactLaw


class PairType(NamedTuple):
    """Grain properties that determine the constants of a pair's contact, and the parameters stored in the pair list."""

    grains: Any  # material, radius [m] and mass [kg] of both grains
    step: Any  # time step that a contact needs [s]
    break_overlap: Any  # −δ at which the contact breaks [m]


NO_GRAIN_TYPE = (np.uint32(0), -1.0, -1.0)
NO_PAIR_TYPE = PairType((NO_GRAIN_TYPE, NO_GRAIN_TYPE), 0.0, 0.0)


@loop
def grain_type_of(grains, i):
    """Properties of grain i that contact constants depend on."""
    return grains.material[i], grains.radius[i], grains.mass[i]


@functools.cache
def pair_type_loop(law: ContactLaw) -> Callable:
    """The loop that computes the pair type of two grains, for one contact law."""
    constants_of_pair = column_loops(law).of_pair

    @loop
    def pair_type_of(grains, settings, i, j, last):
        """Pair type of grains i and j; `last` is reused if equal, because powers are expensive."""
        a, b = grain_type_of(grains, i), grain_type_of(grains, j)
        if (a, b) == last.grains:
            return last
        constants = constants_of_pair(grains, settings.pairings, i, j)
        step = 2.0 * math.pi / math.sqrt(constants.max_squared_frequency) / settings.per_period
        return PairType((a, b), step, constants.break_overlap)

    return pair_type_of


@loop
def pair_type_index(pair_list, p):
    """Index of the stored parameters of pair p."""
    return p if pair_list.step.size > 1 else 0


@loop
def pair_type_count(pair_list, count):
    """Number of stored parameter sets in use."""
    return min(count[PAIRS], pair_list.step.size)
