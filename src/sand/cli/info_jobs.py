"""`sand info` of jobs: cases, folders and results of `sand scatter`, `sand collide` and `sand grow`."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

from ..config.commands import command_for
from ..errors import BadInput
from ..io import run_folder as files
from . import report
from .report import Description

JOBS = {
    "scatter": ("a scattering job", "scattering"),
    "collide": ("collisions", "collision"),
    "grow": ("boxes", "growth"),
}
"""Names of jobs by command: for people, and the `kind` for machines."""


def describe_other_case(path: Path) -> Description | None:
    """Check and describe a case of another command; None if it is a case of `sand run`."""
    content = files.read_toml(path)
    command = command_for(content)
    if command == "scatter":
        return _scatter_case(path)
    if command == "collide":
        return _collision_case(path, content)
    return _growth_case(path) if command == "grow" else None


def _collision_case(path: Path, content: dict[str, Any]) -> Description:
    from ..experiments.collision_case import read_collision

    case = read_collision(path)
    simulation = report.with_notes(lambda: report.with_file_name(path, case.check))
    rows: report.Rows = [
        ("bodies", f"{case.projectile.kind} on {case.target.kind}, {len(simulation.grains)} grains"),
        ("seeds", str(len(case.impact.seeds))),
        ("run it with", f"sand collide {shlex.quote(str(path))}"),
    ]
    return f"{path}: a valid collision case", rows, {"kind": "collision case", "case": content}


def _growth_case(path: Path) -> Description:
    from ..config.build import simulation_of
    from ..config.case import check_case
    from ..experiments.growth_case import read_growth

    content, seeds = read_growth(path)
    simulation = report.with_notes(
        lambda: report.with_file_name(path, lambda: simulation_of(check_case(content, ""), None))
    )
    rows: report.Rows = [
        ("boxes", f"{len(seeds or [])} of {len(simulation.grains)} grains"),
        ("run it with", f"sand grow {shlex.quote(str(path))}"),
    ]
    return f"{path}: a valid growth case", rows, {"kind": "growth case", "case": {**content, "seeds": seeds}}


def _scatter_case(path: Path) -> Description:
    from ..experiments.scattering.case import read_scattering
    from ..units import format_quantity

    case, flights = read_scattering(path)
    rows: report.Rows = [("job", case.measure.job)]
    for flight in flights:
        capture = f", b_max = {format_quantity(flight.scales.capture, 'm')}" if flight.scales.capture else ""
        rows.append((f"{flight.speed:.4g} m/s", f"from {format_quantity(flight.distance, 'm')}{capture}"))
    rows.append(("run it with", f"sand scatter {shlex.quote(str(path))}"))
    return f"{path}: a valid scattering case", rows, {"kind": "scattering case", "case": files.read_toml(path)}


def describe_job_folder(path: Path) -> Description | None:
    """Describe a folder of `sand scatter`, `sand collide` or `sand grow`; None if it is not one."""
    listed = [("files", "  ".join(report.files_of(path)))]
    for name in (files.SCATTERING, files.COLLISION):
        if (path / name).exists() and (job := describe_job_file(path / name)):
            heading, rows, content = job
            return f"{path}: {heading.split(': ', 1)[1]}", rows + listed, {**content, "folder": str(path)}
    single = (path / files.ONE_COLLISION).exists()  # case.toml is then that of the simulation
    command = "collide" if single else command_for(files.read_toml(path / files.CASE))
    if command not in JOBS:
        return None
    name, kind = JOBS[command]
    case = path / (files.ONE_COLLISION if single else files.CASE)
    if not files.is_job(path, case):
        rows = [("state", "not started"), *listed, ("run it with", f"sand {command} {shlex.quote(str(case))}")]
        return f"{path}: {name}", rows, {"kind": kind, "folder": str(path), "finished": False}
    if command == "grow":
        ends = [files.read_json(summary).get("outcome") for summary in path.glob(f"seed-*/{files.SUMMARY}")]
        listed.append(("boxes", f"{ends.count('finished')} finished"))
        if (path / files.GROWTH).exists():
            content = {"kind": kind, "folder": str(path), "finished": True, **files.read_json(path / files.GROWTH)}
            rows = [("state", "finished"), *listed, ("measure with", f"sand analyse {shlex.quote(str(path))}")]
            return f"{path}: {name}", rows, content
    rows = [("state", "running, or interrupted"), *listed, ("continue with", report.resume_line(path))]
    return f"{path}: {name}", rows, {"kind": kind, "folder": str(path), "finished": False}


def describe_job_file(path: Path) -> Description | None:
    """Describe scattering.json or collision.json; None for any other file.  Raises BadInput if it is incomplete."""
    content = files.read_json(path)
    command = "scatter" if "job" in content else "collide" if "collisions" in content else None
    if command is None:
        return None
    name, kind = JOBS[command]
    try:
        rows = _scattering_rows(content) if command == "scatter" else _collision_rows(content)
    except (KeyError, TypeError, ValueError, AttributeError, IndexError):
        raise BadInput(f"{path} is not a result of SAND") from None
    return f"{path}: {name}", rows, {"kind": kind, **content}


def _scattering_rows(content: dict[str, Any]) -> report.Rows:
    from .scatter import result_rows

    return [("job", content["job"]), *result_rows(content)]


def _collision_rows(content: dict[str, Any]) -> report.Rows:
    from .collide import collision_line, outcome_counts

    rows = [(f"seed {one['seed']}", collision_line(one)) for one in content["collisions"][:12]]
    return [*rows, ("outcomes", outcome_counts(content["collisions"]))]
