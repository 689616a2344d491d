"""Updaters: objects that change a simulation, or end its run, at regular moments."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

from ..basics.arguments import objects_with
from ..basics.errors import BadInput, shown, warn
from .cadence import Cadence, Schedule, read_cadence

Simulation = Any
"""`sand.Simulation`, which imports this module."""


class Updater:
    """Base class of objects that may change the simulation during a run; pass instances as `Simulation(updaters=[…])`.

    `act` is called after the first regular step, or the first r-RESPA cycle, that ends at or after each moment of
    `every`. These moments depend neither on output nor on interruptions. A resumed run that is given the same updaters
    has the bits of one without interruption if `act` depends on the state of the simulation alone.

    Attributes
    ----------
    every : float or str
        When `act` is called: a time between the calls [s], "1000 steps", or "log(10 per decade, from 1 ns)".
    """

    every: Any = None

    def act(self, simulation: Simulation) -> bool | None:
        """Read the simulation, change it in `with simulation.change() as state`, or return True to end the run."""


def name_of(updater: Updater) -> str:
    """Name of an updater in messages, checkpoints and the summary: that of its class."""
    return type(updater).__name__


def cadence_of(updater: Updater) -> Cadence:
    """When an updater acts.  Raises BadInput."""
    if getattr(updater, "every", None) is None:
        raise BadInput(f"updaters: {name_of(updater)} has no every; give it one, such as every = '10 ns'")
    return read_cadence(updater.every, f"{name_of(updater)}.every")


def described(updaters: Iterable[Updater]) -> list[str]:
    """Names and cadences of updaters, for checkpoints."""
    return [f"{name_of(each)} ({cadence_of(each)})" for each in updaters]


def read_updaters(value: Any) -> list[Updater]:
    """Check a list of updaters.  Raises BadInput."""
    return objects_with(value, "updaters", "sand.Updater", ("act",), cadence_of)


def check_updaters(given: Any, updaters: Iterable[Updater], saved: Sequence[str]) -> None:
    """Refuse to resume a run with updaters without saying whether they are left out; warn if they are others.

    Parameters
    ----------
    given : Any
        The argument `updaters`; None if it was left out.
    saved : Sequence[str]
        Names of the updaters in the checkpoint, as of `described`.

    Raises
    ------
    BadInput
        If the run had updaters, and none are given.
    """
    if saved and given is None:
        raise BadInput(
            f"this run had updaters, {', '.join(saved)}; resume it in a script with sand.resume(DIR, updaters=[…]), or "
            "with updaters=[] to go on without them"
        )
    if list(saved) != described(updaters):
        now = ", ".join(described(updaters)) or "none"
        warn(f"the run had the updaters {', '.join(saved) or 'none'}, and goes on with {now}")


class UpdateSchedule:
    """When the updaters of a run act, and their calls.

    Attributes
    ----------
    is_near : bool
        Whether the next step may pass the moment of an update, so that steps are taken one by one.
    acting : bool
        Whether an updater acts now.
    stops : bool
        Whether the updater that acts ends the run.
    """

    def __init__(self, simulation: Simulation):
        self._simulation = simulation
        self.acting = self.stops = False
        self._updaters = [(each, cadence_of(each)) for each in simulation.updaters]
        self.is_near = False
        self._schedules = [Schedule(None, 0.0)] * len(self._updaters)
        self._plan(range(len(self._updaters)))

    def _plan(self, which: Iterable[int]) -> None:
        """Find the next moment of updaters after the present regular state: a function of this state alone."""
        engine = self._simulation._engine
        for k in which:
            self._schedules[k] = Schedule(self._updaters[k][1], engine.stored_state.time, engine.steps)
        self.is_near = False

    @property
    def step_due(self) -> float:
        """Step of the next update; infinite without one."""
        return min((each.step_due for each in self._schedules), default=math.inf)

    def limit(self, goal: float, most_steps: float) -> tuple[float, float]:
        """Time [s] and number of steps for the engine, given those of the output, that pass no update."""
        if self.is_near:
            return goal, min(most_steps, 1)
        return min([goal, *(each.due for each in self._schedules)]), most_steps

    def approach(self, time: float) -> None:
        """Note that the next step would pass this time [s], which may be that of an update."""
        self.is_near = self.is_near or time in [each.due for each in self._schedules]

    def act(self) -> str:
        """Call the updaters that are due; returns the name of the first that ends the run, or "".

        Raises
        ------
        BadInput
            If an updater returns something other than True, False or None.
        """
        engine = self._simulation._engine
        due = [k for k, each in enumerate(self._schedules) if each.is_due(engine.stored_state.time, engine.steps)]
        return self._call(due)

    def act_again(self) -> str:
        """Call the updaters that have not acted at this step, because one raised an exception; returns as `act`."""
        step, owed = self._simulation._continuation.owed
        return self._call(owed) if owed and step == self._simulation._engine.steps else ""

    def _call(self, due: list[int]) -> str:
        """Call these updaters; returns and raises as `act`."""
        simulation, ended = self._simulation, ""
        for number, k in enumerate(due):
            updater, self.stops, self.acting = self._updaters[k][0], False, True
            simulation._continuation.owed = (simulation._engine.steps, due[number:])
            try:
                found = updater.act(simulation)
            finally:
                self.acting = False
            if found is not None and not isinstance(found, bool):
                raise BadInput(
                    f"{name_of(updater)}.act returned {shown(found)}; return True to end the run, or nothing"
                )
            if (found or self.stops) and not ended:
                ended = name_of(updater)
        if due:
            simulation._continuation.owed = (-1, [])
            self._plan(due)
        return ended
