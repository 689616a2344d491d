"""Expected cost of a run: length and number of steps, wall time and memory.

Runs record what they cost in a table beside the cache of compiled code, by the kinds of forces and the number of
grains; a run of the same kinds is expected to cost the same per grain and step. Kinds of which no run has been measured
on this machine have a rough estimate.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..compiler.cache import read_record, write_record
from ..compiler.jit import cache_folder
from ..contact.law import contact_constants
from ..contact.model import Contact
from ..integrate.rigid_clusters import RigidClusters
from ..integrate.step_control import FLIGHT_FRACTION, MAX_SPIN_ANGLE
from ..integrate.task_queue import uses_task_queue
from ..neighbours.settings import share_within
from ..threads import threads

LEAST_STEPS, LEAST_SECONDS, REPLACES = 500, 0.1, 0.1
"""Fewest steps, and least wall time [s], of a measured cost; it replaces one that was measured for ten times its time
or less."""
STEP, STEP_TIME, CONTACT_STEP, CONTACT_STEP_TIME = "ns_per_grain_step", "seconds", "ns_per_contact_step", "awake_seconds"
"""Names in the table: cost of a grain's step, the time for which it was measured, and both for the contact steps of
awake clusters."""
PER_STEP, PER_FORCE, PER_PAIR = 100e-9, 100e-9, 2e-9
"""Rough wall times [s] per grain and step: of contacts and motion, of each long-range force, and of each pair of it."""
MOST_PAIRS = 300
"""Pairs per grain, at most, in the rough estimate: with more, forces are cut off or are summed once in many steps."""
PROCESS_BYTES = 3.5e8
"""Memory of Python, libraries, compiled code and the figure, measured on Linux."""
COPIES = 3
"""Copies of the arrays of a state: the present state, one at the time of an output, and what is written."""

Simulation = Any
"""`sand.Simulation`, which imports this module."""


class Cost(NamedTuple):
    """Expected cost of a run; None where the end of the run does not determine it."""

    step: float  # mean step [s]
    steps: float | None
    seconds: float | None  # wall time of all steps and output, without compilation [s]
    memory: float  # [bytes]
    measured: str  # the run of this machine from which the cost is known; "" for a rough estimate


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
    elif getattr(force, "periodic", "") == "ewald" and not simulation.box.is_open:
        words.append("ewald")
    return " ".join(words)


def shortest_step(simulation: Simulation) -> float:
    """Step [s] while there are contacts, 2π/ω_max over the steps per period; without contacts that of free flight.

    With rigid clusters, the longest step of bodies while a cluster is awake.
    """
    engine, grains = simulation._engine, simulation.start
    criteria, verlet = engine.parameters.criteria, simulation.stepping.contact_stepping
    if criteria.fixed > 0.0:
        return float(criteria.fixed)
    if isinstance(simulation.stepping, RigidClusters):  # steps of bodies; in the main job they are half as long
        return float(engine.parameters.flight_limits.longest_awake)
    contact = next((force for force in simulation.forces if isinstance(force, Contact)), None)
    if contact is not None and len(grains) > 1:
        smallest = [
            min(np.flatnonzero(grains.material == k), key=lambda i: float(grains.radius[i]))
            for k in range(len(grains.materials))
        ]
        formula, fastest = contact_constants(contact.contact_law), 0.0
        for i in smallest:
            for j in smallest:
                pairing = contact.pairing(*(grains.materials[grains.material[k]] for k in (i, j)))
                sizes = (float(grains.radius[i]), float(grains.radius[j]), float(grains.mass[i]), float(grains.mass[j]))
                fastest = max(fastest, formula(pairing, *sizes).max_squared_frequency)
        if fastest > 0.0:
            return 2.0 * math.pi / math.sqrt(fastest) / float(verlet.steps_per_period)
    speed, spin = (np.linalg.norm(vectors, axis=1).max() for vectors in (grains.velocity, grains.spin))
    limits = [criteria.longest, *([FLIGHT_FRACTION * criteria.pair_gap / speed] if speed else [])]
    return float(min([*limits, *([MAX_SPIN_ANGLE / spin] if spin else [])]))


def expected_cost(simulation: Simulation, end: float, last_step: float) -> Cost:
    """Expected cost of a run of a simulation that has not begun.

    Parameters
    ----------
    end, last_step : float
        Planned end: time [s] and step, infinite where not set.
    """
    count, step = len(simulation.start), shortest_step(simulation)
    pairs = _pairs_per_grain(simulation)
    long_range = len(simulation._engine.long_range)
    rate, ratio, source = PER_STEP + long_range * (PER_FORCE + PER_PAIR * min(pairs, MOST_PAIRS)), 1.0, ""
    known = _read().get(kind_of(simulation), {})
    if known:
        near = min(known, key=lambda grains: abs(math.log(int(grains) / count)))
        rate, ratio = known[near]["ns_per_grain_step"] * 1e-9, known[near]["step_ratio"]
        if "all pairs" in kind_of(simulation):  # the work per grain grows with N
            rate *= max(count / int(near), 1.0)
        source = f"a run of {near} grains on this machine"
    steps: float | None = min(end / (ratio * step), last_step)
    if steps is None or not math.isfinite(steps):
        steps = None
    seconds = None if steps is None else steps * count * rate
    return Cost(ratio * step, steps, seconds, PROCESS_BYTES + _bytes(simulation, pairs), source)


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

    The first call of the driver fills tables and starts threads.
    """

    def __init__(self, simulation: Simulation):
        self._simulation, self._grains, self._calls = simulation, len(simulation.start), 0
        self._sum = np.zeros(4)

    @contextmanager
    def steps(self) -> Iterator[None]:
        """Measure a block in which the engine takes steps."""
        before = self._now()
        with self._simulation._clock.measure("stepping"):
            yield
        if self._calls:
            self._sum += self._now() - before
        self._calls += 1

    def _now(self) -> np.ndarray:
        """Steps, contact steps within steps of bodies, wall time [s] of all steps, and of those of awake clusters."""
        engine = self._simulation._engine
        return np.array([engine.steps, *engine.awake_work, self._simulation._clock.stepping])[[0, 1, 3, 2]]

    def record(self) -> None:
        """Add the measured cost to the table, if there were enough steps and the table can be written."""
        one, (steps, contact_steps, seconds, awake) = self._simulation, self._sum.tolist()
        found: dict[str, float] = {}
        if steps >= LEAST_STEPS and seconds - awake >= LEAST_SECONDS:
            found |= {STEP: 1e9 * (seconds - awake) / (steps * self._grains), STEP_TIME: seconds - awake}
        if contact_steps >= LEAST_STEPS and awake >= LEAST_SECONDS:
            found |= {CONTACT_STEP: 1e9 * awake / contact_steps, CONTACT_STEP_TIME: awake}
        if len(one.start) != self._grains or not found:
            return
        table = _read()
        measured = table.setdefault(kind_of(one), {}).setdefault(str(self._grains), {})
        for name, span in ((STEP, STEP_TIME), (CONTACT_STEP, CONTACT_STEP_TIME)):
            if found.get(span, 0.0) > REPLACES * measured.get(span, 0.0):
                measured |= {name: found[name], span: found[span]}
        write_record(_path(), table)


def _path() -> Path:
    return cache_folder().parent / "step-costs.json"


def _read() -> dict[str, dict[str, dict[str, float]]]:
    """The table; an unreadable or damaged one counts as empty."""
    try:
        return {
            str(kind): {
                str(int(grains)): {
                    name: float(one[name]) for name in (STEP, STEP_TIME, CONTACT_STEP, CONTACT_STEP_TIME) if name in one
                }
                for grains, one in found.items()
                if int(grains) > 0 and min(one.values()) > 0.0
            }
            for kind, found in read_record(_path()).items()
        }
    except (ValueError, TypeError, KeyError, AttributeError):
        return {}
