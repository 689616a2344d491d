"""Ensembles: runs of the same box for many seeds, each in its own folder."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from functools import partial
from pathlib import Path
from typing import Any

from ..basics.errors import BadInput, shown, warn
from ..basics.paths import user_path
from ..config.build import resume, simulation_of
from ..config.case import check_case
from ..io import run_folder as files
from ..io.checkpoint_files import checkpoint_files
from ..io.lock import writing
from ..simulation.serialise import case_of, changed_tables
from .dilute_case import check_dilute, is_dilute, population_of
from .dilute_files import HitsSeen
from .executors import results_of
from .growth_case import DEFAULT_SEEDS, read_growth
from .job import Job, Progress, ignored

PATIENCE = 10.0
"""Longest wall time [s] to wait for another process that writes to the folder for a moment."""


class GrowthJob(Job):
    """Boxes of one case, each in its own folder; what is kept are these folders, which other processes may share.

    Parameters
    ----------
    seeds : list of int or None, optional
        Replaces the seeds of the case.
    path, folder, **how
        As for `Job`.

    Raises
    ------
    BadInput
        All errors of the case.
    """

    COMMAND, RESULTS, PARTS = "grow", files.GROWTH, "boxes"

    def __init__(self, path: str | Path, folder: str | Path | None = None, seeds: list[int] | None = None, **how: bool):
        super().__init__(path, folder, **how)
        self.content, own = read_growth(path)
        self.seeds = seeds or own or DEFAULT_SEEDS

    def run(
        self, executor: Executor | None = None, observers: Sequence[Any] = (), progress: Progress = ignored
    ) -> dict[str, Any]:
        """Run all boxes to their end, see `grow`; returns how they ended."""
        outcomes: dict[int, str] = {}
        parts = "populations" if is_dilute(self.content) else self.PARTS

        def show(line: str = "", state: str = "") -> None:
            done, total = len(outcomes), len(self.seeds)
            progress(f"{done} of {total} {parts}{state}", done / total, line and f"{line}  ({done} of {total})")

        def finished(seed: int, outcome: str) -> None:
            outcomes[seed] = outcome
            show(f"  seed {seed}: {outcome}")

        show()
        if executor is None and is_dilute(self.content):
            observers = [*observers, HitsSeen(lambda state: show("", state))]
        grow(self.content, self.seeds, self.folder, executor, finished, observers)
        return {"folder": str(self.folder), "seeds": self.seeds, "outcomes": outcomes}


def grow(
    content: dict[str, Any],
    seeds: Sequence[int],
    folder: str | Path,
    executor: Executor | None = None,
    on_result: Callable[[int, str], None] | None = None,
    observers: Sequence[Any] = (),
) -> list[Path]:
    """Run the same box for many seeds, each in its own folder; existing runs are resumed.

    The folder receives the case (case.toml) and, when all boxes are finished, their summaries (growth.json). Several
    processes may run different seeds in the same folder.

    Parameters
    ----------
    content : dict
        Case as for `sand run`, as read from TOML.
    seeds : sequence of int
        One box each.
    folder : str or Path
        Parent of the folders seed-1 and so on.
    executor : Executor or None, optional
        Any `concurrent.futures.Executor`; None runs one box after the other in this process.
    on_result : callable, optional
        Called with a seed and the outcome of its run.
    observers : sequence, optional
        Observers of the simulations, without an executor.

    Returns
    -------
    list of Path
        Folders, in the order of the seeds.

    Raises
    ------
    BadInput
        If the case has errors, the folder contains something else, or a run stopped for physical reasons.
    Interrupted
        By Ctrl-C; the same call resumes.
    """
    place = user_path(folder)
    (check_dilute if is_dilute(content) else check_case)(content, "case")
    places = {seed: place / f"seed-{seed}" for seed in seeds}
    files.make_folder(place, shared=True)
    with writing(place, patience=PATIENCE):
        _refuse_other_boxes(place, list(places.values()), content)
        _describe(place, content, seeds)
    _run_all(content, places, executor, on_result, observers)
    with writing(place, patience=PATIENCE):
        all_seeds = _seeds_in(place / files.CASE)  # also those of other processes
        ends = {seed: _finished_summary(place / f"seed-{seed}") for seed in all_seeds}
        if all(ends.values()):
            named = {f"seed-{seed}": end for seed, end in ends.items()}
            files.write_json(place / files.GROWTH, {"seeds": all_seeds, "boxes": named})
    return list(places.values())


def _refuse_other_boxes(place: Path, places: Sequence[Path], content: dict[str, Any]) -> None:
    """Raise BadInput if the folder contains boxes of another case, before that case is replaced.

    Boxes of the requested seeds are checked by `run_box`, and here only if the case file of the folder has changed.
    """
    path = place / files.CASE
    before = files.read_toml(path) if path.exists() else content
    changed = any(before.get(name) != content.get(name) for name in {*before, *content} - {"run", "grow"})
    started = [case.parent for case in place.glob(f"seed-*/{files.CASE}")]
    boxes = [box for box in started if changed or box not in places]
    if not boxes:
        return
    if is_dilute(content):
        requested = shared_settings(content)
    else:
        requested = shared_settings(case_of(simulation_of(check_case(content, "case"), None), math.inf, math.inf))
    for box in boxes:
        known = shared_settings(files.read_toml(box / files.CASE))
        if others := [name for name in {**known, **requested} if known.get(name) != requested.get(name)]:
            raise BadInput(f"{box} contains a box with different [{others[0]}]; give another folder")


def _run_all(
    content: dict[str, Any],
    places: Mapping[int, Path],
    executor: Executor | None,
    on_result: Callable[[int, str], None] | None,
    observers: Sequence[Any],
) -> None:
    """Run the boxes of `grow`. Raises BadInput for boxes that stopped for physical reasons."""
    folders = {seed: str(place.absolute()) for seed, place in places.items()}  # workers may be in another folder
    run = partial(_run_one, content, folders, observers=observers if executor is None else ())
    outcomes: dict[int, str] = {}
    for seed, outcome in results_of(executor, run, list(places)):
        outcomes[seed] = outcome
        if on_result is not None:
            on_result(seed, outcome)
    problems = []
    for seed, place in places.items():
        if outcomes[seed] != "finished":
            problems.append(f"seed {seed}: stopped ({outcomes[seed]}); see {place / files.SUMMARY}")
        elif not (place / files.SUMMARY).exists():
            problems.append(f"seed {seed}: finished, but not in {place}; its worker must see the same folders")
    if problems:
        raise BadInput(problems)


def _run_one(content: dict[str, Any], places: Mapping[int, str], seed: int, observers: Sequence[Any] = ()) -> str:
    return run_box(content, seed, places[seed], observers)


def _describe(place: Path, content: dict[str, Any], seeds: Sequence[int]) -> None:
    """Write the case to the folder, with the seeds of all boxes present or requested.

    Raises
    ------
    BadInput
        If the folder contains something else.
    """
    path = place / files.CASE
    before: list[int] = []
    if path.exists():
        if not files.was_written_by_sand(path):
            raise BadInput(
                f"{path} is not from SAND, and the case file of the job would replace it; give another folder"
            )
        before = _seeds_in(path)
        if not before:
            raise BadInput(f"{place} contains a run; give another folder for the boxes")
    (place / files.GROWTH).unlink(missing_ok=True)  # written when all boxes are finished
    all_seeds = sorted({*before, *seeds})
    files.write_toml(path, {**content, "grow": {"seeds": all_seeds}}, "settings of sand grow, read by sand resume")


def _seeds_in(path: Path) -> list[int]:
    """Seeds in the case file of a folder of boxes, none in that of a run.  Raises BadInput for anything else."""
    section = files.read_toml(path).get("grow", {})
    seeds = section.get("seeds", []) if isinstance(section, dict) else section
    if not isinstance(seeds, list) or not all(type(seed) is int and seed >= 0 for seed in seeds):
        raise BadInput(
            f"{path}: grow: seeds = {shown(seeds)} must be a list of whole numbers from 0, such as [1, 2, 3]"
        )
    return seeds


def run_box(content: dict[str, Any], seed: int, folder: str, observers: Sequence[Any] = ()) -> str:
    """Run one box to its end, from its newest checkpoint if there is one; returns the name of the outcome.

    Raises
    ------
    BadInput
        If the folder contains a run of another case, or another process writes to it.
    """
    place, own = user_path(folder), list(observers)
    if place.is_dir():
        with writing(place, patience=PATIENCE):  # a worker whose parent was killed may be writing its checkpoint
            pass
    if is_dilute(content):
        return population_of(content, seed, place, own).outcome
    case = check_case(content, "case")
    case.run.seed = seed
    until = case.run.until
    if checkpoint_files(place):
        simulation = resume(place, observers=own)
        if changed := changed_tables(simulation_of(case, None), simulation):
            raise BadInput(
                f"{place} contains a run with different [{changed[0]}]; give another folder, or the same case"
            )
        until = None if until is None else max(until, simulation.time)
    else:
        # a run killed at its very start leaves a folder without a checkpoint
        simulation = simulation_of(case, place, overwrite=True, observers=own)
    steps = None if case.run.steps is None else case.run.steps - simulation.steps
    arrived = (until is not None and simulation.time >= until) or (steps is not None and steps <= 0)
    if arrived and _finished_summary(place).get("steps") == simulation.steps:
        return "finished"
    if arrived:  # killed before it wrote its summary
        until, steps = simulation.time, None
    return simulation.run(until, steps=steps).outcome.name.lower()


def _finished_summary(place: Path) -> dict[str, Any]:
    """Summary of a finished run; empty if it has not finished, or is damaged."""
    path = place / files.SUMMARY
    try:
        summary = files.read_json(path) if path.exists() else {}
    except BadInput as error:
        warn(f"{error}; the end of this run is computed again")
        summary = {}
    return summary if summary.get("outcome") == "finished" else {}


def shared_settings(case: dict[str, Any]) -> dict[str, Any]:
    """Settings that boxes of an ensemble share: the case without [run] and cut-offs, which depend on the grains.

    Raises BadInput if [forces] holds anything but tables.
    """
    given = case.get("forces", {})
    if not isinstance(given, dict) or not all(isinstance(table, dict) for table in given.values()):
        raise BadInput("forces in case.toml must be tables, such as [forces.contact]")
    forces = {name: {key: value for key, value in table.items() if key != "cutoff"} for name, table in given.items()}
    return {name: table for name, table in case.items() if name != "run"} | {"forces": forces}
