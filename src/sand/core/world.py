"""The state of a simulation: copying it is a snapshot, writing it is a checkpoint."""

from __future__ import annotations

import copy
from collections.abc import Collection
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from .aligned import all_aligned, whole
from .box import Box
from .errors import BadInput
from .grains import GrainArrays, Grains
from .stages import StageArrays, stage_arrays

# --- places in World.clock (float64) ---------------------------------------------------------------
TIME, STEP, LEVEL, CONTACT_STEP, CYCLE, LEFT, FAR_LEVEL, CALM, KICKED, FLIGHT = range(10)
CLOCK = ("time", "step", "level", "contact_step", "cycle", "left", "far_level", "calm", "kicked", "flight")

# --- places in World.count (int64) -----------------------------------------------------------------
_NAMES = (
    "steps stage contacts pairs made broken moved rebuilt grain1 grain2 listed far_sums "
    "looked grown rejected needed soon ordered"
)
COUNT = tuple(_NAMES.split())
(STEPS, STAGE, CONTACTS, PAIRS, MADE, BROKEN, MOVED, REBUILT, GRAIN1, GRAIN2, LISTED, FAR_SUMS) = range(12)
LOOKED, GROWN, REJECTED, NEEDED, SOON, ORDERED = range(12, 18)

# --- places in NearPairs.watch (float64) -----------------------------------------------------------------
FAR_LEEWAY, NEAR_LEEWAY, SOON_LEEWAY, FASTEST, QUICKEST, HARMLESS = range(6)

# --- places in World.lost (float64): energy that left the grains, per channel [J] -----------------------
FORMING, BREAKING, SLIDING, ROLLING, TWISTING, DAMPING, STIFFNESS, GAS, OUTSIDE = range(9)
LOST_IN_CONTACTS = ("forming", "breaking", "sliding", "rolling", "twisting", "damping", "stiffness")
LOST = (*LOST_IN_CONTACTS, "gas", "outside")
ALWAYS = 5
"""The first channels are there in every contact law, the others only with damping or stiffnesses that change."""


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
    lost: np.ndarray  # (L, C) energy it dissipated so far [J], the first 5 or all 7 channels of LOST_IN_CONTACTS
    damped: np.ndarray  # (C,) damping force in this step [N], along n on grain 1; (0,) in the plain law
    push: np.ndarray  # (3, C) force on grain 1 [N]
    torque1: np.ndarray  # (3, C) [N m]
    torque2: np.ndarray  # (3, C) [N m]
    flag: np.ndarray  # (C,) uint8: 0, or what became of it where a limit was passed in this step: kernels.contacts
    bonded: np.ndarray  # (C,) uint8: 1 where the long-range force of the pair acts every step
    side: np.ndarray  # (2C,) uint32: 2 × contact + 0 or 1, sorted by grain
    start: np.ndarray  # (N+1,) uint32: where each grain's entries of `side` begin
    turn: np.ndarray  # (N + KINDS,) uint32: the grains as kernels.gathering takes them; (0,) for as they are numbered


class NearPairs(NamedTuple):
    """Pairs close enough to touch soon; the first count[PAIRS] columns are in use."""

    pair: np.ndarray  # (2, P) uint32
    touching: np.ndarray  # (P,) uint8: 1 for pairs in contact
    step: np.ndarray  # (P,) the step their contact needs [s]; (1,) where all are alike
    length: np.ndarray  # (P,) δ_c of their contact [m]; (1,) likewise
    anchor: np.ndarray  # (3, N) positions when the list was made [m]
    soon: np.ndarray  # (P,) uint32: the pairs that may touch next, the first count[SOON]
    mark: np.ndarray  # (3, N) positions when they were picked [m]
    watch: np.ndarray  # (6,) what spares looking at all grains or pairs in every step: kernels.watch


