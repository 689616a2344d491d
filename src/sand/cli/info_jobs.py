"""What `sand info` says of jobs: of their results, and of jobs that have not ended."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

from ..basics.errors import BadInput
from ..config.commands import PACKINGS
from ..io import run_folder as files
from . import report
from .collide import collision_rows
from .laboratory import run_rows
from .scatter import result_rows

Description = tuple[str, report.Rows, dict[str, Any]]
"""Heading and rows for people, and the same content for machines."""
JOBS = {
    "scatter": ("a scattering job", "scattering"),
    "collide": ("collisions", "collision"),
    "grow": ("boxes", "growth"),
    **{name: (f"a job of sand {name}", name) for name in PACKINGS},
    "sweep": ("a sweep", "sweep"),
}
"""Names of jobs by command: for people, and the `kind` for machines."""


def describe_results(path: Path, content: dict[str, Any]) -> Description | None:
    """Describe the results file of a job; None for any other file.  Raises BadInput if it is incomplete."""
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


def describe_job(path: Path, job_command: str, case: Path, begun: bool, rows: report.Rows) -> Description:
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
    if job_command == "grow" and (path / files.ENCOUNTERS).exists():
        return _describe_population(path, rows, content)
    if job_command == "grow":
        ends = [files.read_json(summary).get("outcome") for summary in path.glob(f"seed-*/{files.SUMMARY}")]
        rows.append(("boxes", f"{ends.count('finished')} finished"))
        if (path / files.GROWTH).exists():
            rows = [("state", "finished"), *rows, ("measure with", f"sand analyse {shlex.quote(str(path))}")]
            return name, rows, content | {"finished": True} | files.read_json(path / files.GROWTH)
    return name, [("state", "running, or interrupted"), *rows, ("continue with", report.resume_line(path))], content


def _describe_population(path: Path, rows: report.Rows, content: dict[str, Any]) -> Description:
    """Describe one population of encounters."""
    ended = (path / files.SUMMARY).exists()
    found = files.read_json(path / files.SUMMARY) if ended else {}
    names = {"mean_cluster_size": "S", "number_ratio": "n/n0", "hits": "hits", "flights": "flights", "time": "time [s]"}
    state = str(found["outcome"]) if ended else "running, or interrupted"
    own = [(name, f"{found[key]:.4g}") for key, name in names.items() if ended]
    last = ("continue with", report.resume_line(path))
    return "a population of encounters", [("state", state), *rows, *own, last], content | {"finished": ended} | found
