"""The loop of a run: steps of the engine between outputs, updaters, checks of the condition, and signals."""

from __future__ import annotations

import math
import time as wall
from collections.abc import Mapping
from typing import Any

from ..integrate.parts import Stop
from ..integrate.rigid.rigid_clusters import RigidClusters
from .cadence import Cadence, Schedule, read_cadence
from .condition import EVERY, EVERY_LONG, WALL, Condition, OwnCondition
from .cost.cost import StepTimer
from .ledger import COUNTED
from .observers import call_ticks
from .outcome import OUTCOME_OF_STOP, Outcome
from .pace import RunTimeEstimate
from .signals import Signals
from .stop import StopCriteria
from .updater import UpdateSchedule

Simulation = Any
"""`sand.Simulation`, which imports this module."""
RETURN_EVERY = 0.1
"""Approximate wall time [s] between two returns of the compiled driver to Python, for signals and output."""
ENERGY_CHECK_EVERY = 10_000
"""Steps between two checks of the energy error."""


def run_loop(simulation: Simulation, criteria: StopCriteria, signals: Signals, timer: StepTimer) -> Outcome:
    """Take steps, write output and check the condition, call updaters, until a criterion is met or a signal arrives."""
    end, last, condition = criteria
    simulation._stopped_by = ""
    if condition is not None and simulation._met == (key_of(condition), simulation.steps):
        return Outcome.CONDITION_MET
    started = wall.monotonic()
    frames, rows, saves = _schedules(simulation)
    every = EVERY_LONG if isinstance(simulation.stepping, RigidClusters) else EVERY
    checks = Schedule(None if condition is None else Cadence("steps", every), simulation.time, simulation.steps)
    updates = UpdateSchedule(simulation)
    if condition is not None and simulation.steps == 0.0 == simulation.time and _is_met(simulation, condition):
        return Outcome.CONDITION_MET
    simulation._stopped_by = updates.act_again()
    if simulation._stopped_by:
        return Outcome.CONDITION_MET
    steps_per_call, checked_at, estimate = 64, simulation.steps, RunTimeEstimate(end, last, simulation._warn)
    while True:
        logged = [row["time"] for row in simulation.ledger.rows[-1:]]
        began = wall.monotonic()
        step = min(last, *(each.step_due for each in (frames, rows, saves, checks, updates)))
        most_steps = max(
            min(steps_per_call, step - simulation.steps, checked_at + ENERGY_CHECK_EVERY - simulation.steps), 0
        )
        shown = rows.next(frames.next(end))
        goal, most_steps = updates.limit(saves.next(shown), most_steps)
        with timer.steps():
            stop = simulation._engine.advance(goal, most_steps)
        while stop is Stop.NONE and simulation.time < max(logged, default=0.0):  # an event ended the step before it
            stop = simulation._engine.advance(goal, 1)
        simulation._warn_of_engine()
        unsound = simulation.steps - checked_at >= ENERGY_CHECK_EVERY and not simulation.is_sound
        if simulation.steps - checked_at >= ENERGY_CHECK_EVERY:
            checked_at = simulation.steps
        reached = simulation.time
        if stop is Stop.TIME_REACHED and simulation.steps < step:  # before the first step that would pass this time
            if goal == shown:
                with simulation._clock.measure("output"), timer.output(0):
                    stop = simulation._engine.go_to(goal, min(step, simulation.steps + 1) if updates.is_near else step)
            else:
                stop = Stop.NONE
                updates.approach(goal)
            reached = simulation.time if stop is Stop.NONE and goal == shown else goal
        seconds = wall.monotonic() - began
        if most_steps == steps_per_call:
            growth = min(RETURN_EVERY / max(seconds, 1e-9), 2.0)
            steps_per_call = max(64, min(int(steps_per_call * growth), 10**7))
        if stop in OUTCOME_OF_STOP:
            return OUTCOME_OF_STOP[stop]
        if unsound:
            return Outcome.RUNAWAY
        simulation._stopped_by = updates.act()
        estimate.update(simulation.time, simulation.steps, seconds)
        done = simulation.time >= end or simulation.steps >= last
        met = bool(simulation._stopped_by)
        if condition is not None and checks.is_due(simulation.time, simulation.steps):
            checks.advance(simulation.time, simulation.steps)
            met = _is_met(simulation, condition) or met
        with_frame = done or met or frames.is_due(simulation.time, simulation.steps)
        output = with_frame or rows.is_due(simulation.time, simulation.steps)
        if output:
            with timer.output():
                simulation._record_output(with_frame)
            rows.advance(simulation.time, simulation.steps)
        if with_frame:
            frames.advance(simulation.time, simulation.steps)
        if done or met:
            ended = Outcome.CONDITION_MET if met else Outcome.FINISHED
            return ended if simulation.is_sound else Outcome.RUNAWAY
        due = saves.is_due(reached, simulation.steps)
        if due:
            saves.advance(reached, simulation.steps)
        with simulation._clock.measure("output"), timer.output(0):
            if simulation.writer:
                simulation.writer.tick(simulation, output, due)
            call_ticks(simulation.observers, simulation)
        if signals.received:
            return Outcome.INTERRUPTED
        if condition is not None and _is_late(simulation, condition, wall.monotonic() - started):
            return Outcome.WALL_TIME
        if simulation.writer:
            signals.saving.add(simulation.writer)


def _schedules(simulation: Simulation) -> list[Schedule]:
    """Schedules of frames, rows of the ledger and checkpoints, which continue those of earlier runs."""
    chosen = None if simulation._chosen is None else Cadence("time", simulation._chosen.every)
    last = {"frame_every": simulation._frame_times, "row_every": [row["time"] for row in simulation.ledger.rows[-1:]]}
    return [
        Schedule(
            read_cadence(setting, name, wall=True) if setting is not None else cadence,
            simulation.time,
            simulation.steps,
            max(last.get(name, [])[-1:], default=-math.inf),
        )
        for name, cadence in (("frame_every", chosen), ("row_every", None), ("checkpoint_every", None))
        for setting in [getattr(simulation, name)]
    ]


def _is_met(simulation: Simulation, condition: Condition | OwnCondition) -> bool:
    """Whether the present regular state meets a condition, whatever the wall time."""
    holds = _holds(simulation, condition, 0.0) if isinstance(condition, Condition) else condition.holds(simulation)
    if holds:
        simulation._met = (key_of(condition), simulation.steps)
    return holds


def _is_late(simulation: Simulation, condition: Condition | OwnCondition, seconds: float) -> bool:
    """Whether a condition is met because of the wall time [s] of this run; the run can then be continued."""
    return isinstance(condition, Condition) and WALL in condition.names and _holds(simulation, condition, seconds)


def _holds(simulation: Simulation, condition: Condition, seconds: float) -> bool:
    """Whether a condition holds after a wall time of `seconds` [s]."""
    row: Mapping[str, float] = {}
    if names := set(condition.names) - {WALL}:
        row = simulation._count_row() if COUNTED.issuperset(names) else simulation._log_row()
    return condition.holds({**row, WALL: seconds})


def key_of(condition: Condition | OwnCondition) -> Any:
    """What identifies a condition."""
    return condition.function if isinstance(condition, OwnCondition) else condition.text
