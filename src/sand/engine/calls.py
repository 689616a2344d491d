"""What calls of the stages of a simulation need: a table of its parts, a program, a task queue and threads."""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence

import numpy as np

from ..basics.state import CONTACTS, State
from ..basics.threads import cores, threads
from ..compiler.ahead import compile_ahead
from ..compiler.program import Program
from ..compiler.stage import Stage
from ..compiler.table import Table
from ..integrate.parts import PARTS, SCRATCH, StepParameters, Stop
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

ALONE = 2000
"""Grains from which on several threads take the shorter step to a time of output."""


def _arrays(state: State) -> tuple:
    """The arrays of a state that stages take."""
    return *state.in_groups(), state.clock, state.count, state.lost


def _names(state: State) -> tuple[str, ...]:
    """The parts of a table that these are."""
    return *state.group_names(), "clock", "count", "lost"


def _set_arrays(table: Table, state: State, present: tuple) -> None:
    """Give a table the arrays of a state."""
    for name, value in zip(_names(state), present, strict=True):
        table.set(name, value)


class Calls:
    """Tables, program, task queue and threads of one engine; results do not depend on any of them.

    Parameters
    ----------
    parameters : StepParameters
        Settings of the run, as the stages take them.
    state : State
        A state of the engine.

    Attributes
    ----------
    table : Table
        The parts of the simulation, with the arrays of the regular state.
    program : Program or None
        The stages; None: it is made before the next step.
    workers : WorkerThreads or None
        Threads that share loops, if these are long.
    compiles_ahead : bool
        Whether the first call compiles what the run needs side by side; not in engines of parts.
    """

    def __init__(self, parameters: StepParameters, state: State):
        names = *PARTS, *state.of_components
        self.table, self._copy_table = Table(names), Table(names)
        for name, value in parameters._asdict().items():
            self.table.set(name, value)
        self.table.set("scratch", np.zeros(SCRATCH))
        self.program: Program | None = None
        self.workers = WorkerThreads(take_blocks) if uses_task_queue(len(state.grains)) else None
        self.compiles_ahead = True
        self._arrays: tuple = (None,)  # of the state that the table has
        self._copy_arrays: tuple = (None,)  # of the copy that is stepped to times of output
        self._queue: TaskQueue | None = None  # of the last call of the driver
        self._queue_size = (0, 0)  # grains and contacts that it is for

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

    def for_call(self, state: State, until: float, last: float, shorten: bool) -> Table:
        """The table for one call of the driver."""
        table, queue = self.table_of(state), self._task_queue(len(state.grains), state.contacts.flag.size)
        for name, value in (("queue", queue), ("until", float(until)), ("last", int(last)), ("shorten", shorten)):
            table.set(name, value)
        return table

    def _task_queue(self, grains: int, contacts: int) -> TaskQueue:
        """An empty task queue for one call of the driver: the last one, if no other thread has seen it.

        A thread that starts late could otherwise take blocks of the next call.
        """
        alone = self.workers is None or not self.workers.have_started
        if self._queue is not None and self._queue_size == (grains, contacts) and alone:
            self._queue.words[:] = 0
            self._queue.words[SHARED] = uses_task_queue(grains)
        else:
            self._queue, self._queue_size = new_task_queue(grains, contacts), (grains, contacts)
        return self._queue

    def program_for(self, table: Table, content: ProgramContent, parameters: StepParameters) -> Program:
        """The program, made for the present parameters if there is none."""
        if self.program is None:
            self.program = build_program(content, parameters, table)
        for each in (self.table, table):
            each.set("program", self.program)
        return self.program

    def run(self, driver: Stage, table: Table, state: State, pair_forces: int, stages: Callable[[], Sequence]) -> Stop:
        """Call a driver with the table of `for_call` and the present program.

        Parameters
        ----------
        pair_forces : int
            Number of long-range forces.
        stages : callable
            All stages that a run may call, each with table and parameters.
        """
        try:
            if self.compiles_ahead:
                self.compiles_ahead = False
                compile_ahead(stages(), min(cores(), threads()))
            alone = table["shorten"] and len(state.grains) < ALONE  # threads start later than one step ends
            if (
                not alone
                and self.workers is not None
                and benefits_from_workers(pair_forces, int(state.count[CONTACTS]))
            ):
                self.workers.start(table)
            assert self.program is not None
            return Stop(self.program.run(driver, table))
        except BaseException:  # Ctrl-C while it compiles, an error in a user's formula
            release_workers(table["queue"])
            raise
