"""What is printed, and how: lines for people, one JSON object for machines, notes on stderr."""

from __future__ import annotations

import json
import math
import re
import shlex
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar

import click

from ..config.commands import command_for
from ..errors import BadInput
from ..io.run_folder import CASE, ONE_COLLISION, OWN_FILES, plain, read_toml

T = TypeVar("T")
Rows = list[tuple[str, str]]


LONGEST = 600
"""Characters of a note."""
_UNFIT = re.compile("[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069]")
"""Control characters, and those that change the direction of what follows: they can rewrite what a terminal shows."""


def clean(text: str) -> str:
    """The text as one line, with `\\x1b` and the like in place of control characters."""
    return _UNFIT.sub(lambda found: found[0].encode("unicode_escape").decode(), text)


def say(text: str, *, err: bool = False) -> None:
    """One line for people; all that goes to the terminal comes through here, or through `clean`."""
    click.echo(clean(text), err=err)


def note(text: str) -> None:
    """One line on stderr; of what is too long to be read, its middle is left out."""
    shown = text if len(text) <= LONGEST else f"{text[: LONGEST // 2]} … {text[-LONGEST // 3 :]}"
    say(f"sand: {shown}", err=True)


def compiling(quiet: bool = False) -> AbstractContextManager[None]:
    """Says so, once, if anything has to be compiled inside the block."""
    if quiet:
        return nullcontext()
    jit = with_notes(lambda: import_module("sand.compiler.jit"))  # it may warn of the compiler or its cache
    return jit.compiling(lambda: note("compiling the loops for this combination of forces, for this and later runs …"))


def emit(content: dict[str, Any]) -> None:
    """The one JSON object of --json; NaN and infinities become null."""
    # JSON escapes all other control characters itself
    click.echo(json.dumps(plain(content), indent=2, allow_nan=False).replace("\x7f", "\\u007f"))


def show(heading: str, rows: Rows) -> None:
    """A heading and two columns."""
    width = max((len(label) for label, _ in rows), default=0)
    for line in [heading, *(f"  {label:<{width}}  {text}" for label, text in rows)]:
        say(line)


def with_notes(make: Callable[[], T]) -> T:
    """`make()`, its warnings printed as notes, each once."""
    with notes():
        return make()


