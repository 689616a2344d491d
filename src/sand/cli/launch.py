"""Shared parts of `sand run` and `sand resume`: start a simulation, follow it, and report how it ended."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from ..basics.errors import BadInput, FilesFailed, Interrupted
from ..basics.units import format_quantity
from ..config.case import with_absolute_files
from ..config.commands import BODIES
from ..config.folders import content_of
from ..io.checkpoint_files import checkpoint_files
from ..io.lock import LOCK, refuse_locked
from ..io.run_folder import OWN_FILES, SUMMARY, is_used, read_json, read_toml, refuse_sweep
from ..simulation.outcome import Outcome, Result
from . import report
from .exits import DONE, INTERRUPTED, PHYSICS, WALL_TIME
from .job import InterruptObserver
from .progress import Progress


def launch(
    make: Callable[[], Any],
    folder: Path,
    heading: str,
    ends: tuple[float | None, int | None, str | None],
    wall_time: float | None,
    *,
    quiet: bool,
    as_json: bool,
) -> int:
    """Create a simulation, run it, and report how it ended.

    Parameters
    ----------
    make : Callable[[], Any]
        Returns the simulation, which writes its files to `folder`.
    heading : str
        Heading of the description before the start.
    ends : tuple[float or None, int or None, str or None]
        End of the run: a time [s], a number of further steps, a condition, or whichever comes first; without all, the
        planned end of the simulation.
    wall_time : float or None
        Wall time of the command [s] after which the run stops with a checkpoint.

    Returns
    -------
    int
        The exit code.
    """
    bar, (until, steps, stop) = None, ends
    with report.compiling(quiet), InterruptObserver() as interrupts:
        interrupts.limit(wall_time)
        simulation = make()
        simulation.observers.append(interrupts)
        end, last_step, condition = simulation.planned
        if (until, steps, stop) != (None, None, None):
            end, condition = until or math.inf, stop
            last_step = math.inf if steps is None else simulation.steps + steps
        goal = (end, last_step)
        if not (quiet or as_json):
            report.show(heading, report.opening(simulation, *goal, condition, folder))
            bar = Progress(*goal)
            simulation.observers.append(bar)
        try:
            result = simulation.run(until, steps=steps, stop=stop)
        except Interrupted as interruption:
            result = interruption.result
        except FilesFailed as error:
            raise FilesFailed(f"{error}; {_how_to_recover(folder)}") from error
        except (Exception, KeyboardInterrupt) as error:
            if not (interrupts.received or isinstance(error, KeyboardInterrupt)):
                raise
            result = _finished_result(simulation, goal, folder)
            if result is None:
                return _interrupted(folder, interrupts)  # an interrupted compiler may raise any exception
            report.note("the figure is not drawn")
        finally:
            if bar is not None:
                bar.finish()
    code = _conclude(result, folder, interrupts.why, quiet=quiet, as_json=as_json)
    return WALL_TIME if code == INTERRUPTED and interrupts.is_late else code


def _finished_result(simulation: Any, goal: Sequence[float], folder: Path) -> Any:
    """The result of a run that had finished except for its figure when it was interrupted; None for any other."""
    if simulation.time < goal[0] and simulation.steps < goal[1] and simulation.met_condition is None:
        return None
    try:
        summary = read_json(folder / SUMMARY)
    except BadInput:
        return None
    ends = {one.name.lower(): one for one in (Outcome.FINISHED, Outcome.CONDITION_MET)}
    if summary.get("steps") != simulation.steps or summary.get("outcome") not in ends:
        return None
    met = summary.get("condition") or ""
    outcome = ends[summary["outcome"]]
    return Result(outcome, simulation.steps, simulation.time, simulation.ledger.drift, condition=met)


def _conclude(result: Any, folder: Path, why: str, **output: bool) -> int:
    """Report how a run ended, or `why` it was interrupted; returns the exit code."""
    outcome, when = result.outcome, f"t = {format_quantity(result.time, 's')}"
    summary = read_json(folder / SUMMARY)
    rows = [*report.results(summary), ("files", report.listed(folder))]
    heading = "done" if outcome in (Outcome.FINISHED, Outcome.CONDITION_MET) else "so far"
    report.answer({**summary, "folder": str(folder)}, heading, rows, **output)
    if outcome is Outcome.CONDITION_MET:
        report.note(f"ended at {when}: {outcome.value}: {result.condition}")
    if outcome is Outcome.INTERRUPTED:
        report.note(f"{why} at {when}; resume with: {report.resume_line(folder)}")
        return INTERRUPTED
    if outcome is Outcome.WALL_TIME:
        report.note(f"the wall time of the condition is used up at {when}; resume with: {report.resume_line(folder)}")
        return WALL_TIME
    if outcome.is_physics:
        report.note(f"stopped by physics at {when}: {outcome.value}{report.named(result.grains)}")
        last = checkpoint_files(folder)[-1]
        kept = int(last.stem.removeprefix("checkpoint-")) == result.steps
        report.note(f"the {'last state' if kept else 'last good state'} is in {last}")
        return PHYSICS
    return DONE


def _interrupted(folder: Path, interrupts: InterruptObserver) -> int:
    """Report an interruption before the first step, or a second one; returns the exit code."""
    if not folder.is_dir():
        report.note(f"{interrupts.why}; the folder {folder} does not exist, start again")
    elif checkpoint_files(folder):
        report.note(f"{interrupts.why} at once; continue from the last checkpoint with: {report.resume_line(folder)}")
    else:
        report.note(f"{interrupts.why} before the first step; nothing is lost, start again")
    return WALL_TIME if interrupts.is_late else INTERRUPTED


def _how_to_recover(folder: Path) -> str:
    """What to do after a file could not be written."""
    if not folder.is_dir():
        return f"the folder {folder} has been removed; start again"
    if checkpoint_files(folder):
        return f"once this is solved, continue from the last checkpoint with: {report.resume_line(folder)}"
    return "there is no checkpoint yet; once this is solved, start again with --overwrite"


def refuse_folder(folder: Path, case: Path, *, overwrite: bool) -> None:
    """Refuse a folder that cannot be used, before anything is computed.

    Parameters
    ----------
    folder : Path
        Folder for the files of the run.
    case : Path
        The case file.
    overwrite : bool
        Whether files of an earlier run may be replaced.

    Raises
    ------
    BadInput
        If nothing can be written to the folder; if it is not empty and `overwrite` is not given; or if it holds
        the case file itself, or a body of it.
    """
    existing = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not existing.is_dir():
        raise BadInput(f"cannot write to folder {folder}: {existing} is a file; give another one with --out")
    if not os.access(existing, os.W_OK):
        raise BadInput(f"cannot write to folder {folder}: no permission in {existing}; give another one with --out")
    if existing != folder:
        return
    if (folder / LOCK).exists():
        refuse_locked(folder)
    if not is_used(folder):
        return
    refuse_sweep(folder)
    if not overwrite:
        advice = "give another one with --out, or --overwrite to replace what is in it"
        if report.is_resumable(folder):
            advice += f", {content_of(folder)}; or continue it: {report.resume_line(folder)}"
        raise BadInput(f"folder {folder} exists and is not empty; {advice}")
    replaced = [folder / name for name in OWN_FILES if (folder / name).exists()]
    if any(path.samefile(case) for path in replaced):
        raise BadInput(
            f"--overwrite would replace the case file {case} itself; copy it to another folder, or give another --out"
        )
    content = with_absolute_files(read_toml(case), case)
    for body in sorted(BODIES & content.keys()):
        source = Path(content[body].get("file", case))
        if source.exists() and any(path.samefile(source) for path in replaced):
            raise BadInput(f"--overwrite would replace {source}, the {body} of {case}; give another --out")
