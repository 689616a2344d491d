"""Arguments of public functions and classes: a slip of the caller becomes one line, not a traceback of Python.

`checked` looks at names and kinds alone: arguments that do not exist or are missing, a number where text is due, a
class where an object is due. Numbers, their units and ranges are checked by the functions themselves (`units`).
"""

from __future__ import annotations

import collections.abc
import dataclasses
import difflib
import functools
import inspect
import numbers
import os
import types
import typing
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

from .errors import BadInput, NoSuchAttribute, did_you_mean, shown

T = TypeVar("T")
_LISTS = (collections.abc.Sequence, collections.abc.Iterable, list)
_WORDS = {2: "two", 3: "three"}
_MAKERS = {"Generator": "numpy.random.default_rng(seed)", "Executor": "a concurrent.futures executor"}


def checked(thing: T) -> T:
    """Decorator of a public function, method or class (then of its `__init__`): refuses slips with BadInput.

    Kinds follow from annotations: int, bool, str, paths, arrays (lists of numbers become arrays), functions, lists,
    tuples of a length and classes are looked at; Any and float are left to the function. Frozen dataclasses also
    refuse assignments in a line.
    """
    if not isinstance(thing, type):
        return typing.cast(T, _wrapped(typing.cast(Callable, thing)))
    settings = dataclasses.is_dataclass(thing) and thing.__dataclass_params__.frozen  # type: ignore[attr-defined]
    if "__init__" in vars(thing):
        thing.__init__ = _wrapped(thing.__init__, settings=settings)  # type: ignore[misc]
    if settings:
        refused = ("__setattr__", "__delattr__")
        for name in refused:
            setattr(thing, name, _refuse_change)
    return thing


def _refuse_change(self: Any, name: str, *value: Any) -> None:
    kind = shown(type(self))
    known = [field.name for field in dataclasses.fields(self)]
    if name in known:
        raise NoSuchAttribute(f"{name} of {kind} cannot be assigned; make a new one: {kind}({name}=…)")
    raise NoSuchAttribute(f"{kind} has no '{name}'; {did_you_mean(name, known)}")


def _wrapped(function: Callable, *, settings: bool = False) -> Callable:
    """The function behind a check of its arguments; `settings` also say what else is wrong with them."""

    @functools.wraps(function)
    def call(*args: Any, **given: Any) -> Any:
        signature, readers = _known(function)
        try:
            bound = signature.bind(*args, **given)
        except TypeError:
            raise BadInput(_mismatch(function, signature, args, given)) from None
        problems = {}
        for name, value in bound.arguments.items():
            if name in readers:
                try:
                    bound.arguments[name] = readers[name](value, name)
                except BadInput as error:
                    problems[name] = error.problems
        if problems:
            others = _complaints(function, bound) if settings else []
            own = [line for name in problems if not any(f"{name} =" in o for o in others) for line in problems[name]]
            raise BadInput([*own, *others])
        return function(*bound.args, **bound.kwargs)

    return call


def _complaints(function: Callable, bound: inspect.BoundArguments) -> list[str]:
    """What settings, of which some are of a wrong kind, say themselves."""
    try:
        function(*bound.args, **bound.kwargs)
    except BadInput as error:
        return error.problems
    except Exception:  # whatever values of a wrong kind lead to
        pass
    return []


@functools.cache
def _known(function: Callable) -> tuple[inspect.Signature, dict[str, Callable[[Any, str], Any]]]:
    """The signature, and a reader for each argument whose kind can be checked; made at the first call."""
    signature = inspect.signature(function)
    readers: dict[str, Callable[[Any, str], Any]] = {}
    for name, parameter in signature.parameters.items():
        annotation = parameter.annotation
        if isinstance(annotation, str):
            try:
                annotation = eval(annotation, getattr(function, "__globals__", {}))
            except (NameError, AttributeError, TypeError):  # names for the type checker alone
                continue
        plain = parameter.kind not in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD)
        if plain and annotation is not parameter.empty and (kinds := _kinds(annotation)):
            readers[name] = functools.partial(_read, kinds)
    return signature, readers


class _Kind(NamedTuple):
    """One of the kinds that an argument may have."""

    fits: Callable[[Any], bool]
    words: str  # what a message says of it: "must be …"
    made: str = ""  # for classes, how such an object is made: "give …"
    array: bool = False


def _kinds(annotation: Any) -> list[_Kind]:
    """Of an annotation; none where anything may be given."""
    union = typing.get_origin(annotation) in (typing.Union, types.UnionType)
    parts = typing.get_args(annotation) if union else (annotation,)
    kinds = [_kind(part) for part in parts]
    found = [kind for kind in kinds if kind is not None]
    by_name = any(kind.made for kind in found) and any(kind.words == "text" for kind in found)
    # of an object or its name, such as a material, the function knows the names
    return [] if len(found) < len(kinds) or by_name else found


