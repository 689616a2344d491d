"""A part of a state: some grains with all their contacts, in a smaller state that an engine of its own advances."""

from __future__ import annotations

import copy
import math
import weakref
from collections.abc import Sequence
from dataclasses import dataclass, field
from operator import is_
from typing import Any, NamedTuple

import numpy as np

from ..basics.array_groups import copy_group, resized
from ..basics.arrays import SAVED_BODIES, ContactArrays, body_arrays, cluster_arrays
from ..basics.grains import GrainArrays, Grains
from ..basics.state import BROKEN, CELL, CONTACT_STEPS, CONTACTS, GRAIN1, GRAIN2, MADE, SETTLED, State
from ..compiler.table import Table
from ..contact.gather import resort_contacts_by_grain
from ..integrate.part_copies import ColumnCopies, add_sums_of_part, array_pairs, begin_part, copy_columns
from ..integrate.task_queue import uses_task_queue
from .changed_state import subset
from .engine import Engine
from .new_state import new_state

NOT_COPIED = ("constants", "every_step", "kept", "side", "start", "gather_order")
CONTACT_COLUMNS = tuple(name for name in ContactArrays._fields if name not in NOT_COPIED)
"""Arrays of contacts that a part needs and changes; constants only if they are not uniform, the others follow."""
MOVING = ("position", "velocity", "orientation", "spin", "moment", "image")
"""Arrays of grains that change in a step."""
BODY_COLUMNS = (*SAVED_BODIES, "decay", "mode")
"""Arrays of bodies that a part with bodies needs and changes."""
INDICES = ("pair", "first")
"""Those of these arrays that have indices of grains."""
MOST_ENGINES = 64
"""Engines of different numbers of grains that are kept: the table of an engine is slow to fill with other arrays."""


