"""List of candidate pairs for contacts, and the inner list of pairs that may touch soon."""

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..basics.state import INNER_COUNT, INNER_SKIN, PAIRS, REBUILT
from ..compiler.jit import loop, rare
from ..contact.law import ContactLaw
from ..contact.pair_types import NO_PAIR_TYPE, pair_type_index, pair_type_loop
from ..numerics.flow import store_box
from ..numerics.vec import dot, load, nearest_image, put, sub
from .cell_list import FULL, Grid, append_neighbours, build_grid
from .skin import SKIN_SAFETY


@loop
def in_contact(contacts, i, j):
    """Whether grains i and j share a contact."""
    for s in range(contacts.start[i], contacts.start[i + 1]):
        c = contacts.side[s] >> 1
        if contacts.pair[0, c] == j or contacts.pair[1, c] == j:
            return True
    return False


ROW_FULL = -2
"""Returned by `build_pair_list` when the neighbours of one grain exceed the long-range arrays."""
NO_GRID = Grid(
    (0, 0, 0), (0, 0, 0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0, 0.0, 0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), False
)  # fmt: skip
"""Placeholder where no cells are used."""


@loop
def gap_below(grains, span, max_gap, i, j):
    """Whether the gap between two grains is below `max_gap` [m]."""
    separation = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
    limit = grains.radius[i] + grains.radius[j] + max_gap
    return dot(separation, separation) < limit * limit


@loop
def candidates(pair_list, long_range, grid, span, search, k):
    """Range of the candidates of the k-th grain: entries of `neighbour`, or grain indices if all pairs are searched."""
    if search.listed:
        return np.int64(long_range.start[k]), np.int64(long_range.start[k + 1])
    return np.int64(0), np.int64(k)


@loop
def candidates_from_cells(pair_list, long_range, grid, span, search, k):
    """As `candidates`, for the k-th grain in the order of cells."""
    end = append_neighbours(long_range, pair_list.anchor, grid, span, search.reach, k, 0)
    return np.int64(0), np.int64(end)


@loop
def no_grid(long_range, sorted_position, anchor, span, reach):
    """Where no cells are used."""
    return NO_GRID


class PairSearch(NamedTuple):
    """How pairs are found."""

    span: Any  # basics.box.Span, the box
    max_gap: float  # largest gap [m]
    settings: Any  # integrate.parts.ContactParameters
    search: Any  # cell_list.Search


@functools.cache
def pair_list_loop(law: ContactLaw, celled: bool) -> Callable:
    """The loop that builds the pair list, for one contact law; `celled`: for searches with cells."""
    pair_type_of = pair_type_loop(law)
    find_candidates, make_grid = (candidates_from_cells, build_grid) if celled else (candidates, no_grid)

    @loop
    def build_pair_list(grains, contacts, pair_list, long_range, count, how):
        """List the pairs of a `PairSearch`, selected from the Verlet list, from cells, or from all pairs.

        Returns
        -------
        int
            Number of pairs; FULL if the pair list is too short (the required length is then in count[PAIRS]);
            ROW_FULL if the long-range arrays are too short for the neighbours of one grain.
        """
        span, max_gap, settings, search = how
        found, pair_type, capacity = 0, NO_PAIR_TYPE, pair_list.pair.shape[1]
        sorted_indices = search.celled or search.listed
        # the anchors, set at the end, serve as buffer for positions in sorted order
        grid = make_grid(long_range, pair_list.anchor, grains.position, span, search.reach)
        for k in range(grains.mass.size):
            first, last = find_candidates(pair_list, long_range, grid, span, search, k)
            if last == FULL:
                pair_list.anchor[0, 0] = math.inf
                return ROW_FULL
            i = long_range.order[k] if sorted_indices else np.uint32(k)
            for m in range(first, last):
                j = long_range.order[long_range.neighbour[m]] if sorted_indices else np.uint32(m)
                if j < i and gap_below(grains, span, max_gap, i, j):
                    if found < capacity:
                        pair_type = pair_type_of(grains, settings, i, j, pair_type)
                        pair_list.pair[0, found], pair_list.pair[1, found] = i, j
                        pair_list.in_contact[found] = 1 if in_contact(contacts, i, j) else 0
                        index = pair_type_index(pair_list, found)
                        pair_list.step[index], pair_list.break_overlap[index] = pair_type.step, pair_type.break_overlap
                    found += 1
        count[PAIRS] = found
        if found > capacity:
            pair_list.anchor[0, 0] = math.inf
            return FULL
        for i in range(grains.mass.size):
            put(pair_list.anchor, i, load(grains.position, i))
        store_box(pair_list.built, span)
        count[REBUILT] += 1
        return found

    return build_pair_list


@rare
def build_inner_list(grains, pair_list, count, span, gap):
    """Select the pairs with a gap below `gap` [m] from the pair list.

    No other pair can touch before a grain has moved by half the gap.  If the inner list is too short, all pairs of the
    pair list are searched instead.
    """
    found, capacity = 0, pair_list.inner.size - 1
    for p in range(count[PAIRS]):
        i, j = pair_list.pair[0, p], pair_list.pair[1, p]
        separation = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
        limit = grains.radius[i] + grains.radius[j] + gap
        pair_list.inner[min(found, capacity)] = p
        found += 1 if (pair_list.in_contact[p] == 0) & (dot(separation, separation) < limit * limit) else 0
    pair_list.skin[INNER_COUNT] = found if found <= capacity else count[PAIRS]
    pair_list.skin[INNER_SKIN] = SKIN_SAFETY * 0.5 * gap
