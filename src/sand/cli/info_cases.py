"""What `sand info` says of case files, of runs and of jobs."""

from __future__ import annotations

import math
import shlex
from collections.abc import Callable
from pathlib import Path

from ..basics.errors import naming
from ..basics.units import format_quantity
from ..config.build import simulation_of
from ..config.commands import LOADINGS, command_for
from ..io import run_folder as files
from . import report
from .info_cost import cost_of, limits_of, of_each
from .info_jobs import JOBS, Description

PLANNED = 8
"""Packings of different seeds that are set up for the estimate of the cost, at most."""


def describe_case(path: Path) -> Description:
    """Check and describe a case file, with the choices that would be made automatically."""
    meant_for = command_for(files.read_toml(path))
    if meant_for in JOBS:
        return JOB_CASES[meant_for](path, ("run it with", f"sand {meant_for} {shlex.quote(str(path))}"))
    return run_case(path)


def run_case(path: Path) -> Description:
    """Check and describe the case of a run, with the choices that would be made automatically."""
    from ..config.case import read_case
    from ..simulation.serialise import case_of

    case = read_case(path)
    if case.grains.kind == "given":
        rows = [("grains", f"{case.grains.number}, from a script"), ("box", case.box.space.describe())]
        return "the case of a run", rows, {"kind": "case", "case": files.read_toml(path)}
    with naming(path):
        simulation = simulation_of(case, None)
    end = math.inf if case.run.until is None else case.run.until
    steps = math.inf if case.run.steps is None else case.run.steps
    limits = limits_of(simulation)
    ends = (end, steps, case.run.stop)
    cost, costs = cost_of(simulation, *ends)
    content = {"kind": "case", "case": case_of(simulation, *ends), "choices": simulation.choices, "limits": limits}
    rows = report.opening(simulation, *ends, Path(case.run.out or path.stem))
    return "a valid case", [*rows, *costs, *limits.items()], content | {"cost": cost}


def _collision_case(path: Path, start: tuple[str, str]) -> Description:
    from ..experiments.collision import expected_end, latest_end
    from ..experiments.collision_case import read_collision

    case = read_collision(path)
    seeds = case.impact.seeds
    with naming(path):
        simulation, start_of_first = case.check(), case.approach(seeds[0])
    bodies = f"{case.projectile.kind} on {case.target.kind}, {len(simulation.grains)} grains"
    expected, longest = (each(start_of_first, case.ending()) for each in (expected_end, latest_end))
    cost, costs = cost_of(simulation, expected, math.inf, None, len(seeds))
    note = f"the outcome decides when a collision ends, at {format_quantity(longest, 's')} at the latest"
    note = note if longest > expected else f"at {format_quantity(longest, 's')}"
    number = ("seeds", str(len(seeds)))
    rows = [("bodies", bodies), number, *of_each(costs, len(seeds), "collision"), ("end", note), start]
    content = {"kind": "collision case", "case": files.read_toml(path), "cost": cost}
    return "a valid collision case", rows, content


def _growth_case(path: Path, start: tuple[str, str]) -> Description:
    from ..config.case import check_case
    from ..experiments.dilute_case import describe_population, is_dilute
    from ..experiments.growth_case import DEFAULT_SEEDS, read_growth

    content, given = read_growth(path)
    seeds = given or DEFAULT_SEEDS
    if is_dilute(content):
        with naming(path):
            rows, numbers = describe_population(content, seeds[0])
        of_all = ("populations", f"{len(seeds)} of {rows.pop(0)[1]}")
        return "a valid case of growth in dilute dust", [of_all, *rows, start], {"kind": "growth case", **numbers}
    case = check_case(content, "")
    with naming(path):
        simulation = simulation_of(case, None)
    limits, ends = limits_of(simulation), (case.run.until or math.inf, case.run.steps or math.inf)
    cost, costs = cost_of(simulation, *ends, None, len(seeds), len(seeds))
    boxes = ("boxes", f"{len(seeds)} of {len(simulation.grains)} grains")
    rows = [boxes, *of_each(costs, len(seeds), "box"), *limits.items(), start]
    content = {"kind": "growth case", "case": {**content, "seeds": given}, "limits": limits, "cost": cost}
    return "a valid growth case", rows, content


