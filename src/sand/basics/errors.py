"""Exceptions, warnings and the wording that error messages share."""

from __future__ import annotations

import difflib
import importlib
import re
import sys
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

LONGEST = 80
"""Characters of a value that a message shows."""
CLOSING = ")]}>'\""
"""Last characters of values, which are kept where the rest is cut."""
MOST_ERRORS = 100
"""Errors of one input that are described; the others are counted."""
MOST_NAMED = 5
"""Values that a message lists."""
LONGEST_WORD, LONGEST_LINE = 300, 1500
"""Characters of a word, which may be a path, and of a line of a message; the middle of longer ones is cut."""


class SandError(Exception):
    """Base class of all exceptions of this package; the command line prints them without a traceback."""


class BadInput(SandError, ValueError):
    """Invalid input. One line per error: what, where, unit, what is allowed, what to do.

    Parameters
    ----------
    problems : str or Iterable[str]
        One message, or several, for example all errors of a case file.
    """

    def __init__(self, problems: str | Iterable[str]):
        given = [problems] if isinstance(problems, str) else list(problems)
        # line breaks in the user's values are shown escaped, so that each error stays on one line
        self.problems: list[str] = [_shortened("\\n".join(problem.splitlines())) for problem in given]
        super().__init__("\n".join(self.problems))

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the list of errors, not its joined text."""
        return type(self), (self.problems,)

    def at(self, where: str) -> BadInput:
        """The same errors, each with a location in front, for example `iron-gas.toml: grains.radius`."""
        return BadInput(f"{where}: {problem}" for problem in self.problems)


@contextmanager
def naming(where: object) -> Iterator[None]:
    """Put a location, such as the path of a case file, in front of each error in the block, see `BadInput.at`."""
    try:
        yield
    except BadInput as error:
        raise error.at(str(where)) from None


def _shortened(line: str) -> str:
    """The line without the middle of very long words, such as a name of thousands of characters, and of itself."""
    if len(line) <= LONGEST_WORD:
        return line
    words = re.sub(rf"\S{{{LONGEST_WORD + 1},}}", lambda found: _without_middle(found[0], LONGEST_WORD), line)
    return _without_middle(words, LONGEST_LINE)


def _without_middle(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[: most // 2]}…{text[-most // 2 + 1 :]}"


class NoSuchKey(BadInput, KeyError):
    """A table has no column of this name. Derived from KeyError, so that `in` and `get` work."""

    __str__ = Exception.__str__  # KeyError would show the text in quotes


class NoSuchAttribute(BadInput, AttributeError):
    """An attribute does not exist or is read-only. Derived from AttributeError, so that `hasattr` works."""


class FilesFailed(SandError, OSError):
    """A file or folder could not be read or written; earlier contents are unchanged."""


class NoSuchGrain(BadInput, IndexError):
    """The requested grain does not exist; an IndexError, so that loops over grains end."""


class Interrupted(KeyboardInterrupt):
    """A run was stopped by Ctrl-C or SIGTERM after writing its checkpoint.

    Attributes
    ----------
    result : object
        The result of the run up to the interruption.
    """

    def __init__(self, result: object):
        super().__init__()
        self.result = result

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the result, for other processes."""
        return type(self), (self.result,)


FORBID_EXTRA = {"extra": "forbid"}
"""Pydantic configuration of the settings classes that case files build: unknown keys are errors."""


class ErrorCollector:
    """Collects the errors of several checks, so that they can be reported together."""

    def __init__(self) -> None:
        self.problems: list[str] = []

    def take(self, make: Callable[..., Any], *args: Any, instead: Any = None, **named: Any) -> Any:
        """Return `make(*args, **named)`, or `instead` if it raises BadInput, whose messages are collected."""
        try:
            return make(*args, **named)
        except BadInput as error:
            self.problems += error.problems
            return instead

    def done(self) -> None:
        """Raise BadInput if there were errors; it describes the first `MOST_ERRORS`."""
        if self.problems:
            raise BadInput(first_problems(self.problems[:MOST_ERRORS], len(self.problems), "errors"))


