"""Where grains stand in memory: in large worlds along a curve through space, while all who look find their own order.

A step of many grains waits for memory, and for less of it where grains that touch stand close together.  The order is
made anew as they move, at steps that depend on nothing but how many were taken.
"""

from __future__ import annotations

import numpy as np

from ..contact.gather import resort_sides
from ..state.arrays import FOR_ALL, FOR_RATES, KEPT_FAR, PICKED
from ..state.state import CONTACTS, GRAIN1, GRAIN2, PAIRS, World
from .morton_order import places_on_curve

RENEWED_EVERY = 2000
"""Steps after which the order is made anew: even fast grains pass few others meanwhile; it takes 10 to 20 of them."""
OF_GRAINS = (*KEPT_FAR, *FOR_RATES[:2])
"""The far arrays with a column for each grain that outlast a sum."""
NOT_OF_PAIRS = ("side", "start", "anchor", *PICKED)
"""What contacts and near pairs have no column of."""


def order_on_curve(world: World) -> np.ndarray:
    """The grain at each place of the curve, (N,) uint32."""
    return np.argsort(places_on_curve(world.grains.position), kind="stable").astype(np.uint32)


def inverse(order: np.ndarray) -> np.ndarray:
    """The place of each grain, where `order` has the grain at each place; or the other way round."""
    place = np.empty_like(order)
    place[order] = np.arange(order.size, dtype=order.dtype)
    return place


def rearrange(world: World, rows: np.ndarray) -> None:
    """Let grain k become what grain rows[k] was, wherever it is named; contacts and pairs stay where they stand."""
    number = inverse(rows)  # the new one of each
    near, far, contacts, count = world.near, world.far, world.contacts, world.count
    for array in [*world.grains.arrays, near.anchor, *(getattr(far, name) for name in OF_GRAINS)]:
        if array.shape[-1]:
            array[...] = array[..., rows]
    for array in [contacts.pair[:, : count[CONTACTS]], near.pair[:, : count[PAIRS]], far.order]:
        array[...] = number[array]
    for place in (GRAIN1, GRAIN2):
        if count[place] >= 0:
            count[place] = number[count[place]]
    resort_sides(contacts, count, rows.size)


def sort_columns(world: World) -> None:
    """Contacts and near pairs in the order of their grains."""
    for arrays, used in (world.contacts, CONTACTS), (world.near, PAIRS):
        pair = arrays.pair[:, : world.count[used]]
        by = np.lexsort((pair[1], pair[0]))
        for name, columns in arrays._asdict().items():
            if columns.size and name not in NOT_OF_PAIRS and not (world.alike and name in FOR_ALL):
                columns[..., : by.size] = columns[..., by]
    resort_sides(world.contacts, world.count, len(world.grains))