class Copies(NamedTuple):
    """Copies of grains and their contacts to a part, and back."""

    arrays: tuple[
        weakref.ref[np.ndarray], ...
    ]  # the first and the last array of each group, of all grains and the part
    of: tuple[np.ndarray, np.ndarray]  # the grains, and the columns of contacts
    take: ColumnCopies
    give: ColumnCopies


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
    _pairs: dict[int, Any] = field(init=False, default_factory=dict)  # of arrays that are copied, by number of grains
    _moved: tuple[Any, Any] = field(init=False, default=((), None))  # contacts, and pairs of each array with itself
    _copies: Copies | None = field(init=False, default=None)
    _start: np.ndarray = field(init=False, default_factory=lambda: np.zeros(4))  # numbers of `begin_part`
    _numbers: np.ndarray = field(init=False, default_factory=lambda: np.zeros(2))  # and of `add_sums_of_part`

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
        if index is not self.index or self.engine is self.prototype:
            self.index, self.engine = (
                index,
                self._engines.get(len(index)) or self._new_engine(state, index, len(columns)),
            )
            self.engine.content.heavy[:] = np.searchsorted(index, self.prototype.content.heavy)
            self._numbers[:] = self.steps_are, len(index) / len(state.grains)
        self.columns, own = columns, self.state
        if own.contacts.pair.shape[1] < len(columns):
            own.grow("contacts", len(columns))
        table = self.engine.table_of(own)
        copy_columns.run(table, self._copies_of(state, own).take)
        if state.uniform_contacts:
            own.contacts.constants[...] = state.contacts.constants
        self._give_component_arrays(state, own, index, np.arange(len(index)))
        self._start[:] = state.time, state.clock[SETTLED], state.count[CONTACT_STEPS], len(columns)
        begin_part.run(table, (self._start,))
        return own

    def give_back(self, engine: Engine) -> bool:
        """Copy what has moved back to the state of all grains, that of their engine, with counts and losses.

        Returns
        -------
        bool
            Whether contacts have formed or broken; then `columns` are others.
        """
        state, own = engine.regular_state, self.state
        changed = bool(own.count[MADE] + own.count[BROKEN])
        table = engine.table_of(state)
        if changed:
            self.columns = self._make_room(state, table, int(own.count[CONTACTS]))
            if state.uniform_contacts:
                state.contacts.constants[...] = own.contacts.constants
        copy_columns.run(table, self._copies_of(state, own).give)
        self._give_component_arrays(own, state, np.arange(len(self.index)), self.index, but=CELL)
        if changed:
            resort_contacts_by_grain.run(engine.table_of(state))
        add_sums_of_part.run(table, (own.clock, own.count, own.lost, self._numbers))
        return changed

    def name_limiting(self, state: State) -> None:
        """Name the grains that caused the last stop of the engine in the state of all grains."""
        for grain in (GRAIN1, GRAIN2):
            number = int(self.state.count[grain])
            state.count[grain] = self.index[number] if 0 <= number < len(self.index) else -1

    def _new_engine(self, state: State, index: np.ndarray, contacts: int) -> Engine:
        """An engine for these grains, which is kept for others of the same number; there are at most `MOST_ENGINES`."""
        engine = engine_of_part(
            self.prototype, subset(state.grains, index), state, contacts, has_bodies=self.has_bodies
        )
        if len(self._engines) == MOST_ENGINES:
            self._engines.clear()
            self._pairs.clear()
        self._engines[len(index)] = engine
        return engine

    def _give_component_arrays(
        self, source: State, target: State, own: np.ndarray, theirs: np.ndarray, but: str = ""
    ) -> None:
        """Copy the groups of the components that act in the part (`Component.in_parts`), without one of them."""
        for name in self.prototype.stored_state.of_components.keys() - {but}:
            target.of_components[name] = copy_group(source.of_components[name], target.of_components[name], own, theirs)

    def _copies_of(self, state: State, own: State) -> Copies:
        """What copies the grains and contacts to the part, and back."""
        groups = state.grains.arrays, state.contacts, state.bodies, own.grains.arrays, own.contacts, own.bodies
        arrays = [array for group in groups for array in (group[0], group[-1])]
        of = self.index, self.columns
        if self._copies is None or not (all(map(is_, of, self._copies.of)) and are_those(arrays, self._copies.arrays)):
            here, contacts = np.arange(len(self.index)), np.arange(len(self.columns))
            known, taken, given = self._pairs.get(len(here), ((), None, None))
            if not are_those(arrays, known):
                known, (taken, given) = references(arrays), map(np.array, self._array_pairs(state, own))
                self._pairs[len(here)] = known, taken, given
            number = np.zeros(len(state.grains), np.int64)
            number[self.index] = here
            there, of_contacts = np.array([self.index, here]), np.array([self.columns, contacts])
            give = ColumnCopies(given, there[::-1].copy(), of_contacts[::-1].copy(), self.index)
            self._copies = Copies(known, of, ColumnCopies(taken, there, of_contacts, number), give)
        return self._copies

    def _array_pairs(self, state: State, own: State) -> tuple[list[list[int]], list[list[int]]]:
        """Pairs of arrays that are copied to the part, and back."""

        def pairs(one: State, other: State, grains: Sequence[str]) -> list[list[int]]:
            names = contact_columns(state)
            found = [
                *array_pairs(one.grains.arrays, other.grains.arrays, grains),
                *array_pairs(one.contacts, other.contacts, names, INDICES),
            ]
            of_bodies = BODY_COLUMNS if self.has_bodies else ()
            return [*found, *array_pairs(one.bodies, other.bodies, of_bodies, INDICES)]

        return pairs(state, own, GrainArrays._fields), pairs(own, state, MOVING)

    def _make_room(self, state: State, table: Table, used: int) -> np.ndarray:
        """Move the contacts of all other grains to the first columns; returns `used` columns behind them."""
        kept = np.setdiff1d(np.arange(state.count[CONTACTS]), self.columns)
        first, end = len(kept), len(kept) + used
        if state.contacts.pair.shape[1] < end:
            state.grow("contacts", end)
        if first > 0 and kept[-1] >= first:
            if not are_those([state.contacts.pair], self._moved[0]):
                pairs = array_pairs(state.contacts, state.contacts, contact_columns(state))
                self._moved = references([state.contacts.pair]), np.array([*pairs])
            columns = np.array([kept, np.arange(first)])
            copy_columns.run(table, ColumnCopies(self._moved[1], columns, columns, kept))
        state.count[CONTACTS] = end
        state.pair_list.anchor[...] = math.inf  # the list of candidates says which pairs are in contact
        return np.arange(first, end)


def engine_of_part(given: Engine, grains: Grains, state: State, contacts: int, *, has_bodies: bool = False) -> Engine:
    """An engine with the settings of another one, for grains of its state, or like these, and so many contacts."""
    count = len(grains)
    made = new_state(grains, state.box, given.parameters, given.content, contacts, over_all_pairs=True)
    made.uniform_contacts = state.uniform_contacts
    if has_bodies:
        made.bodies = body_arrays(count, in_gas=bool(state.bodies.decay.size))
    else:
        made.clusters = cluster_arrays(count)
    for name in given.stored_state.of_components:
        made.of_components[name] = resized(state.of_components[name], count)
    # few grains, and bodies, share no work between threads
    engine = given.for_state(made, with_threads=uses_task_queue(count) and not has_bodies)
    engine.content = given.content.for_part(count)
    return engine


def references(arrays: Sequence[np.ndarray]) -> tuple[weakref.ref[np.ndarray], ...]:
    """Weak references: the memory of a state that is no longer used is free."""
    return tuple(map(weakref.ref, arrays))


def are_those(arrays: Sequence[np.ndarray], known: Sequence[weakref.ref[np.ndarray]]) -> bool:
    """Whether references are to these arrays."""
    return len(known) == len(arrays) and all(each() is array for each, array in zip(known, arrays, strict=True))


def contact_columns(state: State) -> tuple[str, ...]:
    """Arrays of contacts that are copied."""
    return CONTACT_COLUMNS if state.uniform_contacts else (*CONTACT_COLUMNS, "constants")
