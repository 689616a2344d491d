"""State of a simulation.  A copy is a snapshot; its arrays are the content of a checkpoint."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from operator import attrgetter
from typing import Any

import numpy as np

from .alignment import aligned_copies, all_aligned
from .array_groups import (
    GRAINS,
    GROWTH,
    SIDES,
    USED,
    Array,
    arrays_of,
    grown,
    new_group,
    reorder_group,
    saved_in,
    table_in,
)
from .arrays import (
    BodyArrays,
    CellArrays,
    ClusterArrays,
    ContactArrays,
    LongRangeArrays,
    PairList,
    body_arrays,
    cluster_arrays,
)
from .box import Box, box_of
from .errors import BadInput
from .grains import Grains
from .material import Material
from .own_quantities import OwnQuantities

# --- indices of State.clock (float64): times, and one sum over cycles -------------------------------
TIME = 0  # simulated time [s]
STEP = 1  # present time step [s]
LEVEL = 2  # longest step allowed by free grains and closing pairs, quantised to a power of two [s]
CONTACT_LIMIT = 3  # longest step allowed by contacts [s]
CYCLE = 4  # length of the present r-RESPA cycle [s]
LEFT = 5  # part of the cycle that remains [s]; 0 between cycles
LONG_RANGE_LEVEL = 6  # longest cycle allowed by long-range forces, quantised [s]
CALM = 7  # longest step allowed by free grains [s]
KICKED = 8  # time of the last kick by the gas [s]
FLIGHT = 9  # next step without contacts [s], of integrators other than Verlet
CORRECTED = 10  # magnitudes of all corrections of spins by r-RESPA, summed [J s]
SETTLED = 11  # time at which settling was last applied to clusters [s]
COMPONENT_STEP = 12  # longest step allowed by components, such as walls [s]; 0 if none limits it
SOME_AWAKE = 13  # time with any cluster awake [s], of rigid clusters
GRAINS_AWAKE = 14  # mean time awake of a grain [s]
LARGEST_LOAD = 15  # largest change of the loads of the contacts of a cluster at rest, in units of their limits
LARGEST_OVERLAP = 16  # largest overlap at the end of a step, in radii of the smaller grain
LARGEST_IMPACT = 17  # largest speed of an impact in units of `contact.impact.impact_share`
IMPACT_SPEED = 18  # speed along the normal of this impact [m/s]
CHANGED = 19  # time at which a contact last formed or broke [s]
SLID = 20  # time at which a contact last slipped [s]
CLOCK = (
    *("time", "step", "level", "contact_limit", "cycle", "left", "long_range_level", "calm", "kicked", "flight"),
    *("corrected", "settled", "component_step", "some_awake", "grains_awake", "largest_load"),
    *("largest_overlap", "largest_impact", "impact_speed", "changed", "slid"),
)
EXTREMES, SUMS = (LARGEST_LOAD, LARGEST_OVERLAP, CHANGED, SLID), (SOME_AWAKE, CORRECTED)
"""Entries that are the largest, or latest, of all parts of the grains, and that add up over parts."""
LEAST_CLOCK = LARGEST_OVERLAP
"""Fewest entries of the clock in a checkpoint. Entries that a checkpoint of an earlier version lacks are set to 0, but
CHANGED and SLID to the time of the checkpoint, because the last events before it are unknown."""

# --- indices of State.count (int64) -----------------------------------------------------------------
STEPS = 0  # steps taken
PHASE = 1  # 0 between steps; 1 after the drift; 2 and 3 after substeps of rigid clusters, see integrate.rigid.substeps
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
# 18 is not used; earlier versions counted the contacts with walls here
BODIES = 19  # bodies in use, single grains included; 0 without rigid clusters
CONTACT_STEPS = 20  # steps of grains of clusters that are awake
WOKEN = 21  # bodies woken
RESTED = 22  # clusters that came to rest, and move as rigid bodies
LATE = 23  # pairs that overlapped before their bodies were woken
SUBSTEPS = 24  # steps of bodies that take several within a step of all bodies
COUNT = (
    *("steps", "phase", "contacts", "pairs", "made", "broken", "slipped", "rebuilt", "grain1", "grain2", "listed"),
    *("long_range_sums", "checked", "step_increases", "rejected", "needed", "ordered", "compared", "unused"),
    *("bodies", "contact_steps", "woken", "rested", "late", "substeps"),
)

EVENTS = (MADE, BROKEN, SLIPPED, WOKEN, RESTED, LATE)
"""Numbers of events, which add up over parts of the grains."""

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


GROUPS = ("contacts", "pair_list", "long_range", "clusters", "bodies")
"""Groups of arrays of a state, besides its grains and the groups of components."""
CELL = "cell"
"""Name of the group of a box that may be deformed, of a component (`components.deformation`)."""
TILT = 9
"""Word of its span with the tilt."""
SINGLE = ("clock", "count", "lost", "cutoff", "order")
"""Its other arrays."""
IN_GROUPS, OTHERS = attrgetter(*GROUPS), attrgetter(*SINGLE)


@dataclass
class State:
    """Time, grains, contacts, box and counters of a simulation: everything that a restart needs."""

    grains: Grains
    fixed_box: Box  # the box, unless it is deformed
    contacts: ContactArrays
    pair_list: PairList
    long_range: LongRangeArrays
    clock: np.ndarray = field(default_factory=lambda: np.zeros(len(CLOCK)))
    count: np.ndarray = field(default_factory=lambda: np.zeros(len(COUNT), np.int64))
    lost: np.ndarray = field(default_factory=lambda: np.zeros(len(LOST)))
    cutoff: np.ndarray = field(default_factory=lambda: np.zeros(len(CUTOFF)))
    clusters: ClusterArrays = field(default_factory=lambda: cluster_arrays(0))
    bodies: BodyArrays = field(default_factory=lambda: body_arrays(0))
    # groups of the components in use, by name
    of_components: dict[str, Any] = field(default_factory=dict)
    # user's index of each grain in memory, with spatial sorting (neighbours.spatial_sort)
    order: np.ndarray = field(default_factory=lambda: np.zeros(0, np.uint32))
    # equal radii, masses and materials, so that one set of constants serves all contacts
    uniform_contacts: bool = False

    def __post_init__(self) -> None:
        self.grains.arrays = all_aligned(self.grains.arrays)
        for group in GROUPS:
            setattr(self, group, all_aligned(getattr(self, group)))

    def add_groups(
        self, groups: Mapping[str, type], sizes: Mapping[str, int], columns: Mapping[str, int] | None = None
    ) -> None:
        """Add the groups of a component, see `array_groups.new_group`."""
        sizes = {"grains": len(self.grains)} | dict(sizes)
        for name, group in groups.items():
            self.of_components[name] = all_aligned(new_group(group, sizes, columns))

    def in_groups(self) -> list[Any]:
        """All groups of arrays."""
        return [self.grains.arrays, *IN_GROUPS(self), *self.of_components.values()]

    def group_names(self) -> tuple[str, ...]:
        """Their names: parts of a simulation, and in checkpoints."""
        return "grains", *GROUPS, *self.of_components

    @property
    def cell(self) -> CellArrays | None:
        """The box in memory, where it may be deformed; None where it may not."""
        return self.of_components.get(CELL)

    @property
    def box(self) -> Box:
        """Box at the time of the state."""
        return self.fixed_box if self.cell is None else box_of(self.cell.span, self.cell.span[TILT])

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

    def limiting_grains(self) -> tuple[int, ...]:
        """Indices of the grains that caused the last stop."""
        return tuple(sorted({int(self.count[g]) for g in (GRAIN1, GRAIN2)} - {-1}))

    def begin_empty_step(self) -> None:
        """Be in the middle of a step of 0 s, whose second half sums the loads."""
        self.count[PHASE] = 1
        self.clock[STEP] = self.clock[CYCLE] = self.clock[LEFT] = 0.0

    def held_grains(self) -> np.ndarray:
        """Grains in tables of components, such as those in contact with walls."""
        found = [
            row[: self._used(group)]
            for group, key, array, each in self._saved()
            if group in self.of_components
            for row, of in zip(np.atleast_2d(array), each.names, strict=False)
            if of == GRAINS
        ]
        return np.concatenate([*found, np.zeros(0, np.uint32)])

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
        other.of_components = {name: copied(group) for name, group in self.of_components.items()}
        for name in SINGLE:
            array = getattr(self, name)
            setattr(other, name, next(copies) if array.size else array)
        return other

    def take_settings(self, other: State) -> None:
        """Take over what another state has besides arrays."""
        self.fixed_box, self.uniform_contacts = other.fixed_box, other.uniform_contacts
        vars(self.grains).update(vars(other.grains) | {"arrays": self.grains.arrays})

    def arrays(self) -> list[np.ndarray]:
        """All arrays of the state."""
        return [*chain.from_iterable(self.in_groups()), *OTHERS(self)]

    def _saved(self) -> list[tuple[str, str, np.ndarray, Array]]:
        """Group and name of each array of a group that a checkpoint has, the array and its declaration."""
        groups = zip(self.group_names(), self.in_groups(), strict=True)
        return [
            (name, key, getattr(group, key), each)
            for name, group in groups
            for key, each in saved_in(group).items()
            if name != "bodies" or self.bodies.mass.size
        ]

    def _used(self, name: str) -> int:
        """Columns in use of the table of a group; 0 without a table."""
        if name in ("contacts", "pair_list"):
            return int(self.count[CONTACTS if name == "contacts" else PAIRS])
        return int(self.of_components[name].used[0]) if hasattr(self.of_components.get(name), "used") else 0

    def _columns(self, name: str, each: Array) -> int | None:
        """Number of columns in a checkpoint of an array of a group; None for all."""
        if each.fewer == 1 and self.uniform_contacts:
            return 1
        return {USED: self._used(name), SIDES: 2 * self._used(name)}.get(str(each.shape[-1]))

    def grow(self, name: str, minimum: int = 0) -> None:
        """Allocate more columns, at least `minimum`, in the table of contacts, candidate pairs or a component."""
        groups = self.of_components if name in self.of_components else vars(self)
        declared = arrays_of(groups[name])
        uniform = [key for key, each in declared.items() if each.fewer == 1 and self.uniform_contacts]
        groups[name] = grown(groups[name], minimum, uniform)

    def grow_of_components(self) -> None:
        """Allocate more columns in the tables of components, one of which is full."""
        for name, group in tuple(self.of_components.items()):
            if hasattr(group, "used"):
                self.grow(name)

    def grow_rows(self) -> None:
        """Allocate a longer Verlet list; its content is discarded."""
        capacity = int(GROWTH * self.long_range.neighbour.size) + 1
        self.long_range = all_aligned(self.long_range._replace(neighbour=np.zeros(capacity, np.uint32)))

    def sums(self) -> list[np.ndarray]:
        """Arrays of sums over time since the start: all losses, and those of contacts and components."""
        groups = (self.contacts, *self.of_components.values())
        summed = (getattr(g, name) for g in groups for name, each in arrays_of(g).items() if each.summed)
        return [self.lost, *summed]

    def forget_sums(self) -> None:
        """Set losses, and the other sums over time, to 0."""
        for array in self.sums():
            array[:] = 0.0

    def reorder(self, rows: np.ndarray, new_index: np.ndarray) -> None:
        """Permute the grains: grain k becomes the former grain rows[k], and the former grain i is new_index[i]."""
        for group in self.in_groups():
            reorder_group(group, rows, new_index)
        for index in (GRAIN1, GRAIN2):
            if self.count[index] >= 0:
                self.count[index] = new_index[self.count[index]]

    def to_arrays(self) -> dict[str, np.ndarray]:
        """All arrays of the state by name, for a checkpoint; unused columns are omitted."""
        out = {"clock": self.clock, "count": self.count, "lost": self.lost, "cutoff": self.cutoff}
        out |= {f"{name}/{key}": array[..., : self._columns(name, each)] for name, key, array, each in self._saved()}
        return out | ({"order": self.order} if self.order.size else {})

    def from_arrays(self, saved: dict[str, np.ndarray]) -> None:
        """Load the arrays of `to_arrays`.  The number of grains and their materials must be those of this state.

        Raises
        ------
        BadInput
            If an array is missing or has another shape.
        """
        if "clock" in saved and LEAST_CLOCK <= saved["clock"].size < len(CLOCK):
            known = np.pad(saved["clock"], (0, max(CHANGED - saved["clock"].size, 0)))
            saved = saved | {"clock": np.append(known, np.full(len(CLOCK) - known.size, known[TIME]))}
        for name in ("clock", "count", "lost", "cutoff"):
            _copy_into(getattr(self, name), saved, name)
        if "order" in saved:
            self.order = np.zeros(len(self.grains), np.uint32)
            _copy_into(self.order, saved, "order")
        self._enlarge_tables(saved)
        for name, key, array, each in self._saved():
            self._load(array, saved, f"{name}/{key}", each)

    def _enlarge_tables(self, saved: Mapping[str, np.ndarray]) -> None:
        """Take over the columns in use of the tables of components, and enlarge tables that are too small."""
        for name, group in zip(self.group_names(), self.in_groups(), strict=True):
            table = table_in(group)
            if name in self.of_components and f"{name}/{table}" in saved:  # `_load` says if it is missing
                group.used[0] = saved[f"{name}/{table}"].shape[-1]
            if table and getattr(group, table).shape[-1] < self._used(name):
                self.grow(name, self._used(name))

    def _load(self, array: np.ndarray, saved: Mapping[str, np.ndarray], name: str, each: Array) -> None:
        """Load one array of a group, `name` as in a checkpoint."""
        group, found = name.split("/")[0], saved.get(name)
        if found is None and not each.required:  # of an earlier version
            array[...] = each.initial
        elif name.endswith("/damping") and not array.size:
            return
        elif name == "long_range/anchor" and found is not None and not found.size:
            return  # saved without a Verlet list: Engine.load_state builds one
        elif found is not None and each.fewer == 1 and self.uniform_contacts:  # one column is stored for all
            _copy_into(array, {name: np.repeat(found[..., :1], array.shape[-1], axis=-1)}, name)
        elif found is not None and found.shape[-1] == each.earlier:
            array[...] = each.initial
            _copy_into(array[..., : each.earlier], saved, name)
        else:
            _copy_into(array[..., : self._columns(group, each)], saved, name)


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


def _copy_into(target: np.ndarray, saved: Mapping[str, np.ndarray], name: str) -> None:
    """Copy the saved array `name` into `target`."""
    if name not in saved:
        raise BadInput(f"the saved state has no '{name}'")
    if saved[name].shape != target.shape:
        raise BadInput(f"'{name}' of the saved state has shape {saved[name].shape}, not {target.shape}")
    target[...] = saved[name]
