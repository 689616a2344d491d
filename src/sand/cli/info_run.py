"""What `sand info` says of a run, and of each of its files."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

from ..basics.errors import BadInput, SandError, naming
from ..basics.units import format_quantity
from ..io import run_folder as files
from ..io.checkpoint_files import checkpoint_files
from ..io.ledger_table import read_ledger
from . import report
from .info_jobs import Description

MOST_WARNINGS = 5
"""Warnings of a run that are shown."""


def describe_run(path: Path, listed: tuple[str, str]) -> Description:
    """Describe the folder of a run; `listed` is the row with its files."""
    until, condition = _planned_end(path / files.CASE)
    summary = _summary(path / files.SUMMARY) if (path / files.SUMMARY).exists() else None
    ledger = _ledger(path / files.LEDGER) if (path / files.LEDGER).exists() else []
    last = ledger[-1] if ledger else None
    # a running or killed run has rows in its ledger after its last summary
    beyond = last if last and (summary is None or last["step"] > summary["steps"]) else None
    rows: report.Rows = []
    if summary is not None:
        named = report.named(summary["grains_concerned"])
        rows.append(("outcome", summary["outcome_text"] + named))
    described, warnings = summary or _in_words(path), (summary or {}).get("warnings", [])
    rows += [("grains", text)] if (text := described.get("grains_in_words") or str(described.get("grains", ""))) else []
    rows += (summary or {}).get("choices", {}).items()
    rows += [("forces", text)] if (text := described.get("forces_in_words")) else []
    rows += [] if summary is None else report.results(summary)
    rows += report.first_of([("warning", text) for text in warnings], MOST_WARNINGS)
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


def _in_words(folder: Path) -> dict[str, str]:
    """Grains and forces of a run without a summary, of its first frame and its case, as far as these can be read."""
    from ..basics.temperature import kinetic_temperature
    from ..config.case import read_case
    from ..io.trajectory import Frames
    from ..simulation.in_words import forces_in_words, grains_in_words

    found: dict[str, str] = {}
    with contextlib.suppress(SandError), contextlib.closing(Frames(folder / files.TRAJECTORY)) as frames:
        start: Any = frames[0] if len(frames) else None
        found |= {} if start is None else {"grains_in_words": grains_in_words(start, kinetic_temperature(start))}
    with contextlib.suppress(SandError):  # forces of the user that are not imported
        found["forces_in_words"] = forces_in_words(read_case(folder / files.CASE).forces.build())
    return found


def _planned_end(case: Path) -> tuple[float | None, str | None]:
    """Time [s] and condition that end a run, which the user may have edited, from its case file.  Raises BadInput."""
    from ..simulation.cadence import duration

    run = files.read_toml(case).get("run", {})
    if not isinstance(run, dict):
        raise BadInput(f"{case}: run must be a table, [run]")
    until, condition = run.get("until"), run.get("stop")
    if condition is not None and not isinstance(condition, str):
        raise BadInput(f"{case}: run.stop must be text, such as 'clusters == 1'")
    with naming(f"{case}: run"):
        return None if until is None else duration(until, "until"), condition


def describe_trajectory(path: Path) -> Description:
    """Describe the frames, times and last frame of a trajectory."""
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


def describe_summary(path: Path) -> Description:
    """Describe the summary of a run."""
    summary = _summary(path)
    rows = [("outcome", summary["outcome_text"] + report.named(summary["grains_concerned"]))]
    return "the summary of a run", rows + report.results(summary), {"kind": "summary", **summary}


def describe_ledger(path: Path) -> Description:
    """Describe the first and the last row of a ledger."""
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
