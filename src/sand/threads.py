"""How many threads large simulations may use."""

from __future__ import annotations

import os

from .arguments import checked
from .errors import BadInput, shown

_wished: int | None = None


def cores() -> int:
    """Processor cores that this process may run on."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on every system
        return os.cpu_count() or 1


@checked
def set_threads(number: int | None) -> None:
    """Let large simulations of this process use so many threads; None: as many as there are cores, or `$SAND_THREADS`.

    No result depends on it, to the last bit. Small simulations use one thread, whatever is set.

    Raises
    ------
    BadInput
        less than 1.
    """
    global _wished
    _wished = None if number is None else _checked(number, "threads")


def threads() -> int:
    """Threads that a large simulation uses.

    Raises
    ------
    BadInput
        `$SAND_THREADS` is not a whole number above 0.
    """
    if _wished is not None:
        return _wished
    told = os.environ.get("SAND_THREADS")
    return cores() if not told else _checked(told, "the environment variable SAND_THREADS")


def _checked(number: int | str, name: str) -> int:
    try:
        if int(number) == float(number) and int(number) >= 1:
            return int(number)
    except (TypeError, ValueError, OverflowError):
        pass
    raise BadInput(f"{name} = {shown(number)}; it must be a whole number, at least 1")
