"""A state and the compiled stages that act on it: parameters, table of parts, program, task queue and threads."""

from __future__ import annotations

import contextlib
import operator
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..basics.arrays import OVER_ALLOCATION
from ..basics.box import Span
from ..basics.state import CONTACTS, PAIRS, State
from ..basics.threads import cores, threads
from ..compiler.ahead import compile_ahead
from ..compiler.program import Program
from ..compiler.stage import PythonStage, Stage
from ..compiler.table import Table
from ..contact.law import ContactLaw
from ..forces.base import ExternalForce, LongRangeForce
from ..forces.pair.long_range_loops import LongRangeSums
from ..integrate.parts import HEAVY, PARTS, SCRATCH, StepParameters, Stop
from ..integrate.stage_list import ProgramContent, build_program
from ..integrate.task_queue import (
    SHARED,
    TaskQueue,
    benefits_from_workers,
    new_task_queue,
    release_workers,
    take_blocks,
    uses_task_queue,
)
from ..integrate.worker_threads import WorkerThreads
from ..neighbours.spatial_sort import inverse, reorder_grains

LongRangeLoops = Sequence[tuple[LongRangeForce, LongRangeSums, Any]]
"""Long-range forces with their loops and numbers."""
ALONE = 2000
"""Grains from which on several threads take the shorter step to a time of output."""


def _arrays(state: State) -> tuple:
    """The arrays of a state that stages take."""
    return *state.in_groups(), state.clock, state.count, state.lost


def _names(state: State) -> tuple[str, ...]:
    """The parts of a table that these are."""
    return *state.group_names(), "clock", "count", "lost"


def _set_arrays(table: Table, state: State, present: tuple) -> None:
    """Give a table the arrays of a state, and its box if that is deformed."""
    for name, value in zip(_names(state), present, strict=True):
        table.set(name, value)
    if state.cell is not None and not isinstance(table["span"], Span):
        table.share("span", state.cell.span)


