"""How far a run is to go."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..arguments import MOST_STEPS
from ..errors import BadInput, shown
from ..units import si

SHORTEST = 1e-21
"""Shortest time [s] that may be asked for; light passes through less than a picometre meanwhile."""


def duration(value: Any, name: str) -> float:
    """A time span [s] of at least `SHORTEST`.  Raises BadInput."""
    seconds = si(value, "s", name, above=0.0)
    if seconds < SHORTEST:
        raise BadInput(f"{name} = {value!r} must be at least {SHORTEST:g} s: nothing moves in less")
    return seconds


def stop_criteria(
    until: Any, steps: int | None, time: float, taken: int, planned: tuple[float, float]
) -> tuple[float, float]:
    """The time [s] and the step that `Simulation.run(until, steps=steps)` ends at, infinite where it has no such end.

    Parameters
    ----------
    time : float
        now [s].
    taken : int
        steps so far.
    planned : tuple[float, float]
        what counts where neither is given.

    Raises
    ------
    BadInput
        no end, one that is past, or steps that are no whole number of at least 1.
    """
    end = math.inf if until is None else si(until, "s", "until")
    if 0.0 < end < SHORTEST:
        duration(until, "until")
    last = math.inf if steps is None else taken + _whole_steps(steps)
    if until is None and steps is None:
        end, last = planned
    if end == last == math.inf:
        raise BadInput("run needs an end: until='5 us' or steps=1000")
    if steps is not None and last > MOST_STEPS:
        raise BadInput(f"steps = {shown(steps)} are more than can be counted, {MOST_STEPS:.3g}")
    if until is not None and end < time:
        raise BadInput(f"until = {until!r} lies before the present time, {time:.6g} s")
    return end, last


def _whole_steps(steps: Any) -> int:
    if isinstance(steps, bool) or not isinstance(steps, (int, np.integer)) or steps < 1:
        raise BadInput(f"steps = {shown(steps)} must be a whole number of at least 1")
    return int(steps)