class FarArrays(NamedTuple):
    """What long-range forces need: the list of pairs within reach, and the loads of their last summation.

    The list is one-sided, each pair stands in the rows of both its grains, and is kept in the order of cells:
    grain order[s] has place s.  It is a function of the anchors alone.
    """

    anchor: np.ndarray  # (3, N) positions when the list was made [m]
    order: np.ndarray  # (N,) uint32: the grain at each place
    start: np.ndarray  # (N+1,) uint32: where each place's row of `mate` begins
    mate: np.ndarray  # (P,) uint32: places of the neighbours
    home: np.ndarray  # (N,) uint32: cell of each grain
    cell: np.ndarray  # (M+1,) uint32: first place of each cell
    here: np.ndarray  # (3, V) positions by place [m]; by grain in sums over all pairs
    source: np.ndarray  # (3, V) moments, or charges in the first row; (1, V) where no force needs it
    force: np.ndarray  # (3, N) far forces [N]; (3, 0) without any
    torque: np.ndarray  # (3, N) far torques [N m]; likewise
    held_force: np.ndarray  # (3, N) the part of them that acts in every step of a cycle [N]
    held_torque: np.ndarray  # (3, N) [N m]
    force_rate: np.ndarray  # (3, N) their rates of change [N/s]
    torque_rate: np.ndarray  # (3, N) [N m/s]
    past_position: np.ndarray  # (3, N) at the last summation, or the one before [m]
    past_moment: np.ndarray  # (3, N) [A m²]
    path: np.ndarray  # (3, N) displacement since the last summation, summed over time [m s]
    share: np.ndarray  # (2B, 3, V) forces and flux densities of each of the B blocks of a sum over all pairs


KEPT_FAR = ("anchor", "force", "torque", "held_force", "held_torque", "past_position", "past_moment", "path")
"""The far arrays that a checkpoint holds; the others follow from them."""
FOR_FORCES = ("force", "torque")
FOR_CELLS = ("order", "home", "cell", "here", "source")
FOR_LIST = ("anchor", "start", *FOR_CELLS)
FOR_IMPULSES = ("held_force", "held_torque", "past_position", "path")
FOR_RATES = ("force_rate", "torque_rate", "past_position", "past_moment")
"""The far arrays that only long-range forces, cells, a list, or cycles of either kind, read and write."""
FOR_ALL = ("bond", "step", "length")
"""Numbers of contacts and near pairs that are the same for all where grains are equal."""
PICKED = ("soon", "mark", "watch", "turn")
"""Of contacts and near pairs, what it leaves out: it is picked or worked out anew."""
KINDS = 64
"""Places behind all grains that sorting them by their contacts needs."""
TURNS_FROM = 4000
"""Fewest grains for which the gathering has an order of its own; what fewer have, the branch predictor learns."""
BLOCK = 128
"""Contacts that are passed over together, whole vectors of them."""
SPARE, GROWTH = 1.1, 1.25
"""Room for what is known to come, contacts at the start or pairs of a list; what is full grows by the second factor."""
CELLS_PER_GRAIN = 4
"""Most cells per grain; where grains are sparse, cells are larger than they need be."""


def far_arrays(grains: int, capacity: int, blocks: int = 1, *, needless: Collection[str] = ()) -> FarArrays:
    """Room for `capacity` entries of rows; the anchors are infinitely far, so that the first step makes the list.

    Args:
        blocks: of a sum over all pairs; 0 where there is none.
        needless: arrays that get no columns, since nothing will touch them.
    """
    vectors = {name: np.zeros((3, grains)) for name in FarArrays._fields}
    vectors["anchor"] = np.full((3, grains), np.inf)
    v = whole(grains)
    sources = 1 if "force" in needless else 3  # cells keep one number there
    vectors |= {"here": np.zeros((3, v)), "source": np.zeros((sources, v)), "share": np.zeros((2 * blocks, 3, v))}
    sizes = {"order": grains, "start": grains + 1, "mate": max(int(capacity), 16), "home": grains}
    sizes["cell"] = CELLS_PER_GRAIN * grains + 28
    arrays = vectors | {name: np.zeros(size, np.uint32) for name, size in sizes.items()}
    return FarArrays(**(arrays | {name: arrays[name][..., :0].copy() for name in needless}))


