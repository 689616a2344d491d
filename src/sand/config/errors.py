"""What is wrong with a case file, in words."""

from __future__ import annotations

import dataclasses
import typing
from typing import Any

from pydantic import BaseModel

from ..errors import did_you_mean


def validation_errors(slip: Any, whole: type, extra: dict[type, list[str]]) -> list[str]:
    """pydantic's error as our lines: place, what is wrong, what to do.

    Parameters
    ----------
    slip
        one entry of `ValidationError.errors()`.
    whole : type
        the model of the whole file, to know which keys are allowed where.
    extra : dict[type, list[str]]
        keys that some settings classes accept besides their own.
    """
    place = ".".join(str(part) for part in slip["loc"] if not str(part).startswith("function-"))
    if slip["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
        keys = _keys_at(whole, slip["loc"][:-1], extra)
        return [f"{place}: there is no such key; {did_you_mean(str(slip['loc'][-1]), keys)}"]
    if slip["type"] == "missing":
        return [f"{place} is missing; add it"]
    if slip["type"] == "value_error":
        # settings classes name themselves; said once is enough
        last = f"{slip['loc'][-1]}: "
        return [f"{place}: {line.removeprefix(last)}" for line in str(slip["ctx"]["error"]).splitlines()]
    if slip["type"] in ("dataclass_type", "model_type"):
        return [f"{place} = {slip['input']!r}: it must be a table, [{place}]"]
    return [f"{place} = {slip['input']!r}: {slip['msg'][0].lower()}{slip['msg'][1:]}"]


def _keys_at(whole: type, places: tuple[Any, ...], extra: dict[type, list[str]]) -> list[str]:
    """The keys allowed at a place of the case file."""
    here: Any = whole
    for place in places:
        fields = _annotations(here, extra)
        if place not in fields:
            here = fields.get("*", here)
            continue
        here = fields[place]
    return [k for k in _annotations(here, extra) if k != "*"]


def _annotations(kind: Any, extra: dict[type, list[str]]) -> dict[str, Any]:
    inner = [a for a in typing.get_args(kind) if a is not type(None)]
    if typing.get_origin(kind) is dict:
        return {"*": inner[1]}
    for candidate in (kind, *inner):
        if isinstance(candidate, type) and issubclass(candidate, BaseModel):
            return {k: f.annotation for k, f in candidate.model_fields.items()}
        if dataclasses.is_dataclass(candidate):
            hints = typing.get_type_hints(candidate)
            own = {f.name: hints[f.name] for f in dataclasses.fields(candidate)}
            return dict.fromkeys(extra.get(typing.cast(type, candidate), [])) | own
    return {}
