"""`sand info DIR|FILE`: describes a run, a job or one of their files on one screen."""

from __future__ import annotations

import math
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from ..basics.errors import BadInput
from ..config.commands import command_for
from ..config.folders import job_in
from ..io import run_folder as files
from ..io.checkpoint_files import checkpoint_files
from ..io.ledger_table import read_ledger
from . import options, parsing, report
from .collide import collision_rows
from .laboratory import run_rows
from .scatter import result_rows

COMPILATION = 5.0
"""Wall time [s] expected of the compilation of a stage that was never compiled on this machine."""
Description = tuple[str, report.Rows, dict[str, Any]]
"""Heading and rows for people, and the same content for machines."""
JOBS = {
    "scatter": ("a scattering job", "scattering"),
    "collide": ("collisions", "collision"),
    "grow": ("boxes", "growth"),
    **{name: (f"a job of sand {name}", name) for name in ("compress", "stretch", "shear")},
    "sweep": ("a sweep", "sweep"),
}
"""Names of jobs by command: for people, and the `kind` for machines."""


@parsing.command("info", short_help="Describe a run or one of its files.")
@click.argument("path", metavar="DIR|FILE", type=options.RUN_OR_CASE)
@options.imports
@options.output
def command(path: str, **output: bool) -> None:
    """Describe the folder of a run, a case file, trajectory.gsd, ledger.csv, summary.json or a checkpoint.

    Also describes cases, folders and results of `sand scatter`, `sand collide`, `sand grow` and `sand sweep`.

    A case file is checked as by `sand run`, but not run.
    """
    heading, rows, content = _describe(Path(path))
    report.answer(content, f"{path}: {heading}", rows, **output)


def _describe(path: Path) -> Description:
    """Describe a folder or a file according to its type.  Raises BadInput."""
    if path.is_dir():
        return describe_folder(path)
    if not path.exists():
        raise BadInput(f"there is no file or folder {path}")
    if path.suffix not in FILE_TYPES:
        raise BadInput(
            f"{path} is not a file that SAND can describe; give a run's folder, a case file (.toml), trajectory.gsd, "
            "a checkpoint (.npz), summary.json or ledger.csv"
        )
    return FILE_TYPES[path.suffix](path)


def _summary(path: Path) -> dict[str, Any]:
    """Read the summary of a run.  Raises BadInput if it lacks entries."""
    summary = files.read_json(path)
    try:
        report.results(summary)
        if {"outcome", "outcome_text", "grains_concerned", "choices", "grains"} <= summary.keys():
            return summary
    except (KeyError, TypeError, ValueError):
        pass
    raise BadInput(f"{path} is not a summary of SAND")


def _ledger(path: Path) -> list[dict[str, float]]:
    """Read the rows of a ledger.  Raises BadInput."""
    rows = read_ledger(path)
    if not rows or not {"step", "time", "total", "clusters", "mean_cluster_size", "largest_cluster"} <= rows[0].keys():
        raise BadInput(f"{path} is not a ledger of SAND, or an empty one")
    return rows


def describe_folder(path: Path) -> Description:
    """Describe the folder of a run or a job: its outcome, or its present state."""
    if not any((path / name).exists() for name in (files.CASE, files.ONE_COLLISION)):
        raise BadInput(f"{path} is not the folder of a run: there is no {files.CASE} in it")
    listed = ("files", "  ".join(report.files_of(path)))
    for name in (files.SCATTERING, files.COLLISION, files.LABORATORY):
        if (path / name).exists() and (job := _describe_results(path / name, files.read_json(path / name))):
            heading, rows, content = job
            return heading, [*rows, listed], {**content, "folder": str(path)}
    job_command, case, begun = job_in(path)
    if job_command in JOBS:
        return _describe_job(path, job_command, case, begun, [listed])
    return _describe_run(path, listed)


