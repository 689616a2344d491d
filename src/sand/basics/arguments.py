"""Checks of the arguments of public functions and classes: a wrong argument raises BadInput with a one-line message.

`checked` compares names and types with the signature: unknown or missing arguments, a number in place of text, a class
in place of an object. Arguments annotated as float, as array or as list of floats may be quantities with a unit, which
are converted to the SI unit that the docstring gives; `~` in a path is the home folder. Other numbers, and ranges, are
checked by the functions themselves (`units`).
"""

from __future__ import annotations

import collections.abc
import dataclasses
import functools
import inspect
import numbers
import os
import re
import types
import typing
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from .descriptions import described, documented_units
from .errors import BadInput, ErrorCollector, NoSuchAttribute, did_you_mean, its_own, shown
from .paths import checked_name

MOST_GRAINS = 100_000_000
"""Largest number of grains of one simulation. The state takes about a kilobyte per grain, 100 GB in all."""
MOST_STEPS = 10**15
"""Largest number of steps: three years at ten million steps a second."""
MOST_SEED = 2**63 - 1
"""Largest seed that the kernels take."""
MOST_PROCESSES = 1024
"""Largest number of processes or threads."""

MOST_WHOLE = 10**300
"""Largest whole number, which a floating-point number can hold."""

T = TypeVar("T")
_LISTS = (collections.abc.Sequence, collections.abc.Iterable, list)
_WORDS = {2: "two", 3: "three"}
_CONSTRUCTORS = {
    "Generator": "numpy.random.default_rng(seed)",
    "Executor": "a concurrent.futures executor",
    "StrainedContacts": "sand.setup.StrainedContacts(…)",
}
"""How users make objects of classes that are not at the top of SAND."""


def checked(thing: T) -> T:
    """Decorator of a public function, method or class (then of its `__init__`) that checks the arguments.

    Types are taken from the annotations int, bool, str, paths, arrays (lists of numbers are converted), functions,
    lists, tuples of fixed length and classes; Any is not checked, and float only for quantities. Assignment to an
    attribute of a decorated frozen dataclass raises a one-line NoSuchAttribute; its representation is that of
    `descriptions.described`, unless the dataclass has one of its own (`repr=False`).
    """
    if not isinstance(thing, type):
        return typing.cast(T, _wrapped(typing.cast(Callable, thing)))
    settings = dataclasses.is_dataclass(thing) and thing.__dataclass_params__.frozen  # type: ignore[attr-defined]
    if "__init__" in vars(thing):
        thing.__init__ = _wrapped(thing.__init__, settings=settings)  # type: ignore[misc]
    if settings:
        for name in ("__setattr__", "__delattr__"):
            setattr(thing, name, _refuse_assignment)
        if thing.__dataclass_params__.repr:  # type: ignore[attr-defined]
            thing.__repr__ = described  # type: ignore[method-assign,assignment]
    return thing


def _refuse_assignment(self: Any, name: str, *value: Any) -> None:
    label = shown(type(self))
    known = [field.name for field in dataclasses.fields(self)]
    if name in known:
        raise NoSuchAttribute(f"{name} of {label} cannot be assigned; make a new one: {label}({name}=…)")
    raise NoSuchAttribute(f"{label} has no '{name}'; {did_you_mean(name, known)}")


def _wrapped(function: Callable, *, settings: bool = False) -> Callable:
    """The function with a check of its arguments in front.

    For the `__init__` of `settings` classes, errors of type and of value are reported together.
    """

    @functools.wraps(function)
    def call(*args: Any, **given: Any) -> Any:
        signature, readers = _readers(function)
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
            others = _value_errors(function, bound) if settings else []
            own = [line for name in problems if not any(f"{name} =" in o for o in others) for line in problems[name]]
            raise BadInput([*own, *others])
        return function(*bound.args, **bound.kwargs)

    return call


def _value_errors(function: Callable, bound: inspect.BoundArguments) -> list[str]:
    """Errors that the function itself finds in arguments some of which are of a wrong type."""
    try:
        function(*bound.args, **bound.kwargs)
    except BadInput as error:
        return error.problems
    except Exception:  # any consequence of the wrong types
        pass
    return []


@functools.cache
def _readers(function: Callable) -> tuple[inspect.Signature, dict[str, Callable[[Any, str], Any]]]:
    """The signature, and a reader for each argument whose type can be checked; built at the first call."""
    signature, units = inspect.signature(function), documented_units(function)
    readers: dict[str, Callable[[Any, str], Any]] = {}
    for name, parameter in signature.parameters.items():
        annotation = parameter.annotation
        if isinstance(annotation, str):
            try:
                annotation = eval(annotation, getattr(function, "__globals__", {}))
            except (NameError, AttributeError, TypeError):  # names imported for the type checker only
                continue
        plain = parameter.kind not in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD)
        declared = hasattr(annotation, "__metadata__")  # read by `settings.Settings`
        if plain and not declared and annotation is not parameter.empty:
            allowed, numeric = _allowed_types(annotation), _is_numeric(annotation)
            if allowed or numeric:
                unit = units.get(name, "1") if numeric else None
                none_allowed = type(None) in _parts(annotation) or parameter.default is None
                readers[name] = functools.partial(_read, allowed, unit, none_allowed, _is_one_number(annotation))
    return signature, readers


