"""Expected cost of a run: length and number of steps, wall time and memory.

The number of steps follows from the state at the start and the kinetics of touches (`expected_steps`), never from
earlier runs, which may have been in another state.  A step has a rough cost by its kind, and by the numbers of grains,
contacts and pairs.  Runs record what steps, outputs and the figure took in units of these rough costs, in a table
beside the cache of compiled code (`StepTimer`).
"""

from __future__ import annotations

import math
import time
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from operator import add, sub
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...basics.state import CONTACTS
from ...basics.threads import threads
from ...compiler.cache import read_record, write_record
from ...compiler.jit import cache_folder
from ...compiler.progress import compilation_seconds
from ...contact.model import Contact
from ...forces.pair.ewald_force import EwaldForce
from ...integrate.integrator import moves_bodies
from ...integrate.task_queue import uses_task_queue
from ...neighbours.search import share_within
from ..cadence import FRAMES, number_in, read_cadence
from .expected_steps import expected_steps

LEAST_STEPS, LEAST_OUTPUTS, LEAST_SECONDS, REPLACES = 500, 20, 0.1, 0.1
"""Fewest steps, and outputs, and least time [s], of a measured cost; it replaces one that was measured for up to ten
times its time."""
PER_STEP, PER_GRAIN, PER_CONTACT = 1e-6, 15e-9, 60e-9
"""Rough wall times [s] of a step: of each step, for each grain, and for each contact."""
PER_CYCLE_STEP, PER_CYCLE_GRAIN, CYCLE = 2.5e-6, 100e-9, 6.0
"""Wall times [s] that r-RESPA adds to a step with contacts, and steps in which each long-range force is summed once."""
PER_PAIR, PER_EWALD_PAIR, PER_WAVE = 2e-9, 5e-9, 3.5e-9
"""Wall times [s] of a long-range sum for each grain and pair, and for each grain and wave vector."""
PER_BODY_STEP, PER_BODY_GRAIN, PER_BODY_IN_GAS = 1e-6, 0.1e-6, 0.17e-6
"""Wall times [s] of a step of bodies, and for each grain without and with the friction and noise of a gas."""
PER_AWAKE_STEP, PER_SUBSTEP = 3e-6, 50e-6
"""Wall times [s] of a contact step of awake clusters, and of a substep of quick bodies.  How many substeps a run takes
is not known before, but those that it took say nothing about the speed of contact steps."""
PER_OUTPUT, PER_OUTPUT_GRAIN = 0.7e-3, 2.1e-6
"""Wall times [s] of a frame and its row, and of each grain in it."""
START, FIGURE = 1.0, 1.5
"""Wall times [s] of the start of a run, with imports and compiled code from the disk, and of the figure at its end."""
UNITS = [value for name, value in sorted(globals().items()) if name.startswith("PER_")] + [CYCLE, FIGURE]
"""What measured costs are ratios to: the table holds these numbers, and counts as empty if they were others."""
PROCESS_BYTES = 3.5e8
"""Memory of Python, libraries, compiled code and the figure, measured on Linux."""
FRAME_BYTES, FRAME_GRAIN_BYTES = 1500.0, 150.0
"""Disk space [bytes] of a frame and its row, and of each grain in it with the contacts of an aggregate."""
CHECKPOINT_BYTES, CHECKPOINT_GRAIN_BYTES, KEPT = 20e3, 570.0, 2
"""Disk space [bytes] of a checkpoint, and of each grain in it; checkpoints that a run keeps."""
COPIES = 3
"""Copies of the arrays of a state: the present state, one at the time of an output, and what is written."""
MODES = ("free", "contact", "bodies", "awake")
"""Kinds of steps: without and with contacts, of bodies, and contact steps of awake clusters within these."""
OUTPUT, DRAWING = "output", "figure"
"""Further entries of the table, of what is no step."""

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
    disk: float | None  # of all files of the run [bytes]
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
        return Cost(step.span, None, None, None, {}, memory, None, "", "")
    found = expected_steps(simulation, end, last_step, may_end_earlier=condition is not None)
    speeds, measured = _speeds(kind_of(simulation))
    sums = long_range_seconds(simulation)
    stepping = math.fsum(
        getattr(found, mode) * step_seconds(simulation, mode, found.contacts, sums) * speeds[mode] for mode in MODES
    )
    span = min(end, found.span)
    number = outputs(simulation, span, found.total)
    output = number * output_seconds(simulation) * speeds[OUTPUT]
    parts = {"stepping": stepping, "output": output, "start": (START + FIGURE) * speeds[DRAWING]}
    bodies = moves_bodies(simulation.stepping)
    return Cost(
        span / found.total,
        found.total,
        found.awake if bodies else None,
        math.fsum(parts.values()),
        parts,
        memory,
        number * (FRAME_BYTES + FRAME_GRAIN_BYTES * len(simulation.start))
        + KEPT * (CHECKPOINT_BYTES + CHECKPOINT_GRAIN_BYTES * len(simulation.start)),
        measured,
        found.bound,
    )


