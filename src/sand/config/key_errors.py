"""Validation of case files: pydantic's errors as one line each, with the place and what is allowed."""

from __future__ import annotations

import dataclasses
import re
import typing
from collections.abc import Iterable
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from ..basics.errors import MOST_ERRORS, BadInput, did_you_mean, first_problems
from ..basics.settings import Setting
from .sections import INTEGRATORS

Model = TypeVar("Model", bound=BaseModel)
LISTS = {"classes": "grains.classes", "walls": "walls", "driven": "driven"}
"""Lists of tables, by the last part of their names, with the names."""
_IN_LIST = re.compile(
    rf"(?:grains(?:\.|: ))?(?P<list>{'|'.join(LISTS)})\[(?P<number>\d+)\](?P<key>\.?)(?P<rest>.*)", re.DOTALL
)
RENAMED = {"path": "file"}
"""Keys of earlier versions, with their present names."""


def validate(model: type[Model], content: Any, name: str, problems: Iterable[str] = (), table: str = "") -> Model:
    """Validate the content of a case file, or of one of its tables.

    Parameters
    ----------
    model : type
        Model of the content.
    name : str
        Name of the file, at the beginning of each message.
    problems : Iterable[str], optional
        Errors found already, which are reported together with those found here.
    table : str, optional
        Name of the table, if `content` is only a part of the file.

    Raises
    ------
    BadInput
        All errors, one line each, the first `MOST_ERRORS` of `problems` and of this model.
    """
    given = list(problems)
    found, case = first_problems(given[:MOST_ERRORS], len(given), "errors"), None
    try:
        case = model.model_validate(content)
    except ValidationError as error:
        slips = error.errors()  # each description takes milliseconds
        lines = [line for slip in slips[:MOST_ERRORS] for line in _messages(slip, model, table)]
        found += first_problems(lines, len(lines) + max(len(slips) - MOST_ERRORS, 0), "errors")
    if found or case is None:
        raise BadInput(f"{name}: {as_in_file(problem)}" for problem in found)
    return case


def as_in_file(problem: str) -> str:
    """The message with the place of a list of tables as a case file has it.

    'grains.classes[0].radius: …' becomes '[[grains.classes]] no. 1: radius: …'.
    """
    found = _IN_LIST.match(problem)
    if not found:
        return problem
    table = f"[[{LISTS[found['list']]}]] no. {int(found['number']) + 1}"
    return f"{table}: {found['rest']}" if found["key"] else f"{table}{found['rest']}"


def _messages(slip: Any, model: type, table: str) -> list[str]:
    """Messages for one entry of `ValidationError.errors()`."""
    kind, path, given = slip["type"], slip["loc"], slip["input"]
    parts = [str(part) for part in ((table,) if table else ()) + tuple(path)]
    place = ".".join(part for part in parts if not part.startswith("function-"))
    place = re.sub(r"\.(\d+)(?=\.|$)", r"[\1]", place) if any(isinstance(part, int) for part in path) else place
    if kind in ("extra_forbidden", "unexpected_keyword_argument"):
        allowed = keys_at(model, path[:-1])
        renamed = RENAMED.get(str(path[-1]))
        advice = f"it is now called '{renamed}'" if renamed in allowed else did_you_mean(str(path[-1]), allowed)
        for key in allowed:
            if str(path[-1]) in keys_at(model, (*path[:-1], key)):
                advice = f"it is a key of [{place.removesuffix(parts[-1])}{key}]"
        return [f"{place}: there is no such key; {advice}"]
    if kind == "missing":
        return [f"{place} is missing; add it"]
    if kind == "value_error":  # messages of settings classes may begin with the key already
        return [_at(place, parts[-1], line) for line in str(slip["ctx"]["error"]).splitlines()]
    if kind in ("dataclass_type", "model_type"):
        return [f"{place} = {given!r}: it must be a table, [{place}]"]
    return [f"{place} = {given!r}: {slip['msg'][0].lower()}{slip['msg'][1:]}"]


def _at(place: str, key: str, line: str) -> str:
    """A message with the place in front, or in place of the key with which it begins."""
    if line.startswith((f"{key} =", f"{key}[")):
        return place + line.removeprefix(key)
    return f"{place}: {line.removeprefix(f'{key}: ')}"


def keys_at(model: type, path: tuple[Any, ...]) -> list[str]:
    """The keys allowed in a table of the case file."""
    return [key for key in _fields(_annotation_at(model, path)) if key != "*"]


def setting_at(model: type, path: tuple[str, ...]) -> Setting | None:
    """What a key of the case file takes, as its annotation says; None if that says nothing."""
    table = _annotation_at(model, path[:-1])
    for candidate in (table, *typing.get_args(table)):
        if isinstance(candidate, type) and issubclass(candidate, BaseModel):
            field = candidate.model_fields.get(path[-1])
            about: Iterable[Any] = field.metadata if field else ()
        elif dataclasses.is_dataclass(candidate):
            hint = typing.get_type_hints(candidate, include_extras=True).get(path[-1])
            about = getattr(hint, "__metadata__", ())
        else:
            continue
        return next((each for each in about if isinstance(each, Setting)), None)
    return None


def _annotation_at(model: type, path: tuple[Any, ...]) -> Any:
    """The annotation of a table of the case file."""
    table: Any = model
    for name in path:
        fields = _fields(table)
        table = fields[name] if name in fields else fields.get("*", table)
    return table


def _fields(annotation: Any) -> dict[str, Any]:
    """Annotations of the keys of a table; "*" stands for any key."""
    inner = [a for a in typing.get_args(annotation) if a is not type(None)]
    if typing.get_origin(annotation) is dict:
        return {"*": inner[1]}
    for candidate in (annotation, *inner):
        if isinstance(candidate, type) and issubclass(candidate, BaseModel):
            return {k: f.annotation for k, f in candidate.model_fields.items()}
        if dataclasses.is_dataclass(candidate):
            hints = typing.get_type_hints(candidate)
            own = {f.name: hints[f.name] for f in dataclasses.fields(candidate)}
            if hasattr(candidate, "with_paper"):
                return {"like": str} | own
            return {"method": str, "clusters": str} | own if candidate in INTEGRATORS.values() else own
    return {}
