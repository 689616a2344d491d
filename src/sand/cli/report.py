"""Output of the commands: lines for people, one JSON object for machines, notes on stderr."""

from __future__ import annotations

import json
import math
import re
import shlex
import sys
import time
import warnings
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import Any

import click

from ..basics.errors import BadInput, FilesFailed
from ..basics.wall_time import format_wall_time
from ..config.folders import job_in
from ..io.checkpoint_files import checkpoint_files
from ..io.ledger_table import TEMPERATURES
from ..io.run_folder import CASE, OWN_FILES, TRAJECTORY, plain, read_toml

Rows = list[tuple[str, str]]
"""Labels and texts of a table of two columns."""
LARGE = 1e8
"""Size [bytes] from which a note says that a trajectory is read, and above which a page takes long to open."""
LONGEST_NOTE = 600
"""Largest number of characters of a note."""
_UNSAFE = re.compile("[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069]")
"""Control characters and characters that change the text direction, which could rewrite the content of a terminal."""


def clean(text: str) -> str:
    """The text as one line, with escapes such as `\\x1b` in place of control characters."""
    return _UNSAFE.sub(lambda found: found[0].encode("unicode_escape").decode(), text)


def write_line(text: str, *, err: bool = False) -> None:
    """Print one line for people; everything printed to the terminal passes through here or through `clean`."""
    shows_progress = sys.modules.get("sand.cli.progress_line")  # not imported for this
    with shows_progress.line_removed() if shows_progress else nullcontext():
        click.echo(clean(text), err=err)


def note(text: str) -> None:
    """Print one line on stderr; the middle of a very long one is left out."""
    shown = text if len(text) <= LONGEST_NOTE else f"{text[: LONGEST_NOTE // 2]} … {text[-LONGEST_NOTE // 3 :]}"
    write_line(f"sand: {shown}", err=True)


def reading(path: str | Path) -> None:
    """Print a note before the trajectories of a run, or of the runs in a folder, are read, if that takes a while."""
    place = Path(path)
    found = [place] if place.is_file() else [*place.glob(TRAJECTORY), *place.glob(f"*/{TRAJECTORY}")]
    size = sum(each.stat().st_size for each in found)
    if size > LARGE:
        note(f"reading {path}, {size / 1e6:.0f} MB …")


def compiling(quiet: bool = False) -> AbstractContextManager[None]:
    """Print a note on each kernel that is compiled inside the block, with the time that it took last."""
    from ..compiler import progress

    return progress.compilation_notes(None if quiet else note)


def emit(content: dict[str, Any]) -> None:
    """Print the JSON object of --json; NaN and infinities become null."""
    # JSON escapes all other control characters itself
    click.echo(json.dumps(plain(content), indent=2, allow_nan=False).replace("\x7f", "\\u007f"))


def show(heading: str, rows: Rows) -> None:
    """Print a heading and a table of two columns."""
    width = max((len(label) for label, _ in rows), default=0)
    for line in [heading, *(f"  {label:<{width}}  {text}" for label, text in rows)]:
        write_line(line)


def answer(content: dict[str, Any], heading: str, rows: Rows, *, as_json: bool, quiet: bool = False) -> None:
    """Print a result, as `emit` for --json or as `show`; nothing if `quiet`."""
    if as_json:
        emit(content)
    elif not quiet:
        show(heading, rows)