class _TypeCheck(NamedTuple):
    """Check of an argument against one allowed type."""

    fits: Callable[[Any], bool]
    words: str  # description for the message: "must be …"
    constructor: str = ""  # for classes, the call that makes such an object: "give …"
    array: bool = False


def _parts(annotation: Any) -> tuple[Any, ...]:
    """The types of a union, or the only one."""
    union = typing.get_origin(annotation) in (typing.Union, types.UnionType)
    return typing.get_args(annotation) if union else (annotation,)


def _is_numeric(annotation: Any) -> bool:
    """Whether an argument may be a float, an array or a list of floats, but not text."""
    parts = _parts(annotation)
    return str not in parts and any(part is float or _is_array(part) or _is_list_of_floats(part) for part in parts)


def _is_one_number(annotation: Any) -> bool:
    """Whether an argument may be a float, but no array or list."""
    parts = _parts(annotation)
    return float in parts and not any(_is_array(part) or typing.get_origin(part) is not None for part in parts)


def _is_list_of_floats(part: Any) -> bool:
    return typing.get_origin(part) in (tuple, *_LISTS) and set(typing.get_args(part)) == {float}


def _is_array(part: Any) -> bool:
    origin = typing.get_origin(part) or part
    return (getattr(origin, "__module__", ""), getattr(origin, "__name__", "")) == ("numpy", "ndarray")


def _allowed_types(annotation: Any) -> list[_TypeCheck]:
    """Checks of an annotation; an empty list if every value is allowed."""
    checks = [_type_check(part) for part in _parts(annotation)]
    found = [check for check in checks if check is not None]
    by_name = any(check.constructor for check in found) and any(check.words == "text" for check in found)
    # arguments that are an object or its name, such as a material, are checked by the function, which has the names
    return [] if len(found) < len(checks) or by_name else found


def _type_check(part: Any) -> _TypeCheck | None:
    origin, inner = typing.get_origin(part) or part, typing.get_args(part)
    simple = {
        type(None): _TypeCheck(lambda v: v is None, ""),
        int: _TypeCheck(
            lambda v: isinstance(v, numbers.Integral) and not isinstance(v, bool) and type(v).__name__ != "timedelta64",
            "a whole number",
        ),
        bool: _TypeCheck(
            lambda v: isinstance(v, bool) or type(v).__name__ == "bool", "True or False"
        ),  # numpy.bool too
        str: _TypeCheck(lambda v: isinstance(v, str), "text"),
    }
    if isinstance(origin, type) and origin in simple:
        return simple[origin]
    if origin is collections.abc.Callable:
        return _TypeCheck(lambda v: callable(v) and not isinstance(v, type), "a function")
    if origin is tuple and inner and inner[-1] is not Ellipsis:
        what = "whole numbers" if set(inner) == {int} else "values"
        words = f"{_WORDS.get(len(inner), len(inner))} {what}"
        return _TypeCheck(lambda v: not isinstance(v, str) and _length(v) == len(inner) and _is_iterable(v), words)
    if origin in _LISTS:
        return _TypeCheck(lambda v: not isinstance(v, (str, bytes)) and _is_iterable(v), "a list")
    anything = origin is Any or not isinstance(origin, type) or origin in (float, complex, object)
    if anything or getattr(origin, "_is_protocol", False):
        return None
    if issubclass(origin, os.PathLike):
        return _TypeCheck(lambda v: isinstance(v, os.PathLike), "a path")
    if issubclass(origin, collections.abc.Mapping):
        return _TypeCheck(lambda v: isinstance(v, collections.abc.Mapping), "a dictionary")
    if _is_array(part):
        return _TypeCheck(
            lambda v: isinstance(v, origin) and v.ndim > 0 and v.dtype.kind in "biufc",
            "an array of numbers",
            array=True,
        )
    call = _CONSTRUCTORS.get(origin.__name__, f"{_public_name(origin)}(…)")
    return _TypeCheck(lambda v: isinstance(v, origin), "", constructor=call)


def _length(value: Any) -> int:
    """Length of a value, −1 if it has none."""
    try:
        return len(value)
    except Exception:  # a scalar quantity or array has the method, but no length
        return -1


def _is_iterable(value: Any) -> bool:
    try:
        iter(value)
    except Exception:  # a scalar quantity or array has the method, but no entries
        return False
    return True


def _public_name(cls: type) -> str:
    """The name by which users write a class."""
    package = cls.__module__.split(".")
    return f"sand.setup.{cls.__name__}" if package[:2] == ["sand", "setup"] else shown(cls)