def _describe_run(path: Path, listed: tuple[str, str]) -> Description:
    from ..basics.units import format_quantity

    until, condition = _planned_end(path / files.CASE)
    summary = _summary(path / files.SUMMARY) if (path / files.SUMMARY).exists() else None
    ledger = _ledger(path / files.LEDGER) if (path / files.LEDGER).exists() else []
    last = ledger[-1] if ledger else None
    # a running or killed run has rows in its ledger after its last summary
    beyond = last if last and (summary is None or last["step"] > summary["steps"]) else None
    rows: report.Rows = []
    if summary is not None:
        named = report.named(summary["grains_concerned"])
        rows += [("outcome", summary["outcome_text"] + named), ("grains", str(summary["grains"]))]
        rows += [*summary["choices"].items(), *report.results(summary)]
    if beyond is not None:
        rows += [
            ("state" if summary is None else "since then", "running, or killed"),
            ("last frame", f"{format_quantity(beyond['time'], 's')} after {beyond['step']} steps"),
            ("clusters", report.clusters(beyond)),
        ]
    if until is not None:
        rows.append(("planned end", format_quantity(until, "s")))
    if condition is not None:
        rows.append(("ends if", condition))
    rows.append(listed)
    ended = summary and not beyond and summary["outcome"] == "finished" and summary["time"] >= (until or 0.0)
    if checkpoint_files(path) and not ended:
        rows.append(("continue with", report.resume_line(path)))
    content = {"kind": "run", "folder": str(path), "summary": summary, "last_row": last}
    return "a run", rows, content | {"planned_end": until, "files": report.files_of(path)}


def _planned_end(case: Path) -> tuple[float | None, str | None]:
    """Time [s] and condition that end a run, which the user may have edited, from its case file.  Raises BadInput."""
    from ..simulation.cadence import duration

    run = files.read_toml(case).get("run", {})
    if not isinstance(run, dict):
        raise BadInput(f"{case}: run must be a table, [run]")
    until, condition = run.get("until"), run.get("stop")
    if condition is not None and not isinstance(condition, str):
        raise BadInput(f"{case}: run.stop must be text, such as 'clusters == 1'")
    try:
        return None if until is None else duration(until, "until"), condition
    except BadInput as error:
        raise error.at(f"{case}: run") from None


def _describe_job(path: Path, job_command: str, case: Path, begun: bool, rows: report.Rows) -> Description:
    """Describe an unfinished job, or the boxes of `sand grow`."""
    name, kind = JOBS[job_command]
    name = "a collision" if case.name == files.ONE_COLLISION else name
    content: dict[str, Any] = {"kind": kind, "folder": str(path), "finished": False}
    if not begun:
        start = ("run it with", f"sand {job_command} {shlex.quote(str(case))}")
        return name, [("state", "not started"), *rows, start], content
    if job_command == "sweep":
        rows.append(("ended", f"{sum(1 for _ in path.glob(f'{files.RUNS}/*/{files.ROW}'))} runs"))
        if (path / files.SWEEP).exists():
            found = files.read_json(path / files.SWEEP)
            numbers = f"{found['done']} of {found['runs']} done, {found['failed']} failed"
            rows = [("state", f"finished: {numbers}"), *rows, ("draw with", f"sand plot {shlex.quote(str(path))}")]
            return name, rows, content | {"finished": True} | found
    if job_command == "grow":
        ends = [files.read_json(summary).get("outcome") for summary in path.glob(f"seed-*/{files.SUMMARY}")]
        rows.append(("boxes", f"{ends.count('finished')} finished"))
        if (path / files.GROWTH).exists():
            rows = [("state", "finished"), *rows, ("measure with", f"sand analyse {shlex.quote(str(path))}")]
            return name, rows, content | {"finished": True} | files.read_json(path / files.GROWTH)
    return name, [("state", "running, or interrupted"), *rows, ("continue with", report.resume_line(path))], content


def describe_case(path: Path) -> Description:
    """Check and describe a case file, with the choices that would be made automatically."""
    from ..config.build import simulation_of
    from ..config.case import read_case
    from ..simulation.serialise import case_of

    meant_for = command_for(files.read_toml(path))
    if meant_for in JOBS:
        return JOB_CASES[meant_for](path, ("run it with", f"sand {meant_for} {shlex.quote(str(path))}"))
    case = read_case(path)
    if case.grains.kind == "given":
        rows = [("grains", f"{case.grains.number}, from a script"), ("box", case.box.periodic.describe())]
        return "the case of a run", rows, {"kind": "case", "case": files.read_toml(path)}
    with report.naming(path):
        simulation = simulation_of(case, None)
    end = math.inf if case.run.until is None else case.run.until
    steps = math.inf if case.run.steps is None else case.run.steps
    limits = _limits(simulation)
    ends = (end, steps, case.run.stop)
    cost, costs = _cost(simulation, *ends)
    content = {"kind": "case", "case": case_of(simulation, *ends), "choices": simulation.choices, "limits": limits}
    rows = report.opening(simulation, *ends, Path(case.run.out or path.stem))
    return "a valid case", [*rows, *costs, *limits.items()], content | {"cost": cost}


