"""Cases that a sweep can vary: how the case of each command is checked and run, and what a row of the table holds."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from ..basics.descriptions import documented_units
from ..basics.errors import BadInput, warn
from ..config.build import resume, simulation_of
from ..config.case import Case, check_case, material_errors
from ..config.commands import command_for
from ..config.key_errors import setting_at, validate
from ..config.sections import with_integrator
from ..io.checkpoint_files import checkpoint_files
from ..io.ledger_table import TEMPERATURES
from ..io.run_folder import FLIGHTS
from ..io.sweep_files import COST, TABLE
from ..io.table import GrowingTable
from ..setup.aggregates import chain
from ..simulation.outcome import Outcome
from ..simulation.run_writer import summary_of
from .collision import approach, expected_end, prepare, resume_collision, run_to_end
from .collision_case import CollisionCase
from .collision_outcome import Collision
from .dilute_case import is_dilute
from .elastic_job import measured
from .growth_case import GrowSection
from .laboratory import simulation_of as simulation_of_plan
from .laboratory import slow_from
from .laboratory_case import OF_COMMAND, check_laboratory, model_of
from .laboratory_job import loaded
from .sequential import SequenceCase
from .sweep_case import Expected, SweptCase
from .sweep_population import SweptPopulation

ENCOUNTERS = "encounters"
"""Kind of cases of `sand grow` whose populations grow by encounters."""
SEQUENCE = ("outcome", "impact_energy", "contacts_before", "contacts_after", "gyration_after", "time", "steps", "drift")
"""Results of each collision of a sequence."""


class SweptRun(SweptCase):
    """A case of `sand run`, or of `sand grow`, each box of which is such a run; see `SweptCase`."""

    NAME, GIVEN = "sand run", ("run.seed", "run.out", "grow")
    NO_RESULTS = (
        *("outcome_text", "condition", "grains_concerned", "notes", "warnings", "seed", "choices"),
        *("grains_in_words", "forces_in_words"),
        *("ns_per_grain_step", "versions", "source_digest", "sand"),
    )
    """Entries of the summary that are not results of the simulation; nor are those whose names begin with "wall_"."""

    def __init__(self, content: dict[str, Any], name: str):
        own = {key: table for key, table in content.items() if key != "grow"}
        self.case = check_case(own, name)
        self.seeds = [self.case.run.seed]
        if "grow" in content:
            self.seeds = validate(GrowSection, content["grow"], name, table="grow").seeds

    @staticmethod
    def model(content: dict[str, Any]) -> type:
        """Model of the case file."""
        return with_integrator(Case, content)

    def expected(self, seed: int) -> Expected:
        """Set up the run, and estimate its cost."""
        self.case.run.seed = seed
        run, simulation = self.case.run, simulation_of(self.case, None)
        cost = simulation.expected_cost(_or_never(run.until), _or_never(run.steps), run.stop)
        return Expected(_without_figure(cost), cost.memory, cost.disk)

    def run(self, seed: int, folder: Path | None, observers: Sequence[Any] = ()) -> dict[str, Any]:
        """Take the run to its end; the results are those of its summary."""
        self.case.run.seed = seed
        run, met = self.case.run, None
        ends = {"until": run.until, "steps": run.steps, "stop": run.stop}
        simulation = _resumed(folder, lambda: resume(str(folder), observers=list(observers)))
        if simulation is not None:
            end, last, stop = simulation.planned
            met = simulation.met_condition if stop is not None and simulation.met_condition == stop else None
            if met or simulation.time >= end or simulation.steps >= last:  # killed before its row was written
                ends = {"until": simulation.time, "steps": None, "stop": None}
            elif run.steps is not None:
                ends["steps"] = run.steps - simulation.steps
        else:
            simulation = simulation_of(self.case, folder, overwrite=True, observers=list(observers))
        result = simulation.run(ends.pop("until"), **ends)
        if result.outcome.is_physics:
            raise BadInput(f"stopped by physics: {result}")
        if result.outcome is Outcome.WALL_TIME:
            raise BadInput(f"the wall time of its condition, {run.stop}, is used up")
        summary = summary_of(simulation, result)
        kept = {k: v for k, v in summary.items() if k not in self.NO_RESULTS and not k.startswith("wall_")}
        return kept | ({"outcome": Outcome.CONDITION_MET.name.lower()} if met else {})


class SweptCollision(SweptCase):
    """A case of `sand collide`; see `SweptCase`."""

    NAME, GIVEN = "sand collide", ("impact.seeds", "impact.out")

    def __init__(self, content: dict[str, Any], name: str):
        problems = material_errors(content, ("target", "projectile"), "silica")
        self.case: CollisionCase = validate(self.model(content), content, name, problems)
        self.seeds = list(self.case.impact.seeds)

    @staticmethod
    def model(content: dict[str, Any]) -> type:
        """Model of the case file."""
        return with_integrator(CollisionCase, content)

    def expected(self, seed: int) -> Expected:
        """Set up the collision, and estimate its cost."""
        start, ending = self.case.approach(seed), self.case.ending()
        end = expected_end(start, ending)
        simulation = prepare(start, *self.case.physics(), ending, frame_every=end / ending.frames)
        cost = simulation.expected_cost(end)
        return Expected(_without_figure(cost), cost.memory, cost.disk)

    def run(self, seed: int, folder: Path | None, observers: Sequence[Any] = ()) -> dict[str, Any]:
        """Simulate the collision."""
        start, physics, own = self.case.approach(seed), self.case.physics(), list(observers)
        simulation = _resumed(folder, lambda: resume_collision(start, str(folder), *physics, observers=own))
        if simulation is None:
            simulation = prepare(start, *physics, out=folder, overwrite=True, observers=own)
        found = run_to_end(start, simulation, self.case.ending()).to_dict()
        return {key: value for key, value in found.items() if key not in ("seed", "speed")}


class SweptSequence(SweptCollision):
    """A case of sequential collisions, which only a sweep reads; the table of a run has a row for each collision."""

    NAME = "sequential collisions"

    def __init__(self, content: dict[str, Any], name: str):
        problems = material_errors(content, ("target",), "silica")
        self.case: SequenceCase = validate(self.model(content), content, name, problems)
        self.seeds = list(self.case.impact.seeds)

    @staticmethod
    def model(content: dict[str, Any]) -> type:
        """Model of the case file."""
        return with_integrator(SequenceCase, content)

    def expected(self, seed: int) -> Expected:
        """Twice the cost of the last collision, estimated for chains: each one before costs half as much; no files."""
        case, body = self.case, self.case.body(seed)
        count = len(body) * 2 ** (case.sequence.collisions - 1)
        long = chain(count, radius=float(body.radius.mean()), material=body.materials[0])
        start = approach(long, long, speed=case.impact.speed, impact_parameter=0.0, along="x", seed=seed)
        cost = prepare(start, *case.physics(), case.ending()).expected_cost(expected_end(start, case.ending()))
        seconds = _without_figure(cost)
        return Expected(None if seconds is None else 2.0 * seconds, cost.memory, 0.0)

    def run(self, seed: int, folder: Path | None, observers: Sequence[Any] = ()) -> dict[str, Any]:
        """Simulate all collisions; nothing is kept of an interrupted run."""
        found = [one.to_dict() for one in self.case.collide(seed, observers)]
        sizes = [one["fragments"] for one in found]
        counts = {"largest": [one[0] for one in sizes], "fragments": [len(one) for one in sizes]}
        return {TABLE: {key: [one[key] for one in found] for key in SEQUENCE} | counts}


class SweptScattering(SweptCase):
    """A case of `sand scatter` with one cross-section; see `SweptCase`."""

    NAME, GIVEN = "sand scatter", ("measure.seed", "measure.out")
    NO_RESULTS = ("profile", "interval", "seconds", "seed", "speed")

    def __init__(self, content: dict[str, Any], name: str):
        from .scattering.scatter_case import ScatterCase

        problems = material_errors(content, ("target", "projectile"), "silica")
        self.case: Any = validate(ScatterCase, content, name, problems)
        if self.case.measure.job != "cross-section":
            raise BadInput(f"{name}: measure.job = {self.case.measure.job!r}; a sweep computes cross-sections")
        if isinstance(self.case.flight.speed, list):
            raise BadInput(f"{name}: flight.speed: a run of a sweep has one speed; give them as --vary flight.speed=…")
        self.seeds = [self.case.measure.seed]

    @staticmethod
    def model(content: dict[str, Any]) -> type:
        """Model of the case file."""
        from .scattering.scatter_case import ScatterCase

        return ScatterCase

    def expected(self, seed: int) -> Expected:
        """Set up the flights, and estimate their cost."""
        from .scattering.flight_cost import expected_flights

        number, seconds, _ = expected_flights(self.case, self.case.flights())
        return Expected(seconds, 0.0, 100.0 * number)

    def run(self, seed: int, folder: Path | None, observers: Sequence[Any] = ()) -> dict[str, Any]:
        """Measure the cross-section; the flights that are in the folder are not computed again."""
        from .scattering.cross_sections import measure
        from .scattering.flights import COLUMNS

        self.case.measure.seed = seed
        (flight,), goal = self.case.flights(), self.case.measure.relative_error
        how: dict[str, Any] = {}
        if folder is not None:
            table = GrowingTable(folder / FLIGHTS, COLUMNS, resume=True)
            how = {"known": table.rows, "keep": lambda rows: table.add(rows.tolist())}
        found = measure(flight, relative_error=goal, seed=seed, **how).to_dict()
        return {key: value for key, value in found.items() if key not in self.NO_RESULTS}


class SweptLoading(SweptCase):
    """A case of `sand compress`, `sand stretch` or `sand shear`; see `SweptCase`."""

    NAME = "packings that are loaded"
    GIVEN = tuple(f"{table}.{key}" for table in OF_COMMAND.values() for key in ("seeds", "out"))

    def __init__(self, content: dict[str, Any], name: str):
        self.case = check_laboratory(content, name)
        self.seeds = list(self.case.section.seeds)

    @staticmethod
    def model(content: dict[str, Any]) -> type:
        """Model of the case file."""
        return model_of(content)

    def expected(self, seed: int) -> Expected:
        """Set up the packing, and estimate its cost."""
        planned = self.case.plan(seed)
        slow_from(planned)
        cost = simulation_of_plan(planned, self.case.physics(), stepping=self.case.stepping).expected_cost(
            planned.until
        )
        return Expected(_without_figure(cost), cost.memory, cost.disk)

    def run(self, seed: int, folder: Path | None, observers: Sequence[Any] = ()) -> dict[str, Any]:
        """Load the packing."""
        return loaded(self.case, seed, folder, observers, resumed=True)


class SweptElastic(SweptLoading):
    """A case of `sand elastic`; see `SweptCase`."""

    NAME = "packings at rest"

    def expected(self, seed: int) -> Expected:
        """Set up the packing, and estimate its cost."""
        begun = self.case.plan(seed)
        cost = begun.simulation.expected_cost(begun.until)
        return Expected(_without_figure(cost), cost.memory, 0.0)

    def run(self, seed: int, folder: Path | None, observers: Sequence[Any] = ()) -> dict[str, Any]:
        """Measure the packing; its waves and matrices are left out."""
        found = measured(self.case, seed, observers)
        return {name: value for name, value in found.items() if name == TABLE or not isinstance(value, list)}


def _resumed(folder: Path | None, make: Callable[[], Any]) -> Any:
    """The simulation of an interrupted run; None if there is none, or none that can be continued, which is noted."""
    if folder is None or not checkpoint_files(folder):
        return None
    try:
        return make()
    except BadInput as error:
        warn(f"{error.problems[0]}; the run begins again")
        return None


def _or_never(end: float | None) -> float:
    return math.inf if end is None else end


def _without_figure(cost: Any) -> float | None:
    """Wall time [s] of a run in a worker process that has started, and that draws nothing."""
    return None if cost.seconds is None else cost.seconds - cost.parts.get("start", 0.0)


CASES: dict[str, type[SweptCase]] = {
    "run": SweptRun,
    "grow": SweptRun,
    ENCOUNTERS: SweptPopulation,
    "collide": SweptCollision,
    "sequence": SweptSequence,
    "scatter": SweptScattering,
    **dict.fromkeys(OF_COMMAND, SweptLoading),
    "elastic": SweptElastic,
}
"""The cases that a sweep can vary, by the command that reads them: one line for each."""


def case_kind(content: dict[str, Any]) -> str:
    """Which of `CASES` the content of a case file is; "" if none of them, or no case."""
    if is_dilute(content):
        return ENCOUNTERS
    found = command_for(content)
    return found if found in CASES else ""


def units_of(content: dict[str, Any], columns: Iterable[str]) -> dict[str, str]:
    """Units of columns of the table of a sweep: of keys of its case, and of results; those without one are missing."""
    content = {table: value for table, value in content.items() if table != "sweep"}
    model = CASES[case_kind(content)].model(content)
    of_runs = {"dissipated": "J", **dict.fromkeys((*TEMPERATURES, "temperature_at_start"), "K")}
    # results of other kinds share names of collisions
    results = documented_units(Collision) | of_runs | dict.fromkeys(COST, "s")
    found = {name: "J" if name.startswith("lost_") else results.get(name, "") for name in columns}
    found |= {key: getattr(setting_at(model, tuple(key.split("."))), "unit", "") for key in found if "." in key}
    return {name: unit for name, unit in found.items() if unit not in ("", "1")}
