"""A world and the compiled code that moves it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..contact.events import add_initial_contacts
from ..contact.gather import resort_contacts_by_grain
from ..forces.base import ExternalForce, LongRangeForce
from ..forces.external.loops import external_energies_for
from ..forces.pair.loops import long_range_energies_for
from ..integrate.adaptive import Adaptive
from ..integrate.adaptive_driver import adaptive_driver_for
from ..integrate.driver import driver_for
from ..integrate.kernel_spec import KernelSpec, StepParameters, Stop
from ..integrate.step_control import INCREASE_INTERVAL
from ..integrate.task_queue import benefits_from_workers, new_task_queue, release_workers, worker_loops
from ..integrate.verlet import Verlet
from ..integrate.worker_threads import WorkerThreads
from ..neighbours.cell_list import FULL, rebuild_verlet_list
from ..neighbours.settings import Neighbours
from ..neighbours.spatial_sort import SORT_INTERVAL, inverse, reorder_grains, sort_contacts_and_pairs, spatial_order
from ..state.arrays import OVER_ALLOCATION
from ..state.state import (
    CHECKED,
    CONTACT_STEP,
    CONTACTS,
    GRAIN1,
    GRAIN2,
    LONG_RANGE_SUMS,
    MADE,
    ORDERED,
    PAIRS,
    SLIPPED,
    STAGE,
    STEP_INCREASES,
    STEPS,
    State,
)


@dataclass
class Engine:
    """A world and the compiled code that moves it.

    Attributes
    ----------
    world
        the state, its grains numbered as the user knows them.
    rules : Rules
        everything that does not change, as the kernels take it.
    warnings : list[str]
        what the forces had to say about these grains.
    far : Sequence[tuple[LongRangeForce, Any, Any]]
        the long-range forces that some grain feels, with their loops and numbers.
    outside : Sequence[ExternalForce]
        the per-grain forces.
    search : str
        how neighbours are found, in words.
    stepping : Verlet or Adaptive
        the integrator, with a number for everything that depends on the grains at the start.
    neighbours : Neighbours
        their settings, likewise, unless they are those of an earlier run.
    """

    _world: State
    rules: StepParameters
    warnings: list[str]
    external: Sequence[ExternalForce]
    long_range: Sequence[tuple[LongRangeForce, Any, Any]]
    search: str
    stepping: Verlet | Adaptive
    neighbours: Neighbours
    _plan: KernelSpec
    _away: bool = field(init=False, default=False)  # are grains at places of their own now?
    _advance: Callable = field(init=False)
    _hands: WorkerThreads | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        self._advance = adaptive_driver_for(self._plan) if self._plan.adaptive else driver_for(self._plan)
        if self._plan.queue:
            self._hands = WorkerThreads(worker_loops(self._plan)[1])

    @property
    def state(self) -> State:
        """The state, its grains numbered as the user knows them."""
        self.restore_user_order()
        return self._world

    @state.setter
    def state(self, other: State) -> None:
        self._world, self._away = other, False

    def restore_user_order(self) -> None:
        """Give every grain the number back that the user knows it by, until the next step is taken."""
        if self._away:
            reorder_grains(self._world, inverse(self._world.order))
            self._away = False

    @property
    def time(self) -> float:
        """[s]"""
        return self._world.time

    @property
    def steps(self) -> int:
        """Taken so far."""
        return self._world.steps

    def _sort_in_space(self) -> None:
        """Grains where steps are fast, if that is not where they are."""
        if not self._world.order.size or self.steps >= self._world.count[ORDERED] + SORT_INTERVAL:
            w = self.state
            w.order, w.count[ORDERED] = spatial_order(w), w.steps
            reorder_grains(w, w.order)
            sort_contacts_and_pairs(w)
            self._remake_list()
        elif not self._away:
            reorder_grains(self._world, self._world.order)
        self._away = True

    def advance(self, until: float, most_steps: float) -> Stop:
        """At least `most_steps` steps, or to `until` [s]; ends with a cycle of the long-range forces."""
        last = min(self.steps + most_steps, 2**62)
        if not self.neighbours.uses_spatial_sort(len(self._world.grains)):
            return self._drive(until, last)
        while True:
            if self.time < until and self.steps < last:
                self._sort_in_space()
            renewed = self._world.count[ORDERED] + SORT_INTERVAL
            stop = self._drive(until, min(last, renewed))
            if not (stop is Stop.STEPS_DONE and renewed <= self.steps < last):
                return stop

    def _drive(self, until: float, last: float) -> Stop:
        """On to a time [s] or a step, as the grains stand now."""
        w = self._world
        while True:
            stages = (w.stages,) if self._plan.adaptive else ()
            arrays = (w.grains.arrays, w.contacts, w.pair_list, w.long_range, *stages, w.clock, w.count, w.lost)
            rules = self._rules_with_crew()
            try:
                stop = Stop(self._advance(*arrays, rules, float(until), int(last)))
            except BaseException:  # Ctrl-C while it compiles, an error in a user's formula
                if self._hands is not None:
                    release_workers(rules.queue)
                raise
            if stop is Stop.CONTACTS_FULL:
                w.grow_contacts()
            elif stop is Stop.PAIRS_FULL:
                found, w.count[PAIRS] = int(w.count[PAIRS]), 0  # none of the list holds
                w.grow_pairs(int(OVER_ALLOCATION * found))
            elif stop is Stop.LIST_FULL:
                w.grow_rows()
            else:
                return stop

    def _rules_with_crew(self) -> StepParameters:
        """The rules for one call of the driver, with a crew at work if there is one."""
        if self._hands is None:
            return self.rules
        w = self._world
        rules = self.rules._replace(queue=new_task_queue(len(w.grains), w.contacts.flag.size))
        if benefits_from_workers(self._plan, w.grains.arrays, int(w.count[CONTACTS])):
            self._hands.start((w.grains.arrays, w.contacts, w.long_range, w.count, rules))
        return rules

    def seed(self, pair: np.ndarray, slide: np.ndarray, roll: np.ndarray, twist: np.ndarray) -> int:
        """Contacts before the first step, arrays (C, …); the first that is stretched beyond its break, or −1."""
        w = self.state
        if w.contacts.pair.shape[1] < len(pair):
            w.grow_contacts(len(pair))
        given = [np.ascontiguousarray(vectors.T, dtype=np.float64) for vectors in (slide, roll, twist)]
        pairs = np.ascontiguousarray(pair.T, dtype=np.uint32)
        return int(
            add_initial_contacts(w.grains.arrays, w.contacts, w.count, w.box.span, self.rules.contact, pairs, *given)
        )

    def begin(self) -> None:
        """Contacts of grains that touch at the start, nothing booked, and the first loads."""
        w = self.state
        w.count[STAGE] = 1
        w.count[CHECKED] = w.count[STEP_INCREASES] = -INCREASE_INTERVAL
        w.clock[CONTACT_STEP] = math.inf
        self._drive(-math.inf, 1)
        w.count[STEPS] = w.count[MADE] = w.count[SLIPPED] = w.count[LONG_RANGE_SUMS] = 0
        w.lost[:] = 0.0
        w.contacts.lost[:] = 0.0

    def load_state(self, saved: dict[str, np.ndarray]) -> None:
        """Go on from a saved state; what a checkpoint leaves out is worked out from the rest."""
        w = self.state
        w.from_arrays(saved)
        if w.order.size:  # lists depend on it
            reorder_grains(w, w.order)
            self._away = True
        elif w.contacts.gather_order.size:
            resort_contacts_by_grain(w.contacts, w.count, len(w.grains))
        if self.rules.search.listed and not self._list_lasts():
            w.long_range.anchor[...] = w.grains.arrays.position
        self._remake_list()

    def _remake_list(self) -> None:
        """The list of the anchors, if there is one, for the numbers that grains have now."""
        w, search = self._world, self.rules.search
        while search.listed and rebuild_verlet_list(w.long_range, w.box.span, search.reach) == FULL:
            w.grow_rows()

    def _list_lasts(self) -> bool:
        """False if a run of an earlier version had no list, or a wider one, for which grains may have gone farther."""
        w = self._world
        if not np.isfinite(w.long_range.anchor).all():
            return False
        moved = w.box.nearest((w.grains.arrays.position - w.long_range.anchor).T)
        return bool((moved**2).sum(axis=1).max() <= (0.5 * self.rules.search.margin) ** 2)

    def energies_at_grains(self) -> dict[str, np.ndarray]:
        """Energy [J] of each grain, (N,), by force: half of each pair's, and what per-grain forces give."""
        w = self.state
        shares = {force.column: np.zeros(len(w.grains)) for force, _, _ in self.long_range}
        for force, sums, numbers in self.long_range:
            long_range_energies_for(sums.energies)(
                w.grains.arrays, w.long_range, self.rules.span, numbers, shares[force.column]
            )
        for outer in self.external:
            shares[outer.name] = np.zeros(len(w.grains))
            fill = external_energies_for(outer.formula)
            fill(w.grains.arrays, w.time, outer.numbers(), shares[outer.name])
        return shares

    def force_energies(self) -> dict[str, float]:
        """Energy [J] of all long-range and per-grain forces by column of the ledger."""
        return {name: math.fsum(share) for name, share in self.energies_at_grains().items()}

    def limiting_grains(self) -> tuple[int, ...]:
        """The grains that the last stop was about."""
        return tuple(sorted({int(self.state.count[g]) for g in (GRAIN1, GRAIN2)} - {-1}))