def step_seconds(simulation: Simulation, mode: str, contacts: float, sums: float) -> float:
    """Rough wall time [s] of a step of a kind, with a number of contacts; `sums` as of `long_range_seconds`."""
    grains, respa = len(simulation.start), simulation._engine.parameters.respa
    if mode == "awake":
        return PER_AWAKE_STEP
    if mode == "bodies":
        in_gas = simulation._engine.parameters.gas.gas.on
        return PER_BODY_STEP + (PER_BODY_GRAIN + (PER_BODY_IN_GAS if in_gas else 0.0)) * grains + sums
    own = PER_STEP + PER_GRAIN * grains + PER_CONTACT * contacts
    if mode == "free" or not sums or respa.max_steps == 1:
        return own + sums
    return own + PER_CYCLE_STEP + PER_CYCLE_GRAIN * grains + sums / min(CYCLE, respa.max_steps)


def output_seconds(simulation: Simulation) -> float:
    """Rough wall time [s] of a frame and its row."""
    return PER_OUTPUT + PER_OUTPUT_GRAIN * len(simulation.start)


def long_range_seconds(simulation: Simulation) -> float:
    """Rough wall time [s] of one sum of all long-range forces on all grains."""
    sums = [numbers for _, _, numbers in simulation._engine.long_range]
    pairs = _pairs_per_grain(simulation) if sums else 0.0
    waves = [getattr(numbers, "waves", None) for numbers in sums]
    each = [PER_PAIR * pairs if q is None else PER_EWALD_PAIR * pairs + PER_WAVE * q.weight.size for q in waves]
    return len(simulation.start) * math.fsum(each)


def outputs(simulation: Simulation, span: float, steps: float) -> float:
    """Number of frames and further rows of a run of a length [s] and of so many steps."""
    given = [setting for setting in (simulation.frame_every, simulation.row_every) if setting is not None]
    frames = FRAMES if simulation.frame_every is None and span > 0.0 else 0
    return 2.0 + frames + math.fsum(number_in(read_cadence(each, "frame_every"), span, steps) for each in given)


def _speeds(kind: str) -> tuple[dict[str, float], str]:
    """Wall times in units of the rough ones, by kind of step and for outputs and figures, and from which runs they are.

    A kind of step that was not measured has the speed of the machine: the median of all measured ratios and of 1, the
    rough estimate, so that one odd record changes little.
    """
    table = read_speeds()
    known = table.get(kind, {})
    every = [one["ratio"] for runs in table.values() for mode, one in runs.items() if mode in MODES]
    machine = math.exp(float(np.median([0.0, *map(math.log, every)])))
    speeds = {mode: known[mode]["ratio"] if mode in known else machine for mode in MODES}
    for part in (OUTPUT, DRAWING):  # these hardly depend on the forces
        others = [runs[part]["ratio"] for runs in table.values() if part in runs]
        speeds[part] = known[part]["ratio"] if part in known else float(np.median(others)) if others else 1.0
    if known.keys() & set(MODES):
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
    groups = [state.grains.arrays, state.contacts, state.pair_list, state.long_range, state.clusters]
    listed = 4.0 * pairs * len(simulation.start) if simulation._engine.parameters.search.listed else 0.0
    return COPIES * float(sum(array.nbytes for group in groups for array in group)) + listed


