"""`sand collide CASE.toml`: two bodies hit each other, once or for many seeds."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import click

from ..core.errors import BadInput
from . import options, report

SHOWN = 12
"""Collisions listed one by one on the screen; all of them are in collision.json."""


@click.command("collide", short_help="Collide two bodies that a case file describes.")
@click.argument("case", metavar="CASE.toml")
@click.option("--out", metavar="DIR", help="Folder for the files (default: the case's name).")
@click.option("--seeds", metavar="LIST", help="Seeds instead of those in the case: '3', '1,2,5' or '1-20'.")
@click.option("--workers", type=click.IntRange(min=1), default=1, help="Processes that share the seeds (default 1).")
@click.option("--overwrite", is_flag=True, help="Replace the run that the folder holds.")
@options.as_json
@options.debug
def command(case: str, out: str | None, seeds: str | None, workers: int, overwrite: bool, as_json: bool) -> int:
    """Collide the bodies that CASE.toml describes, until nothing happens any more.

    Leaves collision.json and a figure in the folder; for a single seed also the trajectory, the ledger and all
    that `sand run` leaves.
    """
    from ..experiments.collision_case import read_collision
    from ..files.folder import COLLISION, FIGURE, make_folder, write_json
    from ..files.lock import writing
    from .launch import refuse_folder

    described = read_collision(case)
    chosen = read_seeds(seeds) if seeds else described.impact.seeds
    folder = Path(out or described.impact.out or Path(case).stem)
    refuse_folder(folder, Path(case), overwrite=overwrite)
    if len(chosen) == 1:
        outcome, _ = report.with_notes(lambda: described.run(chosen[0], out=folder, overwrite=overwrite))
        results = [outcome.to_dict()]
    else:
        make_folder(folder, overwrite=overwrite)
        with writing(folder):
            results = _many(case, chosen, workers)
            from ..view.collisions import collision_figure
            from ..view.figure import save

            save(collision_figure(results), folder / FIGURE)
    content = {"case": str(case), "folder": str(folder), "collisions": results, "counts": dict(counts(results))}
    write_json(folder / COLLISION, content)
    if as_json:
        report.emit(content)
    else:
        _tell(case, folder, results)
    return 0


def _many(case: str, seeds: list[int], workers: int) -> list[dict[str, Any]]:
    """All seeds, in processes if asked for."""
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor

    from ..core.threads import one_thread
    from ..experiments.collision_case import run_seeds
    from ..files.folder import read_toml

    content = read_toml(case)
    if workers == 1:
        return run_seeds(content, seeds)
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context, initializer=one_thread) as pool:
        return run_seeds(content, seeds, pool)


def counts(results: list[dict[str, Any]]) -> Counter[str]:
    """How often each outcome came."""
    return Counter(result["outcome"] for result in results)


def read_seeds(text: str) -> list[int]:
    """'3', '1,2,5', '1-20' as whole numbers.  Raises BadInput."""
    seeds: list[int] = []
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        if not (first.isdecimal() and (last.isdecimal() or not dash)) or int(last or first) - int(first) > 100_000:
            raise BadInput(f"--seeds {text!r} must be whole numbers such as '3', '1,2,5' or '1-20'")
        seeds += range(int(first), int(last or first) + 1)
    if not seeds:
        raise BadInput(f"--seeds {text!r} names no seed: the first number must not be above the last")
    return seeds


def _tell(case: str, folder: Path, results: list[dict[str, Any]]) -> None:
    rows = [(f"seed {r['seed'] if r['seed'] is not None else '-'}", line(r)) for r in results[:SHOWN]]
    if len(results) > SHOWN:
        rows.append(("…", f"and {len(results) - SHOWN} more"))
    tally = ", ".join(f"{n} × {name}" for name, n in counts(results).most_common())
    rows += [("outcomes", tally), ("files", f"{folder}/")]
    report.show(f"collide {case}", rows)


def line(r: dict[str, Any]) -> str:
    """One collision on one line."""
    pieces = f"{len(r['fragments'])} bodies, largest {r['largest_remnant']:.0%} of the mass"
    lost = sum(r["lost"].values()) / r["impact_energy"]
    events = f"contacts {r['made']} made, {r['moved']} moved, {r['broken']} broken"
    busy = "" if r["quiet"] else " (stopped while still busy)"
    return f"{r['outcome']}{busy}: {pieces}; {events}; lost {lost:.2g} of the impact energy; drift {r['drift']:.1e}"
