"""Stop criteria of a run: a time, a step count, a condition, or the planned end of a resumed run."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from ..basics.arguments import MOST_STEPS
from ..basics.errors import BadInput, shown
from ..basics.units import si, whole_number
from .cadence import SHORTEST_DURATION, duration
from .condition import GIVEN, Condition, OwnCondition, read_condition


class StopCriteria(NamedTuple):
    """The end of one call of `Simulation.run`; infinite or None where a criterion is not set."""

    time: float  # [s]
    step: float
    condition: Condition | OwnCondition | None = None

    @property
    def stop(self) -> str | None:
        """Text of the condition."""
        return None if self.condition is None else self.condition.text


def stop_criteria(
    until: Any, steps: int | None, stop: Any, time: float, step: int, planned: tuple[float, float, str | None]
) -> StopCriteria:
    """Resolve the arguments of `Simulation.run` to absolute stop criteria.

    Parameters
    ----------
    until : float or str or callable, optional
        Absolute simulation time, in seconds or as text with a unit; or a function, as for `stop`.
    steps : int, optional
        Number of further steps, at least 1.
    stop : str or callable or OwnCondition, optional
        A condition, see `read_condition`, or a function of the simulation.
    time : float
        Present time [s].
    step : int
        Present step count.
    planned : tuple[float, float, str or None]
        Time [s], step and condition used if no criterion is given, so that a resumed run ends where it was to end.

    Raises
    ------
    BadInput
        If there is no criterion, `until` lies in the past, `steps` is not a positive integer, or the condition cannot
        be read.
    """
    if callable(until) and not isinstance(until, type):
        if stop is not None:
            raise BadInput("until and stop are both conditions; give one, or a time as until")
        until, stop = None, until
    end = math.inf if until is None else si(until, "s", "until")
    if 0.0 < end < SHORTEST_DURATION:
        duration(until, "until")
    last = math.inf if steps is None else step + whole_number(steps, "steps")
    if until is None and steps is None and stop is None:
        end, last, stop = planned
        if stop == GIVEN:
            raise BadInput("the condition that ends this run is a function of a script: run(until=function), or a time")
    if callable(stop) and not isinstance(stop, type):
        stop = OwnCondition(stop)
    is_given = stop is None or isinstance(stop, OwnCondition)
    condition: Condition | OwnCondition | None = stop if is_given else read_condition(stop)
    if end == last == math.inf and condition is None:
        raise BadInput("run needs an end: until='5 us', steps=1000 or stop='clusters == 1'")
    if steps is not None and last > MOST_STEPS:
        raise BadInput(f"steps = {shown(steps)}: the step count must not exceed {MOST_STEPS:.3g}")
    if until is not None and end < time:
        raise BadInput(f"until = {until!r} lies before the present time, {time:.6g} s")
    return StopCriteria(end, last, condition)