def contact_arrays(grains: int, room: int, constants: int, *, alike: bool = False, channels: int = 7) -> ContactArrays:
    """Room for so many contacts, with `constants` numbers each or for all if `alike`, and `channels` of losses."""
    c = whole(max(int(room), 16))
    vectors = {k: np.zeros((3, c)) for k in ("pointer1", "pointer2", "push", "torque1", "torque2")}
    numbers = {"twist": np.zeros(c), "formed": np.zeros(c), "damped": np.zeros(c if channels > ALWAYS else 0)}
    return ContactArrays(
        pair=np.zeros((2, c), np.uint32),
        bond=np.zeros((constants, BLOCK if alike else c)),
        flag=np.zeros(c, np.uint8),
        bonded=np.zeros(c, np.uint8),
        lost=np.zeros((channels, c)),
        side=np.zeros(2 * c, np.uint32),
        start=np.zeros(grains + 1, np.uint32),
        turn=np.zeros(grains + KINDS if grains >= TURNS_FROM else 0, np.uint32),
        **(vectors | numbers),
    )


def near_pairs(grains: int, capacity: int, *, alike: bool = False) -> NearPairs:
    """Room for `capacity` pairs; the anchors are infinitely far, so that the first step makes the list."""
    p, nowhere = whole(max(int(capacity), 16)), np.full((3, grains), np.inf)
    pair, touching, soon = np.zeros((2, p), np.uint32), np.zeros(p, np.uint8), np.zeros(p, np.uint32)
    kind = np.zeros((2, 1 if alike else p))
    return NearPairs(pair, touching, kind[0], kind[1], nowhere, soon, nowhere.copy(), np.full(6, -1.0))