@contextmanager
def notes() -> Iterator[None]:
    """Warnings are printed as notes, at once and each once."""
    told: set[str] = set()

    def tell(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
        if issubclass(category, UserWarning) and str(message) not in told:
            told.add(str(message))
            note(f"note: {message}")

    with warnings.catch_warnings():
        warnings.simplefilter("always")
        warnings.showwarning = tell
        yield


def blame(case: Path, make: Callable[[], T]) -> T:
    """`make()`; what turns out to be wrong with the case there gets the file's name in front, too."""
    try:
        return make()
    except BadInput as error:
        raise error.at(str(case)) from None


def resume_line(folder: Path) -> str:
    """What to type to go on with a run."""
    return f"sand resume {shlex.quote(str(folder))}"


def way_on(folder: Path) -> str:
    """How to go on with what has stopped, in words."""
    if can_go_on(folder):
        return f"go on with: {resume_line(folder)}"
    return "nothing is lost, start again"


def can_go_on(folder: Path) -> bool:
    """True if `sand resume` finds something to go on with in a folder."""
    if checkpoints(folder) or (folder / ONE_COLLISION).exists():
        return True
    try:
        return command_for(read_toml(folder / CASE)) in ("grow", "scatter", "collide")
    except BadInput:
        return False


def checkpoints(folder: Path) -> list[Path]:
    """The checkpoints in a run's folder, oldest first."""
    return sorted(folder.glob("checkpoint-*.npz"))


def files_of(folder: Path) -> list[str]:
    """Names of the run's files that are there."""
    return [name for name in OWN_FILES if (folder / name).exists()] + [p.name for p in checkpoints(folder)]


def opening(simulation: Any, end: float, last_step: float, folder: Path) -> Rows:
    """What is about to run, and what was chosen for the user.

    Parameters
    ----------
    end, last_step : float
        time [s] and step that are to be reached, infinite where there is none.
    """
    from ..units import format_quantity

    every = simulation.frame_every
    if every is None:  # what `run` will choose
        every = (end - simulation.time) / 200.0
    several = every <= end - simulation.time
    frames = f"a frame every {format_quantity(every, 's')}" if several else "frames at start and end"
    goals = [f"{format_quantity(end, 's')}"] if math.isfinite(end) else []
    goals += [f"step {int(last_step)}"] if math.isfinite(last_step) else []
    start = f"from {format_quantity(simulation.time, 's')} " if simulation.time > 0.0 else ""
    return [
        ("grains", _grains(simulation.grains, simulation.temperature)),
        *simulation.choices.items(),
        ("forces", ", ".join(_force(f) for f in simulation.forces) or "none: grains fly straight on"),
        ("time", f"{start}to {' or '.join(goals)}, {frames}"),
        ("seed", str(simulation.seed)),
        ("folder", str(folder)),
    ]


def _grains(grains: Any, temperature: float) -> str:
    from ..units import format_quantity

    def span(values: Any, say: Callable[[float], str]) -> str:
        least, most = say(float(values.min())), say(float(values.max()))
        return least if least == most else f"{least} to {most}"

    parts = [
        f"{len(grains)} of {', '.join(m.name for m in grains.materials)}",
        f"radius {span(grains.radius, lambda v: format_quantity(v, 'm'))}",
    ]
    if grains.body_moment.any():
        size = (grains.body_moment**2).sum(axis=1) ** 0.5
        parts.append(f"moment {span(size, lambda v: f'{v:.4g} A m^2')}")
    moving = f"kinetic temperature {format_quantity(temperature, 'K')}" if temperature > 0.0 else "at rest"
    return ", ".join([*parts, moving])


def _force(force: Any) -> str:
    """Its name and what was set by the user; case.toml lists all settings."""

    def say(value: Any) -> str:
        return f"{value:.4g}" if isinstance(value, float) else str(value)

    try:
        usual = type(force)().parameters()
    except (BadInput, TypeError):  # a force that cannot do without settings
        usual = {}
    settings = ", ".join(f"{key} = {say(v)}" for key, v in force.parameters().items() if v != usual.get(key))
    return f"{force.name} ({settings})" if settings else force.name


def results(summary: dict[str, Any]) -> Rows:
    """The numbers of summary.json that people ask for first."""
    from ..units import format_quantity

    rate = summary["ns_per_grain_step"]
    wall = format_wall_time(summary["wall_seconds"])
    return [
        ("time", f"{format_quantity(summary['time'], 's')} in {summary['steps']} steps"),
        ("clusters", clusters(summary)),
        (
            "contacts",
            f"{summary['contacts']} ({summary['contacts_made']} made, {summary['contacts_moved']} moved, "
            f"{summary['contacts_broken']} broken)",
        ),
        ("energy drift", f"{summary['drift']:.2g} of the energy dissipated and in motion"),
        ("wall time", wall if rate is None else f"{wall}, {rate:.3g} ns per grain and step"),
    ]


def clusters(row: dict[str, Any]) -> str:
    """Number, mean size S and largest, of a summary or a row of the ledger."""
    return (
        f"{int(row['clusters'])}, mean size S = {row['mean_cluster_size']:.4g}, largest {int(row['largest_cluster'])}"
    )


def format_wall_time(seconds: float) -> str:
    """Wall time for people: '5.6 s', '12 min 05 s', '3 h 07 min'."""
    if seconds < 60.0:
        return f"{seconds:.3g} s"
    whole = round(seconds)
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"


def named(grains: Iterable[int]) -> str:
    """The grains an outcome concerns, in brackets; nothing if there are none."""
    numbers = ", ".join(str(i) for i in grains)
    return f" (grains {numbers})" if numbers else ""
