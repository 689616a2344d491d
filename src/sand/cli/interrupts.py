"""Signals that raise KeyboardInterrupt and are recorded; imported first, so without any heavy import."""

from __future__ import annotations

import signal
import sys
import time

BEGAN = time.monotonic()
"""Beginning of the command [s]."""
TYPE_CHECKING = False  # typing takes as long to load as everything else here
if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from typing import Any, Self


class Interruption(KeyboardInterrupt):
    """The exception of `Interrupts`.

    ``python -m`` ends a process by SIGINT, not with its exit code, if code that `exec` runs was left by an exception
    whose type is KeyboardInterrupt itself, also where that was caught.
    """


class Interrupts:
    """Context manager in which signals raise KeyboardInterrupt and are recorded.

    The record is needed because imports and callbacks of the compiler may swallow the exception. In other threads than
    the main one, and for signals that are ignored (as Ctrl-C in a background job of a shell), nothing is changed.

    Parameters
    ----------
    numbers : Sequence[int]
        The signals.
    after : optional
        Signal handler to install at the end; by default the one before.
    """

    stops_runs = True  # runs may put their own handlers in place of this one

    def __init__(self, numbers: Sequence[int], after: Any = None):
        self.received = False
        self._numbers, self._after = numbers, after
        self._before: dict[int, Callable[[int, Any], Any] | int] = {}
        self._hook = sys.unraisablehook

    def __enter__(self) -> Self:
        for number in self._numbers:
            before = signal.getsignal(number)
            if before in (signal.SIG_IGN, None):
                continue
            try:
                signal.signal(number, self._raise)
            except ValueError:  # not in the main thread
                return self
            self._before[number] = before
        sys.unraisablehook = self._report
        return self

    def _raise(self, _number: int, _frame: Any) -> None:
        self.received = True
        raise Interruption

    def _report(self, unraisable: Any) -> None:
        """Hook for exceptions that Python cannot raise: KeyboardInterrupt is recorded and needs no message."""
        if not isinstance(unraisable.exc_value, KeyboardInterrupt):
            self._hook(unraisable)

    def __exit__(self, *_: object) -> None:
        for number, before in self._before.items():
            signal.signal(number, before if self._after is None else self._after)
        if sys.unraisablehook == self._report:
            sys.unraisablehook = self._hook
