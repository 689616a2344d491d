"""Settings declared once: what each field of a settings class takes, which constructor, case file and messages follow.

A settings class is a frozen dataclass derived from `Settings`. The annotation of a field says what it takes, its unit
and its range, and for which value of another field it is:

    shape: Annotated[str, Word("constant", "ramp")] = "constant"
    end: Annotated[Any, Number("s", above=0.0), For("shape", "ramp", needed="a time in s, such as '5 us'")] = None

The class is also a table of the case file (`config`), and its docstring the text of `sand new` and of the reference.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import typing
from collections.abc import Callable, Collection, Iterable, Set
from typing import Any, ClassVar, NamedTuple

from .errors import FORBID_EXTRA, BadInput, ErrorCollector, did_you_mean, shown
from .units import is_word, si, whole_number
from .vectors import along_z, components, three

MOST_LISTED = 3
"""Words that a message lists; with more of them it says only what they are for."""


RAMP = "may be a ramp"
"""Annotation of a field of a force that also takes a `Ramp`."""


class Setting:
    """What a field takes; subclasses read a value of the user. This one takes any, to be checked where it is used."""

    unit = ""
    """SI unit of numbers; empty if there are none, "1" for pure numbers."""
    none = False
    """Whether None is a value, also where it is not the default."""

    def read(self, value: Any, name: str) -> Any:
        """The value in SI; `name` begins the message. Raises BadInput."""
        return value

    def write(self, value: Any) -> Any:
        """The value as in a case file."""
        return list(value) if isinstance(value, tuple) else value


class Number(Setting):
    """A number with a unit, in a range as for `units.si`; with `auto` also the word "auto"."""

    def __init__(self, unit: str = "1", *, auto: bool = False, none: bool = False, **bounds: float):
        self.unit, self.auto, self.none, self.bounds = unit, auto, none, bounds

    def read(self, value: Any, name: str) -> Any:
        """The number in SI."""
        return value if self.auto and is_word(value, "auto") else self.number(value, name)

    def number(self, value: Any, name: str) -> float:
        """The number in SI, of a value that is no word."""
        return si(value, self.unit, name, **self.bounds)


class Whole(Setting):
    """A whole number in a range; with `auto` also the word "auto"."""

    def __init__(self, least: int, most: int | None = None, *, auto: bool = False):
        self.least, self.most, self.auto = least, most, auto

    @property
    def range(self) -> str:
        """What is allowed, in words."""
        bounds = f" of at least {self.least}" if self.most is None else f", {self.least:g} … {self.most:g}"
        return f"a whole number{bounds}"

    def read(self, value: Any, name: str) -> Any:
        """The number, as given."""
        if self.auto and is_word(value, "auto"):
            return value
        try:
            return whole_number(value, name, self.least, self.most)
        except BadInput as error:
            raise BadInput([f'{line}, or "auto"' for line in error.problems] if self.auto else error.problems) from None


class List(Setting):
    """A list of entries, each read as a setting; with `what`, which says what to give, it may not be empty."""

    def __init__(self, entry: Setting, what: str = ""):
        self.entry, self.what, self.unit = entry, what, entry.unit

    def read(self, value: Any, name: str) -> tuple[Any, ...]:
        """The entries."""
        entries = components(value)
        if entries is None or (not entries and self.what):
            advice = f"; give {self.what}" if self.what else ""
            raise BadInput(f"{name} = {shown(value)} {'must be a list' if entries is None else 'is empty'}{advice}")
        errors = ErrorCollector()
        found = [errors.take(self.entry.read, one, f"{name}[{k}]") for k, one in enumerate(entries)]
        if errors.problems:
            raise BadInput(errors.problems)
        return tuple(found)

    def write(self, value: Any) -> list[Any]:
        """The entries as in a case file."""
        return [self.entry.write(one) for one in value]


class Word(Setting):
    """One of a few words, and of those `among` a collection that may grow, such as a registry."""

    def __init__(self, *words: str, among: Collection[str] = ()):
        self.words, self.among = words, among

    @property
    def allowed(self) -> tuple[str, ...]:
        """The words."""
        return (*self.among, *self.words)

    def has(self, value: Any) -> bool:
        """Whether a value is one of the words."""
        return isinstance(value, str) and value in self.allowed

    def read(self, value: Any, name: str) -> str:
        """The word."""
        if self.has(value):
            return str(value)
        is_text = isinstance(value, str)
        no_text = "" if value is None or is_text else " must be text"
        raise BadInput(
            f"{name} = {shown(value)}{no_text}; {did_you_mean(value if is_text else shown(value), self.allowed)}"
        )


class Flag(Setting):
    """True or False."""

    def read(self, value: Any, name: str) -> bool:
        """The value."""
        if not isinstance(value, bool):
            raise BadInput(f"{name} = {shown(value)} must be true or false")
        return value


class Vector(Setting):
    """Three components with a unit."""

    def __init__(self, unit: str):
        self.unit = unit

    def read(self, value: Any, name: str) -> tuple[float, float, float]:
        """The components in SI."""
        return three(value, self.unit, name)


class Direction(Setting):
    """Three numbers, not all 0; `unit_length`: divided by their length."""

    unit = "1"

    def __init__(self, what: str = "three numbers, not all 0, such as [0, 0, 1]", *, unit_length: bool = False):
        self.what, self.unit_length = what, unit_length

    def read(self, value: Any, name: str) -> tuple[float, ...]:
        """The components."""
        axis = three(value, "1", name)
        length = math.hypot(*axis)
        if length == 0.0:
            raise BadInput(f"{name} = {shown(value)} has no direction; give {self.what}")
        return tuple(v / length for v in axis) if self.unit_length else axis


class AlongZ(Setting):
    """Three components, or one value along +z."""

    def __init__(self, unit: str):
        self.unit = unit

    def read(self, value: Any, name: str) -> tuple[float, float, float]:
        """The components in SI."""
        return along_z(value, self.unit, name)


class Reading(Setting):
    """What a function of a value and its name in messages takes; `write` is its inverse, for case files."""

    def __init__(self, read: Callable[[Any, str], Any], write: Callable[[Any], Any] | None = None, unit: str = ""):
        self._read, self._write, self.unit = read, write or super().write, unit

    def read(self, value: Any, name: str) -> Any:
        """The result of the function."""
        return self._read(value, name)

    def write(self, value: Any) -> Any:
        """The value as in a case file."""
        return self._write(value)


class Table(Setting):
    """An object of another settings class, in a case file a table of its keys."""

    def __init__(self, kind: type[Settings]):
        self.kind = kind

    def read(self, value: Any, name: str) -> Any:
        """The object."""
        if not isinstance(value, self.kind):
            raise BadInput(f"{name} = {shown(value)}; give {shown(self.kind)}(…)")
        return value

    def write(self, value: Any) -> dict[str, Any]:
        """Its keys."""
        return Settings.parameters(value)


class For:
    """A field that is for some values of another one.

    Parameters
    ----------
    word : str
        The other field.
    values
        Its values with which this field is used.
    needed : str, optional
        What is missing if the field is not given for these values: "a time in s, such as '5 us'"; it may be left out
        by default.
    default : optional
        Value for these values if none is given.
    """

    def __init__(self, word: str, *values: str, needed: str = "", default: Any = None):
        self.word, self.values, self.needed, self.default = word, values, needed, default

    def unused(self, key: str, value: Any, present: str) -> str:
        """Message about a field that is given in vain; `key` is its name, `present` the value of the other field."""
        others = " or ".join(map(repr, self.values))
        other = f"give {self.word} = {others}" if len(self.values) <= MOST_LISTED else f"change {self.word}"
        return f"{key} = {shown(value)} is not used by {self.word} = {present!r}; leave it out, or {other}"

    def missing(self, key: str, present: str) -> str:
        """Message about a field that is missing; the arguments are those of `unused`."""
        return f"{key} is missing: {self.word} = {present!r} needs {self.needed}"


class Declared(NamedTuple):
    """A field of a settings class."""

    setting: Setting
    condition: For | None
    optional: bool  # whether it may be None
    ramp: bool  # whether it may be a ramp


def declared(kind: type) -> dict[str, Declared]:
    """The declared fields of a settings class, in their order."""
    return _declared(typing.cast(Any, kind))


@functools.cache
def _declared(kind: type) -> dict[str, Declared]:
    hints = typing.get_type_hints(kind, include_extras=True)
    names: Iterable[str] = [one.name for one in dataclasses.fields(kind)] if dataclasses.is_dataclass(kind) else hints
    found = {}
    for name in names:
        about = getattr(hints[name], "__metadata__", ())
        condition = next((each for each in about if isinstance(each, For)), None)
        setting = next((each for each in about if isinstance(each, Setting)), Setting() if condition else None)
        if setting is not None:
            optional = setting.none or getattr(kind, name, setting) is None
            found[name] = Declared(setting, condition, optional, RAMP in about)
    return found


class Settings:
    """Base class of settings; see the module.

    Attributes
    ----------
    place : str
        Beginning of messages; by default the name of the object.
    """

    __pydantic_config__ = FORBID_EXTRA
    place: ClassVar[str]

    def __post_init__(self) -> None:
        """Read all fields. Raises BadInput, one line for each mistake."""
        errors, wrong = ErrorCollector(), set()
        label = getattr(type(self), "place", getattr(self, "name", ""))
        keys = declared(type(self))
        for name, key in keys.items():
            where, value = f"{label}: {name}" if label else name, getattr(self, name)
            before = len(errors.problems)
            if key.condition is not None and self._is_known(key.condition.word):
                present, condition = getattr(self, key.condition.word), key.condition
                if present in condition.values:
                    value = condition.default if value is None else value
                    if value is None and condition.needed:
                        errors.problems.append(condition.missing(where, present))
                elif value is not None:
                    errors.problems.append(condition.unused(where, value, present))
                    value = None
            if value is not None or not key.optional:
                value = errors.take(key.setting.read, value, where, instead=value)
            object.__setattr__(self, name, value)
            if len(errors.problems) > before:
                wrong.add(name)
        errors.problems += [f"{label}: {line}" if label else line for line in self.contradictions(wrong)]
        errors.done()

    def _is_known(self, word: str) -> bool:
        """Whether the value of a field is one of its words."""
        setting = declared(type(self))[word].setting
        return not isinstance(setting, Word) or setting.has(getattr(self, word))

    def contradictions(self, wrong: Set[str]) -> Iterable[str]:
        """Messages about fields that do not fit together; those in `wrong` could not be read."""
        return ()

    @property
    def units(self) -> dict[str, str]:
        """Units of the fields that are numbers or vectors."""
        return {
            name: key.setting.unit for name, key in declared(type(self)).items() if key.setting.unit not in ("", "1")
        }

    def parameters(self) -> dict[str, Any]:
        """Settings in SI units, as in a case file; settings that are None are left out."""
        written = {name: key.setting.write(getattr(self, name)) for name, key in declared(type(self)).items()}
        return {name: value for name, value in written.items() if value is not None}
