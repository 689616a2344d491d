"""Descriptions of objects by the arguments that make them: values that are not the default, with units.

Units are those of the docstring: the first one in brackets in the description of a parameter, such as [m].
"""

from __future__ import annotations

import ast
import contextlib
import dataclasses
import enum
import functools
import inspect
import re
import sys
import textwrap
from typing import Any

_UNIT = re.compile(r"\[((?:1/)?[A-Za-z][^\],]*)\]")


@functools.cache
def docstring(thing: Any) -> str:
    """Docstring of a class or function; under `python -OO`, which strips docstrings, from its source."""
    if sys.flags.optimize < 2:
        return inspect.getdoc(thing) or ""
    for owner in getattr(thing, "__mro__", (thing,)):
        with contextlib.suppress(OSError, TypeError, SyntaxError):  # no source
            definition = ast.parse(textwrap.dedent(inspect.getsource(owner))).body[0]
            if isinstance(definition, (ast.ClassDef, ast.FunctionDef)) and (text := ast.get_docstring(definition)):
                return text
    return ""


@functools.cache
def parameter_docs(kind: Any) -> dict[str, str]:
    """Descriptions of the parameters, or attributes, in a numpydoc docstring, by name."""
    text = docstring(kind)
    text = re.split(r"(?:Parameters|Attributes)\n-{10}\n", text, maxsplit=1)[-1]
    text = re.split(r"\n\n?[A-Z][a-z]+\n-{3,}\n", text)[0]
    found: dict[str, str] = {}
    names: list[str] = []
    for line in text.splitlines():
        if (match := re.fullmatch(r"(\w+(?:, \w+)*) : .*", line)) is not None:
            names = match[1].split(", ")
            found |= dict.fromkeys(names, "")
        else:
            found |= {name: f"{found[name]} {line.strip()}".strip() for name in names}
    return found


def units_of(thing: Any) -> dict[str, str]:
    """Units of the arguments of an object that have one."""
    if hasattr(thing, "units"):  # a force of the user
        return dict(thing.units)
    return documented_units(type(thing))


def documented_units(thing: Any) -> dict[str, str]:
    """Units in the docstring of a class or function, by parameter; those without a unit are missing."""
    found = {name: documented_unit(text) for name, text in parameter_docs(thing).items()}
    return {name: unit for name, unit in found.items() if unit}


def documented_unit(text: str) -> str:
    """The unit in the description of a parameter; empty if there is none."""
    match = _UNIT.search(text)
    return match[1].replace("²", "^2").replace("³", "^3") if match else ""


def changed_arguments(thing: Any) -> dict[str, Any]:
    """Arguments of a dataclass object, or of a force of the user, that are not the default; quantities as text."""
    units = units_of(thing)
    if not dataclasses.is_dataclass(thing):
        given = {name: value for name, value in thing.parameters().items() if name != "import"}
        return {name: _with_unit(value, units.get(name)) for name, value in given.items()}
    fields = [field for field in dataclasses.fields(thing) if field.init and field.repr]
    changed = {
        field.name: value
        for field in fields
        if not _same(value := getattr(thing, field.name), field.default, units.get(field.name))
    }
    return {name: _with_unit(value, units.get(name)) for name, value in changed.items()}


def _same(value: Any, default: Any, unit: str | None) -> bool:
    if isinstance(default, str) and isinstance(value, float) and unit is not None:
        from .units import in_unit  # imports numpy, which light commands do without

        default = in_unit(default, unit)
    return value is default or (type(value) is type(default) and bool(value == default))


def _with_unit(value: Any, unit: str | None) -> Any:
    if isinstance(value, (tuple, list)):
        return tuple(_with_unit(one, unit) for one in value)
    if isinstance(value, float) and unit not in (None, "1"):
        from .units import exact_quantity

        return exact_quantity(value, str(unit)) if value else 0
    return value


def as_text(value: Any) -> str:
    """An argument for a line of text, without quotation marks."""
    if isinstance(value, tuple):
        return f"({', '.join(map(as_text, value))})"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def described(thing: Any) -> str:
    """Representation of an object: its class, with the arguments that are not the default, quantities as text."""
    texts = (f"{name}={_code(value)}" for name, value in changed_arguments(thing).items())
    return f"{type(thing).__name__ if dataclasses.is_dataclass(thing) else thing.name}({', '.join(texts)})"


def _code(value: Any) -> str:
    return f"{type(value).__name__}.{value.name}" if isinstance(value, enum.Enum) else repr(value)
