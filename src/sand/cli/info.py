"""`sand info DIR|FILE`: describes a run or one of its files on one screen."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from ..errors import BadInput
from ..io import run_folder as files
from ..io.ledger_table import read_ledger
from . import options, report
from .info_jobs import describe_job_file, describe_job_folder, describe_other_case
from .report import Description


@click.command("info", short_help="Describe a run or one of its files.")
@click.argument("path", metavar="DIR|FILE", type=options.PATH)
@options.as_json
@options.debug
def command(path: str, as_json: bool) -> int:
    """Describe the folder of a run, a case file, trajectory.gsd, ledger.csv, summary.json or a checkpoint.

    Also describes cases, folders and results of `sand scatter`, `sand collide` and `sand grow`.

    A case file is checked as by `sand run`, but not run.
    """
    heading, rows, content = report.with_notes(lambda: _describe(Path(path)))
    if as_json:
        report.emit(content)
    else:
        report.show(heading, rows)
    return 0


def _describe(path: Path) -> Description:
    """Describe a folder or a file according to its type.  Raises BadInput."""
    if path.is_dir():
        return describe_run(path)
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


def describe_run(path: Path) -> Description:
    """Describe the folder of a run: its outcome, or its present state."""
    from ..units import format_quantity

    if not any((path / name).exists() for name in (files.CASE, files.ONE_COLLISION)):
        raise BadInput(f"{path} is not the folder of a run: there is no {files.CASE} in it")
    if (job := describe_job_folder(path)) is not None:
        return job
    planned = files.read_toml(path / files.CASE).get("run", {})
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
        label = "state" if summary is None else "since then"
        rows += [
            (label, "running, or killed"),
            ("last frame", f"{format_quantity(beyond['time'], 's')} after {beyond['step']} steps"),
            ("clusters", report.clusters(beyond)),
        ]
    if "until" in planned:
        rows.append(("planned end", format_quantity(planned["until"], "s")))
    rows.append(("files", "  ".join(report.files_of(path))))
    until = planned.get("until", 0.0)
    ended = summary and not beyond and summary["outcome"] == "finished" and summary["time"] >= until
    if report.checkpoints(path) and not ended:
        rows.append(("continue with", report.resume_line(path)))
    content: dict[str, Any] = {"kind": "run", "folder": str(path), "summary": summary, "last_row": last}
    content |= {"planned_end": planned.get("until"), "files": report.files_of(path)}
    return f"{path}: a run", rows, content


def describe_case(path: Path) -> Description:
    """Check and describe a case file, with the choices that would be made automatically."""
    from ..config.build import simulation_of
    from ..config.case import read_case
    from ..simulation.serialise import case_of

    if (other := describe_other_case(path)) is not None:
        return other
    case = read_case(path)
    if case.grains.kind == "given":
        rows = [("grains", f"{case.grains.number}, from a script"), ("box", case.box.periodic.describe())]
        return f"{path}: the case of a run", rows, {"kind": "case", "case": files.read_toml(path)}
    simulation = report.with_notes(lambda: report.with_file_name(path, lambda: simulation_of(case, None)))
    folder = Path(case.run.out or path.stem)
    end = math.inf if case.run.until is None else case.run.until
    steps = math.inf if case.run.steps is None else case.run.steps
    rows = report.opening(simulation, end, steps, folder)
    content = {"kind": "case", "case": case_of(simulation, end, steps), "choices": simulation.choices}
    return f"{path}: a valid case", rows, content


def describe_trajectory(path: Path) -> Description:
    """Describe the frames, times and last frame of a trajectory."""
    from ..io.trajectory import read_frames
    from ..units import format_quantity

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
    return f"{path}: a trajectory", rows, content


def describe_checkpoint(path: Path) -> Description:
    """Describe the state in a checkpoint."""
    from ..io.checkpoint import read_checkpoint
    from ..units import format_quantity

    arrays, meta = read_checkpoint(path)
    grains, contacts = len(arrays["grains/radius"]), arrays["contacts/pair"].shape[1]
    end = meta.get("until")
    rows = [
        ("time", f"{format_quantity(meta['time'], 's')} after {meta['steps']} steps"),
        ("grains", f"{grains}, {contacts} contacts"),
        ("planned end", "none" if end is None else format_quantity(end, "s")),
        ("continue with", report.resume_line(path.parent)),
    ]
    content = {"kind": "checkpoint", "grains": grains, "contacts": contacts, **meta}
    return f"{path}: an intact checkpoint", rows, content


def describe_json(path: Path) -> Description:
    """Describe the summary of a run, or the results of another command."""
    if (job := describe_job_file(path)) is not None:
        return job
    summary = _summary(path)
    rows = [("outcome", summary["outcome_text"] + report.named(summary["grains_concerned"]))]
    return f"{path}: the summary of a run", rows + report.results(summary), {"kind": "summary", **summary}


def describe_ledger(path: Path) -> Description:
    """Describe the first and the last row of a ledger."""
    from ..units import format_quantity

    ledger = _ledger(path)
    first, last = ledger[0], ledger[-1]
    lost = {name: value for name, value in last.items() if name.startswith("lost_")}
    rows = [
        ("rows", f"{len(ledger)}, from {format_quantity(first['time'], 's')} to {format_quantity(last['time'], 's')}"),
        ("total energy", f"{first['total']:.6g} J at first, {last['total']:.6g} J at last"),
        ("dissipated", ", ".join(f"{k[5:]} {v:.3g} J" for k, v in lost.items())),
        ("clusters", report.clusters(last)),
    ]
    content = {"kind": "ledger", "rows": len(ledger), "first": first, "last": last}
    return f"{path}: the ledger of a run", rows, content


FILE_TYPES: dict[str, Callable[[Path], Description]] = {
    ".toml": describe_case,
    ".gsd": describe_trajectory,
    ".npz": describe_checkpoint,
    ".json": describe_json,
    ".csv": describe_ledger,
}
