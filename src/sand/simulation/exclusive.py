"""One thread at a time works with a simulation: its arrays, tables and files have no other protection."""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

from ..basics.errors import BadInput

LONG = "run"
"""The call that may take long: others are refused at once while it goes on, and wait for the end of all others."""
PATIENCE = 10.0
"""Longest wall time [s] to wait for a call of another thread."""

Method = TypeVar("Method", bound=Callable[..., Any])


class Exclusive:
    """The right of a thread to work with a simulation; its own calls may be nested."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._calls: list[str] = []  # of the thread that has the right, the outermost first

    @contextmanager
    def held(self, what: str) -> Iterator[None]:
        """Hold the right during the block, after short calls of other threads have ended.

        Raises
        ------
        BadInput
            If another thread runs the simulation, or holds the right for long; `what` is the call that is refused.
        """
        free = self._lock.acquire(blocking=False)
        if not free and (LONG in self._calls or not self._lock.acquire(timeout=PATIENCE)):
            raise BadInput(
                f"another thread works with this simulation, so that {what} is not possible; call it in that thread, "
                "such as in an observer, or wait until its call has ended"
            )
        self._calls.append(what)
        try:
            yield
        finally:
            self._calls.pop()
            self._lock.release()

    def __contains__(self, what: str) -> bool:
        """Whether a call goes on."""
        return what in self._calls

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy of a simulation has a right of its own."""
        return Exclusive, ()


def exclusive(method: Method) -> Method:
    """Decorator: hold `self._exclusive` during a method."""

    @functools.wraps(method)
    def guarded(self: Any, *given: Any, **options: Any) -> Any:
        with self._exclusive.held(method.__name__):
            return method(self, *given, **options)

    return guarded  # type: ignore[return-value]
