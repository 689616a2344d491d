"""The registry of forces: the tables [forces.*] of case files, the reference and the tests of all forces follow it."""

from __future__ import annotations

import dataclasses
import importlib
from typing import Any

from ..basics.errors import BadInput
from . import BUILT_IN
from .pair.pair_force import PairForce

FORCES: dict[str, type] = {}
"""Registered forces by name, the key of their table in case files."""
MEMBERS = ("name", "references", "parameters", "check")
"""Members of every force (`base.Force`)."""
EXTERNAL = ("formula", "numbers", "flux_density_size")
"""Further members of an external force (`base.ExternalForce`)."""
LONG_RANGE = ("column", "choose", "sums", "numbers", "acts_on", "energy_scale")
"""Further members of a long-range force (`base.LongRangeForce`)."""
PAIR = ("formula", "column", "no_effect")
"""Further members of a `PairForce`, and `constants`."""


def register(force: type) -> type:
    """Register a force of the package, a frozen dataclass.

    Raises
    ------
    BadInput
        If its name or its ledger column is taken by another force, or a member is missing; one line each.
    """
    name = getattr(force, "name", force.__name__)
    if missing := _missing(force):
        raise BadInput(f"force '{name}' ({force.__module__}.{force.__name__}) lacks {', '.join(missing)}")
    if FORCES.get(name, force) is not force:
        raise BadInput(f"force '{name}' exists already ({FORCES[name].__module__}); choose another name")
    column = column_of(force)
    others = [other for other, kind in FORCES.items() if kind is not force and column_of(kind) == column]
    if others:
        raise BadInput(f"force '{name}': the ledger column '{column}' is that of '{others[0]}'; choose another one")
    FORCES[name] = force
    return force


def column_of(force: Any) -> str:
    """Name of the energy of a force, or of a class of forces, in the ledger."""
    return str(getattr(force, "column", force.name))


def _missing(force: type) -> list[str]:
    """Members that a force lacks."""
    if not dataclasses.is_dataclass(force):
        return ["the decorator dataclass(frozen=True)"]
    needed = [*MEMBERS]
    if issubclass(force, PairForce):
        needed += PAIR
    elif hasattr(force, "column") or hasattr(force, "sums"):
        needed += LONG_RANGE
    elif hasattr(force, "formula"):
        needed += EXTERNAL
    missing = [member for member in needed if not hasattr(force, member)]
    if issubclass(force, PairForce) and force.constants is PairForce.constants:
        missing.append("constants")
    return missing


for _name, _module in BUILT_IN.items():
    register(getattr(importlib.import_module(f"sand.{_module}"), _name))