@dataclass
class CompiledState:
    """A state and the compiled stages that act on it; results depend on neither table, program nor threads.

    Attributes
    ----------
    stored_state : State
        The regular state in the present order of its arrays.
    parameters : StepParameters
        Settings of the run, as the stages take them.
    content : ProgramContent
        What the program is made of.
    external : Sequence[ExternalForce]
        Per-grain forces.
    long_range : LongRangeLoops
        Long-range forces that act on at least one grain.
    table : Table
        The parts of the simulation, with the arrays of the regular state.
    program : Program or None
        The stages; None: it is made before the next step.
    workers : WorkerThreads or None
        Threads that share loops, if these are long.
    compiles_ahead : bool
        Whether the first call compiles what the run needs side by side; not in engines of parts.
    """

    stored_state: State
    parameters: StepParameters
    content: ProgramContent
    external: Sequence[ExternalForce]
    long_range: LongRangeLoops
    table: Table = field(init=False)
    program: Program | None = field(init=False, default=None)
    workers: WorkerThreads | None = field(init=False, default=None)
    compiles_ahead: bool = field(init=False, default=True)
    _is_sorted: bool = field(init=False, default=False)  # are the arrays in Morton order now?
    _copy_table: Table = field(init=False)  # of the copy that is stepped to times of output
    _arrays: tuple = field(init=False, default=(None,))  # of the state that the table has
    _copy_arrays: tuple = field(init=False, default=(None,))  # of the copy
    _memory: dict[str, Any] = field(init=False, default_factory=dict)  # arrays that measurements use again
    _queue: TaskQueue | None = field(init=False, default=None)  # of the last call of the driver
    _queue_size: tuple[int, int] = field(init=False, default=(0, 0))  # grains and contacts that it is for

    def __post_init__(self) -> None:
        names = *PARTS, *self.stored_state.of_components
        self.table, self._copy_table = Table(names), Table(names)
        for name, value in self.parameters._asdict().items():
            self.table.set(name, value)
        self.table.set("scratch", np.zeros(SCRATCH))
        if uses_task_queue(len(self.stored_state.grains)):
            self.workers = WorkerThreads(take_blocks)

    @property
    def regular_state(self) -> State:
        """The state after the last regular step, from which the run continues; grains in the user's order."""
        self.restore_user_order()
        return self.stored_state

    @regular_state.setter
    def regular_state(self, other: State) -> None:
        """Continue from another state, in the user's order, with the next step."""
        self.stored_state, self._is_sorted = other, False

    @property
    def state(self) -> State:
        """The state that is measured."""
        return self.regular_state

    def restore_user_order(self) -> None:
        """Undo the spatial sorting of the arrays, until the next step."""
        if self._is_sorted:
            reorder_grains(self.stored_state, inverse(self.stored_state.order))
            self._is_sorted = False

    @property
    def law(self) -> ContactLaw:
        """The contact law."""
        return self.content.law

    def table_of(self, state: State) -> Table:
        """The table with the present arrays of the state."""
        present = _arrays(state)
        if all(map(operator.is_, present, self._copy_arrays)):
            return self._copy_table
        if not all(map(operator.is_, present, self._arrays)):
            _set_arrays(self.table, state, present)
            self._arrays = present
        return self.table

    def take_copy(self, state: State, copied: State, has_same_arrays: bool) -> None:
        """Prepare a table for a copy of a state; `has_same_arrays`: those of the copy before."""
        self._copy_table.follow(self.table_of(state), _names(copied) if has_same_arrays else ())
        self._copy_arrays = _arrays(copied)
        _set_arrays(self._copy_table, copied, self._copy_arrays)

    def table_for_call(self, until: float = np.inf, last: float = 1, *, shorten: bool = False) -> Table:
        """The table as for a call of the driver, with all parts that stages take."""
        state, table = self.stored_state, self.table_of(self.stored_state)
        queue = self._task_queue(len(state.grains), state.contacts.flag.size)
        for name, value in (("queue", queue), ("until", float(until)), ("last", int(last)), ("shorten", shorten)):
            table.set(name, value)
        return table

    def _task_queue(self, grains: int, contacts: int) -> TaskQueue:
        """An empty task queue for one call of the driver: the last one, if no other thread has seen it.

        A thread that starts late could otherwise take blocks of the next call.
        """
        alone = self.workers is None or not self.workers.have_started
        if self._queue is not None and self._queue_size == (grains, contacts) and alone:
            if uses_task_queue(grains):
                self._queue.words[:] = 0
                self._queue.words[SHARED] = 1
        else:
            self._queue, self._queue_size = new_task_queue(grains, contacts), (grains, contacts)
        return self._queue

    def program_for(self, table: Table) -> Program:
        """The program, made for the present parameters if there is none."""
        if self.program is None:
            self.program = build_program(self.content, self.parameters, table)
        for each in (self.table, table):
            each.set("program", self.program)
        return self.program

    def stages(self, table: Table) -> list[tuple[Table, Stage | PythonStage, Any]]:
        """All stages that a run may call, each with a table of parts, by default this one, and its parameters."""
        return [(table, each, own) for each, own in self.program_for(table).stages.values()]

    def run_driver(self, driver: Stage, until: float, last: float, shorten: bool = False) -> Stop:
        """Run a driver with the stages of the simulation, in the present order of the arrays.

        Arrays that overflow are enlarged; returns why it stops otherwise.
        """
        state = self.stored_state
        while True:
            stop = self._call_driver(driver, self.table_for_call(until, last, shorten=shorten))
            if stop is Stop.CONTACTS_FULL:
                state.grow("contacts")
            elif stop is Stop.TABLES_FULL:
                state.grow_of_components()
            elif stop is Stop.PAIRS_FULL:
                found, state.count[PAIRS] = int(state.count[PAIRS]), 0  # the list is incomplete
                state.grow("pair_list", int(OVER_ALLOCATION * found))
            elif stop is Stop.LIST_FULL:
                state.grow_rows()
            else:
                return stop

    def _call_driver(self, driver: Stage, table: Table) -> Stop:
        """One call of a driver, with the table of `table_for_call`."""
        state, workers = self.stored_state, self.workers
        try:
            if self.compiles_ahead:
                self.compiles_ahead = False
                compile_ahead(self.stages(table), min(cores(), threads()))
            alone = table["shorten"] and len(state.grains) < ALONE  # threads start later than one step ends
            loops = len(self.content.pair_forces), int(state.count[CONTACTS])
            program = self.program_for(table)  # which the threads take from the table
            if workers is not None and not alone and benefits_from_workers(*loops):
                workers.start(table)
            return Stop(program.run(driver, table))
        except BaseException:  # Ctrl-C while it compiles, an error in a user's formula
            release_workers(table["queue"])
            raise

    def set_parameters(self, **changes: Any) -> None:
        """Replace parameters of steps, by name, from the next step on."""
        self.parameters = self.parameters._replace(**changes)
        for name, value in changes.items():
            self.table.set(name, value)
        self.program = None

    def set_forces(self, long_range: LongRangeLoops, external: Sequence[ExternalForce]) -> None:
        """Use other numbers of the same forces from the next step on; loads and contacts stay as they are."""
        self.long_range, self.external = long_range, external
        self.content = self.content._replace(
            pair_forces=[own[1:] for own in long_range],
            external_forces=[(force.formula, force.numbers()) for force in external],
        )
        self.program = None

    def memory_for(self, measurement: str, make: Callable[[int], Any]) -> Any:
        """Memory for a measurement, which `make` makes for a number of grains when it is first needed."""
        if measurement not in self._memory:
            self._memory[measurement] = make(len(self.stored_state.grains))
        return self._memory[measurement]

    @contextlib.contextmanager
    def heavy_grains(self, state: State) -> Iterator[None]:
        """While constants of contacts are computed, some grains have a mass that counts as infinite."""
        index, arrays = self.content.heavy, state.grains.arrays
        for quantity in (arrays.mass, arrays.inertia):
            quantity[index] *= HEAVY
        try:
            yield
        finally:
            for quantity in (arrays.mass, arrays.inertia):
                quantity[index] /= HEAVY
