"""The registry of integrators: case files and the tests of all integrators follow it."""

from __future__ import annotations

import importlib
from typing import Any

from ..basics.errors import BadInput, shown
from . import BUILT_IN
from .integrator import INTEGRATORS, Integrator


def checked_integrator(value: Any) -> Integrator:
    """The value, if it is settings of an integrator.  Raises BadInput with what to give instead."""
    if isinstance(value, type) and value in INTEGRATORS.values():
        raise BadInput(f"stepping = {shown(value)} is a class; write {shown(value)}(…) to make one")
    if isinstance(value, type) or not isinstance(value, Integrator):
        choices = " or ".join(f"{shown(each)}(…)" for each in INTEGRATORS.values())
        raise BadInput(f"stepping = {shown(value)}; give {choices}")
    return value


for _class, _module in BUILT_IN.items():
    _name = getattr(importlib.import_module(f"sand.{_module}"), _class).name  # registered by this import or before
    INTEGRATORS[_name] = INTEGRATORS.pop(_name)  # in the order of the table
