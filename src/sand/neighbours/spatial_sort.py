"""Spatial sorting: grains in Morton order in memory.

The step of a large system is limited by memory access, which is faster if grains that touch are close in memory.  From
4000 grains on, arrays are kept in Morton order while stepping; the public API always uses the user's indices.  The
order is renewed at fixed step counts, so that it is reproducible.
"""

from __future__ import annotations

import numpy as np

from ..basics.arguments import checked
from ..basics.arrays import NOT_SAVED, RATE_ARRAYS, SAVED_LONG_RANGE, UNIFORM_ARRAYS
from ..basics.grains import Grains
from ..basics.state import CONTACTS, GRAIN1, GRAIN2, PAIRS, WALL_CONTACTS, State
from ..contact.gather import resort_contacts_by_grain

BITS = 21
"""Bits per coordinate; three coordinates fill 63 bits."""
SORT_INTERVAL = 2000
"""Steps between two sorts.  Even fast grains pass few others in this time; a sort costs as much as 10 to 20 steps."""
PER_GRAIN_ARRAYS = (*SAVED_LONG_RANGE, *RATE_ARRAYS[:2])
"""Long-range arrays with a column per grain that persist between summations."""
NOT_PER_PAIR = ("side", "start", "anchor", *NOT_SAVED)
"""Arrays of contacts and candidate pairs without a column per contact or pair."""


def morton_keys(position: np.ndarray) -> np.ndarray:
    """Position of each point (N, 3) on the Morton curve, (N,) uint64: the interleaved bits of its coordinates."""
    low = position.min(axis=0)
    longest = float((position.max(axis=0) - low).max())
    scaled = (position - low) / longest if longest > 0.0 else np.zeros_like(position)
    cell = (scaled * (2**BITS - 1)).astype(np.uint64)
    keys = np.zeros(len(position), np.uint64)
    for axis in range(3):
        bits = cell[:, axis]
        # each step separates the upper half of the bits from the lower, until neighbouring bits are three apart
        for shift, mask in (
            (32, 0x1F00000000FFFF),
            (16, 0x1F0000FF0000FF),
            (8, 0x100F00F00F00F00F),
            (4, 0x10C30C30C30C30C3),
            (2, 0x1249249249249249),
        ):
            bits = (bits | (bits << np.uint64(shift))) & np.uint64(mask)
        keys |= bits << np.uint64(axis)
    return keys


def spatial_order(state: State) -> np.ndarray:
    """Grains in Morton order, (N,) uint32."""
    return np.argsort(morton_keys(state.grains.position), kind="stable").astype(np.uint32)


def inverse(order: np.ndarray) -> np.ndarray:
    """Inverse permutation."""
    inverted = np.empty_like(order)
    inverted[order] = np.arange(order.size, dtype=order.dtype)
    return inverted


def reorder_grains(state: State, rows: np.ndarray) -> None:
    """Permute the grains: grain k becomes the former grain rows[k].  Contacts and candidate pairs stay in order."""
    new_index = inverse(rows)
    pair_list, long_range, contacts, count = state.pair_list, state.long_range, state.contacts, state.count
    for array in [*state.grains.arrays, pair_list.anchor, *(getattr(long_range, name) for name in PER_GRAIN_ARRAYS)]:
        if array.shape[-1]:
            array[...] = array[..., rows]
    at_walls = state.wall_contacts.pair[0, : count[WALL_CONTACTS]]
    for array in [contacts.pair[:, : count[CONTACTS]], pair_list.pair[:, : count[PAIRS]], long_range.order, at_walls]:
        array[...] = new_index[array]
    for index in (GRAIN1, GRAIN2):
        if count[index] >= 0:
            count[index] = new_index[count[index]]
    resort_contacts_by_grain(state.grains.arrays, contacts, count)


def sort_contacts_and_pairs(state: State) -> None:
    """Sort contacts and candidate pairs by their grains."""
    for arrays, used in (state.contacts, CONTACTS), (state.pair_list, PAIRS):
        pair = arrays.pair[:, : state.count[used]]
        order = np.lexsort((pair[1], pair[0]))
        for name, columns in arrays._asdict().items():
            if columns.size and name not in NOT_PER_PAIR and not (state.uniform_contacts and name in UNIFORM_ARRAYS):
                columns[..., : order.size] = columns[..., order]
    resort_contacts_by_grain(state.grains.arrays, state.contacts, state.count)


@checked
def in_space_order(grains: Grains) -> Grains:
    """Renumber grains in Morton order (Morton 1966), so that neighbours in space are neighbours in memory.

    Large simulations sort grains internally (`Neighbours.order`) and keep the user's indices.  Nothing but the indices
    changes.

    Parameters
    ----------
    grains : Grains
        The grains.

    Returns
    -------
    Grains
        A copy, of which grain k is `order[k]` of the original, order = argsort of `morton_keys`.
    """
    order = np.argsort(morton_keys(grains.position), kind="stable")
    ordered = grains.copy()
    for array, old in zip(ordered.arrays, grains.arrays, strict=True):
        array[...] = old[..., order]
    return ordered
