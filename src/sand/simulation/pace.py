"""Estimate of the remaining run time; warns once if a run would take extremely long."""

from __future__ import annotations

import math
from collections.abc import Callable

from ..basics.wall_time import YEAR, format_wall_time

SAMPLE_SECONDS = 1.0
"""Wall time [s] of steps, compilation excluded, after which the estimate is made."""
WARN_STEPS, WARN_SECONDS = 1e12, YEAR
"""Remaining steps, and wall time [s], above which the estimate becomes a warning."""


LONG = "this run needs about"
"""Beginning of the warning."""


class RunTimeEstimate:
    """One estimate of the remaining steps and wall time of a run.

    Parameters
    ----------
    end, last : float
        Time [s] and step at which the run ends; infinite where not set.
    warn : callable
        Called with the text of the warning and its beginning, by which it is recognised.
    """

    def __init__(self, end: float, last: float, warn: Callable[[str, str], None]):
        self._end, self._last, self._warn = end, last, warn
        self._first: tuple[float, int] | None = None  # time and step after the first call
        self._seconds = 0.0
        self._done = False

    def update(self, time: float, steps: int, seconds: float) -> None:
        """Record one call of the driver, which took a wall time of `seconds`; may issue the warning."""
        if self._done:
            return
        if self._first is None:  # the first call compiles
            self._first = (time, steps)
            return
        self._seconds += seconds
        taken = steps - self._first[1]
        if self._seconds < SAMPLE_SECONDS or not taken:
            return
        self._done = True
        step = (time - self._first[0]) / taken
        left = min((self._end - time) / step if step > 0.0 else math.inf, self._last - steps)
        rest = left * self._seconds / taken
        if left > WARN_STEPS or rest > WARN_SECONDS:
            takes = format_wall_time(float(f"{rest:.2g}"))
            self._warn(
                f"{LONG} {left:.1g} more steps, about {takes} at the present speed; stop it with Ctrl-C "
                "and choose an earlier end or fewer steps",
                LONG,
            )
