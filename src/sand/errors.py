"""Everything SAND may complain about."""

from __future__ import annotations

import difflib
import sys
import warnings
from collections.abc import Iterable, Sequence
from typing import Any

LONGEST = 80
"""Characters of a value that a message shows."""


class SandError(Exception):
    """Base of all our errors; the command line prints it without a traceback."""


class BadInput(SandError, ValueError):
    """The user's mistakes, one line each: what, where, unit, what is allowed, what to do.

    Parameters
    ----------
    problems : str or Iterable[str]
        one sentence, or several when a file holds several mistakes.
    """

    def __init__(self, problems: str | Iterable[str]):
        given = [problems] if isinstance(problems, str) else list(problems)
        # what the user wrote may hold line breaks, and is shown as it would be typed
        self.problems: list[str] = ["\\n".join(problem.splitlines()) for problem in given]
        super().__init__("\n".join(self.problems))

    def __reduce__(self) -> tuple[Any, ...]:
        """For other processes, which would otherwise take all mistakes for one."""
        return type(self), (self.problems,)

    def at(self, where: str) -> BadInput:
        """The same mistakes with the place in front, for example `iron-gas.toml: grains.radius`."""
        return BadInput(f"{where}: {problem}" for problem in self.problems)


class NoSuchKey(BadInput, KeyError):
    """A table has no column of this name; a KeyError, so that `in` and `get` work."""

    __str__ = Exception.__str__  # KeyError would show the text in quotes


class NoSuchAttribute(BadInput, AttributeError):
    """An object has no attribute of this name, or one that cannot be assigned; so `hasattr` works."""


class FilesFailed(SandError, OSError):
    """A file or folder could not be read or written; what was there before is untouched."""


class Interrupted(KeyboardInterrupt):
    """Ctrl-C or SIGTERM reached a run; its checkpoint is written. `result` says how far it came."""

    def __init__(self, result: object):
        super().__init__()
        self.result = result

    def __reduce__(self) -> tuple[Any, ...]:
        """For other processes."""
        return type(self), (self.result,)


FORBID_EXTRA = {"extra": "forbid"}
"""Marks the settings classes that case files build: an unknown key is a mistake, never ignored."""


def did_you_mean(word: str, allowed: Sequence[str]) -> str:
    """A closing remark for a misspelt word: the nearest allowed one, or all of them."""
    near = difflib.get_close_matches(word, allowed, n=1)
    return f"did you mean '{near[0]}'?" if near else f"allowed: {', '.join(allowed)}"


def shown(value: Any) -> str:
    """A value as a message shows it: short, arrays by their shape, classes by their name."""
    if isinstance(value, type):
        return f"sand.{value.__name__}" if value.__module__.startswith("sand.") else value.__name__
    shape = getattr(value, "shape", None)
    if isinstance(shape, tuple) and shape and hasattr(value, "dtype"):
        return f"array of shape {shape}"
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # an integer of thousands of digits, lists in lists without end
        return f"<{type(value).__name__}>"
    return text if len(text) <= LONGEST else text[: LONGEST - 1] + "…"


def refuse_other(frame: Any, *names: str) -> None:
    """Raises BadInput if what should be a frame lacks one of these attributes."""
    if not all(hasattr(frame, name) for name in names):
        raise BadInput(f"frame = {shown(frame)}; give a frame, such as sand.open(DIR).frames[-1]")


def warn(text: str) -> None:
    """Issue a warning that names the first line outside this package."""
    frame, depth = sys._getframe(1), 2
    while frame.f_back is not None and str(frame.f_globals.get("__name__", "")).partition(".")[0] == "sand":
        frame, depth = frame.f_back, depth + 1
    warnings.warn(text, stacklevel=depth)
