"""Expected cost of a run: length and number of steps, wall time and memory.

The number of steps follows from the state at the start and the kinetics of touches (`expected_steps`), never from
earlier runs, which may have been in another state.  A step has a rough cost by its kind, and by the numbers of grains,
contacts and pairs.  Runs record their speed in units of this rough cost in a table beside the cache of compiled code.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from operator import add, sub
from pathlib import Path
from typing import Any, NamedTuple

from ..compiler.cache import read_record, write_record
from ..compiler.jit import cache_folder
from ..contact.model import Contact
from ..forces.pair.ewald_force import EwaldForce
from ..integrate.rigid_clusters import RigidClusters
from ..integrate.task_queue import uses_task_queue
from ..neighbours.settings import share_within
from ..state.state import CONTACTS
from ..threads import threads
from .cadence import FRAMES, number_in, read_cadence
from .expected_steps import expected_steps

LEAST_STEPS, LEAST_SECONDS, REPLACES = 500, 0.1, 0.1
"""Fewest steps, and least wall time [s], of a measured speed; it replaces one that was measured for ten times its time
or less."""
PER_STEP, PER_GRAIN, PER_CONTACT = 1e-6, 15e-9, 60e-9
"""Rough wall times [s] of a step: of each step, for each grain, and for each contact."""
PER_CYCLE_STEP, PER_CYCLE_GRAIN, CYCLE = 2.5e-6, 100e-9, 6.0
"""Wall times [s] that r-RESPA adds to a step with contacts, and steps in which each long-range force is summed once."""
PER_PAIR, PER_EWALD_PAIR, PER_WAVE = 2e-9, 5e-9, 3.5e-9
"""Wall times [s] of a long-range sum for each grain and pair, and for each grain and wave vector."""
PER_BODY_STEP, PER_AWAKE_STEP = 10e-6, 3e-6
"""Wall times [s] of a step of bodies, and of a contact step of awake clusters."""
PER_OUTPUT, PER_OUTPUT_GRAIN = 0.7e-3, 2.1e-6
"""Wall times [s] of a frame and its row, and of each grain in it."""
START, FIGURE = 1.0, 1.5
"""Wall times [s] of the start of a run, with imports and compiled code from the disk, and of the figure at its end."""
PROCESS_BYTES = 3.5e8
"""Memory of Python, libraries, compiled code and the figure, measured on Linux."""
COPIES = 3
"""Copies of the arrays of a state: the present state, one at the time of an output, and what is written."""
MODES = ("free", "contact", "bodies", "awake")
"""Kinds of steps: without and with contacts, of bodies, and contact steps of awake clusters within these."""

Simulation = Any
"""`sand.Simulation`, which imports this module."""


class Cost(NamedTuple):
    """Expected cost of a run; None where the end of the run does not determine it."""

    step: float  # mean step [s]
    steps: float | None  # of grains, or of bodies
    contact_steps: float | None  # of awake clusters, within steps of bodies; None without rigid clusters
    seconds: float | None  # wall time, without compilation [s]
    parts: dict[str, float]  # of it: stepping, output, start and figure [s]
    memory: float  # [bytes]
    measured: str  # the runs of this machine from which the speed is known; "" for a rough estimate
    bound: str  # "at most" where the run may need less


def kind_of(simulation: Simulation) -> str:
    """What determines the cost of a grain's step, apart from the number of grains."""
    names = [_name(force, simulation) for force in simulation.forces]
    search = simulation._engine.parameters.search
    found = "list" if search.listed else "cells" if search.celled else "all pairs"
    count = threads() if uses_task_queue(len(simulation.start)) else 1
    return f"{', '.join(names) or 'no forces'}; {found}; {simulation.stepping.name}; {count} thread{'s' * (count > 1)}"


def _name(force: Any, simulation: Simulation) -> str:
    words = [force.name]
    if isinstance(force, Contact):
        words += [force.law, *([] if force.damping == "none" else ["damped"])]
    elif isinstance(force, EwaldForce) and force.uses_ewald(simulation.start, simulation.box):
        words.append("ewald")
    return " ".join(words)


