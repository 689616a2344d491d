"""The state of a simulation: copying it is a snapshot, writing it is a checkpoint."""

from __future__ import annotations

import copy
from dataclasses import dataclass, field, replace

import numpy as np

from ..box import Box
from ..errors import BadInput
from ..grains import GrainArrays, Grains
from ..numerics.simd import all_aligned
from .arrays import (
    GROWTH,
    NOT_SAVED,
    SAVED_LONG_RANGE,
    UNIFORM_ARRAYS,
    ContactArrays,
    LongRangeArrays,
    PairList,
    StageArrays,
    grown,
    stage_arrays,
)

# --- indices of State.clock (float64) ---------------------------------------------------------------
TIME, STEP, LEVEL, CONTACT_STEP, CYCLE, LEFT, LONG_RANGE_LEVEL, CALM, KICKED, FLIGHT = range(10)
CLOCK = ("time", "step", "level", "contact_step", "cycle", "left", "long_range_level", "calm", "kicked", "flight")

# --- indices of State.count (int64) -----------------------------------------------------------------
_NAMES = (
    "steps stage contacts pairs made broken slipped rebuilt grain1 grain2 listed long_range_sums "
    "checked step_increases rejected needed ordered"
)
COUNT = tuple(_NAMES.split())
(STEPS, STAGE, CONTACTS, PAIRS, MADE, BROKEN, SLIPPED, REBUILT, GRAIN1, GRAIN2, LISTED, LONG_RANGE_SUMS) = range(12)
CHECKED, STEP_INCREASES, REJECTED, NEEDED, ORDERED = range(12, 17)

# --- indices of PairList.skin (float64) -----------------------------------------------------------------
LONG_RANGE_SKIN, PAIR_LIST_SKIN, INNER_SKIN, LARGEST_SPEED, LARGEST_SPIN, SAFE_SPEED, INNER_COUNT = range(7)

# --- indices of State.lost (float64): energy that left the grains, per channel [J] -----------------------
FORMING, BREAKING, SLIDING, ROLLING, TWISTING, DAMPING, STIFFNESS, GAS, OUTSIDE = range(9)
LOST_IN_CONTACTS = ("forming", "breaking", "sliding", "rolling", "twisting", "damping", "stiffness")
LOST = (*LOST_IN_CONTACTS, "gas", "outside")
RECORDED = tuple(name for name in LOST_IN_CONTACTS if name != "breaking")
"""What contacts keep a record of, in this order: none that is there has lost anything by breaking."""


