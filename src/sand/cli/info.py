"""`sand info DIR|FILE`: what a run or one of its files holds, on one screen."""

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
from .info_jobs import of_job_file, of_job_folder, of_other_case

Report = tuple[str, report.Rows, dict[str, Any]]
"""A heading, rows for people, and the same for machines."""


@click.command("info", short_help="What a run, or one of its files, holds.")
@click.argument("path", metavar="DIR|FILE", type=options.PLACE)
@options.as_json
@options.debug
def command(path: str, as_json: bool) -> int:
    """What a run's folder holds, or a case file, trajectory.gsd, ledger.csv, summary.json or checkpoint.

    The same for cases, folders and results of `sand scatter` and `sand collide`.

    A case file is checked as `sand run` would, without running it.
    """
    heading, rows, content = report.with_notes(lambda: _teller(Path(path))(Path(path)))
    if as_json:
        report.emit(content)
    else:
        report.show(heading, rows)
    return 0


def _teller(path: Path) -> Callable[[Path], Report]:
    """The function that knows this kind of file.  Raises BadInput."""
    if path.is_dir():
        return of_run
    if not path.exists():
        raise BadInput(f"there is no file or folder {path}")
    if path.suffix not in KINDS:
        raise BadInput(
            f"{path} is not something to tell about; give a run's folder, a case file (.toml), trajectory.gsd, "
            "a checkpoint (.npz), summary.json or ledger.csv"
        )
    return KINDS[path.suffix]


def _summary(path: Path) -> dict[str, Any]:
    """A summary that holds what is told of it.  Raises BadInput."""
    summary = files.read_json(path)
    try:
        report.results(summary)
        if {"outcome", "outcome_text", "grains_concerned", "choices", "grains"} <= summary.keys():
            return summary
    except (KeyError, TypeError, ValueError):
        pass
    raise BadInput(f"{path} is not a summary of SAND")


def _ledger(path: Path) -> list[dict[str, float]]:
    """The rows of a ledger.  Raises BadInput."""
    rows = read_ledger(path)
    if not rows or not {"step", "time", "total", "clusters", "mean_cluster_size", "largest_cluster"} <= rows[0].keys():
        raise BadInput(f"{path} is not a ledger of SAND, or an empty one")
    return rows


def of_run(path: Path) -> Report:
    """A run's folder: how it ended or how far it is."""
    from ..units import format_quantity

    if not any((path / name).exists() for name in (files.CASE, files.ONE_COLLISION)):
        raise BadInput(f"{path} is not the folder of a run: there is no {files.CASE} in it")
    if (job := of_job_folder(path)) is not None:
        return job
    planned = files.read_toml(path / files.CASE).get("run", {})
    summary = _summary(path / files.SUMMARY) if (path / files.SUMMARY).exists() else None
    ledger = _ledger(path / files.LEDGER) if (path / files.LEDGER).exists() else []
    last = ledger[-1] if ledger else None
    # a run that is going on, or was killed, is in its ledger beyond its summary
    beyond = last if last and (summary is None or last["step"] > summary["steps"]) else None
    rows: report.Rows = []
    if summary is not None:
        named = report.named(summary["grains_concerned"])
        rows += [("outcome", summary["outcome_text"] + named), ("grains", str(summary["grains"]))]
        rows += [*summary["choices"].items(), *report.results(summary)]
    if beyond is not None:
        label = "state" if summary is None else "since then"
        rows += [
            (label, "running, or stopped without having been closed"),
            ("last frame", f"{format_quantity(beyond['time'], 's')} after {beyond['step']} steps"),
            ("clusters", report.clusters(beyond)),
        ]
    if "until" in planned:
        rows.append(("planned end", format_quantity(planned["until"], "s")))
    rows.append(("files", "  ".join(report.files_of(path))))
    until = planned.get("until", 0.0)
    ended = summary and not beyond and summary["outcome"] == "finished" and summary["time"] >= until
    if report.checkpoints(path) and not ended:
        rows.append(("go on with", report.resume_line(path)))
    content: dict[str, Any] = {"kind": "run", "folder": str(path), "summary": summary, "last_row": last}
    content |= {"planned_end": planned.get("until"), "files": report.files_of(path)}
    return f"{path}: a run", rows, content


def of_case(path: Path) -> Report:
    """A case file, checked: what would run, and what would be chosen."""
    from ..config.build import simulation_of
    from ..config.case import read_case
    from ..simulation.serialise import case_of

    if (other := of_other_case(path)) is not None:
        return other
    case = read_case(path)
    if case.grains.kind == "given":
        rows = [("grains", f"{case.grains.number}, made by a script"), ("box", case.box.periodic.describe())]
        return f"{path}: the case of a run", rows, {"kind": "case", "case": files.read_toml(path)}
    simulation = report.with_notes(lambda: report.blame(path, lambda: simulation_of(case, None)))
    folder = Path(case.run.out or path.stem)
    end = math.inf if case.run.until is None else case.run.until
    steps = math.inf if case.run.steps is None else case.run.steps
    rows = report.opening(simulation, end, steps, folder)
    content = {"kind": "case", "case": case_of(simulation, end, steps), "choices": simulation.choices}
    return f"{path}: a case without mistakes", rows, content


def of_trajectory(path: Path) -> Report:
    """Frames, times and the last frame of a trajectory."""
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


def of_checkpoint(path: Path) -> Report:
    """The state a checkpoint holds."""
    from ..io.checkpoint import read_checkpoint
    from ..units import format_quantity

    arrays, meta = read_checkpoint(path)
    grains, contacts = len(arrays["grains/radius"]), arrays["contacts/pair"].shape[1]
    end = meta.get("until")
    rows = [
        ("time", f"{format_quantity(meta['time'], 's')} after {meta['steps']} steps"),
        ("grains", f"{grains}, {contacts} contacts"),
        ("planned end", "none" if end is None else format_quantity(end, "s")),
        ("go on with", report.resume_line(path.parent)),
    ]
    content = {"kind": "checkpoint", "grains": grains, "contacts": contacts, **meta}
    return f"{path}: a checkpoint, whole", rows, content


def of_summary(path: Path) -> Report:
    """A summary, or the results of another command."""
    if (job := of_job_file(path)) is not None:
        return job
    summary = _summary(path)
    rows = [("outcome", summary["outcome_text"] + report.named(summary["grains_concerned"]))]
    return f"{path}: the summary of a run", rows + report.results(summary), {"kind": "summary", **summary}


def of_ledger(path: Path) -> Report:
    """First and last row of the books."""
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


KINDS: dict[str, Callable[[Path], Report]] = {
    ".toml": of_case,
    ".gsd": of_trajectory,
    ".npz": of_checkpoint,
    ".json": of_summary,
    ".csv": of_ledger,
}