def expected_cost(simulation: Simulation, end: float, last_step: float, condition: str | None = None) -> Cost:
    """Expected cost of a run of a simulation that has not begun.

    Parameters
    ----------
    end, last_step : float
        Planned end: time [s] and step, infinite where not set.
    condition : str or None, optional
        Condition that may end it earlier.
    """
    memory = PROCESS_BYTES + _bytes(simulation, _pairs_per_grain(simulation))
    if math.isinf(end) and math.isinf(last_step):
        step = expected_steps(simulation, math.inf, 1.0)
        return Cost(step.span, None, None, None, {}, memory, "", "")
    found = expected_steps(simulation, end, last_step, may_end_earlier=condition is not None)
    speeds, measured = _speeds(kind_of(simulation))
    grains, sums = len(simulation.start), long_range_seconds(simulation)
    stepping = math.fsum(
        getattr(found, mode) * step_seconds(simulation, mode, found.contacts, sums) * speeds[mode] for mode in MODES
    )
    span = min(end, found.span)
    output = outputs(simulation, span, found.total) * (PER_OUTPUT + PER_OUTPUT_GRAIN * grains)
    parts = {"stepping": stepping, "output": output, "start": START + FIGURE}
    rigid = isinstance(simulation.stepping, RigidClusters)
    return Cost(
        span / found.total,
        found.total,
        found.awake if rigid else None,
        math.fsum(parts.values()),
        parts,
        memory,
        measured,
        found.bound,
    )


def step_seconds(simulation: Simulation, mode: str, contacts: float, sums: float) -> float:
    """Rough wall time [s] of a step of a kind, with a number of contacts; `sums` as of `long_range_seconds`."""
    grains, respa = len(simulation.start), simulation._engine.parameters.respa
    if mode == "awake":
        return PER_AWAKE_STEP
    if mode == "bodies":
        return PER_BODY_STEP + PER_GRAIN * grains + sums
    own = PER_STEP + PER_GRAIN * grains + PER_CONTACT * contacts
    if mode == "free" or not sums or respa.max_steps == 1:
        return own + sums
    return own + PER_CYCLE_STEP + PER_CYCLE_GRAIN * grains + sums / min(CYCLE, respa.max_steps)


def long_range_seconds(simulation: Simulation) -> float:
    """Rough wall time [s] of one sum of all long-range forces on all grains."""
    sums = [numbers for _, _, numbers in simulation._engine.long_range]
    pairs = _pairs_per_grain(simulation) if sums else 0.0
    waves = [getattr(numbers, "waves", None) for numbers in sums]
    each = [PER_PAIR * pairs if q is None else PER_EWALD_PAIR * pairs + PER_WAVE * q.weight.size for q in waves]
    return len(simulation.start) * math.fsum(each)


def outputs(simulation: Simulation, span: float, steps: float) -> float:
    """Number of frames and further rows of a run of a length [s] and of so many steps."""
    settings = [simulation.frame_every, simulation.row_every]
    if settings[0] is None and span > 0.0:
        settings[0] = span / FRAMES
    return 2.0 + math.fsum(
        number_in(read_cadence(setting, "frame_every"), span, steps) for setting in settings if setting is not None
    )


def _speeds(kind: str) -> tuple[dict[str, float], str]:
    """Wall times in units of the rough ones, by kind of step, and from which runs they are known."""
    table = _read()
    known = table.get(kind, {})
    every = [one["ratio"] for runs in table.values() for one in runs.values()]
    machine = math.exp(math.fsum(map(math.log, every)) / len(every)) if every else 1.0
    speeds = {mode: known[mode]["ratio"] if mode in known else machine for mode in MODES}
    if known:
        return speeds, "as in a run of this kind on this machine"
    return speeds, "as in other runs on this machine" if every else ""


