"""Contact network of an aggregate: ends, junctions, rings and chains."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order

from ..basics.arguments import MOST_GRAINS, checked
from ..basics.units import whole_number
from .clusters import checked_pairs, cluster_labels
from .shape import coordination


class Network(NamedTuple):
    """Topology of the contact network of one aggregate."""

    ends: int  # grains with one contact
    junctions: int  # grains with three or more contacts
    rings: int  # independent closed loops, C − N + 1
    longest: int  # grains on the longest of the shortest paths between grains (graph diameter)
    chains: np.ndarray  # grains of each piece between junctions, largest first
    coordination: float  # mean number of contacts of a grain


@checked
def network(count: int, pairs: np.ndarray) -> Network:
    """Ends, junctions, rings and chains of one aggregate.

    `longest` is exact for trees. With rings it is the path between two distant ends found by two breadth-first
    searches.

    Parameters
    ----------
    count : int
        Number of grains N ≥ 1, all connected.
    pairs : ndarray
        Contacts (C, 2), each once.
    """
    ends = checked_pairs(whole_number(count, "count", 1, MOST_GRAINS), pairs)
    contacts = coordination(count, ends)
    unbranched = (contacts[ends] <= 2).all(axis=1)
    pieces = cluster_labels(count, ends[unbranched])
    lengths = np.bincount(pieces[contacts <= 2], minlength=1)
    return Network(
        int((contacts == 1).sum()),
        int((contacts >= 3).sum()),
        len(ends) - count + 1,
        _longest(count, ends),
        np.sort(lengths[lengths > 0])[::-1],
        float(contacts.mean()),
    )


def _longest(count: int, ends: np.ndarray) -> int:
    """Number of grains on the path to the farthest grain from the farthest grain from grain 0."""
    graph = coo_array((np.ones(len(ends), np.int8), (ends[:, 0], ends[:, 1])), shape=(count, count)).tocsr()
    order, _ = breadth_first_order(graph, 0, directed=False)
    order, predecessor = breadth_first_order(graph, order[-1], directed=False)
    grain, longest = order[-1], 1
    while grain != order[0]:
        grain, longest = predecessor[grain], longest + 1
    return longest