def first_problems(problems: Sequence[str], total: int, kind: str) -> list[str]:
    """The messages about the first of `total` problems, and how many more of this kind, such as "contacts", exist."""
    rest = total - len(problems)
    return [*problems, *([f"… and {rest} more {kind}"] if rest > 0 else [])]


def did_you_mean(word: str, allowed: Sequence[str], most: int = 1) -> str:
    """Advice for a misspelt word: at most this many of the nearest allowed ones, or the list of all."""
    names = [str(name) for name in allowed]  # keys of the user's dictionary may be anything
    near = difflib.get_close_matches(word[:LONGEST], names, n=most)
    quoted = [f"'{name}'" for name in near]
    choice = " or ".join([", ".join(quoted[:-1]), quoted[-1]] if len(quoted) > 1 else quoted)
    return f"did you mean {choice}?" if near else f"allowed: {', '.join(names)}"


def shown(value: Any) -> str:
    """Short text for a value in a message; arrays are shown by shape, classes by name; cut text keeps its bracket."""
    if isinstance(value, type):
        return f"sand.{value.__name__}" if value.__module__.startswith("sand.") else value.__name__
    shape = getattr(value, "shape", None)
    if isinstance(shape, tuple) and shape and hasattr(value, "dtype"):
        unit = getattr(value, "units", getattr(value, "unit", None))
        return f"array of shape {shape}" + ("" if unit is None else f" in {unit}")
    try:
        text = repr(value)
    except Exception:  # integers of thousands of digits, lists that contain themselves
        return f"<{type(value).__name__}>"
    end = text[-1:] if text[-1:] in CLOSING else ""
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 1 - len(end)]}…{end}"


def its_own(value: Any, names: Iterable[str], fits: Callable[[Any], bool]) -> str:
    """Advice where an object is given in place of one that it has: "give its .grains"; empty if it has none.

    Parameters
    ----------
    names : Iterable[str]
        Attributes that are looked at.
    fits : callable
        Whether the value of an attribute is what is wanted.
    """
    for name in () if isinstance(value, type) else names:
        try:
            found = fits(getattr(value, name))
        except Exception:  # objects without it, and errors of the user's objects
            continue
        if found:
            return f"give its .{name}"
    return ""


def refuse_other(frame: Any, *names: str, called: str = "frame") -> None:
    """Raise BadInput if `frame`, the argument of this name, is a class or lacks one of these attributes."""
    if isinstance(frame, type) or not all(hasattr(frame, name) for name in names):
        own = its_own(frame, ("grains",), lambda one: all(hasattr(one, name) for name in names))
        raise BadInput(f"{called} = {shown(frame)}; {own or 'give a frame, such as sand.open(DIR).frames[-1]'}")


def import_optional(package: str, purpose: str) -> Any:
    """Import a package that only some functions need and that is not installed with SAND.

    Parameters
    ----------
    package : str
        Name of the package.
    purpose : str
        Function that needs it, for the message.

    Raises
    ------
    BadInput
        If the package is not installed.
    """
    try:
        return importlib.import_module(package)
    except ImportError:
        raise BadInput(f"{purpose} needs {package}, which is not installed: pip install {package}") from None


def warn(text: str) -> None:
    """Issue a warning that refers to the caller's line outside this package."""
    frame, depth = sys._getframe(1), 2
    while frame.f_back is not None and str(frame.f_globals.get("__name__", "")).partition(".")[0] == "sand":
        frame, depth = frame.f_back, depth + 1
    warnings.warn(text, stacklevel=depth)


def each_once(values: Sequence[Any], name: str) -> list[Any]:
    """The values without repetitions, the first few of which a warning names."""
    number = Counter(values)
    if again := [one for one, times in number.items() if times > 1]:
        more = ", …" if len(again) > MOST_NAMED else ""
        warn(f"{name}: {', '.join(map(shown, again[:MOST_NAMED]))}{more} given more than once; each is used once")
    return list(number)