def _pairs_per_grain(simulation: Simulation) -> float:
    """Mean number of grains within reach of the lists, or all others where pairs are not listed."""
    search, grains = simulation._engine.parameters.search, simulation.start
    others = max(len(grains) - 1, 0)
    if not search.listed or not others:
        return float(others)
    return others * share_within(grains.position, simulation.box, search.reach)


def _bytes(simulation: Simulation, pairs: float) -> float:
    state = simulation._engine.regular_state
    groups = [state.grains.arrays, state.contacts, state.pair_list, state.long_range, state.runge_kutta, state.clusters]
    listed = 4.0 * pairs * len(simulation.start) if simulation._engine.parameters.search.listed else 0.0
    return COPIES * float(sum(array.nbytes for group in groups for array in group)) + listed


class StepTimer:
    """Measures the steps of one call of `run`: not output, compilation or loading of code, nor the first call.

    The first call of the driver fills tables and starts threads.  Steps with and without contacts are told apart, as
    are those of bodies and of awake clusters: the speed of one kind says nothing about another.
    """

    def __init__(self, simulation: Simulation):
        self._simulation, self._calls = simulation, 0
        self._rigid = isinstance(simulation.stepping, RigidClusters)
        self._long_range = long_range_seconds(simulation)
        # of each kind: number of steps, their wall time [s], and the rough estimate of that [s]
        self._sums = {mode: [0.0, 0.0, 0.0] for mode in MODES}

    @contextmanager
    def steps(self) -> Iterator[None]:
        """Measure a block in which the engine takes steps."""
        before = self._now()
        with self._simulation._clock.measure("stepping"):
            yield
        if self._calls:
            self._add(*before, *self._now())
        self._calls += 1

    def _now(self) -> tuple[tuple[float, ...], int]:
        """Steps, wall time [s], contact steps of awake clusters and their wall time [s]; number of contacts."""
        engine = self._simulation._engine
        counted = (engine.steps, self._simulation._clock.stepping, *engine.awake_work)
        return counted, int(engine._state.count[CONTACTS])

    def _add(self, before: tuple[float, ...], contacts: int, after: tuple[float, ...], contacts_after: int) -> None:
        steps, seconds, awake_steps, awake = map(sub, after, before)
        if self._rigid:
            found = {"bodies": (steps, seconds - awake), "awake": (awake_steps, awake)}
        elif (contacts > 0) != (contacts_after > 0):
            return
        else:
            found = {"contact" if contacts else "free": (steps, seconds)}
        for mode, (number, spent) in found.items():
            rough = step_seconds(self._simulation, mode, contacts, self._long_range)
            self._sums[mode] = [*map(add, self._sums[mode], (number, spent, number * rough))]

    def record(self) -> None:
        """Add the measured speeds to the table, if there were enough steps and the table can be written."""
        found = {
            mode: {"ratio": spent / rough, "seconds": spent}
            for mode, (number, spent, rough) in self._sums.items()
            if number >= LEAST_STEPS and spent >= LEAST_SECONDS
        }
        if not found:
            return
        table = _read()
        known = table.setdefault(kind_of(self._simulation), {})
        known |= {
            mode: one for mode, one in found.items() if one["seconds"] > REPLACES * known.get(mode, one)["seconds"]
        }
        write_record(_path(), table)


def _path() -> Path:
    return cache_folder().parent / "step-speeds.json"


def _read() -> dict[str, dict[str, dict[str, float]]]:
    """The table, by kind of simulation and kind of step; an unreadable or damaged one counts as empty."""
    try:
        table = {
            str(kind): {mode: {key: float(one[key]) for key in ("ratio", "seconds")} for mode, one in found.items()}
            for kind, found in read_record(_path()).items()
        }
    except (ValueError, TypeError, KeyError, AttributeError):
        return {}
    whole = all(
        mode in MODES and 0.0 < one["ratio"] < math.inf for runs in table.values() for mode, one in runs.items()
    )
    return table if whole else {}