def _cost(
    simulation: Any, end: float, last_step: float, condition: str | None, runs: int = 1, figures: int = 1
) -> tuple[dict[str, Any], report.Rows]:
    """Expected cost of a run, or of several like it one after the other, which draw one figure or one each."""
    from ..compiler.jit import COMPILE_TIMES
    from ..compiler.progress import compile_times

    cost, missing = simulation.expected_cost(end, last_step, condition), simulation._engine.uncompiled()
    if cost.seconds is not None:
        parts = {name: (figures if name == "start" else runs) * value for name, value in cost.parts.items()}
        # collisions of many seeds keep no files
        disk = runs * cost.disk if figures == runs and cost.disk is not None else None
        cost = cost._replace(parts=parts, seconds=sum(parts.values()), disk=disk)
    known = compile_times(COMPILE_TIMES)
    compilation = sum(known.get(name, COMPILATION) for name in missing)
    names = f"{', '.join(missing[:3])}{f' and {len(missing) - 3} more' if len(missing) > 3 else ''}"
    rows = [
        ("steps", _steps(cost)),
        ("wall time", _wall_time(cost)),
        ("memory", f"about {report.format_bytes(cost.memory)}"),
        *([] if cost.disk is None else [("disk", f"about {report.format_bytes(cost.disk)}")]),
        ("compilation", f"about {compilation:.0f} s, if all is used: {names}" if missing else "none"),
    ]
    content = {**cost._asdict(), "measured": bool(cost.measured), "compiled": missing}
    return content | {"compilation_seconds": compilation}, rows


def _steps(cost: Any) -> str:
    """Expected steps, for people."""
    from ..basics.units import format_quantity

    each = f"about {format_quantity(float(f'{cost.step:.2g}'), 's')} each"
    if cost.steps is None:
        return each
    number = f"{cost.bound or 'about'} {cost.steps:.2g}"
    if cost.contact_steps is None:
        return f"{number}, {each}"
    return f"{number} of bodies, {each}, and about {cost.contact_steps:.2g} contact steps of awake clusters"


def _wall_time(cost: Any) -> str:
    """Expected wall time and its parts, for people."""
    if cost.seconds is None:
        return "depends on the condition"
    stepping, output, start = (report.format_wall_time(float(f"{v:.2g}")) for v in cost.parts.values())
    total = report.format_wall_time(float(f"{cost.seconds:.2g}"))
    source = f"speed {cost.measured}" if cost.measured else "rough estimate: no run was measured on this machine"
    return f"{cost.bound or 'about'} {total}: steps {stepping}, output {output}, start and figure {start} ({source})"


def _limits(simulation: Any) -> dict[str, str]:
    """Limits of the model for the grains and forces of a simulation, by label."""
    from ..limits.model_limits import limit_rows

    return limit_rows(simulation.grains, simulation.forces, simulation.box)


def _collision_case(path: Path, start: tuple[str, str]) -> Description:
    from ..basics.units import format_quantity
    from ..experiments.collision import expected_end, latest_end
    from ..experiments.collision_case import read_collision

    case = read_collision(path)
    seeds = case.impact.seeds
    with report.naming(path):
        simulation, start_of_first = case.check(), case.approach(seeds[0])
    bodies = f"{case.projectile.kind} on {case.target.kind}, {len(simulation.grains)} grains"
    expected, longest = (each(start_of_first, case.ending()) for each in (expected_end, latest_end))
    cost, costs = _cost(simulation, expected, math.inf, None, len(seeds))
    note = f"the outcome decides when a collision ends, at {format_quantity(longest, 's')} at the latest"
    note = note if longest > expected else f"at {format_quantity(longest, 's')}"
    rows = [
        ("bodies", bodies),
        ("seeds", str(len(seeds))),
        *_of_each(costs, len(seeds), "collision"),
        ("end", note),
        start,
    ]
    content = {"kind": "collision case", "case": files.read_toml(path), "cost": cost}
    return "a valid collision case", rows, content