def _read(
    allowed: list[_TypeCheck], unit: str | None, none_allowed: bool, one_number: bool, value: Any, name: str
) -> Any:
    """The value, converted to an array if only an array is allowed. Raises BadInput if it has none of the types.

    Quantities are converted to the SI unit `unit`; None leaves them to the function. `none_allowed`: None is a value
    of the argument, `one_number`: arrays are not.
    """
    if isinstance(value, int) and abs(value) > MOST_WHOLE:
        raise BadInput(f"{name} = {shown(value)} is a whole number beyond the range of the computation")
    if unit is not None and not isinstance(value, float) and not (value is None and none_allowed):
        from .units import has_unit_within, in_unit, not_a_quantity  # imports numpy

        if not allowed or (has_unit_within(value) and not isinstance(value, str)):
            converted = in_unit(value, unit)
            if converted is None:
                raise not_a_quantity(value, unit, name)
            if one_number and not isinstance(converted, float):
                raise BadInput(f"{name} = {shown(value)} must be one number")
            value = tuple(converted) if isinstance(value, tuple) else converted
    if any(check.words == "a path" for check in allowed) and isinstance(value, (str, Path)):
        value = type(value)(checked_name(str(value), name))
    if not allowed or any(check.fits(value) for check in allowed):
        return value
    if any(check.array for check in allowed) and not isinstance(value, str):
        import numpy as np  # here, because commands that take no array start faster without it

        try:
            array = np.asarray(value)
        except Exception:  # errors of NumPy, and of the object
            array = np.zeros(1, object)
        if array.ndim and array.dtype.kind in "biufc":
            return array
    constructors = [check.constructor for check in allowed if check.constructor]
    words = [check.words for check in allowed if check.words]
    if isinstance(value, type) and f"{_public_name(value)}(…)" in constructors:
        raise BadInput(f"{name} = {_public_name(value)} is a class; write {_public_name(value)}(…) to make one")
    if "a path" in words:  # paths may also be given as text
        words = [word for word in words if word != "text"]
    wanted = f" must be {' or '.join(words)}" if words else f"; give {' or '.join(constructors)}"
    checks = [check for check in allowed if check.constructor]
    owned = dict.fromkeys([name, *(re.findall(r"\w+", check.constructor)[-1].lower() for check in checks)])
    if own := its_own(value, owned, lambda one: any(check.fits(one) for check in checks)):
        wanted = f"; {own}"
    raise BadInput(f"{name} = {shown(value)}{wanted}")


def objects_with(
    value: Any, name: str, base: str, methods: Sequence[str], check: Callable[[Any], object] = id
) -> list[Any]:
    """A list of objects that have these methods, such as observers.

    Parameters
    ----------
    name, base : str
        Name of the argument, and of the base class of the objects, for messages.
    check : callable, optional
        Called with each object that has the methods; may raise BadInput.

    Raises
    ------
    BadInput
        If it is no list, an entry is a class, or a method is missing; one line for each entry.
    """
    try:
        objects = list(value)
    except TypeError:
        raise BadInput(f"{name} = {shown(value)}; give a list of {base} objects") from None
    errors = ErrorCollector()
    for one in objects:
        if isinstance(one, type):
            errors.problems.append(f"{name}: {shown(one)} is a class; write {shown(one)}()")
        elif not all(callable(getattr(one, method, None)) for method in methods):
            listed = " or ".join([", ".join(methods[:-1]), methods[-1]] if len(methods) > 1 else methods)
            errors.problems.append(f"{name}: {shown(one)} is not a {base}: it lacks {listed}")
        else:
            errors.take(check, one)
    errors.done()
    return objects


def _mismatch(
    function: Callable, signature: inspect.Signature, args: tuple[Any, ...], given: dict[str, Any]
) -> list[str]:
    """Messages about the names and the number of arguments."""
    label = function.__qualname__.removesuffix(".__init__").rpartition("<locals>.")[2]
    every = list(signature.parameters.values())
    is_method = bool(every) and every[0].name in ("self", "cls")
    own = every[1:] if is_method else every
    positional = [p.name for p in own if p.kind is p.POSITIONAL_OR_KEYWORD]
    names = [p.name for p in own if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)]
    count = len(args) - is_method
    problems = []
    if count > len(positional):
        plural = "" if len(positional) == 1 else "s"
        listed = f" ({', '.join(positional)})" if positional else ""
        more = "; give the others by name" if len(names) > len(positional) else ""
        problems.append(f"{label} takes {len(positional)} argument{plural} without a name{listed}, not {count}{more}")
    free = any(p.kind is p.VAR_KEYWORD for p in own)
    unknown = [] if free else [name for name in given if name not in names]
    problems += [f"{label}: there is no argument '{name}'; {did_you_mean(name, names or ['none'])}" for name in unknown]
    problems += [f"{label}: {name} is given twice" for name in positional[: max(count, 0)] if name in given]
    if not problems:
        missing = [p.name for p in own if p.default is p.empty and p.name in names]
        left = [name for name in missing if name not in given and name not in positional[: max(count, 0)]]
        problems = [f"{label}: {name} is missing; add {name}=…" for name in left]
    return problems or [f"{label}: the arguments do not fit; it takes {', '.join(names)}"]
