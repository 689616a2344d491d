"""Cadences of output: at multiples of a time or of a number of steps, logarithmic in time, or by wall time."""

from __future__ import annotations

import math
import re
from decimal import Decimal
from time import monotonic
from typing import Any, Literal, NamedTuple

from ..basics.arguments import MOST_STEPS
from ..basics.errors import BadInput
from ..basics.units import LONGEST_TEXT, format_quantity, si, whole_number

SHORTEST_DURATION = 1e-21
"""Shortest accepted time span [s]; light travels less than a picometre in it."""
MOST_PER_DECADE = 1000
"""Largest number of outputs per decade of time."""
FRAMES = 200
"""Frames of a run for which the user has chosen no cadence."""
NEAR = 1e-6
"""Times nearer to an output than this fraction of the interval count as the output, as both are rounded."""
_STEPS = re.compile(r"([+-]?[\d.eE+-]+)\s*steps?")
_LOG = re.compile(r"log\s*\(\s*(-?[\d.]+)\s*per\s+decade\s*,\s*from\s+([^()]+?)\s*\)")
_WALL = re.compile(r"(.+?)\s+wall(?:\s+time)?")


def duration(value: Any, name: str) -> float:
    """Convert a time span to seconds.

    Raises
    ------
    BadInput
        If it is not a time, or shorter than `SHORTEST_DURATION`.
    """
    seconds = si(value, "s", name, above=0.0)
    if seconds < SHORTEST_DURATION:
        raise BadInput(f"{name} = {value!r} must be at least {SHORTEST_DURATION:g} s")
    return seconds


class Cadence(NamedTuple):
    """When something is written: `read_cadence` reads it from a user's setting."""

    kind: Literal["time", "steps", "log", "wall"]
    every: float  # simulated time [s], number of steps, first time [s], or wall time [s]
    per_decade: int = 0

    @property
    def setting(self) -> float | str:
        """The setting in SI, from which `read_cadence` makes the same cadence."""
        texts = {
            "steps": f"{self.every:.0f} steps",
            "log": f"log({self.per_decade} per decade, from {self.every!r} s)",
            "wall": f"{self.every!r} s wall",
        }
        return texts.get(self.kind, self.every)

    def __str__(self) -> str:
        first = format_quantity(self.every, "s")
        texts = {
            "time": f"every {first}",
            "steps": f"every {self.every:.0f} steps",
            "log": f"{self.per_decade} per decade of time from {first}",
            "wall": f"every {first} of wall time",
        }
        return texts[self.kind]


def read_cadence(value: Any, name: str, *, wall_time: bool = False) -> Cadence:
    """Read a cadence from the setting `name`.

    Parameters
    ----------
    value : float or str
        A time (1e-9 or "1 ns"), "1000 steps", "log(10 per decade, from 1 ns)", or, with `wall_time`, "30 s wall".

    Raises
    ------
    BadInput
        If it is none of these, or a number in it is out of range.
    """
    text = value.strip() if isinstance(value, str) and len(value) <= LONGEST_TEXT else ""
    if match := _WALL.fullmatch(text):
        if not wall_time:
            raise BadInput(
                f"{name} = {value!r}: wall time is for checkpoint_every only, as results must not depend on it; "
                "give a simulated time, '1000 steps' or 'log(10 per decade, from 1 ns)'"
            )
        return Cadence("wall", duration(match[1], name))
    if match := _STEPS.fullmatch(text):
        steps = int(match[1]) if re.fullmatch(r"[+-]?\d+", match[1]) else match[1]
        return Cadence("steps", whole_number(steps, f"steps in {name}", most=MOST_STEPS))
    if text.startswith("log"):
        match = _LOG.fullmatch(text)
        if match is None:
            raise BadInput(f"{name} = {value!r}; write it as 'log(10 per decade, from 1 ns)'")
        number = int(match[1]) if re.fullmatch(r"-?\d+", match[1]) else match[1]
        per_decade = whole_number(number, f"outputs per decade in {name}", most=MOST_PER_DECADE)
        return Cadence("log", duration(match[2], f"first time in {name}"), per_decade)
    return Cadence("time", duration(value, name))


def number_in(cadence: Cadence, span: float, steps: float) -> float:
    """Number of outputs in a run of a length [s] and of so many steps, from time 0 on."""
    if cadence.kind == "steps":
        return steps // cadence.every
    if cadence.kind == "time":
        return span // cadence.every
    return max(cadence.per_decade * math.log10(span / cadence.every) + 1.0, 0.0) // 1.0 if span > 0.0 else 0.0


