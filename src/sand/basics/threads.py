"""Number of threads of large simulations."""

from __future__ import annotations

import os

from .arguments import checked
from .errors import BadInput, shown

_requested: int | None = None


def cores() -> int:
    """Number of processor cores available to this process."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on every system
        return os.cpu_count() or 1


@checked
def set_threads(number: int | None) -> None:
    """Set the number of threads of large simulations in this process.

    Results do not depend on it, to the last bit. Small simulations always use one thread.

    Parameters
    ----------
    number : int or None
        At least 1. None: `$SAND_THREADS`, or else the number of cores.

    Raises
    ------
    BadInput
        If the number is less than 1.
    """
    global _requested
    _requested = None if number is None else _positive_integer(number, "threads")


def threads() -> int:
    """Number of threads of a large simulation.

    Raises
    ------
    BadInput
        If `$SAND_THREADS` is not a whole number above 0.
    """
    if _requested is not None:
        return _requested
    variable = os.environ.get("SAND_THREADS")
    return cores() if not variable else _positive_integer(variable, "the environment variable SAND_THREADS")


def _positive_integer(number: int | str, name: str) -> int:
    try:
        if int(number) == float(number) and int(number) >= 1:
            return int(number)
    except (TypeError, ValueError, OverflowError):
        pass
    raise BadInput(f"{name} = {shown(number)}; it must be a whole number, at least 1")
