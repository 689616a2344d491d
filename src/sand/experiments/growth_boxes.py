"""The same box for many seeds: each a run in a folder of its own."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

from ..config.build import resume, simulation_of
from ..config.case import check_case
from ..errors import BadInput
from ..io import run_folder as files
from ..io.lock import writing
from ..simulation.serialise import case_of


def grow(
    content: dict[str, Any],
    seeds: Sequence[int],
    folder: str | Path,
    executor: Executor | None = None,
    told: Callable[[int, str], None] | None = None,
    observers: Sequence[Any] = (),
) -> list[Path]:
    """Run the same box for many seeds, each into its own folder; runs that are there already are gone on with.

    case.toml in the folder says what was asked for, growth.json at the end how each box ended.

    Parameters
    ----------
    content : dict[str, Any]
        a case as for `sand run`, as read from TOML.
    seeds : Sequence[int]
        one box each.
    folder : str or Path
        that holds their folders, seed-1 and so on.
    executor : Executor or None, optional
        where; one after the other in this process by default.
    told : Callable[[int, str], None] or None, optional
        called with a seed and how its run ended.
    observers : Sequence[Any], optional
        of the simulations, where there is no executor.

    Returns
    -------
    list[Path]
        The folders, in the order of the seeds.

    Raises
    ------
    BadInput
        a case with mistakes, a folder that holds something else, a run stopped by physics.
    Interrupted
        Ctrl-C; calling again goes on.
    """
    place = Path(folder)
    check_case(content, "case")
    places = [place / f"seed-{seed}" for seed in seeds]
    _refuse_other_boxes(place, places, content)
    files.make_folder(place, shared=True)
    with writing(place):
        every = _describe(place, content, seeds)
        _run_all(content, seeds, places, executor, told, observers)
        ends = {seed: _closed(place / f"seed-{seed}") for seed in every}
        if all(ends.values()):
            named = {f"seed-{seed}": end for seed, end in ends.items()}
            files.write_json(place / files.GROWTH, {"seeds": every, "boxes": named})
    return places


def _refuse_other_boxes(place: Path, places: Sequence[Path], content: dict[str, Any]) -> None:
    """Raises BadInput if a folder holds boxes of another case, before that case is replaced.

    Boxes at these places are looked at by `run_box`, and here only where the description of the case has changed.
    """
    path = place / files.CASE
    before = files.read_toml(path) if path.exists() else content
    changed = any(before.get(name) != content.get(name) for name in {*before, *content} - {"run", "grow"})
    boxes = [there for there in boxes_of(place) if changed or there not in places]
    if not boxes:
        return
    asked = shared_settings(case_of(simulation_of(check_case(content, "case"), None), math.inf, math.inf))
    for there in boxes:
        known = shared_settings(files.read_toml(there / files.CASE))
        if others := [name for name in {**known, **asked} if known.get(name) != asked.get(name)]:
            raise BadInput(f"{there} holds a box with other [{others[0]}]; give another folder")


def _run_all(
    content: dict[str, Any],
    seeds: Sequence[int],
    places: Sequence[Path],
    executor: Executor | None,
    told: Callable[[int, str], None] | None,
    observers: Sequence[Any],
) -> None:
    """The boxes of `grow`.  Raises BadInput for those that physics stopped."""
    jobs = [(content, seed, str(one)) for seed, one in zip(seeds, places, strict=True)]
    if executor is None:
        outcomes: Any = (run_box(*job, observers) for job in jobs)
    else:
        waiting = [executor.submit(run_box, *job) for job in jobs]
        outcomes = (future.result() for future in waiting)
    wrong = []
    for seed, one, outcome in zip(seeds, places, outcomes, strict=True):
        if told is not None:
            told(seed, outcome)
        if outcome != "finished":
            wrong.append(f"seed {seed}: stopped ({outcome}); see {one / files.SUMMARY}")
    if wrong:
        raise BadInput(wrong)


def _describe(place: Path, content: dict[str, Any], seeds: Sequence[int]) -> list[int]:
    """Leave the case in the folder, with the seeds of all boxes that are, or will be, in it; returns these.

    Raises
    ------
    BadInput
        the folder holds something else.
    """
    path = place / files.CASE
    before: list[int] = []
    if path.exists():
        before = files.read_toml(path).get("grow", {}).get("seeds", [])
        if not before:
            raise BadInput(f"{place} holds a run; give another folder for the boxes")
    (place / files.GROWTH).unlink(missing_ok=True)  # it comes when all boxes are finished
    every = sorted({*before, *seeds})
    files.write_toml(path, {**content, "grow": {"seeds": every}}, "sand grow: what was asked for; sand resume reads it")
    return every


def boxes_of(folder: Path) -> list[Path]:
    """The folders that `grow` has begun in a folder."""
    return [there.parent for there in folder.glob(f"seed-*/{files.CASE}")]


def run_box(content: dict[str, Any], seed: int, folder: str, observers: Sequence[Any] = ()) -> str:
    """Run one box to its end, from its newest checkpoint if it has one; returns the name of the outcome.

    Raises
    ------
    BadInput
        the folder holds a run of another case.
    """
    place, case = Path(folder), check_case(content, "case")
    case.run.seed = seed
    if any(place.glob("checkpoint-*.npz")):
        simulation = resume(place, observers=list(observers))
        asked, there = (case_of(one, math.inf, math.inf) for one in (simulation_of(case, None), simulation))
        if changed := [name for name in asked if name != "run" and asked[name] != there[name]]:
            raise BadInput(f"{place} holds a run with other [{changed[0]}]; give another folder, or the same case")
        until = case.run.until if case.run.until is None else max(case.run.until, simulation.time)
    else:
        # a folder without a checkpoint is what a kill at the very start leaves
        simulation, until = simulation_of(case, place, overwrite=True, observers=list(observers)), case.run.until
    steps = None if case.run.steps is None else case.run.steps - simulation.steps
    arrived = (until is not None and simulation.time >= until) or (steps is not None and steps <= 0)
    if arrived and _closed(place).get("steps") == simulation.steps:
        return "finished"
    if arrived:  # a kill left it without a summary
        until, steps = simulation.time, None
    return simulation.run(until, steps=steps).outcome.name.lower()


def _closed(place: Path) -> dict[str, Any]:
    """The summary in a folder if its run has finished, else nothing."""
    path = place / files.SUMMARY
    summary = files.read_json(path) if path.exists() else {}
    return summary if summary.get("outcome") == "finished" else {}


def shared_settings(case: dict[str, Any]) -> dict[str, Any]:
    """What boxes of an ensemble have in common: the case but for [run] and for cut-offs, which follow the grains."""
    forces = {
        name: {key: value for key, value in table.items() if key != "cutoff"}
        for name, table in case.get("forces", {}).items()
    }
    return {name: table for name, table in case.items() if name != "run"} | {"forces": forces}
