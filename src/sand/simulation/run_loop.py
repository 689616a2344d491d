"""The loop of a run: the engine takes steps, and between these, callbacks act whose schedules are due."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from time import monotonic
from typing import Any, NamedTuple

import numpy as np

from ..basics.errors import Interrupted
from ..basics.state import LATE
from ..integrate.integrator import moves_bodies
from ..integrate.parts import Stop
from .cadence import Cadence, Chosen, Schedule, read_cadence
from .condition import EVERY_LONG, WALL, Condition, OwnCondition
from .ledger import COUNTED, kinetic_energies
from .observers import call_ticks
from .outcome import OUTCOME_OF_STOP, Outcome, Result
from .pace import RunTimeEstimate
from .run_writer import is_mostly_awake
from .signals import Signals
from .stop import StopCriteria
from .updater import UpdateSchedule

Simulation = Any
"""`sand.Simulation`, which imports this module."""
RETURN_EVERY = 0.1
"""Approximate wall time [s] between two returns of the compiled driver to Python, for signals and output."""
ENERGY_CHECK_EVERY = 10_000
"""Steps between two checks of the energy error."""


@dataclass
class Continuation:
    """What the runs of a simulation leave for the next one.

    Attributes
    ----------
    chosen : Chosen or None
        Cadence of the frames of the last run, if the user gives none.
    met : tuple or None
        The condition that was met, and the step.
    owed : tuple of int and list
        A step, and the updaters that have still to act at it.
    failure : str
        Why the simulation cannot continue.
    """

    chosen: Chosen | None = None
    met: tuple[Any, int] | None = None
    owed: tuple[int, list[int]] = field(default_factory=lambda: (-1, []))
    failure: str = ""


class Callback(NamedTuple):
    """What is done in a run, and when.

    `act` returns why the run ends, or None.  It is called after each call of the engine, which ends at the next step of
    `schedules` at the latest.  Times of frames, rows, checkpoints and updaters end a call as well: `_take_steps`.
    """

    act: Callable[[], Outcome | None]
    schedules: tuple[Schedule, ...] = ()


class RunLoop:
    """One run of a simulation; it lives during `Simulation.run`.

    Frames, rows and the end of a run are at exactly their times: the state there belongs to a copy, so that output
    changes no bit of the regular steps.  A checkpoint holds the last regular state before its time.  Updaters act at
    the first regular step at or after theirs (`UpdateSchedule`), conditions and the energy error are looked at after
    numbers of regular steps; all else is done whenever the engine returns, about every `RETURN_EVERY`.

    Attributes
    ----------
    updates : UpdateSchedule
        The updaters.
    """

    def __init__(self, simulation: Simulation, criteria: StopCriteria, signals: Signals):
        self._simulation, self._signals, self._timer = simulation, signals, simulation._timer
        self._criteria = criteria
        self._end, self._last_step, self._condition = criteria
        self._began = monotonic()
        self._steps_per_call = 64
        self._stop, self._reached = Stop.NONE, simulation.time
        self._ends: Outcome | None = None  # why the run ends after the output at this step
        self._ended_by = ""  # the updater that ends the run
        self._is_unsound = False  # whether the energy error is above its limit
        self._has_output = False  # whether there was output at this step
        self._estimate = RunTimeEstimate(self._end, self._last_step, simulation._warnings.show)
        self._plan()

    def _plan(self) -> None:
        """The callbacks, in the order in which they act, with schedules that continue those of earlier runs."""
        simulation, ledger = self._simulation, self._simulation.ledger
        now = simulation.time, simulation.steps
        chosen = simulation._continuation.chosen
        by_default = {"frame_every": None if chosen is None else Cadence("time", chosen.every)}
        last = {"frame_every": max(ledger.frame_times[-1:], default=-math.inf), "row_every": ledger.last_time}
        self._frames, self._rows, self._saves = (
            Schedule(
                by_default.get(name) if setting is None else read_cadence(setting, name, wall_time=True),
                *now,
                last.get(name, -math.inf),
            )
            for name in ("frame_every", "row_every", "checkpoint_every")
            for setting in [getattr(simulation, name)]
        )
        checks = None
        if self._condition is not None:
            every = EVERY_LONG if moves_bodies(simulation.stepping) else self._condition.every
            checks = Cadence("steps", every)
        self._checks = Schedule(checks, *now)
        self._energy_checks = Schedule(Cadence("steps", ENERGY_CHECK_EVERY), *now)
        self.updates = UpdateSchedule(simulation)
        self._callbacks: tuple[Callback, ...] = (
            Callback(self._find_fault, (self._energy_checks,)),
            Callback(self._update),
            Callback(self._check_condition, (self._checks,)),
            Callback(self._write_output, (self._frames, self._rows)),  # after changes, and at the end of the run
            Callback(self._save, (self._saves,)),
            Callback(self._tick),
            Callback(self._look_for_signals),
        )

    def run(self) -> Outcome:
        """Take steps until a criterion is met, an updater ends the run, or a signal arrives."""
        simulation, condition = self._simulation, self._condition
        if condition is not None:
            if simulation._continuation.met == (key_of(condition), simulation.steps):
                return Outcome.CONDITION_MET
            if simulation.steps == 0.0 == simulation.time and self._is_met(condition):
                return Outcome.CONDITION_MET
        self._ended_by = self.updates.act_again()
        outcome = Outcome.CONDITION_MET if self._ended_by else None
        try:
            while outcome is None:
                self._take_steps()
                outcome = next((found for each in self._callbacks if (found := each.act())), None)
        finally:
            self._callbacks = ()  # they refer to this object, which would keep the simulation in memory
        return outcome

    def _take_steps(self) -> None:
        """Let the engine take steps up to the next moment of a callback, `_reached`, or for `RETURN_EVERY`."""
        simulation, began = self._simulation, monotonic()
        due = [each.step_due for callback in self._callbacks for each in callback.schedules]
        step = min(self._last_step, self.updates.step_due, *due)
        most_steps = max(min(self._steps_per_call, step - simulation.steps), 0)
        shown = self._rows.next(self._frames.next(self._end))
        goal, most_steps = self.updates.limit(self._saves.next(shown), most_steps)
        with self._timer.steps():
            stop = simulation._engine.advance(goal, most_steps)
        while stop is Stop.NONE and simulation.time < simulation.ledger.last_time:  # an event ended the step before it
            stop = simulation._engine.advance(goal, 1)
        is_due = self._energy_checks.take(simulation.time, simulation.steps)
        self._is_unsound = is_due and not simulation.is_sound  # of the regular state, before one at a time of output
        self._reached = simulation.time
        if stop is Stop.TIME_REACHED and simulation.steps < step:  # before the first step that would pass this time
            self._reached = goal
            if goal == shown:
                last = min(step, simulation.steps + 1) if self.updates.is_near else step
                with simulation._clock.measure("output"), self._timer.output(0):
                    stop = simulation._engine.go_to(goal, last)
                if stop is Stop.NONE:  # the regular state has arrived at the step before this time
                    self._reached = simulation.time
            else:
                self.updates.approach(goal)
        self._stop, seconds = stop, monotonic() - began
        self._estimate.update(simulation.time, simulation.steps, seconds)
        if most_steps == self._steps_per_call:
            growth = min(RETURN_EVERY / max(seconds, 1e-9), 2.0)
            self._steps_per_call = max(64, min(int(most_steps * growth), 10**7))

    def _find_fault(self) -> Outcome | None:
        """Why the physics or the numerics end the run."""
        simulation = self._simulation
        simulation._warnings.take(simulation._engine)
        if self._stop in OUTCOME_OF_STOP:
            return OUTCOME_OF_STOP[self._stop]
        return Outcome.RUNAWAY if self._is_unsound else None

    def _update(self) -> None:
        """Call the updaters that are due."""
        self._ended_by = self.updates.act()
        self._ends = Outcome.CONDITION_MET if self._ended_by else None

    def _check_condition(self) -> None:
        """Look whether the present regular state meets the condition."""
        is_due = self._checks.take(self._simulation.time, self._simulation.steps)
        if self._condition is not None and is_due and self._is_met(self._condition):
            self._ends = Outcome.CONDITION_MET

    def _is_met(self, condition: Condition | OwnCondition) -> bool:
        """Whether the present regular state meets a condition, whatever the wall time."""
        simulation = self._simulation
        holds = self._holds(condition, 0.0) if isinstance(condition, Condition) else condition.holds(simulation)
        if holds:
            simulation._continuation.met = (key_of(condition), simulation.steps)
        return holds

    def _holds(self, condition: Condition, seconds: float) -> bool:
        """Whether a condition holds after a wall time of `seconds` [s]."""
        ledger, names = self._simulation.ledger, set(condition.names) - {WALL}
        row: Mapping[str, float] = {}
        if names:
            row = (ledger.counts_of if COUNTED.issuperset(names) else ledger.row_of)(self._simulation._engine)
        return condition.holds({**row, WALL: seconds})

    def _write_output(self) -> Outcome | None:
        """Record a row or a frame that is due, and the end of the run."""
        simulation, now = self._simulation, (self._simulation.time, self._simulation.steps)
        if now[0] >= self._end or now[1] >= self._last_step:
            self._ends = self._ends or Outcome.FINISHED
        with_frame = self._ends is not None or self._frames.is_due(*now)
        self._has_output = with_frame or self._rows.is_due(*now)
        if self._has_output:
            with self._timer.output():
                simulation._record_output(with_frame)
            self._rows.advance(*now)
        if with_frame:
            self._frames.advance(*now)
        return self._ends if self._ends is None or simulation.is_sound else Outcome.RUNAWAY

    def _save(self) -> None:
        """Write a checkpoint that is due at the time that the regular steps have reached."""
        simulation = self._simulation
        is_due = self._saves.take(self._reached, simulation.steps)
        if simulation.writer:
            with simulation._clock.measure("output"), self._timer.output(0):
                simulation.writer.tick(simulation, self._has_output, is_due)

    def _tick(self) -> None:
        """Call the observers."""
        with self._simulation._clock.measure("output"), self._timer.output(0):
            call_ticks(self._simulation.observers, self._simulation)

    def _look_for_signals(self) -> Outcome | None:
        """Why the run ends early: by a signal, or by the wall time in its condition; it can then be continued."""
        condition = self._condition
        if self._signals.received:
            return Outcome.INTERRUPTED
        if isinstance(condition, Condition) and WALL in condition.names:
            seconds = monotonic() - self._began
            if self._holds(condition, seconds):
                return Outcome.WALL_TIME
        if self._simulation.writer:
            self._signals.saving.add(self._simulation.writer)
        return None

    def close(self, outcome: Outcome) -> Result:
        """The result of the run, after its last row, warnings and files.  Raises Interrupted after a signal."""
        simulation = self._simulation
        grains = simulation._engine.state.limiting_grains() if outcome.is_physics else ()
        if outcome is Outcome.RUNAWAY:
            grains = tuple(sorted(np.argsort(np.add(*kinetic_energies(simulation.grains)))[-2:].tolist()))
        if outcome.is_physics:
            simulation._record_output()
        drift = simulation.present_ledger.drift
        simulation._warnings.take(simulation._engine)
        if is_mostly_awake(simulation):
            simulation._warnings.show(
                "clusters were awake most of the time: clusters = 'grains' (sand.Verlet) costs no more"
            )
        if simulation.regular_state.count[LATE]:
            simulation._warnings.show(
                "grains of two bodies overlapped before their touch was seen; halve step_fraction in [stepping]"
            )
        met = (self._ended_by or self._criteria.stop or "") if outcome is Outcome.CONDITION_MET else ""
        result = Result(outcome, simulation.steps, simulation.time, drift, grains, met)
        if simulation.writer:
            simulation.writer.close(simulation, result)
        for observer in simulation.observers:
            observer.close(simulation, result)
        if outcome is Outcome.INTERRUPTED:
            raise Interrupted(result)
        return result


def key_of(condition: Condition | OwnCondition) -> Any:
    """What identifies a condition."""
    return condition.function if isinstance(condition, OwnCondition) else condition.text