def _kind(part: Any) -> _Kind | None:
    origin, inner = typing.get_origin(part) or part, typing.get_args(part)
    simple = {
        type(None): _Kind(lambda v: v is None, ""),
        int: _Kind(lambda v: isinstance(v, numbers.Integral) and not isinstance(v, bool), "a whole number"),
        bool: _Kind(lambda v: isinstance(v, bool) or type(v).__name__ == "bool", "True or False"),  # numpy.bool too
        str: _Kind(lambda v: isinstance(v, str), "text"),
    }
    if isinstance(origin, type) and origin in simple:
        return simple[origin]
    if origin is collections.abc.Callable:
        return _Kind(lambda v: callable(v) and not isinstance(v, type), "a function")
    if origin is tuple and inner and inner[-1] is not Ellipsis:
        what = "whole numbers" if set(inner) == {int} else "values"
        words = f"{_WORDS.get(len(inner), len(inner))} {what}"
        return _Kind(lambda v: not isinstance(v, str) and hasattr(v, "__len__") and len(v) == len(inner), words)
    if origin in _LISTS:
        return _Kind(lambda v: not isinstance(v, (str, bytes)) and hasattr(v, "__iter__"), "a list")
    anything = origin is Any or not isinstance(origin, type) or origin in (float, complex, object)
    if anything or getattr(origin, "_is_protocol", False):
        return None
    if issubclass(origin, os.PathLike):
        return _Kind(lambda v: isinstance(v, os.PathLike), "a path")
    if issubclass(origin, collections.abc.Mapping):
        return _Kind(lambda v: isinstance(v, collections.abc.Mapping), "a dictionary")
    if (origin.__module__, origin.__name__) == ("numpy", "ndarray"):
        return _Kind(lambda v: isinstance(v, origin) and v.dtype.kind in "biufc", "an array of numbers", array=True)
    return _Kind(lambda v: isinstance(v, origin), "", made=_MAKERS.get(origin.__name__, f"{_public(origin)}(…)"))


def _public(kind: type) -> str:
    """The name a user writes for a class."""
    package = kind.__module__.split(".")
    return f"sand.setup.{kind.__name__}" if package[:2] == ["sand", "setup"] else shown(kind)


def _read(kinds: list[_Kind], value: Any, name: str) -> Any:
    """The value, where lists are due to be arrays as an array.  Raises BadInput if it is of none of the kinds."""
    if any(kind.fits(value) for kind in kinds):
        return value
    if any(kind.array for kind in kinds) and not isinstance(value, str):
        import numpy as np  # late: commands that take no array need not load it

        try:
            array = np.asarray(value)
        except (TypeError, ValueError):
            array = np.zeros(1, object)
        if array.dtype.kind in "biufc":
            return array
    makers = [kind.made for kind in kinds if kind.made]
    words = [kind.words for kind in kinds if kind.words]
    if isinstance(value, type) and f"{_public(value)}(…)" in makers:
        raise BadInput(f"{name} = {_public(value)} is a class; write {_public(value)}(…) to make one")
    if "a path" in words:  # a path may be given as text
        words.remove("text")
    wanted = f" must be {' or '.join(words)}" if words else f"; give {' or '.join(makers)}"
    raise BadInput(f"{name} = {shown(value)}{wanted}")


def _mismatch(
    function: Callable, signature: inspect.Signature, args: tuple[Any, ...], given: dict[str, Any]
) -> list[str]:
    """What is wrong with the names and the number of arguments."""
    label = function.__qualname__.removesuffix(".__init__").rpartition("<locals>.")[2]
    every = list(signature.parameters.values())
    is_method = bool(every) and every[0].name in ("self", "cls")
    own = every[1:] if is_method else every
    by_place = [p.name for p in own if p.kind is p.POSITIONAL_OR_KEYWORD]
    names = [p.name for p in own if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)]
    count = len(args) - is_method
    problems = []
    if count > len(by_place):
        plural = "" if len(by_place) == 1 else "s"
        told = f" ({', '.join(by_place)})" if by_place else ""
        more = "; give the others by name" if len(names) > len(by_place) else ""
        problems.append(f"{label} takes {len(by_place)} argument{plural} without a name{told}, not {count}{more}")
    free = any(p.kind is p.VAR_KEYWORD for p in own)
    unknown = [] if free else [name for name in given if name not in names]
    problems += [f"{label}: there is no argument '{name}'; {_advice(name, names)}" for name in unknown]
    problems += [f"{label}: {name} is given twice" for name in by_place[: max(count, 0)] if name in given]
    if not problems:
        missing = [p.name for p in own if p.default is p.empty and p.name in names]
        left = [name for name in missing if name not in given and name not in by_place[: max(count, 0)]]
        problems = [f"{label}: {name} is missing; add {name}=…" for name in left]
    return problems or [f"{label}: the arguments do not fit; it takes {', '.join(names)}"]


def _advice(name: str, names: list[str]) -> str:
    """The nearest argument, with one letter more or less counting as near."""
    near = difflib.get_close_matches(name, names, n=1)
    return f"did you mean '{near[0]}'?" if near else did_you_mean(name, names or ["none"])
