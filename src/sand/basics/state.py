"""State of a simulation.  A copy is a snapshot; its arrays are the content of a checkpoint."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from operator import attrgetter
from typing import Any

import numpy as np

from .alignment import aligned_copies, all_aligned
from .arrays import (
    GROWTH,
    KEPT_ROWS,
    NOT_SAVED,
    SAVED_BODIES,
    SAVED_LONG_RANGE,
    SAVED_WALLS,
    UNIFORM_ARRAYS,
    BodyArrays,
    ClusterArrays,
    ContactArrays,
    LongRangeArrays,
    PairList,
    WallArrays,
    body_arrays,
    cluster_arrays,
    empty_contact_arrays,
    grown,
    wall_arrays,
)
from .box import Box
from .errors import BadInput
from .grains import GrainArrays, Grains
from .material import Material
from .own_quantities import OwnQuantities

# --- indices of State.clock (float64): times, and one sum over cycles -------------------------------
TIME = 0  # simulated time [s]
STEP = 1  # present time step [s]
LEVEL = 2  # longest step allowed by free grains and closing pairs, quantised to a power of two [s]
CONTACT_STEP = 3  # longest step allowed by contacts [s]
CYCLE = 4  # length of the present r-RESPA cycle [s]
LEFT = 5  # part of the cycle that remains [s]; 0 between cycles
LONG_RANGE_LEVEL = 6  # longest cycle allowed by long-range forces, quantised [s]
CALM = 7  # longest step allowed by free grains [s]
KICKED = 8  # time of the last kick by the gas [s]
FLIGHT = 9  # next step without contacts [s], of integrators other than Verlet
CORRECTED = 10  # magnitudes of all corrections of spins by r-RESPA, summed [J s]
SETTLED = 11  # time at which settling was last applied to clusters [s]
WALL_STEP = 12  # longest step allowed by walls [s]; 0 without walls
SOME_AWAKE = 13  # time with any cluster awake [s], of rigid clusters
GRAINS_AWAKE = 14  # mean time awake of a grain [s]
LARGEST_LOAD = 15  # largest change of the loads of the contacts of a cluster at rest, in units of their limits
LARGEST_OVERLAP = 16  # largest overlap at the end of a step, in radii of the smaller grain
LARGEST_IMPACT = 17  # largest speed of an impact in units of `contact.impact.impact_share`
IMPACT_SPEED = 18  # speed along the normal of this impact [m/s]
CLOCK = (
    *("time", "step", "level", "contact_step", "cycle", "left", "long_range_level", "calm", "kicked", "flight"),
    *("corrected", "settled", "wall_step", "some_awake", "grains_awake", "largest_load"),
    *("largest_overlap", "largest_impact", "impact_speed"),
)
LEAST_CLOCK = LARGEST_OVERLAP
"""Fewest entries of the clock in a checkpoint: those that earlier versions did not have begin at 0."""

# --- indices of State.count (int64) -----------------------------------------------------------------
STEPS = 0  # steps taken
STAGE = 1  # 1 in the middle of a step, after the drift; 0 between steps
CONTACTS = 2  # contacts in use
PAIRS = 3  # candidate pairs in use
MADE = 4  # contacts formed
BROKEN = 5  # contacts broken
SLIPPED = 6  # slip events
REBUILT = 7  # builds of the pair list
GRAIN1 = 8  # grains that caused the driver to stop, or −1
GRAIN2 = 9
LISTED = 10  # builds of the Verlet list
LONG_RANGE_SUMS = 11  # summations of long-range forces
CHECKED = 12  # step at which the time step was last chosen
STEP_INCREASES = 13  # step at which the time step was last allowed to increase
REJECTED = 14  # rejected steps without contacts, of integrators other than Verlet
NEEDED = 15  # step at which a time step as short as LEVEL, or as FLIGHT, was last needed
ORDERED = 16  # step of the last spatial sort
COMPARED = 17  # contacts formed and broken when the cut-off was last compared with the clusters; −1: it is fixed
WALL_CONTACTS = 18  # contacts with walls in use
BODIES = 19  # bodies in use, single grains included; 0 without rigid clusters
CONTACT_STEPS = 20  # steps of grains of clusters that are awake
WOKEN = 21  # bodies woken
RESTED = 22  # clusters that came to rest, and move as rigid bodies
LATE = 23  # pairs that overlapped before their bodies were woken
SUBSTEPS = 24  # steps of bodies that take several within a step of all bodies
COUNT = (
    *("steps", "stage", "contacts", "pairs", "made", "broken", "slipped", "rebuilt", "grain1", "grain2", "listed"),
    *("long_range_sums", "checked", "step_increases", "rejected", "needed", "ordered", "compared", "wall_contacts"),
    *("bodies", "contact_steps", "woken", "rested", "late", "substeps"),
)

# --- indices of State.cutoff (float64): the cut-off of dipoles that follows the largest clusters -----------------
CUT_RADIUS = 0  # cut-off [m]; 0 without such a cut-off
CUT_CAPTURE = 1  # capture radius b_max of the two clusters for which it was chosen [m]
CUT_TEMPERATURE = 2  # temperature of the clusters' translation at the start [K]
CUT_TIME = 3  # time of the choice [s]
CUT_FIRST, CUT_SECOND = 4, 5  # grains of the two clusters
CUT_LIMITED = 6  # time of the first choice that half the box limited [s]; infinite if none
CUTOFF = ("radius", "capture", "temperature", "time", "first", "second", "limited")

# --- indices of PairList.skin (float64), see neighbours.skin ------------------------------------------------
LONG_RANGE_SKIN, PAIR_LIST_SKIN, INNER_SKIN, SQUARED_SPEED, SQUARED_SPIN, SAFE_SPEED, INNER_COUNT = range(7)

# --- indices of State.lost (float64): energy dissipated or transferred, per channel [J] ---------------------
FORMING, BREAKING, SLIDING, ROLLING, TWISTING = range(5)
DAMPING_NORMAL, DAMPING_SLIDING, DAMPING_ROLLING, DAMPING_TWISTING, STIFFNESS, SETTLING, GAS, OUTSIDE = range(5, 13)
CUTOFF_CHANGED = 13
QUIETING = 14
DAMPING = ("damping_normal", "damping_sliding", "damping_rolling", "damping_twisting")
LOST = (
    *("forming", "breaking", "sliding", "rolling", "twisting", *DAMPING, "stiffness", "settling", "gas", "outside"),
    *("cutoff_changed", "quieting"),
)
RECORDED = ("forming", "sliding", "rolling", "twisting", "damping", "stiffness")
"""Losses recorded per contact, in this order: damping of all modes together, and nothing by breaking, after which a
contact does not exist."""


GROUPS = ("contacts", "pair_list", "long_range", "clusters", "walls", "wall_contacts", "bodies")
"""Groups of arrays of a state, besides its grains."""
SINGLE = ("clock", "count", "lost", "cutoff", "order")
"""Its other arrays."""
IN_GROUPS, OTHERS = attrgetter(*GROUPS), attrgetter(*SINGLE)
WALL_CONTACT_ARRAYS = (
    *("pair", "pointer1", "pointer2", "twist", "formed", "constants", "lost", "damping", "force", "torque1", "flag"),
)
"""Arrays of the contacts with walls in a checkpoint."""


@dataclass
class State:
    """Time, grains, contacts, box and counters of a simulation: everything that a restart needs."""

    grains: Grains
    box: Box
    contacts: ContactArrays
    pair_list: PairList
    long_range: LongRangeArrays
    clock: np.ndarray = field(default_factory=lambda: np.zeros(len(CLOCK)))
    count: np.ndarray = field(default_factory=lambda: np.zeros(len(COUNT), np.int64))
    lost: np.ndarray = field(default_factory=lambda: np.zeros(len(LOST)))
    cutoff: np.ndarray = field(default_factory=lambda: np.zeros(len(CUTOFF)))
    clusters: ClusterArrays = field(default_factory=lambda: cluster_arrays(0))
    walls: WallArrays = field(default_factory=lambda: wall_arrays(0, 0))
    wall_contacts: ContactArrays = field(default_factory=lambda: empty_contact_arrays(0, 0, 0))
    bodies: BodyArrays = field(default_factory=lambda: body_arrays(0))
    # user's index of each grain in memory, with spatial sorting (neighbours.spatial_sort)
    order: np.ndarray = field(default_factory=lambda: np.zeros(0, np.uint32))
    # equal radii, masses and materials, so that one set of constants serves all contacts
    uniform_contacts: bool = False

    def __post_init__(self) -> None:
        self.grains.arrays = all_aligned(self.grains.arrays)
        for group in GROUPS:
            setattr(self, group, all_aligned(getattr(self, group)))

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return float(self.clock[TIME])

    @property
    def steps(self) -> int:
        """Number of steps taken."""
        return int(self.count[STEPS])

    @property
    def at_rest(self) -> np.ndarray | None:
        """Which grains (N,) belong to clusters at rest, single grains included; None without rigid clusters."""
        return self.bodies.asleep == 1 if self.bodies.asleep.size else None

    def take_extremes(self, part: State) -> None:
        """Take over the largest overlap and the largest impact of a part of the grains that took steps of its own."""
        own, other = self.clock, part.clock
        own[LARGEST_OVERLAP] = max(own[LARGEST_OVERLAP], other[LARGEST_OVERLAP])
        if other[LARGEST_IMPACT] > own[LARGEST_IMPACT]:
            own[LARGEST_IMPACT], own[IMPACT_SPEED] = other[LARGEST_IMPACT], other[IMPACT_SPEED]

    def copy(self) -> State:
        """Independent copy (snapshot); empty arrays, which nothing changes, are the same."""
        copies = iter(aligned_copies([array for array in self.arrays() if array.size]))
        other = object.__new__(type(self))  # `replace` would look at the alignment of each array again
        vars(other).update(vars(self))

        def copied(group: Any) -> Any:
            if not any(array.size for array in group):
                return group
            return type(group)(*(next(copies) if array.size else array for array in group))

        other.grains = self.grains.with_arrays(copied(self.grains.arrays))
        for name in GROUPS:
            setattr(other, name, copied(getattr(self, name)))
        for name in SINGLE:
            array = getattr(self, name)
            setattr(other, name, next(copies) if array.size else array)
        return other

    def take_settings(self, other: State) -> None:
        """Take over what another state has besides arrays."""
        self.box, self.uniform_contacts = other.box, other.uniform_contacts
        vars(self.grains).update(vars(other.grains) | {"arrays": self.grains.arrays})

    def arrays(self) -> list[np.ndarray]:
        """All arrays of the state."""
        return [*self.grains.arrays, *chain.from_iterable(IN_GROUPS(self)), *OTHERS(self)]

    def _uniform_arrays(self) -> tuple[str, ...]:
        """Names of arrays with identical columns."""
        return UNIFORM_ARRAYS if self.uniform_contacts else ()

    def _columns(self, group: str, name: str) -> int | None:
        """Number of columns of an array of contacts or candidate pairs in a checkpoint; None for all."""
        used = int(self.count[CONTACTS if group == "contacts" else PAIRS])
        n = 1 if name in self._uniform_arrays() else 2 * used if name == "side" else used
        return None if name in ("start", "anchor") else n

    def grow_contacts(self, minimum: int = 0) -> None:
        """Allocate more contacts, at least `minimum`."""
        self.contacts = grown(self.contacts, ("start", "gather_order", *self._uniform_arrays()), minimum)

    def grow_component_contacts(self) -> None:
        """Allocate more contacts with walls."""
        self.wall_contacts = grown(self.wall_contacts, ("start", "gather_order"), 0)

    def grow_pairs(self, minimum: int = 0) -> None:
        """Allocate more candidate pairs, at least `minimum`."""
        self.pair_list = grown(self.pair_list, ("anchor", "skin", *self._uniform_arrays()), minimum)

    def grow_rows(self) -> None:
        """Allocate a longer Verlet list; its content is discarded."""
        capacity = int(GROWTH * self.long_range.neighbour.size) + 1
        self.long_range = all_aligned(self.long_range._replace(neighbour=np.zeros(capacity, np.uint32)))

    def all_losses(self) -> tuple[np.ndarray, ...]:
        """Arrays of losses: of all, and of each contact, also with walls."""
        return self.lost, self.contacts.lost, self.wall_contacts.lost

    def forget_losses(self) -> None:
        """Set losses, and impulses on walls, to 0."""
        for array in (*self.all_losses(), self.walls.impulse):
            array[:] = 0.0

    def to_arrays(self) -> dict[str, np.ndarray]:
        """All arrays of the state by name, for a checkpoint; unused columns are omitted."""
        out = {"clock": self.clock, "count": self.count, "lost": self.lost, "cutoff": self.cutoff}
        out |= {f"grains/{k}": v for k, v in self.grains.arrays._asdict().items()}
        for group in ("contacts", "pair_list"):
            for name, array in getattr(self, group)._asdict().items():
                if name not in NOT_SAVED:
                    out[f"{group}/{name}"] = array[..., : self._columns(group, name)]
        out |= {f"long_range/{name}": getattr(self.long_range, name) for name in SAVED_LONG_RANGE}
        if self.walls.work.size:
            out |= {f"walls/{name}": getattr(self.walls, name) for name in SAVED_WALLS}
            for name in WALL_CONTACT_ARRAYS:
                out[f"wall_contacts/{name}"] = getattr(self.wall_contacts, name)[..., : self.count[WALL_CONTACTS]]
        if self.bodies.mass.size:
            out |= {f"bodies/{name}": getattr(self.bodies, name) for name in SAVED_BODIES}
        return out | ({"order": self.order} if self.order.size else {})

    def from_arrays(self, saved: dict[str, np.ndarray]) -> None:
        """Load the arrays of `to_arrays`.  The number of grains and their materials must be those of this state.

        Raises
        ------
        BadInput
            If an array is missing or has another shape.
        """
        if "clock" in saved and LEAST_CLOCK <= saved["clock"].size < len(CLOCK):
            saved = saved | {"clock": np.pad(saved["clock"], (0, len(CLOCK) - saved["clock"].size))}
        for name in ("clock", "count", "lost", "cutoff"):
            _copy_into(getattr(self, name), saved, name)
        if "order" in saved:
            self.order = np.zeros(len(self.grains), np.uint32)
            _copy_into(self.order, saved, "order")
        if self.contacts.pair.shape[1] < self.count[CONTACTS]:
            self.grow_contacts(int(self.count[CONTACTS]))
        if self.pair_list.pair.shape[1] < self.count[PAIRS]:
            self.grow_pairs(int(self.count[PAIRS]))
        if "grains/image" not in saved:  # of a checkpoint of an earlier version, which counted no crossings
            saved = saved | {"grains/image": np.zeros_like(self.grains.arrays.image)}
        if "contacts/kept" not in saved:  # likewise; displacements are then computed in the next step
            saved = saved | {"contacts/kept": np.zeros((KEPT_ROWS, int(self.count[CONTACTS])))}
        for name in GrainArrays._fields:
            _copy_into(getattr(self.grains.arrays, name), saved, f"grains/{name}")
        for group in ("contacts", "pair_list"):
            for name, array in getattr(self, group)._asdict().items():
                if name in NOT_SAVED or (name == "damping" and not array.size):
                    continue
                key, n = f"{group}/{name}", self._columns(group, name)
                if name in self._uniform_arrays() and key in saved:  # one column is stored for all
                    saved = saved | {key: np.repeat(saved[key][..., :1], array.shape[-1], axis=-1)}
                    n = array.shape[-1]
                _copy_into(array[..., :n], saved, key)
        for name in SAVED_LONG_RANGE:
            if name == "anchor" and saved.get("long_range/anchor", self.long_range.anchor).size == 0:
                continue  # saved without a Verlet list: Engine.load_state builds one
            _copy_into(getattr(self.long_range, name), saved, f"long_range/{name}")
        for name in SAVED_BODIES if self.bodies.mass.size else ():
            _copy_into(getattr(self.bodies, name), saved, f"bodies/{name}")
        for name in SAVED_WALLS if self.walls.work.size else ():
            _copy_into(getattr(self.walls, name), saved, f"walls/{name}")
        used = int(self.count[WALL_CONTACTS])
        while self.wall_contacts.flag.size < used:
            self.grow_component_contacts()
        for name in WALL_CONTACT_ARRAYS if self.walls.work.size else ():
            _copy_into(getattr(self.wall_contacts, name)[..., :used], saved, f"wall_contacts/{name}")


def grains_from_arrays(
    saved: Mapping[str, np.ndarray], materials: Sequence[Material], units: Mapping[str, str]
) -> Grains:
    """Grains with the radii, masses, velocities, spins, moments, charges and own quantities of saved arrays.

    Their moments are those in the body frames; `State.from_arrays` restores the orientations.

    Parameters
    ----------
    saved : Mapping[str, ndarray]
        Arrays of `State.to_arrays`.
    materials : Sequence[Material]
        Material of each grain.
    units : Mapping[str, str]
        Units of the own quantities by name, in the order of their rows.

    Raises
    ------
    KeyError
        If an array is missing.
    BadInput
        If a quantity is out of range.
    """
    part = {name.split("/", 1)[1]: array for name, array in saved.items() if name.startswith("grains/")}
    return Grains(
        part["position"].T,
        part["radius"],
        materials,
        velocity=part["velocity"].T,
        spin=part["spin"].T,
        moment=part["body_moment"].T,
        charge=part["charge"],
        mass=part["mass"],
        own=OwnQuantities(dict(zip(units, part["own"], strict=True)), units),
    )


def _copy_into(target: np.ndarray, saved: dict[str, np.ndarray], name: str) -> None:
    """Copy the saved array `name` into `target`."""
    if name not in saved:
        raise BadInput(f"the saved state has no '{name}'")
    if saved[name].shape != target.shape:
        raise BadInput(f"'{name}' of the saved state has shape {saved[name].shape}, not {target.shape}")
    target[...] = saved[name]
