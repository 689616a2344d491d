"""One line of progress on a terminal of any width: tqdm's bar, without numbers that do not fit."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from tqdm import tqdm
from tqdm.utils import disp_len, disp_trim

USUAL_WIDTH = 80
"""Columns of a terminal that does not tell its size."""
LEAST_BAR = 3
"""Shortest bar, in columns; numbers are left out before it gets shorter."""
BAR = "{bar}"


def columns(file: Any) -> int:
    """Present number of columns of a terminal."""
    try:
        found = os.get_terminal_size(file.fileno()).columns
    except (OSError, ValueError, AttributeError):
        found = 0
    return found or USUAL_WIDTH


class ProgressLine(tqdm):
    """A bar of tqdm that is shorter than its line: the last column stays free, so that no terminal begins a new line.

    Where the numbers after the times do not fit, the last ones are left out; a text that is still too long is cut.  The
    width is read whenever the line is drawn, so that it follows a change of the window.
    """

    monitor_interval = 0  # no monitor thread: updates are frequent enough

    @property
    def format_dict(self) -> dict[str, Any]:
        """As for tqdm, with the present width of the terminal."""
        return {**super().format_dict, "ncols": columns(self.fp)}

    @staticmethod
    def status_printer(file: Any) -> Callable[[str], None]:
        """What draws the line, and overwrites the rest of the one before as far as that is still within the width."""
        before = 0

        def draw(text: str) -> None:
            nonlocal before
            length = disp_len(text)
            file.write("\r" + text + " " * max(min(before, columns(file) - 1) - length, 0))
            file.flush()
            before = length

        return draw

    @staticmethod
    def format_meter(n: float, total: float | None, elapsed: float, **settings: Any) -> str:
        """Text of the line."""
        room = max((settings.pop("ncols", None) or USUAL_WIDTH) - 1, 1)
        layout, numbers = settings.pop("bar_format", None) or BAR, (settings.pop("postfix", None) or "").split(", ")
        without = layout.replace(BAR, "|" * LEAST_BAR)
        for kept in range(len(numbers), -1, -1):
            shown = {**settings, "postfix": ", ".join(numbers[:kept])}
            if disp_len(tqdm.format_meter(n, total, elapsed, ncols=None, bar_format=without, **shown)) <= room:
                break
        return str(disp_trim(tqdm.format_meter(n, total, elapsed, ncols=room, bar_format=layout, **shown), room))


def progress_line(total: float | None, *, disable: bool, **layout: Any) -> ProgressLine:
    """A line of progress on stderr, which is removed at its end."""
    return ProgressLine(total=total, disable=disable, miniters=0, delay=0.2, leave=False, file=sys.stderr, **layout)


@contextmanager
def line_removed() -> Iterator[None]:
    """Remove the line of progress while something else is printed, and draw it again."""
    with ProgressLine.external_write_mode(file=sys.stderr):
        yield
