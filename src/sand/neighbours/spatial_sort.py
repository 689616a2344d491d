"""Where grains stand in memory: in large worlds along a curve through space, while all who look find their own order.

A step of many grains waits for memory, and for less of it where grains that touch stand close together.  The order is
made anew as they move, at steps that depend on nothing but how many were taken.
"""

from __future__ import annotations

import numpy as np

from ..arguments import checked
from ..contact.gather import resort_contacts_by_grain
from ..grains import Grains
from ..state.arrays import NOT_SAVED, RATE_ARRAYS, SAVED_LONG_RANGE, UNIFORM_ARRAYS
from ..state.state import CONTACTS, GRAIN1, GRAIN2, PAIRS, State

BITS = 21
"""Of each coordinate: three of them fill 63 bits."""


def morton_keys(position: np.ndarray) -> np.ndarray:
    """Place of each point (N, 3) on Morton's curve, (N,) uint64: the bits of its three coordinates in turns."""
    low = position.min(axis=0)
    longest = float((position.max(axis=0) - low).max())
    scaled = (position - low) / longest if longest > 0.0 else np.zeros_like(position)
    cell = (scaled * (2**BITS - 1)).astype(np.uint64)
    place = np.zeros(len(position), np.uint64)
    for axis in range(3):
        bits = cell[:, axis]
        # each step moves the upper half of the bits away from the lower: 21 bits end three apart
        for shift, mask in (
            (32, 0x1F00000000FFFF),
            (16, 0x1F0000FF0000FF),
            (8, 0x100F00F00F00F00F),
            (4, 0x10C30C30C30C30C3),
            (2, 0x1249249249249249),
        ):
            bits = (bits | (bits << np.uint64(shift))) & np.uint64(mask)
        place |= bits << np.uint64(axis)
    return place


SORT_INTERVAL = 2000
"""Steps after which the order is made anew: even fast grains pass few others meanwhile; it takes 10 to 20 of them."""
OF_GRAINS = (*SAVED_LONG_RANGE, *RATE_ARRAYS[:2])
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


def reorder_grains(state: State, rows: np.ndarray) -> None:
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


def sort_contacts_and_pairs(state: State) -> None:
    """Contacts and near pairs in the order of their grains."""
    for arrays, used in (state.contacts, CONTACTS), (state.pair_list, PAIRS):
        pair = arrays.pair[:, : state.count[used]]
        by = np.lexsort((pair[1], pair[0]))
        for name, columns in arrays._asdict().items():
            if columns.size and name not in NOT_OF_PAIRS and not (state.uniform_contacts and name in UNIFORM_ARRAYS):
                columns[..., : by.size] = columns[..., by]
    resort_contacts_by_grain(state.contacts, state.count, len(state.grains))


@checked
def in_space_order(grains: Grains) -> Grains:
    """The same grains, numbered along a curve that fills space (Morton 1966).

    Where numbers come at random, grains that touch lie far apart in memory; along the curve they lie close. Large
    simulations do so by themselves (`Neighbours.order`), and keep the numbers. Nothing else changes.

    Parameters
    ----------
    grains : Grains
        at their places.

    Returns
    -------
    Grains
        A copy; grain k of it is `order[k]` of the old ones, order = argsort of `morton_keys`.
    """
    order = np.argsort(morton_keys(grains.position), kind="stable")
    ordered = grains.copy()
    for array, old in zip(ordered.arrays, grains.arrays, strict=True):
        array[...] = old[..., order]
    return ordered
