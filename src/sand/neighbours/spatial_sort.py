"""Spatial sorting: grains in Morton order in memory.

The step of a large system is limited by memory access, which is faster if grains that touch are close in memory.  From
4000 grains on, arrays are kept in Morton order while stepping; the public API always uses the user's indices.  The
order is renewed at fixed step counts, so that it is reproducible.
"""

from __future__ import annotations

import numpy as np

from ..basics.arguments import checked
from ..basics.array_groups import USED, arrays_of
from ..basics.grains import Grains
from ..basics.state import CONTACTS, PAIRS, State
from ..contact.gather import resort_contacts_by_grain

BITS = 21
"""Bits per coordinate; three coordinates fill 63 bits."""
SORT_INTERVAL = 2000
"""Steps between two sorts.  Even fast grains pass few others in this time; a sort costs as much as 10 to 20 steps."""


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
    state.reorder(rows, inverse(rows))
    resort_contacts_by_grain(state.grains.arrays, state.contacts, state.count)


def sort_contacts_and_pairs(state: State) -> None:
    """Sort contacts and candidate pairs by their grains."""
    for arrays, used in (state.contacts, CONTACTS), (state.pair_list, PAIRS):
        pair = arrays.pair[:, : state.count[used]]
        order = np.lexsort((pair[1], pair[0]))
        for columns, each in zip(arrays, arrays_of(arrays).values(), strict=True):
            uniform = each.fewer == 1 and state.uniform_contacts
            if columns.size and each.shape[-1] == USED and not uniform:
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
