"""Stop criteria of a run: a time, a step count, or the planned end of a resumed run."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from ..arguments import MOST_STEPS
from ..errors import BadInput, shown
from ..units import si, whole_number

SHORTEST_DURATION = 1e-21
"""Shortest accepted time span [s]; light travels less than a picometre in it."""


class StopCriteria(NamedTuple):
    """The end of one call of `Simulation.run`; infinite where a criterion is not set."""

    time: float  # [s]
    step: float


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


def stop_criteria(until: Any, steps: int | None, time: float, step: int, planned: tuple[float, float]) -> StopCriteria:
    """Resolve the arguments of `Simulation.run` to absolute stop criteria.

    Parameters
    ----------
    until : float or str, optional
        Absolute simulation time, in seconds or as text with a unit.
    steps : int, optional
        Number of further steps, at least 1.
    time : float
        Present time [s].
    step : int
        Present step count.
    planned : tuple[float, float]
        Time [s] and step used if neither `until` nor `steps` is given, so that a resumed run ends where it was to end.

    Raises
    ------
    BadInput
        If there is no criterion, `until` lies in the past, or `steps` is not a positive integer.
    """
    end = math.inf if until is None else si(until, "s", "until")
    if 0.0 < end < SHORTEST_DURATION:
        duration(until, "until")
    last = math.inf if steps is None else step + whole_number(steps, "steps")
    if until is None and steps is None:
        end, last = planned
    if end == last == math.inf:
        raise BadInput("run needs an end: until='5 us' or steps=1000")
    if steps is not None and last > MOST_STEPS:
        raise BadInput(f"steps = {shown(steps)}: the step count must not exceed {MOST_STEPS:.3g}")
    if until is not None and end < time:
        raise BadInput(f"until = {until!r} lies before the present time, {time:.6g} s")
    return StopCriteria(end, last)
