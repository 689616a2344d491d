"""What `sand run` and `sand resume` share: start, watch, and tell how it ended."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from ..config.commands import BODIES
from ..errors import BadInput, FilesFailed, Interrupted
from ..io.lock import LOCK, refuse_locked
from ..io.run_folder import OWN_FILES, SUMMARY, is_used, read_json, read_toml
from ..units import format_quantity
from . import report
from .exits import DONE, INTERRUPTED, PHYSICS
from .interrupt import Watch
from .progress import Progress


class End(NamedTuple):
    """Where a run is to go: to a time [s], to a number of steps from now, or to whichever comes first."""

    until: float | None = None
    steps: int | None = None


def launch(make: Callable[[], Any], folder: Path, heading: str, end: End | None, *, quiet: bool, as_json: bool) -> int:
    """Make a simulation, run it and tell; returns the exit code.

    Parameters
    ----------
    make : Callable[[], Any]
        returns the simulation, its files in `folder`.
    heading : str
        of what is told before the start.
    end : End or None
        of the run; None: the end that the simulation has in its plans.
    """
    talk = not (quiet or as_json)
    bar = None
    with report.compiling(quiet), Watch() as watch:
        simulation = report.with_notes(make)
        simulation.observers.append(watch)
        goal = _goal(simulation, end)
        if talk:
            report.show(heading, report.opening(simulation, *goal, folder))
            if sys.stderr.isatty():
                bar = Progress(*goal)
                simulation.observers.append(bar)
        try:
            until, steps = end or End()
            with report.notes():
                result = simulation.run(until, steps=steps)
        except Interrupted as stop:
            result = stop.result
        except FilesFailed as error:
            raise FilesFailed(f"{error}; {_what_is_left(folder)}") from error
        except (Exception, KeyboardInterrupt) as error:
            if not (watch.asked or isinstance(error, KeyboardInterrupt)):
                raise
            result = _only_drawing(simulation, goal, folder)
            if result is None:
                return _cut_off(folder)  # a compiler that is interrupted may fail in any way
            report.note("the figure is left out")
        finally:
            if bar is not None:
                bar.finish()
    return _conclude(result, folder, talk=talk, as_json=as_json)


def _only_drawing(simulation: Any, goal: tuple[float, float], folder: Path) -> Any:
    """The result of a run that was through when Ctrl-C came, but for its figure; None for any other."""
    from ..simulation.outcome import Outcome, Result

    if simulation.time < goal[0] and simulation.steps < goal[1]:
        return None
    try:
        summary = read_json(folder / SUMMARY)
    except BadInput:
        return None
    if (summary.get("steps"), summary.get("outcome")) != (simulation.steps, "finished"):
        return None
    return Result(Outcome.FINISHED, simulation.steps, simulation.time, simulation.ledger.drift)


def _goal(simulation: Any, end: End | None) -> tuple[float, float]:
    """Time [s] and step to reach, infinite where there is none."""
    if end is None:
        return simulation.planned
    return (
        math.inf if end.until is None else end.until,
        math.inf if end.steps is None else simulation.steps + end.steps,
    )


def _conclude(result: Any, folder: Path, *, talk: bool, as_json: bool) -> int:
    """Tell how a run ended; returns the exit code."""
    from ..simulation.outcome import Outcome

    outcome, when = result.outcome, f"t = {format_quantity(result.time, 's')}"
    summary = read_json(folder / SUMMARY)
    if as_json:
        report.emit({**summary, "folder": str(folder)})
    if talk:
        rows = [*report.results(summary), ("files", _listed(folder))]
        report.show("done" if outcome is Outcome.FINISHED else "so far", rows)
    if outcome is Outcome.INTERRUPTED:
        report.note(f"interrupted at {when}; resume with: {report.resume_line(folder)}")
        return INTERRUPTED
    if outcome.is_physics:
        report.note(f"stopped by physics at {when}: {outcome.value}{report.named(result.grains)}")
        last = report.checkpoints(folder)[-1]
        kept = int(last.stem.removeprefix("checkpoint-")) == result.steps
        report.note(f"the {'state just' if kept else 'last good state'} before is in {last}")
        return PHYSICS
    return DONE


def _cut_off(folder: Path) -> int:
    """Ctrl-C before the first step, or twice: the last checkpoint, if any, is what is left."""
    if not folder.is_dir():
        report.note(f"interrupted; the folder {folder} is not there, start again")
    elif report.checkpoints(folder):
        report.note(f"interrupted at once; go on from the last checkpoint with: {report.resume_line(folder)}")
    else:
        report.note("interrupted before the first step; nothing is lost, start again")
    return INTERRUPTED


def _what_is_left(folder: Path) -> str:
    """What to do when a file could not be written."""
    if not folder.is_dir():
        return f"the folder {folder} has vanished with all that was in it; start again"
    if report.checkpoints(folder):
        return f"once that is mended go on from the last checkpoint with: {report.resume_line(folder)}"
    return "there is no checkpoint yet; once that is mended start again, with --overwrite"


def _listed(folder: Path) -> str:
    """The files written: folder/ and their names, as one line."""
    return f"{folder}/  " + "  ".join(report.files_of(folder))


def refuse_folder(folder: Path, case: Path, *, overwrite: bool) -> None:
    """What can be wrong with --out, in words of the command line, before anything is computed.

    Raises
    ------
    BadInput
        nothing can be written there; or the folder is in use and --overwrite is not given; or it holds
        the case file itself, or a body of it.
    """
    ground = next(place for place in (folder, *folder.absolute().parents) if place.exists())
    if not ground.is_dir():
        raise BadInput(f"cannot write to folder {folder}: {ground} is a file; give another one with --out")
    if not os.access(ground, os.W_OK):
        raise BadInput(f"cannot write to folder {folder}: no permission in {ground}; give another one with --out")
    if ground != folder:
        return
    if (folder / LOCK).exists():
        refuse_locked(folder)
    if not is_used(folder):
        return
    if not overwrite:
        told = "give another one with --out, or --overwrite to replace the run in it"
        if report.can_go_on(folder):
            told += f"; or go on with what is in it: {report.resume_line(folder)}"
        raise BadInput(f"folder {folder} exists and is not empty; {told}")
    if any((folder / name).exists() and (folder / name).samefile(case) for name in OWN_FILES):
        raise BadInput(
            f"--overwrite would replace the case file {case} itself; copy it to another folder first, "
            "or give another --out"
        )
    content = read_toml(case)
    for body in sorted(BODIES & content.keys()):
        path = Path(content[body].get("path", case))
        if any((folder / name).exists() and path.exists() and (folder / name).samefile(path) for name in OWN_FILES):
            raise BadInput(f"--overwrite would replace {path}, the {body} of {case}; give another --out")
