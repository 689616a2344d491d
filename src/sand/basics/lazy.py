"""Packages whose public names are imported on first use."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from typing import Any

from .errors import NoSuchAttribute, did_you_mean


def lazily(package: str, found: Mapping[str, str]) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """`__getattr__` and `__dir__` of a package.

    Parameters
    ----------
    package : str
        Its full name.
    found : mapping of str to str
        For each public name the module of the package that has it; empty for a module of this name.
    """

    def get(name: str) -> Any:
        if name not in found:
            raise NoSuchAttribute(f"module '{package}' has no '{name}'; {did_you_mean(name, list(found))}")
        module = importlib.import_module(f"{package}.{found[name] or name}")
        return getattr(module, name) if found[name] else module

    return get, lambda: sorted(found)
