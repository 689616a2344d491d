"""Blocks in which no signal raises an exception: LLVM and numba leave damaged code behind if one does."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

__all__ = ["uninterrupted"]


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Context manager or decorator: signals that arrive in the block are handled at its end; a second Ctrl-C at once.

    When LLVM asks for the content of cached code, an exception is lost and the code stays without address; when it
    links modules, one that comes before Python has noted who owns them frees them twice.  Both end the process with a
    segmentation fault.  A signal that is not handled in Python keeps its effect.
    """
    arrived, has_ended, before = list[int](), False, dict[int, Any]()

    def note(number: int, frame: Any) -> None:
        if has_ended or (number == signal.SIGINT and number in arrived):
            before[number](number, frame)
        else:
            arrived.append(number)

    if threading.current_thread() is threading.main_thread():
        before |= {number: found for number in signal.valid_signals() if callable(found := signal.getsignal(number))}
    try:
        for number in before:
            signal.signal(number, note)
        yield
    finally:
        has_ended = True
        try:
            for number, handler in before.items():
                if signal.getsignal(number) is note:  # a second Ctrl-C may have ended the block of `handler`, too
                    signal.signal(number, handler)
        finally:
            for number in arrived:
                before[number](number, None)
