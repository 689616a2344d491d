"""Standard output and standard error that may be closed, full, or without a reader: the work goes on without them."""

from __future__ import annotations

import errno
import io
import os
import sys

TYPE_CHECKING = False  # typing takes long to load
if TYPE_CHECKING:
    from typing import Any


class Output(io.RawIOBase):
    """A standard stream whose first error is recorded; what is written after it is lost.

    Parameters
    ----------
    number : int
        Its file descriptor.
    """

    def __init__(self, number: int):
        super().__init__()
        self._number = number
        self.problem: OSError | None = None

    def writable(self) -> bool:
        """It can be written to, at any time."""
        return True

    def fileno(self) -> int:
        """File descriptor."""
        return self._number

    def isatty(self) -> bool:
        """Whether it is a terminal."""
        return os.isatty(self._number)

    def write(self, data: Any) -> int | None:
        """Write bytes; returns how many, None if a pipe that does not wait is full."""
        if self.problem is None:
            try:
                return os.write(self._number, data)
            except BlockingIOError:
                return None
            except OSError as error:
                self.problem = error
        return len(data)


def keep_working_without_streams() -> list[Output]:
    """Put `Output` in place of the standard streams of this process; text for a closed stream is discarded.

    A file that is opened later would otherwise get the number of the closed stream, and receive the text for it.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.set_inheritable(
                os.open(os.devnull, os.O_RDWR), True
            )  # it gets the lowest free number, which is this one
    outputs = []
    for number, name in ((1, "stdout"), (2, "stderr")):
        stream = getattr(sys, name)
        buffer = getattr(stream, "buffer", None)
        raw = getattr(buffer, "raw", buffer)  # with PYTHONUNBUFFERED there is no buffer
        if stream is not None and not isinstance(raw, io.FileIO):
            continue  # a terminal of Windows, or a stream of another program
        output = Output(number)
        by_line = number == 2 or raw is buffer or getattr(stream, "line_buffering", False)
        encoding = getattr(stream, "encoding", None) or "utf-8"
        text = io.TextIOWrapper(io.BufferedWriter(output), encoding, errors="replace", line_buffering=by_line)
        setattr(sys, name, text)
        outputs.append(output)
    return outputs


def lost(outputs: list[Output]) -> str:
    """Why results could not be written to standard output, after it is flushed; empty if they could.

    A reader that has ended, as in `sand info DIR | head -1`, wanted no more.
    """
    if not outputs:
        return ""
    sys.stdout.flush()
    problem = next((one.problem for one in outputs if one.fileno() == 1), None)
    return "" if problem is None or problem.errno == errno.EPIPE else str(problem.strerror)