def _of_each(costs: report.Rows, number: int, name: str) -> report.Rows:
    """Rows of the cost of several runs: the steps are those of one of them, the wall time that of all by one worker."""
    if number == 1:
        return costs
    texts = dict(costs)
    texts["steps"] += f", in each {name}"
    texts["wall time"] += f"; all {number} by one worker"
    return list(texts.items())


def _growth_case(path: Path, start: tuple[str, str]) -> Description:
    from ..config.build import simulation_of
    from ..config.case import check_case
    from ..experiments.growth_case import DEFAULT_SEEDS, read_growth

    content, given = read_growth(path)
    seeds = given or DEFAULT_SEEDS
    case = check_case(content, "")
    with report.naming(path):
        simulation = simulation_of(case, None)
    limits, ends = _limits(simulation), (case.run.until or math.inf, case.run.steps or math.inf)
    cost, costs = _cost(simulation, *ends, None, len(seeds), len(seeds))
    boxes = ("boxes", f"{len(seeds)} of {len(simulation.grains)} grains")
    rows = [boxes, *_of_each(costs, len(seeds), "box"), *limits.items(), start]
    content = {"kind": "growth case", "case": {**content, "seeds": given}, "limits": limits, "cost": cost}
    return "a valid growth case", rows, content


def _laboratory_case(path: Path, start: tuple[str, str]) -> Description:
    from ..basics.units import format_quantity
    from ..experiments.laboratory import simulation_of, slow_from
    from ..experiments.laboratory_case import read_laboratory

    content = files.read_toml(path)
    case = read_laboratory(path, command_for(content) or "")
    seeds = case.section.seeds
    with report.naming(path):
        planned = case.first_plan()
        good = slow_from(planned)
        simulation = simulation_of(planned, case.physics(), stepping=case.stepping)
    limits = _limits(simulation)
    cost, costs = _cost(simulation, planned.until, math.inf, None, len(seeds), len(seeds))
    scales = planned.scales
    rate = f"{planned.rate:.3g} 1/s, or {planned.rate * scales.time:.2g} /t_c"
    sides = " x ".join(format_quantity(float(f"{side:.3g}"), "m") for side in planned.sides)
    rows = [
        ("aggregate", f"{len(simulation.grains)} grains, filling factor {planned.filling(planned.sides):.3g}"),
        ("between walls" if planned.loading.by == "walls" else "box", sides),
        ("rate of strain", f"{rate}; the largest that is slow enough: {good}"),
        (
            "E_roll",
            f"12 pi^2 gamma R xi_c roll_factor = {scales.roll_energy:.3g} J; E_roll/r^3 = {scales.pressure:.3g} Pa",
        ),
        ("dashpots", f"1 % of the critical one is damping_constant = {0.01 * scales.critical_damping:.2g} kg/s"),
        ("seeds", str(len(seeds))),
        *_of_each(costs, len(seeds), "run"),
        ("end", f"at {format_quantity(planned.until, 's')}"),
        *limits.items(),
        start,
    ]
    numbers = {
        "rate": planned.rate,
        "until": planned.until,
        "sides": planned.sides.tolist(),
        **planned.scales._asdict(),
    }
    return "a valid case", rows, {"kind": "laboratory case", "case": content, "cost": cost, "limits": limits} | numbers


def _scattering_case(path: Path, start: tuple[str, str]) -> Description:
    from ..basics.units import format_quantity
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
    content = {
        "kind": "scattering case",
        "case": files.read_toml(path),
        "cost": {"flights": number, "seconds": seconds},
    }
    return "a valid scattering case", rows, content


def _sweep_case(path: Path, start: tuple[str, str]) -> Description:
    from ..experiments.sweep_job import SweepJob
    from .sweep import costs_of

    job = SweepJob(path)
    expected = job.expected(job.rows)
    keys = [(key, f"{len({str(row.values[key]) for row in job.rows})} values") for key in job.keys]
    rows = [("runs", f"{len(job.rows)} of {job.kind.NAME}"), *keys, *costs_of(expected, len(job.rows), 1), start]
    content = {"kind": "sweep case", "case": files.read_toml(path), "runs": len(job.rows)}
    return "a valid case of a sweep", rows, content | {"cost": expected._asdict()}


