"""Recipes: how another process can make the same function, stage or type, as a JSON value.

What a module of SAND contains is found there by its name.  What a `factory` has made, such as a stage for one contact
law, is made again from the recipes of its arguments.  Objects of the user have no recipe.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from importlib import import_module
from operator import attrgetter
from typing import Any, TypeVar

import numpy as np

__all__ = ["NoRecipe", "factory", "made_from", "recipe_of"]

Factory = TypeVar("Factory", bound=Callable[..., Any])
PLAIN = (bool, int, float, str, type(None))
_made: dict[int, tuple[str, tuple[Any, ...], dict[str, Any], list[Any]]] = {}
"""By the id of what factories have made and keep: name of the factory, its arguments, and the path in its result."""


class NoRecipe(Exception):
    """Another process cannot make this object."""


def factory(function: Factory) -> Factory:
    """Decorator for functions that make functions and stages: each is made once for each set of arguments."""
    name = f"{function.__module__}:{function.__qualname__}"

    @functools.cache
    @functools.wraps(function)
    def make(*arguments: Any, **named: Any) -> Any:
        found = function(*arguments, **named)
        _note(found, (name, arguments, named), [])
        return found

    return make  # type: ignore[return-value]


def _note(found: Any, made_by: tuple[str, tuple[Any, ...], dict[str, Any]], path: list[Any]) -> None:
    """Note how an object was made, and the members of a tuple or dictionary, unless they are older."""
    if type(found) in PLAIN or found == ():
        return
    _made.setdefault(id(found), (*made_by, path))
    members = found.items() if isinstance(found, dict) else enumerate(found) if isinstance(found, tuple) else ()
    for key, member in members:
        if _named(member) is None:
            _note(member, made_by, [*path, int(key)])


def _named(value: Any) -> str | None:
    """Where a module of SAND or Python contains an object, as module:name; None if none does."""
    owner = getattr(value, "function", value)  # of a stage
    module, name = getattr(owner, "__module__", None), getattr(owner, "__qualname__", None)
    if not name or not module or module.partition(".")[0] not in ("sand", "builtins"):
        return None
    try:
        return f"{module}:{name}" if attrgetter(name)(import_module(module)) is value else None
    except (ImportError, AttributeError):
        return None


def recipe_of(value: Any) -> Any:
    """The recipe of numbers, text, data types, functions, stages, types, and tuples of these.

    Raises
    ------
    NoRecipe
        If another process cannot make the object.
    """
    if type(value) in PLAIN:
        return value
    if isinstance(value, np.dtype):
        return {"dtype": value.str}
    if (name := _named(value)) is not None:
        return {"name": name}
    if id(value) in _made:
        maker, arguments, named, path = _made[id(value)]
        given = {key: recipe_of(each) for key, each in named.items()}
        return {"factory": maker, "arguments": list(map(recipe_of, arguments)), "named": given, "path": path}
    if isinstance(value, tuple):
        return {"tuple": recipe_of(type(value)), "members": list(map(recipe_of, value))}
    raise NoRecipe(repr(value))


def made_from(recipe: Any) -> Any:
    """The object that a recipe describes."""
    if not isinstance(recipe, dict):
        return recipe
    if "dtype" in recipe:
        return np.dtype(recipe["dtype"])
    if "tuple" in recipe:
        kind, members = made_from(recipe["tuple"]), map(made_from, recipe["members"])
        return tuple(members) if kind is tuple else kind(*members)
    module, _, name = (recipe["name"] if "name" in recipe else recipe["factory"]).partition(":")
    found = attrgetter(name)(import_module(module))
    if "factory" in recipe:
        named = {key: made_from(each) for key, each in recipe["named"].items()}
        found = found(*map(made_from, recipe["arguments"]), **named)
        for key in recipe["path"]:
            found = found[key]
    return found
