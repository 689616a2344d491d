"""Where grains stand in memory: in large worlds along a curve through space, while all who look find their own order.

A step of many grains waits for memory, and for less of it where grains that touch stand close together.  The order is
made anew as they move, at steps that depend on nothing but how many were taken.
"""

from __future__ import annotations

import numpy as np

from ..contact.gather import resort_contacts_by_grain
from ..state.arrays import FOR_ALL, FOR_RATES, NOT_SAVED, SAVED_LONG_RANGE
from ..state.state import CONTACTS, GRAIN1, GRAIN2, PAIRS, State
from .morton_order import morton_keys

RENEWED_EVERY = 2000
"""Steps after which the order is made anew: even fast grains pass few others meanwhile; it takes 10 to 20 of them."""
OF_GRAINS = (*SAVED_LONG_RANGE, *FOR_RATES[:2])
"""The far arrays with a column for each grain that outlast a sum."""
NOT_OF_PAIRS = ("side", "start", "anchor", *NOT_SAVED)
"""What contacts and near pairs have no column of."""


def spatial_order(state: State) -> np.ndarray:
    """The grain at each place of the curve, (N,) uint32."""
    return np.argsort(morton_keys(state.grains.position), kind="stable").astype(np.uint32)


def inverse(order: np.ndarray) -> np.ndarray:
    """The place of each grain, where `order` has the grain at each place; or the other way round."""
    place = np.empty_like(order)
    place[order] = np.arange(order.size, dtype=order.dtype)
    return place


def rearrange(state: State, rows: np.ndarray) -> None:
    """Let grain k become what grain rows[k] was, wherever it is named; contacts and pairs stay where they stand."""
    number = inverse(rows)  # the new one of each
    pair_list, long_range, contacts, count = state.pair_list, state.long_range, state.contacts, state.count
    for array in [*state.grains.arrays, pair_list.anchor, *(getattr(long_range, name) for name in OF_GRAINS)]:
        if array.shape[-1]:
            array[...] = array[..., rows]
    for array in [contacts.pair[:, : count[CONTACTS]], pair_list.pair[:, : count[PAIRS]], long_range.order]:
        array[...] = number[array]
    for place in (GRAIN1, GRAIN2):
        if count[place] >= 0:
            count[place] = number[count[place]]
    resort_contacts_by_grain(contacts, count, rows.size)


def sort_columns(state: State) -> None:
    """Contacts and near pairs in the order of their grains."""
    for arrays, used in (state.contacts, CONTACTS), (state.pair_list, PAIRS):
        pair = arrays.pair[:, : state.count[used]]
        by = np.lexsort((pair[1], pair[0]))
        for name, columns in arrays._asdict().items():
            if columns.size and name not in NOT_OF_PAIRS and not (state.uniform_contacts and name in FOR_ALL):
                columns[..., : by.size] = columns[..., by]
    resort_contacts_by_grain(state.contacts, state.count, len(state.grains))
