"""How long a run will take, said once if that is beyond all patience."""

from __future__ import annotations

import math

from ..errors import warn

LOOK_AFTER = 1.0
"""Wall time [s] of steps after which the estimate is made; compiling does not count."""
MOST_STEPS, MOST_SECONDS = 1e12, 365.25 * 86400.0
"""Steps, and wall time [s], beyond which a word is said."""


class Pace:
    """Steps and time of a run so far, for one estimate of what is left.

    Parameters
    ----------
    end, last : float
        time [s] and step at which the run is to end; infinite where it has no such end.
    """

    def __init__(self, end: float, last: float):
        self._end, self._last = end, last
        self._begun: tuple[float, int] | None = None
        self._spent = 0.0
        self._done = False

    def look(self, time: float, steps: int, seconds: float) -> None:
        """After each call of the driver: where the run stands, and the wall time [s] that the call took.  May warn."""
        if self._done:
            return
        if self._begun is None:  # the first call compiles
            self._begun = (time, steps)
            return
        self._spent += seconds
        taken = steps - self._begun[1]
        if self._spent < LOOK_AFTER or not taken:
            return
        self._done = True
        left = steps_left(self._end - time, self._last - steps, (time - self._begun[0]) / taken)
        wall = left * self._spent / taken
        if left > MOST_STEPS or wall > MOST_SECONDS:
            years = f"about {wall / MOST_SECONDS:.2g} years" if wall > MOST_SECONDS else f"{wall / 86400.0:.2g} days"
            warn(
                f"this run needs about {left:.1g} more steps, {years} at the present pace; stop it with Ctrl-C, "
                "and ask for an earlier end or fewer steps"
            )


def steps_left(time: float, steps: float, step: float) -> float:
    """Steps until a time [s] or a number of steps is passed, whichever comes first, at a mean `step` [s]."""
    return min(time / step if step > 0.0 else math.inf, steps)
