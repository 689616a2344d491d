"""The state of a simulation: copying it is a snapshot, writing it is a checkpoint."""

from __future__ import annotations

import copy
from dataclasses import dataclass, field, replace

import numpy as np

from ..box import Box
from ..errors import BadInput
from ..grains import GrainArrays, Grains
from ..numerics.aligned import all_aligned
from .arrays import FOR_ALL, GROWTH, KEPT_FAR, PICKED, ContactArrays, FarArrays, NearPairs, grown
from .stages import StageArrays, stage_arrays

# --- places in World.clock (float64) ---------------------------------------------------------------
TIME, STEP, LEVEL, CONTACT_STEP, CYCLE, LEFT, FAR_LEVEL, CALM, KICKED, FLIGHT = range(10)
CLOCK = ("time", "step", "level", "contact_step", "cycle", "left", "far_level", "calm", "kicked", "flight")

# --- places in World.count (int64) -----------------------------------------------------------------
_NAMES = (
    "steps stage contacts pairs made broken moved rebuilt grain1 grain2 listed far_sums "
    "looked grown rejected needed unused ordered"
)
COUNT = tuple(_NAMES.split())
(STEPS, STAGE, CONTACTS, PAIRS, MADE, BROKEN, MOVED, REBUILT, GRAIN1, GRAIN2, LISTED, FAR_SUMS) = range(12)
LOOKED, GROWN, REJECTED, NEEDED, _UNUSED, ORDERED = range(12, 18)  # checkpoints of old have a number there

# --- places in NearPairs.watch (float64) -----------------------------------------------------------------
FAR_LEEWAY, NEAR_LEEWAY, SOON_LEEWAY, FASTEST, QUICKEST, HARMLESS, SOON = range(7)

# --- places in World.lost (float64): energy that left the grains, per channel [J] -----------------------
FORMING, BREAKING, SLIDING, ROLLING, TWISTING, DAMPING, STIFFNESS, GAS, OUTSIDE = range(9)
LOST_IN_CONTACTS = ("forming", "breaking", "sliding", "rolling", "twisting", "damping", "stiffness")
LOST = (*LOST_IN_CONTACTS, "gas", "outside")
RECORDED = tuple(name for name in LOST_IN_CONTACTS if name != "breaking")
"""What contacts keep a record of, in this order: none that is there has lost anything by breaking."""


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
    order: np.ndarray = field(
        default_factory=lambda: np.zeros(0, np.uint32)
    )  # the grain at each place, neighbours.spatial_sort
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
        self.contacts = grown(self.contacts, ("start", "turn", *self._for_all()), least)

    def grow_pairs(self, least: int = 0) -> None:
        """More room for near pairs, for `least` of them at least."""
        self.near = grown(self.near, ("anchor", "watch", *self._for_all()), least)

    def grow_rows(self) -> None:
        """More room for neighbours within the reach of long-range forces; what is there is not kept."""
        more = int(GROWTH * self.far.mate.size) + 1
        source = np.zeros((1, more)) if self.far.source.shape == (1, self.far.mate.size) else self.far.source
        self.far = all_aligned(self.far._replace(mate=np.zeros(more, np.uint32), source=source))

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

        Raises
        ------
        BadInput
            a missing array, or one of another shape.
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
                if name == "lost" and key in saved:  # up to format 3 also by breaking, in format 1 what nothing fills
                    kept = np.delete(saved[key], BREAKING, 0) if len(saved[key]) in (5, 7) else saved[key]
                    saved = saved | {key: kept[: len(array)]}
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