def _laboratory_case(path: Path, start: tuple[str, str]) -> Description:
    from ..experiments.laboratory import simulation_of, slow_from
    from ..experiments.laboratory_case import read_laboratory

    content = files.read_toml(path)
    case = read_laboratory(path, command_for(content) or "")
    seeds = case.section.seeds
    with naming(path):
        planned = case.first_plan()
        good = slow_from(planned)
        simulation = simulation_of(planned, case.physics(), stepping=case.stepping)
    limits = limits_of(simulation)
    ends = [planned.until, *(case.plan(seed).until for seed in seeds[1:PLANNED])]
    cost, costs = cost_of(simulation, sum(ends) / len(ends), math.inf, None, len(seeds), len(seeds))
    first, last = (format_quantity(float(f"{end:.3g}"), "s") for end in (min(ends), max(ends)))
    scales = planned.scales
    energy = f"12 pi^2 gamma R xi_c roll_factor = {scales.roll_energy:.3g} J; E_roll/r^3 = {scales.pressure:.3g} Pa"
    sides = " x ".join(format_quantity(float(f"{side:.3g}"), "m") for side in planned.sides)
    rows = [
        ("aggregate", f"{len(simulation.grains)} grains, filling factor {planned.filling(planned.sides):.3g}"),
        ("between walls" if planned.loading.by == "walls" else "box", sides),
        ("rate of strain", f"{planned.rate_text(planned.rate)}; the largest that is slow enough: {good}")
        if good
        else ("lid", "moves freely under the pressure, with the mass of all grains"),
        ("E_roll", energy),
        ("dashpots", f"1 % of the critical one is damping_constant = {0.01 * scales.critical_damping:.2g} kg/s"),
        ("seeds", str(len(seeds))),
        *of_each(costs, len(seeds), "run"),
        ("end", f"at {first}" if first == last else f"at {first} to {last}, according to the seed"),
        *limits.items(),
        start,
    ]
    numbers = {"rate": planned.rate, "until": planned.until, "sides": planned.sides.tolist(), **scales._asdict()}
    return "a valid case", rows, {"kind": "laboratory case", "case": content, "cost": cost, "limits": limits} | numbers


def _elastic_case(path: Path, start: tuple[str, str]) -> Description:
    from ..experiments.laboratory_case import read_laboratory

    content, case = files.read_toml(path), read_laboratory(path, "elastic")
    seeds = case.section.seeds
    with naming(path):
        begun = case.first_plan()
    limits, grains = limits_of(begun.simulation), len(begun.simulation.grains)
    cost, costs = cost_of(begun.simulation, begun.until, math.inf, None, len(seeds), 1)
    rows = [
        ("packing", f"{grains} grains, box at the start {begun.simulation.box.describe()}"),
        ("seeds", str(len(seeds))),
        *of_each(costs, len(seeds), "seed"),
        ("cost", "a rough estimate: how long a packing needs to come to rest is seen then"),
        *limits.items(),
        start,
    ]
    return "a valid case", rows, {"kind": "elastic case", "case": content, "cost": cost, "limits": limits}


def _scattering_case(path: Path, start: tuple[str, str]) -> Description:
    from ..experiments.scattering.flight_cost import expected_flights
    from ..experiments.scattering.scatter_case import read_scattering

    case, flights = read_scattering(path)
    rows: report.Rows = [("job", case.measure.job)]
    for flight in flights:
        capture = f", b_max = {format_quantity(flight.scales.capture, 'm')}" if flight.scales.capture else ""
        rows.append((f"{flight.speed:.4g} m/s", f"from {format_quantity(flight.distance, 'm')}{capture}"))
    number, seconds, source = expected_flights(case, flights)
    took = report.format_wall_time(float(f"{seconds:.2g}"))
    rows += [("flights", f"about {number:.2g}"), ("wall time", f"about {took} by one worker ({source})"), start]
    cost = {"flights": number, "seconds": seconds}
    return "a valid scattering case", rows, {"kind": "scattering case", "case": files.read_toml(path), "cost": cost}


def _sweep_case(path: Path, start: tuple[str, str]) -> Description:
    from ..experiments.sweep_job import SweepJob
    from .sweep import costs_of

    job = SweepJob(path)
    expected = job.expected(job.rows)
    keys = [(key, f"{len({str(row.values[key]) for row in job.rows})} values") for key in job.keys]
    rows = [("runs", f"{len(job.rows)} of {job.kind.NAME}"), *keys, *costs_of(expected, len(job.rows), 1), start]
    content = {"kind": "sweep case", "case": files.read_toml(path), "runs": len(job.rows)}
    return "a valid case of a sweep", rows, content | {"cost": expected._asdict()}


JOB_CASES: dict[str, Callable[[Path, tuple[str, str]], Description]] = {
    "scatter": _scattering_case,
    "collide": _collision_case,
    "grow": _growth_case,
    **dict.fromkeys(LOADINGS, _laboratory_case),
    "elastic": _elastic_case,
    "sweep": _sweep_case,
}
"""Description of the case files of jobs; the second argument is the row with the command that runs the case."""
