"""A part of a state: some grains with all their contacts, in a smaller state that an engine of its own advances."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..basics.arrays import SAVED_BODIES, SAVED_LONG_RANGE, ContactArrays, body_arrays, cluster_arrays
from ..basics.state import (
    BROKEN,
    CHECKED,
    COMPARED,
    CONTACT_STEP,
    CONTACT_STEPS,
    CONTACTS,
    CORRECTED,
    GRAIN1,
    GRAIN2,
    GRAINS_AWAKE,
    KICKED,
    LARGEST_LOAD,
    LATE,
    MADE,
    RESTED,
    SETTLED,
    SLIPPED,
    SOME_AWAKE,
    STEP_INCREASES,
    STEPS,
    TIME,
    WOKEN,
    State,
)
from ..contact.gather import resort_contacts_by_grain
from ..integrate.step_control import INCREASE_INTERVAL
from ..integrate.task_queue import uses_task_queue
from .changed_state import subset
from .engine import Engine
from .new_state import new_state

NOT_COPIED = ("pair", "constants", "every_step", "kept", "side", "start", "gather_order")
CONTACT_COLUMNS = tuple(name for name in ContactArrays._fields if name not in NOT_COPIED)
"""Arrays of contacts that a part needs and changes; pairs are numbered anew, the others follow."""
MOVING = ("position", "velocity", "orientation", "spin", "moment", "image")
"""Arrays of grains that change in a step."""
BODY_COLUMNS = (*SAVED_BODIES, "decay", "mode")
"""Arrays of bodies that a part with bodies needs and changes."""
EVENTS = (MADE, BROKEN, SLIPPED, WOKEN, RESTED, LATE)
"""Numbers of `State.count` that are added to those of all grains."""
MOST_ENGINES = 64
"""Engines of different numbers of grains that are kept: the table of an engine is slow to fill with other arrays."""


@dataclass
class Part:
    """Some grains of a state with all their contacts, and bodies, which an engine of its own advances.

    Attributes
    ----------
    prototype : Engine
        The engine from which those of the part are made, with forces between nearest images of all pairs.
    steps_are : int
        Number in `State.count` to which steps of the part are added.
    has_bodies : bool
        Whether grains of the part move as bodies.
    engine : Engine
        The engine of the grains that were taken last; there is one for each number of grains.
    index, columns : ndarray
        These grains, ascending, and the columns of their contacts in the state of all grains.
    """

    prototype: Engine
    steps_are: int
    has_bodies: bool = False
    engine: Engine = field(init=False)
    index: np.ndarray = field(init=False, default_factory=lambda: np.zeros(0, np.int64))
    columns: np.ndarray = field(init=False, default_factory=lambda: np.zeros(0, np.int64))
    _engines: dict[int, Engine] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        self.engine = self.prototype

    def __deepcopy__(self, memo: dict[int, Any]) -> Part:
        """A part like this whose engine has a table of its own."""
        return Part(copy.deepcopy(self.prototype, memo), self.steps_are, self.has_bodies)

    def anew(self) -> Part:
        """A part like this for other grains; it shares the threads of this one, as the two never step at once."""
        prototype = self.prototype.for_state(self.prototype.regular_state, with_threads=True)
        return Part(prototype, self.steps_are, self.has_bodies)

    @property
    def state(self) -> State:
        """The state of the part."""
        return self.engine.regular_state

    def take(self, state: State, index: np.ndarray, columns: np.ndarray) -> State:
        """Copy grains, with contacts as they are and everything else as at a start; returns the state of the part.

        Parameters
        ----------
        index : ndarray
            Grains, ascending.
        columns : ndarray
            Columns of all contacts between them.
        """
        self.index, self.columns = index, columns
        self.engine = self._engines.get(len(index)) or self._new_engine(state)
        own = self.state
        own.count[:], own.clock[:], own.lost[:] = 0, 0.0, 0.0
        for name, array in own.grains.arrays._asdict().items():
            getattr(state.grains.arrays, name).take(index, axis=-1, out=array)
        self._copy_contacts(state, own)
        if self.has_bodies:
            _copy(BODY_COLUMNS, state.bodies, index, own.bodies, slice(None))
            own.bodies.first[:] = np.searchsorted(index, own.bodies.first)
        state.give_component_arrays(own, index, np.arange(len(index)))
        self.engine.content.heavy[:] = np.searchsorted(index, self.prototype.content.heavy)
        own.count[COMPARED] = -1
        own.count[CHECKED] = own.count[STEP_INCREASES] = -INCREASE_INTERVAL
        # the kicks of the gas are counted with the steps of grains, so that no random number is used twice
        own.count[CONTACT_STEPS] = state.count[CONTACT_STEPS]
        own.clock[TIME] = own.clock[KICKED] = state.time
        own.clock[SETTLED] = state.clock[SETTLED]
        own.clock[CONTACT_STEP] = math.inf
        for name in SAVED_LONG_RANGE:
            getattr(own.long_range, name)[...] = math.inf if name == "anchor" else 0.0
        own.pair_list.anchor[...] = math.inf
        resort_contacts_by_grain.run(self.engine.table_of(own))
        return own

    def give_back(self, state: State) -> bool:
        """Copy what has moved back to the state of all grains, with counts and losses.

        Returns
        -------
        bool
            Whether contacts have formed or broken; then `columns` are others.
        """
        own = self.state
        _copy(MOVING, own.grains.arrays, slice(None), state.grains.arrays, self.index)
        changed = bool(own.count[MADE] + own.count[BROKEN])
        self.columns = self._changed_contacts(state, own) if changed else self._same_contacts(state, own)
        if self.has_bodies:
            _copy(BODY_COLUMNS, own.bodies, slice(None), state.bodies, self.index)
            state.bodies.first[self.index] = self.index[own.bodies.first]
        own.give_component_arrays(state, np.arange(len(self.index)), self.index)
        self._count(state, own)
        return changed

    def name_limiting(self, state: State) -> None:
        """Name the grains that caused the last stop of the engine in the state of all grains."""
        for grain in (GRAIN1, GRAIN2):
            number = int(self.state.count[grain])
            state.count[grain] = self.index[number] if 0 <= number < len(self.index) else -1

    def _new_engine(self, state: State) -> Engine:
        """An engine for these grains, which is kept for others of the same number; there are at most `MOST_ENGINES`."""
        given, count = self.prototype, len(self.index)
        grains, capacity = subset(state.grains, self.index), len(self.columns)
        made = new_state(grains, state.box, given.parameters, given.content, capacity, over_all_pairs=True)
        made.uniform_contacts = state.uniform_contacts
        if self.has_bodies:
            made.bodies = body_arrays(count, in_gas=bool(state.bodies.decay.size))
        else:
            made.clusters = cluster_arrays(count)
        state.give_component_arrays(made, self.index, np.arange(count))
        # few grains, and bodies, share no work between threads
        engine = given.for_state(made, with_threads=uses_task_queue(count) and not self.has_bodies)
        engine.content = given.content.for_part(count)
        if len(self._engines) == MOST_ENGINES:
            self._engines.clear()
        self._engines[count] = engine
        return engine

    def _copy_contacts(self, state: State, own: State) -> None:
        """Copy the contacts to the state of the part."""
        used, contacts = len(self.columns), state.contacts
        if own.contacts.pair.shape[1] < used:
            own.grow("contacts", used)
        own.contacts.pair[:, :used] = np.searchsorted(self.index, contacts.pair[:, self.columns])
        _copy(CONTACT_COLUMNS, contacts, self.columns, own.contacts, slice(used))
        if state.uniform_contacts:
            own.contacts.constants[...] = contacts.constants
        else:
            own.contacts.constants[:, :used] = contacts.constants[:, self.columns]
        own.contacts.every_step[:] = 0
        own.contacts.kept[:] = 0.0  # displacements of another step, before the clusters moved as rigid bodies
        own.count[CONTACTS] = used

    def _same_contacts(self, state: State, own: State) -> np.ndarray:
        """Copy contacts back, none of which has formed or broken; returns their columns."""
        _copy(CONTACT_COLUMNS, own.contacts, slice(int(own.count[CONTACTS])), state.contacts, self.columns)
        return self.columns

    def _changed_contacts(self, state: State, own: State) -> np.ndarray:
        """Copy contacts back behind those of all other grains; returns their columns."""
        used = int(own.count[CONTACTS])
        kept = np.setdiff1d(np.arange(state.count[CONTACTS]), self.columns)
        first, end = len(kept), len(kept) + used
        if state.contacts.pair.shape[1] < end:
            state.grow("contacts", end)
        contacts, pairs = state.contacts, self.index[own.contacts.pair[:, :used]]
        for name in ("pair", *CONTACT_COLUMNS, "constants"):
            array = getattr(contacts, name)
            if not array.shape[-1]:
                continue
            if name == "constants" and state.uniform_contacts:
                array[...] = own.contacts.constants
                continue
            array[..., :first] = array[..., kept]
            array[..., first:end] = pairs if name == "pair" else getattr(own.contacts, name)[..., :used]
        state.count[CONTACTS] = end
        state.pair_list.anchor[...] = math.inf  # the list of candidates says which pairs are in contact
        resort_contacts_by_grain(state.grains.arrays, contacts, state.count)
        return np.arange(first, end)

    def _count(self, state: State, own: State) -> None:
        """Add what the part has counted and lost to the numbers of all grains."""
        for number in EVENTS:
            state.count[number] += own.count[number]
        state.count[CONTACT_STEPS] = own.count[CONTACT_STEPS]
        state.count[self.steps_are] += own.count[STEPS]
        state.lost += own.lost
        state.clock[SETTLED] = own.clock[SETTLED]
        state.clock[SOME_AWAKE] += own.clock[SOME_AWAKE]
        state.clock[GRAINS_AWAKE] += own.clock[GRAINS_AWAKE] * len(self.index) / len(state.grains)
        state.clock[CORRECTED] += own.clock[CORRECTED]
        state.clock[LARGEST_LOAD] = max(state.clock[LARGEST_LOAD], own.clock[LARGEST_LOAD])
        state.take_extremes(own)


def _copy(names: Sequence[str], source: Any, taken: Any, target: Any, given: Any) -> None:
    """Copy columns of the arrays with these names that are not empty, to columns of a target."""
    for name in names:
        if getattr(target, name).shape[-1]:
            getattr(target, name)[..., given] = getattr(source, name)[..., taken]