class StepTimer:
    """Measures steps and outputs of the runs of a simulation: not compilation, nor the first call of the driver.

    The first call fills tables and starts threads; one in which code was compiled or loaded does not count either.
    Steps with and without contacts are told apart, as are those of bodies and of awake clusters: the speed of one kind
    says nothing about another.

    Parameters
    ----------
    simulation : Simulation
        The simulation.
    clock : callable, optional
        Time [s]: processor time of this thread, as wall time would count other programs and pauses of the process.
        Of several threads that share a step this one waits for the others, on its core while no program needs it.
    """

    def __init__(self, simulation: Simulation, clock: Callable[[], float] = time.thread_time):
        self._of, self._clock, self._calls = weakref.ref(simulation), clock, 0  # it ends with the simulation
        self._moves_bodies = moves_bodies(simulation.stepping)
        self._kind, self._long_range = kind_of(simulation), long_range_seconds(simulation)
        self._rough_output = output_seconds(simulation)
        # of each kind of step, and of outputs and figures: number, their time [s], and the rough estimate of that [s]
        self._sums = {mode: [0.0, 0.0, 0.0] for mode in (*MODES, OUTPUT, DRAWING)}
        self._recorded = 0.0  # time of what was measured when it was last recorded [s]

    @property
    def _simulation(self) -> Simulation:
        found = self._of()
        assert found is not None
        return found

    @property
    def is_valid(self) -> bool:
        """Whether the simulation is still of the same kind."""
        return self._kind == kind_of(self._simulation)

    @contextmanager
    def steps(self) -> Iterator[None]:
        """Measure a block in which the engine takes steps."""
        before, compiled = self._now(), compilation_seconds()
        with self._simulation._clock.measure("stepping"):
            yield
        if self._calls and compilation_seconds() == compiled:
            self._add(*before, *self._now())
        self._calls += 1

    @contextmanager
    def output(self, number: int = 1) -> Iterator[None]:
        """Measure a block that writes an output to files, or prepares or follows one with `number` 0."""
        before, compiled = self._clock(), compilation_seconds()
        yield
        if self._simulation.writer and compilation_seconds() == compiled:
            self._count(OUTPUT, number, self._clock() - before, number * self._rough_output)

    @contextmanager
    def figure(self) -> Iterator[None]:
        """Measure a block that draws the figure, and record it."""
        before = self._clock()
        yield
        self._sums[DRAWING] = [1.0, self._clock() - before, FIGURE]
        self.record()

    def _now(self) -> tuple[tuple[float, ...], int]:
        """Steps, time [s], contact steps, substeps and the time [s] of both; number of contacts."""
        engine = self._simulation._engine
        counted = (engine.steps, self._clock(), *engine.awake_work)
        return counted, int(engine.stored_state.count[CONTACTS])

    def _add(self, before: tuple[float, ...], contacts: int, after: tuple[float, ...], contacts_after: int) -> None:
        steps, seconds, awake_steps, substeps, awake = map(sub, after, before)
        if self._moves_bodies:
            found = {"bodies": (steps, seconds - awake), "awake": (awake_steps, awake)}
            self._count("awake", 0, 0.0, substeps * PER_SUBSTEP)
        elif (contacts > 0) != (contacts_after > 0):
            return
        else:
            found = {"contact" if contacts else "free": (steps, seconds)}
        for mode, (number, spent) in found.items():
            rough = step_seconds(self._simulation, mode, contacts, self._long_range)
            self._count(mode, number, spent, number * rough)

    def _count(self, mode: str, number: float, seconds: float, rough: float) -> None:
        self._sums[mode] = [*map(add, self._sums[mode], (number, seconds, rough))]

    def record(self) -> None:
        """Add what was measured to the table, if it was enough and the table can be written."""
        least = dict.fromkeys(MODES, LEAST_STEPS) | {OUTPUT: LEAST_OUTPUTS, DRAWING: 1}
        found = {
            mode: {"ratio": spent / rough, "seconds": spent}
            for mode, (number, spent, rough) in self._sums.items()
            if number >= least[mode] and spent >= LEAST_SECONDS
        }
        spent = math.fsum(one["seconds"] for one in found.values())
        if spent < 2.0 * self._recorded or not found:  # many short runs of one simulation write it only sometimes
            return
        self._recorded, table = spent, read_speeds()
        known = table.setdefault(self._kind, {})
        known |= {
            mode: one for mode, one in found.items() if one["seconds"] > REPLACES * known.get(mode, one)["seconds"]
        }
        write_record(_path(), {"units": UNITS, "kinds": table})


def _path() -> Path:
    return cache_folder().parent / "step-speeds.json"


def read_speeds() -> dict[str, dict[str, dict[str, float]]]:
    """The table, by kind of simulation and kind of step; one that is damaged or of other units counts as empty."""
    try:
        content = read_record(_path())
        table = {
            str(kind): {mode: {key: float(one[key]) for key in ("ratio", "seconds")} for mode, one in found.items()}
            for kind, found in (content["kinds"] if content["units"] == UNITS else {}).items()
        }
    except (ValueError, TypeError, KeyError, AttributeError):
        return {}
    whole = all(
        mode in (*MODES, OUTPUT, DRAWING) and 0.0 < one["ratio"] < math.inf
        for runs in table.values()
        for mode, one in runs.items()
    )
    return table if whole else {}