@dataclass
class State:
    """Time, grains, contacts, box and the counters of a run; everything a restart needs."""

    grains: Grains
    box: Box
    contacts: ContactArrays
    pair_list: PairList
    long_range: LongRangeArrays
    clock: np.ndarray = field(default_factory=lambda: np.zeros(len(CLOCK)))
    count: np.ndarray = field(default_factory=lambda: np.zeros(len(COUNT), np.int64))
    lost: np.ndarray = field(default_factory=lambda: np.zeros(len(LOST)))
    stages: StageArrays = field(default_factory=lambda: stage_arrays(0))
    order: np.ndarray = field(
        default_factory=lambda: np.zeros(0, np.uint32)
    )  # the grain at each place, neighbours.spatial_sort
    uniform_contacts: bool = (
        False  # radii, masses, materials are equal and stay so: one set of constants for all contacts
    )

    def __post_init__(self) -> None:
        self.grains.arrays = all_aligned(self.grains.arrays)
        for group in ("contacts", "pair_list", "long_range", "stages"):
            setattr(self, group, all_aligned(getattr(self, group)))

    @property
    def time(self) -> float:
        """[s]"""
        return float(self.clock[TIME])

    @property
    def steps(self) -> int:
        return int(self.count[STEPS])

    def copy(self) -> State:
        """An independent copy: a snapshot."""
        return replace(copy.deepcopy(self))  # made anew, so that its arrays begin with a line

    def _for_all(self) -> tuple[str, ...]:
        return UNIFORM_ARRAYS if self.uniform_contacts else ()

    def _columns(self, group: str, name: str) -> int | None:
        """How many columns of an array of contacts or near pairs a checkpoint holds; None: all."""
        used = int(self.count[CONTACTS if group == "contacts" else PAIRS])
        n = 1 if name in self._for_all() else 2 * used if name == "side" else used
        return None if name in ("start", "anchor") else n

    def grow_contacts(self, least: int = 0) -> None:
        """More room for contacts, for `least` of them at least."""
        self.contacts = grown(self.contacts, ("start", "gather_order", *self._for_all()), least)

    def grow_pairs(self, least: int = 0) -> None:
        """More room for near pairs, for `least` of them at least."""
        self.pair_list = grown(self.pair_list, ("anchor", "skin", *self._for_all()), least)

    def grow_rows(self) -> None:
        """More room for neighbours within the reach of long-range forces; what is there is not kept."""
        more = int(GROWTH * self.long_range.neighbour.size) + 1
        source = (
            np.zeros((1, more))
            if self.long_range.source.shape == (1, self.long_range.neighbour.size)
            else self.long_range.source
        )
        self.long_range = all_aligned(self.long_range._replace(neighbour=np.zeros(more, np.uint32), source=source))

    def to_arrays(self) -> dict[str, np.ndarray]:
        """Every number of the state by name, for a checkpoint; unused columns are left out."""
        out = {"clock": self.clock, "count": self.count, "lost": self.lost}
        out |= {f"grains/{k}": v for k, v in self.grains.arrays._asdict().items()}
        for group in ("contacts", "pair_list"):
            for name, array in getattr(self, group)._asdict().items():
                if name not in NOT_SAVED:
                    out[f"{group}/{name}"] = array[..., : self._columns(group, name)]
        out |= {f"long_range/{name}": getattr(self.long_range, name) for name in SAVED_LONG_RANGE}
        return out | ({"order": self.order} if self.order.size else {})

    def from_arrays(self, saved: dict[str, np.ndarray]) -> None:
        """Take over the numbers of `to_arrays`; the grains' number and materials are this world's own.

        Raises
        ------
        BadInput
            a missing array, or one of another shape.
        """
        for name in ("clock", "count", "lost"):
            _take(getattr(self, name), saved, name)
        if "order" in saved:
            self.order = np.zeros(len(self.grains), np.uint32)
            _take(self.order, saved, "order")
        if self.contacts.pair.shape[1] < self.count[CONTACTS]:
            self.grow_contacts(int(self.count[CONTACTS]))
        if self.pair_list.pair.shape[1] < self.count[PAIRS]:
            self.grow_pairs(int(self.count[PAIRS]))
        for name in GrainArrays._fields:
            _take(getattr(self.grains.arrays, name), saved, f"grains/{name}")
        for group in ("contacts", "pair_list"):
            for name, array in getattr(self, group)._asdict().items():
                if name in NOT_SAVED or (name == "damped" and not array.size):
                    continue
                key, n = f"{group}/{name}", self._columns(group, name)
                if name in self._for_all() and key in saved:  # one stored column stands for all
                    saved = saved | {key: np.repeat(saved[key][..., :1], array.shape[-1], axis=-1)}
                    n = array.shape[-1]
                _take(array[..., :n], saved, key)
        for name in SAVED_LONG_RANGE:
            _take(getattr(self.long_range, name), saved, f"long_range/{name}")


def _take(target: np.ndarray, saved: dict[str, np.ndarray], name: str) -> None:
    if name not in saved:
        raise BadInput(f"the saved state has no '{name}'")
    if saved[name].shape != target.shape:
        raise BadInput(f"'{name}' of the saved state has shape {saved[name].shape}, not {target.shape}")
    target[...] = saved[name]