class Chosen(NamedTuple):
    """The cadence of frames that was chosen for one run, where the user gives none."""

    every: float  # [s]
    end: float  # of the run for which it was chosen [s]


def chosen_cadence(time: float, end: float, before: Chosen | None = None) -> Chosen | None:
    """Choose a cadence for a run from a time to an end [s]: about `FRAMES` frames; None if the end is not a time.

    The cadence chosen for an earlier run ends with that run.  It is kept if the run was interrupted and goes on to the
    same end, so that an interruption changes no frame.
    """
    if before is not None and before.end == end:
        return before
    if not 0.0 < end - time < math.inf:
        return None
    # a whole number of them from time 0 to the end, so that the last is not shorter; the factor allows for rounding
    number = math.ceil(FRAMES * end / (end - time) * (1.0 - 1e-9))
    return Chosen(max(end / number, SHORTEST_DURATION), end)


class Schedule:
    """The next output of a cadence: a time, met exactly, a step, or after a wall time.

    Times are multiples of the interval, or first × 10^(k / per decade) with k = 0, 1, …; steps are multiples of the
    number of steps, or, with r-RESPA, the ends of the cycles in which these lie.

    Parameters
    ----------
    cadence : Cadence or None
        None: nothing is due.
    time, step : float, int
        Present time [s] and step; outputs are due after them.
    last : float, optional
        Time [s] of the last output.
    """

    def __init__(self, cadence: Cadence | None, time: float, step: int = 0, last: float = -math.inf):
        self._cadence = cadence
        self._timed = cadence is not None and cadence.kind in ("time", "log")
        self._number = 0 if cadence is None or cadence.kind == "log" else 1
        self._after = -math.inf
        self._seconds = cadence.every if cadence is not None and cadence.kind == "wall" else math.inf  # wall time
        self.step_due: float = math.inf
        """Step of the next output; infinite for a cadence by time."""
        if last > -math.inf:
            self.advance(last, step)
        self._advance(time, step, time)

    def _time(self, number: int) -> float:
        """Time [s] of an output."""
        assert self._cadence is not None
        _, every, per_decade = self._cadence
        if not per_decade:
            return number * every
        decades, rest = divmod(number, per_decade)
        decade = float(Decimal(repr(every)).scaleb(decades))  # exact: 1 ns, 10 ns, …
        return decade * 10.0 ** (rest / per_decade)

    def _spacing(self) -> float:
        assert self._cadence is not None
        _, every, per_decade = self._cadence
        return self._time(self._number) * (10.0 ** (1.0 / per_decade) - 1.0) if per_decade else every

    @property
    def due(self) -> float:
        """Time [s] of the next output; infinite for a cadence by steps."""
        return max(self._time(self._number), self._after) if self._timed else math.inf

    def next(self, end: float) -> float:
        """Time [s] of the next output, or `end` if that is not later."""
        return self.due if self._timed and self.due < end - NEAR * self._spacing() else end

    def is_due(self, time: float, step: int) -> bool:
        """Whether the next output is due at this time [s] and step, or at the present wall time."""
        return self.due <= time or self.step_due <= step or monotonic() - self._since > self._seconds

    def take(self, time: float, step: int) -> bool:
        """Whether the next output is due at this time [s] and step; if so, move to the one after it."""
        is_due = self.is_due(time, step)
        if is_due:
            self.advance(time, step)
        return is_due

    def advance(self, time: float, step: int = 0) -> None:
        """Move to the first output after an output at this time [s] and step."""
        self._advance(time, step, time + NEAR * self._spacing() if self._timed else time)

    def _advance(self, time: float, step: int, late: float) -> None:
        self._since = monotonic()
        if self._cadence is None:
            return
        kind, every, per_decade = self._cadence
        if kind == "steps":
            self.step_due = (step // int(every) + 1) * int(every)
        if not self._timed:
            return
        if kind == "time":
            self._number = max(self._number, math.floor(late / every))
        elif late > every:
            self._number = max(self._number, math.floor(per_decade * math.log10(late / every)))
        # rounding may put the first or the second output tried before `late`
        for _ in range(2):
            if self._time(self._number) <= late:
                self._number += 1
        # where the spacing of doubles exceeds the interval, outputs follow at that spacing
        self._after = math.nextafter(time, math.inf)
