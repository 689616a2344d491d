"""What kernels read and write of contacts, near pairs and long-range sums: the arrays, and how much room they get."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, NamedTuple

import numpy as np

from ..numerics.simd import all_aligned, padded_size

ALWAYS_RECORDED = 4
"""The first records are kept in every contact law, the others only with damping or stiffnesses that change."""


class ContactArrays(NamedTuple):
    """One column per contact; the first count[CONTACTS] columns are in use.

    They are in the order they formed, or in that of their grains where an order is kept.
    """

    pair: np.ndarray  # (2, C) uint32: grains 1 and 2
    pointer1: np.ndarray  # (3, C) unit vector to the contact, body frame of grain 1
    pointer2: np.ndarray  # (3, C) the same for grain 2
    twist: np.ndarray  # (C,) φ [rad]
    formed: np.ndarray  # (C,) time of first touch [s]; the start for contacts that were there
    bond: np.ndarray  # (K, C) constants of the contact law; where all contacts are alike (K, BLOCK), all the same
    lost: np.ndarray  # (L, C) energy it dissipated so far [J], the first 4 or all 6 of world.RECORDED
    damped: np.ndarray  # (C,) damping force in this step [N], along n on grain 1; (0,) in the plain law
    push: np.ndarray  # (3, C) force on grain 1 [N]
    torque1: np.ndarray  # (3, C) [N m]
    torque2: np.ndarray  # (3, C) [N m]
    flag: np.ndarray  # (C,) uint8: 0, or what became of it where a limit was passed in this step: contact.update
    bonded: np.ndarray  # (C,) uint8: 1 where the long-range force of the pair acts every step
    side: np.ndarray  # (2C,) uint32: 2 × contact + 0 or 1, sorted by grain
    start: np.ndarray  # (N+1,) uint32: where each grain's entries of `side` begin
    gather_order: (
        np.ndarray
    )  # (N + GATHER_CLASSES,) uint32: the grains as contact.gather takes them; (0,) for as they are numbered


class PairList(NamedTuple):
    """Pairs close enough to touch soon; the first count[PAIRS] columns are in use."""

    pair: np.ndarray  # (2, P) uint32
    touching: np.ndarray  # (P,) uint8: 1 for pairs in contact
    step: np.ndarray  # (P,) the step their contact needs [s]; (1,) where all are alike
    length: np.ndarray  # (P,) δ_c of their contact [m]; (1,) likewise
    anchor: np.ndarray  # (3, N) positions when the list was made [m]; scratch while cells make it
    inner: (
        np.ndarray
    )  # (P/8,) uint32: the pairs that may touch next, the first watch[INNER_COUNT]; all if there are too many
    skin: np.ndarray  # (7,) what spares looking at all grains or pairs in every step: neighbours.skin


class LongRangeArrays(NamedTuple):
    """What long-range forces need: the list of pairs within reach, and the loads of their last summation.

    The list is one-sided, each pair stands in the rows of both its grains, and is kept in the order of cells:
    grain order[s] has place s.  It is a function of the anchors alone.
    """

    anchor: np.ndarray  # (3, N) positions when the list was made [m]
    order: np.ndarray  # (N,) uint32: the grain at each place
    start: np.ndarray  # (N+1,) uint32: where each place's row of `mate` begins
    neighbour: np.ndarray  # (P,) uint32: places of the neighbours
    cell_of: np.ndarray  # (N,) uint32: cell of each grain
    cell_start: np.ndarray  # (M+1,) uint32: first place of each cell
    packed_position: np.ndarray  # (3, V) positions by place [m]; by grain in sums over all pairs
    source: np.ndarray  # (3, V) moments, or charges in the first row; (1, P) where no force needs it
    force: np.ndarray  # (3, N) far forces [N]; (3, 0) without any
    torque: np.ndarray  # (3, N) far torques [N m]; likewise
    slow_force: np.ndarray  # (3, N) the part of them that acts in every step of a cycle [N]
    slow_torque: np.ndarray  # (3, N) [N m]
    force_rate: np.ndarray  # (3, N) their rates of change [N/s]
    torque_rate: np.ndarray  # (3, N) [N m/s]
    past_position: np.ndarray  # (3, N) at the last summation, or the one before [m]
    past_moment: np.ndarray  # (3, N) [A m²]
    path: np.ndarray  # (3, N) displacement since the last summation, summed over time [m s]
    block_sums: np.ndarray  # (2B, 3, V) forces and flux densities of each of the B blocks of a sum over all pairs


class StageArrays(NamedTuple):
    """Room for the stages of a Runge–Kutta step; rows are position, velocity, orientation, spin.  Never saved."""

    start: np.ndarray  # (13, N) the state that a step begins with
    rate: np.ndarray  # (7, 13, N) its rates of change at each stage
    power: np.ndarray  # (7,) of the outside forces at each stage [W]


SAVED_LONG_RANGE = ("anchor", "force", "torque", "slow_force", "slow_torque", "past_position", "past_moment", "path")
"""The far arrays that a checkpoint holds; the others follow from them."""
FORCE_ARRAYS = ("force", "torque")
CELL_ARRAYS = ("order", "cell_of", "cell_start", "source")
LIST_ARRAYS = ("anchor", "start", "packed_position", *CELL_ARRAYS)
RESPA_ARRAYS = ("slow_force", "slow_torque", "past_position", "path")
RATE_ARRAYS = ("force_rate", "torque_rate", "past_position", "past_moment")
"""The far arrays that only long-range forces, cells, a list, or cycles of either kind, read and write."""
UNIFORM_ARRAYS = ("bond", "step", "length")
"""Numbers of contacts and near pairs that are the same for all where grains are equal."""
NOT_SAVED = ("inner", "skin", "gather_order")
"""Of contacts and near pairs, what it leaves out: it is picked or worked out anew."""
GATHER_CLASSES = 64
"""Places behind all grains that sorting them by their contacts needs."""
GATHER_ORDER_FROM = 4000
"""Fewest grains for which the gathering has an order of its own; what fewer have, the branch predictor learns."""
BLOCK = 128
"""Contacts that are passed over together, whole vectors of them."""
OVER_ALLOCATION, GROWTH = 1.1, 1.25
"""Room for what is known to come, contacts at the start or pairs of a list; what is full grows by the second factor."""
PAIRS_PER_SOON = 8
"""Near pairs for each of those that may touch soon and have room; where more are that close, all are looked at."""
CELLS_PER_GRAIN = 4
"""Most cells per grain; where grains are sparse, cells are larger than they need be."""


def empty_long_range_arrays(
    grains: int, capacity: int, blocks: int = 1, *, needless: Collection[str] = ()
) -> LongRangeArrays:
    """Room for `capacity` entries of rows; the anchors are infinitely far, so that the first step makes the list.

    Parameters
    ----------
    blocks : int, optional
        of a sum over all pairs; 0 where there is none.
    needless : Collection[str], optional
        arrays that get no columns, since nothing will touch them.
    """
    vectors = {name: np.zeros((3, grains)) for name in LongRangeArrays._fields}
    vectors["anchor"] = np.full((3, grains), np.inf)
    v, p = padded_size(grains), max(int(capacity), 16)
    # without forces, cells keep one number there for each neighbour of a grain
    source = np.zeros((1, p) if "force" in needless else (3, v))
    vectors |= {"packed_position": np.zeros((3, v)), "source": source, "block_sums": np.zeros((2 * blocks, 3, v))}
    sizes = {"order": grains, "start": grains + 1, "neighbour": p, "cell_of": grains}
    sizes["cell_start"] = CELLS_PER_GRAIN * grains + 28
    arrays = vectors | {name: np.zeros(size, np.uint32) for name, size in sizes.items()}
    return LongRangeArrays(**(arrays | {name: arrays[name][..., :0].copy() for name in needless}))


def empty_contact_arrays(
    grains: int, room: int, constants: int, *, uniform_contacts: bool = False, channels: int = 6
) -> ContactArrays:
    """Room for so many contacts, with `constants` numbers each or for all if `alike`, and `channels` of losses."""
    c = padded_size(max(int(room), 16))
    vectors = {k: np.zeros((3, c)) for k in ("pointer1", "pointer2", "push", "torque1", "torque2")}
    numbers = {"twist": np.zeros(c), "formed": np.zeros(c), "damped": np.zeros(c if channels > ALWAYS_RECORDED else 0)}
    return ContactArrays(
        pair=np.zeros((2, c), np.uint32),
        bond=np.zeros((constants, BLOCK if uniform_contacts else c)),
        flag=np.zeros(c, np.uint8),
        bonded=np.zeros(c, np.uint8),
        lost=np.zeros((channels, c)),
        side=np.zeros(2 * c, np.uint32),
        start=np.zeros(grains + 1, np.uint32),
        gather_order=np.zeros(grains + GATHER_CLASSES if grains >= GATHER_ORDER_FROM else 0, np.uint32),
        **(vectors | numbers),
    )


def empty_pair_list(grains: int, capacity: int, *, uniform_contacts: bool = False) -> PairList:
    """Room for `capacity` pairs; the anchors are infinitely far, so that the first step makes the list."""
    p, nowhere = padded_size(max(int(capacity), 16)), np.full((3, grains), np.inf)
    pair, touching, inner = np.zeros((2, p), np.uint32), np.zeros(p, np.uint8), np.zeros(p // PAIRS_PER_SOON, np.uint32)
    kind = np.zeros((2, 1 if uniform_contacts else p))
    return PairList(pair, touching, kind[0], kind[1], nowhere, inner, np.full(7, -1.0))


def stage_arrays(grains: int) -> StageArrays:
    """Room for so many grains; 0 where no Runge–Kutta step is taken."""
    return StageArrays(np.zeros((13, grains)), np.zeros((7, 13, grains)), np.zeros(7))


def grown(arrays: Any, others: Collection[str], least: int) -> Any:
    """The same columns in longer arrays, with room for `least` pairs at least; `others` have none for each pair."""
    columns = arrays.pair.shape[1]
    more, longer = padded_size(max(int(GROWTH * columns) + 1, least)), {}
    for name, old in arrays._asdict().items():
        if name in others:
            longer[name] = old
            continue
        new = np.zeros((*old.shape[:-1], more * old.shape[-1] // columns), old.dtype)
        new[..., : old.shape[-1]] = old
        longer[name] = new
    return all_aligned(type(arrays)(**longer))