def _grown(arrays: Any, others: Collection[str], least: int) -> Any:
    """The same columns in longer arrays, with room for `least` pairs at least; `others` have none for each pair."""
    columns = arrays.pair.shape[1]
    more, longer = whole(max(int(GROWTH * columns) + 1, least)), {}
    for name, old in arrays._asdict().items():
        if name in others:
            longer[name] = old
            continue
        new = np.zeros((*old.shape[:-1], more * (old.shape[-1] // columns)), old.dtype)
        new[..., : old.shape[-1]] = old
        longer[name] = new
    return all_aligned(type(arrays)(**longer))


@dataclass
class World:
    """Time, grains, contacts, box and the counters of a run; everything a restart needs."""

    grains: Grains
    box: Box
    contacts: ContactArrays
    near: NearPairs
    far: FarArrays
    clock: np.ndarray = field(default_factory=lambda: np.zeros(len(CLOCK)))
    count: np.ndarray = field(default_factory=lambda: np.zeros(len(COUNT), np.int64))
    lost: np.ndarray = field(default_factory=lambda: np.zeros(len(LOST)))
    stages: StageArrays = field(default_factory=lambda: stage_arrays(0))
    order: np.ndarray = field(default_factory=lambda: np.zeros(0, np.uint32))  # the grain at each place, run.places
    alike: bool = False  # radii, masses, materials are equal and stay so: one set of constants for all contacts

    def __post_init__(self) -> None:
        self.grains.arrays = all_aligned(self.grains.arrays)
        for group in ("contacts", "near", "far", "stages"):
            setattr(self, group, all_aligned(getattr(self, group)))

    @property
    def time(self) -> float:
        """[s]"""
        return float(self.clock[TIME])

    @property
    def steps(self) -> int:
        return int(self.count[STEPS])

    def copy(self) -> World:
        """An independent copy: a snapshot."""
        return replace(copy.deepcopy(self))  # made anew, so that its arrays begin with a line

    def _for_all(self) -> tuple[str, ...]:
        return FOR_ALL if self.alike else ()

    def _columns(self, group: str, name: str) -> int | None:
        """How many columns of an array of contacts or near pairs a checkpoint holds; None: all."""
        used = int(self.count[CONTACTS if group == "contacts" else PAIRS])
        n = 1 if name in self._for_all() else 2 * used if name == "side" else used
        return None if name in ("start", "anchor") else n

    def grow_contacts(self, least: int = 0) -> None:
        """More room for contacts, for `least` of them at least."""
        self.contacts = _grown(self.contacts, ("start", "turn", *self._for_all()), least)

    def grow_pairs(self, least: int = 0) -> None:
        """More room for near pairs, for `least` of them at least."""
        self.near = _grown(self.near, ("anchor", "mark", "watch", *self._for_all()), least)

    def grow_rows(self) -> None:
        """More room for neighbours within the reach of long-range forces; what is there is not kept."""
        self.far = self.far._replace(mate=np.zeros(int(GROWTH * self.far.mate.size) + 1, np.uint32))

    def to_arrays(self) -> dict[str, np.ndarray]:
        """Every number of the state by name, for a checkpoint; unused columns are left out."""
        out = {"clock": self.clock, "count": self.count, "lost": self.lost}
        out |= {f"grains/{k}": v for k, v in self.grains.arrays._asdict().items()}
        for group in ("contacts", "near"):
            for name, array in getattr(self, group)._asdict().items():
                if name not in PICKED:
                    out[f"{group}/{name}"] = array[..., : self._columns(group, name)]
        out |= {f"far/{name}": getattr(self.far, name) for name in KEPT_FAR}
        return out | ({"order": self.order} if self.order.size else {})

    def from_arrays(self, saved: dict[str, np.ndarray]) -> None:
        """Take over the numbers of `to_arrays`; the grains' number and materials are this world's own.

        Raises:
            BadInput: a missing array, or one of another shape.
        """
        for name in ("clock", "count", "lost"):
            # checkpoints of earlier versions lack the last counters, which begin at 0
            n = saved[name].size if name == "count" and name in saved else None
            _take(getattr(self, name)[:n], saved, name)
        if "order" in saved:
            self.order = np.zeros(len(self.grains), np.uint32)
            _take(self.order, saved, "order")
        if self.contacts.pair.shape[1] < self.count[CONTACTS]:
            self.grow_contacts(int(self.count[CONTACTS]))
        if self.near.pair.shape[1] < self.count[PAIRS]:
            self.grow_pairs(int(self.count[PAIRS]))
        for name in GrainArrays._fields:
            _take(getattr(self.grains.arrays, name), saved, f"grains/{name}")
        for group in ("contacts", "near"):
            for name, array in getattr(self, group)._asdict().items():
                if name in PICKED or (name == "damped" and not array.size):
                    continue
                key, n = f"{group}/{name}", self._columns(group, name)
                if name in self._for_all() and key in saved:  # format 1 has the same numbers for each, if any
                    saved = saved | {key: np.repeat(saved[key][..., :1], array.shape[-1], axis=-1)}
                    n = saved[key].shape[-1]
                if name == "lost" and key in saved:  # it has channels that nothing fills, too
                    saved = saved | {key: saved[key][: len(array)]}
                _take(array[..., :n], saved, key)
        for name in KEPT_FAR:  # format 1 may hold columns that nothing touches; without a list nothing is anchored
            listless = name == "anchor" and saved.get("far/anchor", self.far.anchor).size == 0
            if getattr(self.far, name).size and not listless:
                _take(getattr(self.far, name), saved, f"far/{name}")


def _take(target: np.ndarray, saved: dict[str, np.ndarray], name: str) -> None:
    if name not in saved:
        raise BadInput(f"the saved state has no '{name}'")
    if saved[name].shape != target.shape:
        raise BadInput(f"'{name}' of the saved state has shape {saved[name].shape}, not {target.shape}")
    target[...] = saved[name]


_MADE = "ContactArrays FarArrays NearPairs World contact_arrays far_arrays near_pairs"
__all__ = [name for name in dir() if name.isupper() and name[0] != "_"] + _MADE.split()