def describe_trajectory(path: Path) -> Description:
    """Describe the frames, times and last frame of a trajectory."""
    from ..basics.units import format_quantity
    from ..io.trajectory import read_frames

    frames = read_frames(path)
    if not frames:
        raise BadInput(f"{path} holds no frame")
    first, last = frames[0], frames[-1]
    rows = [
        ("frames", f"{len(frames)}, from {format_quantity(first.time, 's')} to {format_quantity(last.time, 's')}"),
        ("grains", str(len(last.radius))),
        ("box", last.box.describe()),
        ("last frame", f"step {last.step}, {len(last.pair)} contacts"),
    ]
    content = {
        "kind": "trajectory",
        "frames": len(frames),
        "grains": len(last.radius),
        "first_time": first.time,
        "last_time": last.time,
        "last_step": last.step,
        "contacts": len(last.pair),
        "box": list(last.box.lengths),
    }
    return "a trajectory", rows, content


def describe_checkpoint(path: Path) -> Description:
    """Describe the state in a checkpoint."""
    from ..basics.units import format_quantity
    from ..config.build import read_state

    arrays, meta = read_state(path)
    grains, contacts = len(arrays["grains/radius"]), arrays["contacts/pair"].shape[1]
    end = meta.get("until")
    rows = [
        ("time", f"{format_quantity(meta['time'], 's')} after {meta['steps']} steps"),
        ("grains", f"{grains}, {contacts} contacts"),
        ("planned end", "none" if end is None else format_quantity(end, "s")),
        ("continue with", report.resume_line(path.parent)),
    ]
    return "an intact checkpoint", rows, {"kind": "checkpoint", "grains": grains, "contacts": contacts, **meta}


def describe_json(path: Path) -> Description:
    """Describe the summary of a run, or the results of another command."""
    if (job := _describe_results(path, files.read_json(path))) is not None:
        return job
    summary = _summary(path)
    rows = [("outcome", summary["outcome_text"] + report.named(summary["grains_concerned"]))]
    return "the summary of a run", rows + report.results(summary), {"kind": "summary", **summary}


def _describe_results(path: Path, content: dict[str, Any]) -> Description | None:
    """Describe scattering.json or collision.json; None for any other file.  Raises BadInput if it is incomplete."""
    try:
        if "job" in content:
            (name, kind), rows = JOBS["scatter"], [("job", content["job"]), *result_rows(content)]
        elif "collisions" in content:
            (name, kind), rows = JOBS["collide"], collision_rows(content["collisions"])
            name = "a collision" if len(content["collisions"]) == 1 else name
        elif "loading" in content:
            (name, kind), rows = JOBS[content["loading"]], run_rows(content["runs"])
        else:
            return None
    except (KeyError, TypeError, ValueError, AttributeError, IndexError):
        raise BadInput(f"{path} is not a result of SAND") from None
    return name, rows, {"kind": kind, **content}


def describe_ledger(path: Path) -> Description:
    """Describe the first and the last row of a ledger."""
    from ..basics.units import format_quantity

    ledger = _ledger(path)
    first, last = ledger[0], ledger[-1]
    lost = {name: value for name, value in last.items() if name.startswith("lost_")}
    rows = [
        ("rows", f"{len(ledger)}, from {format_quantity(first['time'], 's')} to {format_quantity(last['time'], 's')}"),
        ("total energy", f"{first['total']:.6g} J at first, {last['total']:.6g} J at last"),
        ("dissipated", ", ".join(f"{k[5:]} {v:.3g} J" for k, v in lost.items())),
        ("clusters", report.clusters(last)),
    ]
    return "the ledger of a run", rows, {"kind": "ledger", "rows": len(ledger), "first": first, "last": last}


JOB_CASES: dict[str, Callable[[Path, tuple[str, str]], Description]] = {
    "scatter": _scattering_case,
    "collide": _collision_case,
    "grow": _growth_case,
    **dict.fromkeys(("compress", "stretch", "shear"), _laboratory_case),
    "sweep": _sweep_case,
}
"""Description of the case files of jobs; the second argument is the row with the command that runs the case."""
FILE_TYPES: dict[str, Callable[[Path], Description]] = {
    ".toml": describe_case,
    ".gsd": describe_trajectory,
    ".npz": describe_checkpoint,
    ".json": describe_json,
    ".csv": describe_ledger,
}