@contextmanager
def notes() -> Iterator[None]:
    """Print warnings as notes, immediately and each once."""
    printed: set[str] = set()

    def show_warning(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
        if issubclass(category, UserWarning) and str(message) not in printed:
            printed.add(str(message))
            note(f"note: {message}")

    with warnings.catch_warnings():
        warnings.simplefilter("always")
        warnings.showwarning = show_warning
        yield


def first_of(rows: Rows, most: int) -> Rows:
    """The first `most` rows, and how many more there are."""
    return [*rows[:most], ("…", f"and {len(rows) - most} more")] if len(rows) > most else rows


def resume_line(folder: Path) -> str:
    """The command that continues a run, with the modules of the user's own forces."""
    try:
        tables = read_toml(folder / CASE).get("forces", {})
    except (BadInput, FilesFailed):
        tables = {}
    given = [table.get("import") for table in tables.values() if isinstance(table, dict)]
    modules = dict.fromkeys(str(path).partition(":")[0] for path in given if path is not None)
    imports = "".join(f" --import {shlex.quote(module)}" for module in modules)
    return f"sand resume {shlex.quote(str(folder))}{imports}"


def how_to_continue(folder: Path) -> str:
    """How to continue an interrupted job."""
    if is_resumable(folder):
        return f"continue with: {resume_line(folder)}"
    return "nothing is lost, start again"


def is_resumable(folder: Path) -> bool:
    """Whether `sand resume` can continue the content of a folder."""
    if checkpoint_files(folder):
        return True
    try:
        command, _, begun = job_in(folder)
    except BadInput:
        return False
    return begun and command not in (None, "run")


def files_of(folder: Path) -> list[str]:
    """Names of the files of SAND in a folder."""
    return [name for name in OWN_FILES if (folder / name).exists()] + [p.name for p in checkpoint_files(folder)]


def listed(folder: Path) -> str:
    """The folder and the names of its files, as one line."""
    return f"{folder}/  " + "  ".join(files_of(folder))


LAYOUT = "{percentage:3.0f}%|{bar}| {desc} [{elapsed}<{remaining}{postfix}]"
"""Layout of a line of progress whose end is known."""
LINE_EVERY, LINE_PART, LINE_AT_LEAST = 30.0, 0.05, 1.0
"""Where there is no terminal: a line after this wall time [s], or this part of the work but not before the last [s]."""
JOB_LINE_EVERY = 3600.0
"""The same wall time [s] for jobs, whose parts may take hours."""


class ProgressLines:
    """Progress as lines of text, in place of a progress bar of tqdm, where there is no terminal.

    Parameters
    ----------
    total : float or None
        Position at the end; None or infinite if it is not known.
    initial : float, optional
        Position at the beginning.
    desc : str, optional
        Description of the work.
    every : float, optional
        Wall time [s] after which a line is printed that is not due by the progress.

    Attributes
    ----------
    initial : float
        Position at the beginning, also if it becomes known later.
    """

    def __init__(self, total: float | None, initial: float = 0.0, desc: str = "", every: float = LINE_EVERY):
        self.n, self._total, self.initial, self._every = initial, total or math.inf, initial, every
        self._texts = {"desc": desc, "postfix": ""}
        self._began = self._last = time.monotonic()
        self._last_part = self._part()

    def __enter__(self) -> ProgressLines:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _part(self) -> float:
        return self.n / self._total

    @property
    def format_dict(self) -> dict[str, float]:
        """The mean rate, as `tqdm.format_dict`."""
        return {"rate": (self.n - self.initial) / max(time.monotonic() - self._began, 1e-9)}

    def set_description_str(self, text: str, refresh: bool = True) -> None:
        """Set the description."""
        self._texts["desc"] = text

    def set_postfix_str(self, text: str, refresh: bool = True) -> None:
        """Set the numbers after the times."""
        self._texts["postfix"] = text

    def update(self, by: float = 1.0) -> None:
        """Advance; prints a line if one is due."""
        self.n += by
        now = time.monotonic()
        waited, done = now - self._last, self._part() - self._last_part
        if waited < self._every and (done < LINE_PART or waited < LINE_AT_LEAST):
            return
        self._last, self._last_part = now, self._part()
        known, rate = math.isfinite(self._total), self.format_dict["rate"]
        times = format_wall_time(now - self._began)
        if known and rate > 0.0:
            times += f", {format_wall_time((self._total - self.n) / rate)} left"
        part = f"{self._part():.0%}" if known else ""
        note(", ".join(text for text in (part, self._texts["desc"], times, self._texts["postfix"]) if text))

    def close(self) -> None:
        """Nothing is left to be removed."""


def progress_bar(total: float | None, hidden: bool, **layout: Any) -> Any:
    """One line of progress on a terminal, otherwise `ProgressLines`."""
    if not (hidden or sys.stderr.isatty()):
        return ProgressLines(total, layout.get("initial", 0.0), layout.get("desc", ""), layout.get("every", LINE_EVERY))
    from .progress_line import progress_line

    layout.pop("every", None)
    return progress_line(total, disable=hidden, **layout)


def opening(simulation: Any, end: float, last_step: float, condition: str | None, folder: Path) -> Rows:
    """Describe a simulation before its start, with the choices made automatically.

    Parameters
    ----------
    end, last_step : float
        Planned end: time [s] and step, infinite where not set.
    condition : str or None
        Condition that ends the run.
    """
    from ..basics.units import format_quantity
    from ..simulation.cadence import chosen_cadence, read_cadence
    from ..simulation.in_words import forces_in_words, grains_in_words

    every = simulation.frame_every
    if every is None:
        chosen = chosen_cadence(simulation.time, end, simulation._continuation.chosen)
        every = math.inf if chosen is None else chosen.every
    if isinstance(every, str):
        frames = f"frames {read_cadence(every, 'frame_every')}"
    else:
        several = math.isfinite(every) and every <= end - simulation.time
        frames = f"a frame every {format_quantity(every, 's')}" if several else "frames at start and end"
    if simulation.row_every is not None:
        frames += f", further rows of the ledger {read_cadence(simulation.row_every, 'row_every')}"
    if simulation.checkpoint_every is not None:
        frames += f", checkpoints {read_cadence(simulation.checkpoint_every, 'checkpoint_every', wall_time=True)}"
    ends = [f"{format_quantity(end, 's')}"] if math.isfinite(end) else []
    ends += [f"step {int(last_step)}"] if math.isfinite(last_step) else []
    ends += [condition] if condition else []
    start = f"from {format_quantity(simulation.time, 's')} " if simulation.time > 0.0 else ""
    return [
        ("grains", grains_in_words(simulation.grains, simulation.temperature)),
        *simulation.choices.items(),
        ("forces", forces_in_words(simulation.forces)),
        ("time", f"{start}to {' or '.join(ends)}, {frames}"),
        ("seed", str(simulation.seed)),
        ("folder", str(folder)),
    ]


def results(summary: dict[str, Any]) -> Rows:
    """The most important numbers of summary.json."""
    from ..basics.units import format_quantity

    rigid = summary.get("rigid_clusters")
    awake: Rows = [("contact steps", awake_share(rigid))] if rigid else []
    return [
        ("time", f"{format_quantity(summary['time'], 's')} in {summary['steps']} steps"),
        *awake,
        ("clusters", clusters(summary)),
        (
            "contacts",
            f"{summary['contacts']} ({summary['contacts_made']} formed, {summary['contacts_broken']} broken); "
            f"{summary['contacts_moved']} slips (sliding, rolling or twisting beyond its limit)",
        ),
        *temperatures(summary),
        ("energy drift", f"{summary['drift']:.2g} of the dissipated and kinetic energy"),
        ("wall time", wall_time(summary)),
    ]


def wall_time(summary: dict[str, Any]) -> str:
    """Wall time of a run and its parts, and the speed of its steps; older summaries lack the parts."""
    total, rate = format_wall_time(summary["wall_seconds"]), summary["ns_per_grain_step"]
    # steps of bodies have no cost of their own
    speed = "" if rate is None or "rigid_clusters" in summary else f"{rate:.3g} ns per grain and step"
    if "wall_stepping" not in summary:
        return f"{total}, {speed}" if speed else total
    steps = f"steps {format_wall_time(summary['wall_stepping'])}" + (f" ({speed})" if speed else "")
    names = {"output": "output", "compilation": "compiled code", "start": "start", "other": "other"}
    parts = {name: summary[f"wall_{part}"] for part, name in names.items()}
    shown = [
        f"{name} {format_wall_time(seconds)}"
        for name, seconds in parts.items()
        if seconds >= 0.01 * summary["wall_seconds"]
    ]
    return f"{total}: " + ", ".join([steps, *shown])


def awake_share(rigid: dict[str, Any]) -> str:
    """How long clusters were awake, and steps of contacts, from `rigid_clusters` of a summary."""
    return (
        f"{rigid['contact_steps']}, of clusters that are awake: some cluster {rigid['time_awake']:.2%} of the time, a "
        f"grain {rigid['grains_awake']:.2%} of it on average"
    )


def clusters(row: dict[str, Any]) -> str:
    """Number of clusters, mean size S and largest size, from a summary or a row of the ledger."""
    return (
        f"{int(row['clusters'])}, mean size S = {row['mean_cluster_size']:.4g}, largest {int(row['largest_cluster'])}"
    )


def temperatures(row: dict[str, Any]) -> Rows:
    """Temperatures of the bodies at one time, from a summary or a row of the ledger; none from older ones."""
    found = [row.get(name) for name in TEMPERATURES]
    if row["clusters"] < 2 or None in found:
        return []
    translation, rotation, median = (f"{value:.3g} K" for value in found)
    return [("bodies", f"translation {translation}, rotation {rotation} (median {median})")]


def format_bytes(number: float) -> str:
    """A size in memory or on a disk for people: '350 MB', '1.2 GB'."""
    return f"{number / 1e6:.3g} MB" if number < 1e9 else f"{number / 1e9:.2g} GB"


def named(grains: Iterable[int]) -> str:
    """The grains that an outcome concerns, in brackets; empty if there are none."""
    numbers = ", ".join(str(i) for i in grains)
    return f" (grains {numbers})" if numbers else ""
