"""`sand info` of what is not a run: cases, folders and results of `sand scatter` and `sand collide`."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..config.commands import command_for
from ..errors import BadInput
from ..io import run_folder as files
from . import report

UNFINISHED = {
    "scatter": ("a scattering job", "scattering"),
    "collide": ("collisions", "collision"),
    "grow": ("boxes", "growth"),
}
"""Jobs by the command that began them: what they are called for people, and for machines."""
Report = tuple[str, report.Rows, dict[str, Any]]
"""A heading, rows for people, and the same for machines."""


def of_other_case(path: Path) -> Report | None:
    """A case of another command, checked; None if it is not one."""
    content = files.read_toml(path)
    kind = command_for(content)
    if kind == "scatter":
        return _scatter_case(path)
    if kind == "collide":
        return _collision_case(path, content)
    return _growth_case(path) if kind == "grow" else None


def _collision_case(path: Path, content: dict[str, Any]) -> Report:
    from ..experiments.collision_case import read_collision

    case = read_collision(path)
    simulation = report.with_notes(lambda: report.blame(path, case.check))
    rows: report.Rows = [
        ("bodies", f"{case.projectile.kind} on {case.target.kind}, {len(simulation.grains)} grains"),
        ("seeds", str(len(case.impact.seeds))),
        ("run it with", f"sand collide {shlex.quote(str(path))}"),
    ]
    return f"{path}: a collision without mistakes", rows, {"kind": "collision case", "case": content}


def _growth_case(path: Path) -> Report:
    from ..config.build import simulation_of
    from ..config.case import check_case
    from ..experiments.growth_case import read_growth

    content, seeds = read_growth(path)
    simulation = report.with_notes(lambda: report.blame(path, lambda: simulation_of(check_case(content, ""), None)))
    rows: report.Rows = [
        ("boxes", f"{len(seeds or [])} of {len(simulation.grains)} grains"),
        ("run it with", f"sand grow {shlex.quote(str(path))}"),
    ]
    return f"{path}: boxes without mistakes", rows, {"kind": "growth case", "case": {**content, "seeds": seeds}}


def _scatter_case(path: Path) -> Report:
    from ..experiments.scattering.case import read_scattering
    from ..units import format_quantity

    case, flights = read_scattering(path)
    rows: report.Rows = [("job", case.measure.job)]
    for one in flights:
        reach = f", b_max = {format_quantity(one.scales.capture, 'm')}" if one.scales.capture else ""
        rows.append((f"{one.speed:.4g} m/s", f"from {format_quantity(one.distance, 'm')}{reach}"))
    rows.append(("run it with", f"sand scatter {shlex.quote(str(path))}"))
    return (
        f"{path}: a scattering case without mistakes",
        rows,
        {"kind": "scattering case", "case": files.read_toml(path)},
    )


def of_job_folder(path: Path) -> Report | None:
    """A folder of `sand scatter`, `sand collide` or `sand grow`; None if it is not one."""
    for name in (files.SCATTERING, files.COLLISION):
        if (path / name).exists():
            told = of_job_file(path / name)
            assert told is not None
            heading, rows, content = told
            listed = [*rows, ("files", "  ".join(report.files_of(path)))]
            return f"{path}: {heading.split(': ', 1)[1]}", listed, {**content, "folder": str(path)}
    one = (path / files.ONE_COLLISION).exists()  # case.toml is that of its simulation
    kind = "collide" if one else command_for(files.read_toml(path / files.CASE))
    if kind not in UNFINISHED:
        return None
    name, json = UNFINISHED[kind]
    listed = [("files", "  ".join(report.files_of(path)))]
    if kind == "grow":
        ends = [files.read_json(one).get("outcome") for one in path.glob(f"seed-*/{files.SUMMARY}")]
        listed.append(("boxes", f"{ends.count('finished')} finished"))
    if kind == "grow" and (path / files.GROWTH).exists():
        content = {"kind": json, "folder": str(path), "finished": True, **files.read_json(path / files.GROWTH)}
        rows = [("state", "finished"), *listed, ("measure with", f"sand analyse {shlex.quote(str(path))}")]
        return f"{path}: boxes", rows, content
    rows = [("state", "running, or cut short"), *listed, ("go on with", report.resume_line(path))]
    return f"{path}: {name}", rows, {"kind": json, "folder": str(path), "finished": False}


def of_job_file(path: Path) -> Report | None:
    """scattering.json or collision.json; None for anything else.  Raises BadInput for one that is not whole."""
    content = files.read_json(path)
    tellers: tuple[tuple[str, str, str, Callable[[dict[str, Any]], report.Rows]], ...] = (
        ("job", "scattering", "a scattering job", _scattering),
        ("collisions", "collision", "collisions", _collisions),
    )
    for key, kind, name, rows in tellers:
        if key in content:
            try:
                return f"{path}: {name}", rows(content), {"kind": kind, **content}
            except (KeyError, TypeError, ValueError, AttributeError, IndexError):
                raise BadInput(f"{path} is not a result of SAND") from None
    return None


def _scattering(content: dict[str, Any]) -> report.Rows:
    from .scatter import rows_of

    return [("job", content["job"]), *rows_of(content)]


def _collisions(content: dict[str, Any]) -> report.Rows:
    from .collide import counts, line

    rows = [(f"seed {one['seed']}", line(one)) for one in content["collisions"][:12]]
    return [*rows, ("outcomes", ", ".join(f"{n} × {name}" for name, n in counts(content["collisions"]).most_common()))]
