"""Everything SAND may complain about."""

from __future__ import annotations

import difflib
import warnings
from collections.abc import Iterable, Sequence


class SandError(Exception):
    """Base of all our errors; the command line prints it without a traceback."""


class BadInput(SandError, ValueError):
    """The user's mistakes, one line each: what, where, unit, what is allowed, what to do.

    Args:
        problems: one sentence, or several when a file holds several mistakes.
    """

    def __init__(self, problems: str | Iterable[str]):
        given = [problems] if isinstance(problems, str) else list(problems)
        # what the user wrote may hold line breaks, and is shown as it would be typed
        self.problems: list[str] = ["\\n".join(problem.splitlines()) for problem in given]
        super().__init__("\n".join(self.problems))

    def at(self, where: str) -> BadInput:
        """The same mistakes with the place in front, for example `iron-gas.toml: grains.radius`."""
        return BadInput(f"{where}: {problem}" for problem in self.problems)


class FilesFailed(SandError, OSError):
    """A file or folder could not be read or written; what was there before is untouched."""


class Interrupted(KeyboardInterrupt):
    """Ctrl-C or SIGTERM reached a run; its checkpoint is written. `result` says how far it came."""

    def __init__(self, result: object):
        super().__init__()
        self.result = result


def warn(text: str) -> None:
    """A Python warning (`UserWarning`) of one line that names no place in our source; commands print it as a note."""
    warnings.warn_explicit(text, UserWarning, "<sand>", 1)


FORBID_EXTRA = {"extra": "forbid"}
"""Marks the settings classes that case files build: an unknown key is a mistake, never ignored."""


def did_you_mean(word: str, allowed: Sequence[str]) -> str:
    """A closing remark for a misspelt word: the nearest allowed one, or all of them."""
    near = difflib.get_close_matches(word, allowed, n=1)
    return f"did you mean '{near[0]}'?" if near else f"allowed: {', '.join(allowed)}"
