"""`sand info` of what is not a run: cases, folders and results of `sand scatter` and `sand collide`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..core.errors import BadInput
from ..files import folder as files
from . import report

Told = tuple[str, report.Rows, dict[str, Any]]
"""A heading, rows for people, and the same for machines."""


def of_other_case(path: Path) -> Told | None:
    """A case of another command, checked; None if it is not one."""
    content = files.read_toml(path)
    if "flight" in content or "measure" in content:
        return _scatter_case(path)
    if "impact" in content:
        from ..experiments.collision_case import read_collision

        case = read_collision(path)
        rows = [("bodies", f"{case.projectile.kind} on {case.target.kind}"), ("seeds", str(len(case.impact.seeds)))]
        rows.append(("run it with", f"sand collide {path}"))
        return f"{path}: a collision without mistakes", rows, {"kind": "collision case", "case": content}
    return None


def _scatter_case(path: Path) -> Told:
    from ..core.units import spoken
    from ..experiments.scattering_case import read_scattering

    case, flights = read_scattering(path)
    rows: report.Rows = [("job", case.measure.job)]
    for one in flights:
        reach = f", b_max = {spoken(one.scales.capture, 'm')}" if one.scales.capture else ""
        rows.append((f"{one.speed:.4g} m/s", f"from {spoken(one.distance, 'm')}{reach}"))
    rows.append(("run it with", f"sand scatter {path}"))
    return (
        f"{path}: a scattering case without mistakes",
        rows,
        {"kind": "scattering case", "case": files.read_toml(path)},
    )


def of_job_folder(path: Path) -> Told | None:
    """A folder of `sand scatter` or `sand collide`; None if it is not one."""
    for name in (files.SCATTERING, files.COLLISION):
        if (path / name).exists():
            told = of_job_file(path / name)
            assert told is not None
            heading, rows, content = told
            listed = [*rows, ("files", "  ".join(report.files_of(path)))]
            return f"{path}: {heading.split(': ', 1)[1]}", listed, {**content, "folder": str(path)}
    if (path / files.FLIGHTS).exists():
        rows = [("state", "cut short"), ("go on with", f"sand scatter {path / files.CASE} --out {path} --resume")]
        return f"{path}: a scattering job", rows, {"kind": "scattering", "folder": str(path), "finished": False}
    return None


def of_job_file(path: Path) -> Told | None:
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
